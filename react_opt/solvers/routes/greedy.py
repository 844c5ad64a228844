"""A full plan quickly: one best response after the other, repaired where the robots are in each other's way."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from react_opt.models.replay import coupling_faults, feasible
from react_opt.route_problem import FloatArray, Route, RouteProblem
from react_opt.solvers.routes.beam import Response, affordable_width, best_response, needed_battery
from react_opt.solvers.routes.crowding import most_placed
from react_opt.solvers.routes.residual import leftover

_WIDTH = 64
_EXPANSIONS = 60_000  # labels times arcs that one response may look at
_TRIES = 400  # responses per robot before the search for a plan gives up


@dataclass(frozen=True)
class InfeasibleRobot:
    """Proof that no plan exists: a limit that one robot cannot keep whatever the others do.

    Parameters
    ----------
    robot
        Index of the robot in the instance.
    rule
        The rule it breaks: ``battery``, ``return_to`` or ``robots_per_cell``.
    text
        The reason in words.
    """

    robot: int
    rule: str
    text: str


@dataclass(frozen=True)
class Greedy:
    """Outcome of `greedy`: a plan, or why there is none.

    Parameters
    ----------
    routes
        One route per robot, classes in order; None where none was found.
    reason
        None with a plan; a proof that there is none; or in words why none was found (which proves nothing).
    """

    routes: list[Route] | None
    reason: InfeasibleRobot | str | None


def route_classes(problem: RouteProblem) -> list[int]:
    """Class of each route of a complete set: one per robot, classes in order."""
    return [k for k, group in enumerate(problem.classes) for _ in group.robots]


def proven_infeasible(problem: RouteProblem) -> InfeasibleRobot | None:
    """Proof that no plan exists, or None where this relaxation finds none.

    Exact for each robot alone: the least battery with which it reaches the horizon (and its ``return_to``)
    without falling below its reserve, all chargers and places being its own. Of the coupling limits only
    ``robots_per_cell`` is looked at: where robots must stand at one instant, and whether they can disperse from
    their starts.

    Parameters
    ----------
    problem
        The problem.
    """
    alone = leftover(problem, [])
    for group in problem.classes:
        robot = group.robots[0]
        need = float(needed_battery(problem, group, alone)[group.start_step, group.start])
        if need == np.inf:
            if group.return_to >= 0:
                return InfeasibleRobot(
                    robot, "return_to", f"cannot stand where it must return to at instant {problem.horizon}"
                )
            return InfeasibleRobot(robot, "battery", "its reserve is above what it can charge to")
        if group.battery_j < need - 1e-6 * max(1.0, group.capacity_j):
            text = f"needs {need:g} J to last until instant {problem.horizon}, has {group.battery_j:g} J"
            return InfeasibleRobot(robot, "battery", text)
    most = problem.robots_per_cell
    if most is not None:
        tied: Counter[tuple[int, int]] = Counter()
        for group in problem.classes:
            places = {(group.start, group.start_step)} if group.start_step >= 1 else set()
            if group.return_to >= 0 and problem.horizon >= 1:
                places.add((group.return_to, problem.horizon))
            for place in places:
                tied[place] += len(group.robots)
                if tied[place] > most:
                    text = f"{tied[place]} robots must stand in cell {place[0]} at instant {place[1]}"
                    return InfeasibleRobot(group.robots[-1], "robots_per_cell", text)
        crowd = most_placed(problem)
        if crowd is not None:
            text = f"{crowd[0]} robots start where only {crowd[1]} find room in the first steps"
            return InfeasibleRobot(problem.classes[-1].robots[-1], "robots_per_cell", text)
    return None


def greedy(problem: RouteProblem, deadline: float | None = None, seed: int = 0) -> Greedy:
    """Plan one robot after the other, each answering those before it.

    A robot that finds no way is planned as if it were alone, and those it collides with are planned again, in
    an order and with tastes drawn at random.

    Parameters
    ----------
    problem
        The problem.
    deadline
        ``time.perf_counter()`` after which only the cheapest responses are computed and no repair begins.
    seed
        Seed of the repairs; a plan that needs none does not depend on it.
    """
    proof = proven_infeasible(problem)
    if proof is not None:
        return Greedy(None, proof)
    rng = np.random.default_rng(seed)
    classes = route_classes(problem)
    routes: list[Route | None] = [None] * len(classes)
    waiting = list(range(len(classes)))
    prices: FloatArray | None = None
    usual = affordable_width(problem, _WIDTH, _EXPANSIONS)
    size = max(1, problem.n_cells) * max(1, problem.horizon)
    limit = len(classes) * max(20, min(_TRIES, 8_000_000 // size))
    for count in range(limit):
        late = deadline is not None and time.perf_counter() > deadline
        if late and count >= len(classes):
            return Greedy(None, "no plan that keeps the limits between robots was found in the time given")
        number = waiting.pop(0)
        fixed = [route for route in routes if route is not None]
        calm = count < len(classes)
        noise = None if calm else rng.uniform(0.2, 3.0, problem.n_cells)
        response = best_response(
            problem,
            classes[number],
            fixed,
            width=1 if late else usual if calm else int(rng.integers(1, 9)),
            prices=prices,
            price_steps=0 if late else 10,
            noise=noise,
        )
        prices = response.prices
        if response.route is None:
            response = _push(problem, classes[number], rng)
            if response.route is None:  # alone, with chargers and places free: cannot be
                return Greedy(None, "no route was found for a robot that has one")
            for other in _in_the_way(problem, routes, response.route):
                routes[other] = None
                waiting.append(other)
            rng.shuffle(waiting)
        routes[number] = response.route
        if not waiting:
            plan = [route for route in routes if route is not None]
            faults = feasible(problem, plan)
            return Greedy(None, f"the plan found breaks a limit: {faults[0]}") if faults else Greedy(plan, None)
    return Greedy(None, f"no plan that keeps the limits between robots was found in {limit} responses")


def _push(problem: RouteProblem, robot_class: int, rng: np.random.Generator) -> Response:
    """A route as if there were no other robot, with tastes drawn at random."""
    noise = rng.uniform(0.0, 4.0, problem.n_cells)
    return best_response(problem, robot_class, [], width=int(rng.integers(1, 4)), noise=noise)


def _in_the_way(problem: RouteProblem, routes: Sequence[Route | None], new: Route) -> list[int]:
    """Robots planned so far that cannot keep their routes beside a new one (those kept fit together)."""
    kept: list[Route] = [new]
    gone = []
    for number, route in enumerate(routes):
        if route is None:
            continue
        if not coupling_faults(problem, [*kept, route]):
            kept.append(route)
        else:
            gone.append(number)
    return gone
