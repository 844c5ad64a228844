"""Best response of one robot against the fixed routes of the others: a beam search over the time-expanded graph.

Labels are kept by instant; a label is (t, cell, cells collected, value, battery). Within (t, cell) a label is
dropped when another has collected a subset, is worth at least as much and has at least as much battery left. The
Lagrangian potential of `residual` ranks the labels of one instant and bounds their completions. With unlimited
width the search is exact, and `Response.exact` says when a narrower one was, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from react_opt.route_problem import FloatArray, RobotClass, Route, RouteProblem
from react_opt.solvers.routes.labelling import beam
from react_opt.solvers.routes.residual import Leftover, leftover, potential, shape_prices, survival

UNLIMITED = 1 << 60
_SLACK = 1e-9  # relative slack of battery comparisons, far below what any plan is checked with

_NOTHING = -1e300  # below every value

# How the battery enters dominance: not at all, beside the value, or beside the coverage (where charging may be
# cut off by the capacity, so that more value does not make up for less coverage).
_IGNORED, _BESIDE_VALUE, _BESIDE_COVERAGE = 0, 1, 2


@dataclass(frozen=True)
class Response:
    """Best response of one robot.

    Parameters
    ----------
    route
        The best route found that is worth more than the floor asked for; None where there is none.
    value
        What it adds to the objective: coverage gained and sigma times its battery left (the floor where there is
        no route).
    exact
        Whether no route at all is worth more than ``value``.
    bound
        Upper bound of the value of every route.
    prices
        ``(n_cells,)`` cell prices of the bound, to begin the next response with.
    """

    route: Route | None
    value: float
    exact: bool
    bound: float
    prices: FloatArray


def best_response(
    problem: RouteProblem,
    robot_class: int,
    others: Sequence[Route] | Leftover,
    *,
    width: int = UNLIMITED,
    floor: float = -np.inf,
    prices: FloatArray | None = None,
    price_steps: int = 10,
    noise: FloatArray | None = None,
) -> Response:
    """Best route of a robot of one class when the other robots' routes are fixed.

    Parameters
    ----------
    problem
        The problem.
    robot_class
        Index of the robot's class.
    others
        The other robots' routes, or what they leave.
    width
        Labels kept per instant.
    floor
        Only a route worth more than this is of interest.
    prices
        ``(n_cells,)`` prices to begin with, for instance those of an earlier response.
    price_steps
        Subgradient steps that improve the prices.
    noise
        ``(n_cells,)`` positive factors on the prices, to look elsewhere; the bound stays valid.
    """
    group = problem.classes[robot_class]
    rest = others if isinstance(others, Leftover) else leftover(problem, others)
    need = needed_battery(problem, group, rest)
    base = problem.sigma * group.battery_j
    slack = _SLACK * max(1.0, group.capacity_j)
    no_prices = np.zeros(problem.n_cells)
    if group.battery_j < need[group.start_step, group.start] - slack:
        return Response(None, floor, True, -np.inf, no_prices)
    mode = _battery_mode(problem, group, rest)
    spare_j = group.battery_j - group.reserve_j if mode == _BESIDE_VALUE else -1.0
    graph = (problem.out_start, problem.arc_to, problem.arc_steps, problem.arc_energy_j)
    aim = floor - base if floor > -np.inf else 0.0
    price, extra, bound = shape_prices(
        *graph, group.start, group.start_step, group.wait_j, group.sense_j, problem.sigma, spare_j, rest.gain,
        no_prices if prices is None else prices, need, rest.drive, rest.charge_j, aim, price_steps,
    )  # fmt: skip
    shaped = price if noise is None else price * noise
    choice = np.empty((problem.horizon + 1, problem.n_cells), dtype=np.int32)
    ahead = potential(
        *graph, group.start_step, group.wait_j, group.sense_j, problem.sigma + extra, rest.gain, shaped, need,
        rest.drive, rest.charge_j, choice,
    )  # fmt: skip
    waits = not (rest.unhindered and _falling(rest.gain, max(1, group.start_step)))
    numbers = np.array(
        [
            *(group.battery_j, group.capacity_j, group.reserve_j, group.wait_j, group.sense_j),
            *(problem.sigma, extra, max(floor - base, _NOTHING), slack),
        ]
    )
    chain, worth, complete = beam(
        *graph, problem.horizon, group.start, group.start_step, group.return_to, numbers, rest.gain, need, ahead,
        shaped, rest.drive, rest.charge_j, mode, waits, width, _zobrist(problem.n_cells),
    )  # fmt: skip
    if len(chain) == 0:
        return Response(None, floor, complete, max(floor, bound + base) if not complete else floor, price)
    route = _route(problem, robot_class, chain)
    return Response(route, worth + base, complete, worth + base if complete else bound + base, price)


def needed_battery(problem: RouteProblem, group: RobotClass, rest: Leftover) -> FloatArray:
    """Least battery at each (t, cell) with which a robot still reaches the horizon (`residual.survival`)."""
    return survival(
        problem.out_start, problem.arc_to, problem.arc_steps, problem.arc_energy_j,
        np.array([group.reserve_j, group.capacity_j, group.wait_j]), group.return_to, group.start_step,
        problem.n_cells, problem.horizon, rest.stand, rest.drive, rest.charge_j,
    )  # fmt: skip


def affordable_width(problem: RouteProblem, width: int, expansions: int) -> int:
    """Width of a beam that looks at no more than so many pairs of label and arc, at least 4.

    Parameters
    ----------
    problem
        The problem.
    width
        Width wished for.
    expansions
        Pairs of label and arc; a hundred thousand take some hundredths of a second.
    """
    per_label = 1 + problem.n_arcs // max(1, problem.n_cells)
    return min(width, max(4, expansions // (problem.horizon * per_label + 1)))


def battery_can_bind(problem: RouteProblem, group: RobotClass) -> bool:
    """Whether a robot of the class might spend more than it has above its reserve by the horizon.

    Decided by the dearest rate of spending and sensing at every instant that can earn something.
    """
    steps = problem.horizon - group.start_step
    rate = group.wait_j
    if problem.n_arcs:
        rate = max(rate, float(np.max(problem.arc_energy_j / problem.arc_steps)))
    first = max(1, group.start_step)
    worthy = problem.reward[:, first:] > 0.0
    sensings = min(int(worthy.any(axis=1).sum()), int(worthy.any(axis=0).sum()))
    return steps * rate + sensings * group.sense_j > group.battery_j - group.reserve_j


def _battery_mode(problem: RouteProblem, group: RobotClass, rest: Leftover) -> int:
    if rest.charge_j.size:
        return _BESIDE_COVERAGE
    return _BESIDE_VALUE if battery_can_bind(problem, group) else _IGNORED


def _falling(gain: FloatArray, first: int) -> bool:
    """Whether sensing later never earns more: then waiting before the end is of no use."""
    return bool(np.all(gain[:, first + 1 :] <= gain[:, first:-1] + 1e-12))


def _zobrist(n_cells: int) -> NDArray[np.uint64]:
    """Random words whose exclusive or is the hash of a cell and a set of cells, ``(2, n_cells)``."""
    return np.random.default_rng(0).integers(1, 1 << 63, (2, n_cells)).astype(np.uint64)


def _route(problem: RouteProblem, robot_class: int, chain: FloatArray) -> Route:
    """Route of a chain of labels: rows of instant, cell, arc taken to get there, sensed, charge."""
    start_step = problem.classes[robot_class].start_step
    length = problem.horizon - start_step + 1
    cell = np.full(length, -1, dtype=np.int64)
    arc = np.full(length, -1, dtype=np.int64)
    sense = np.zeros(length, dtype=bool)
    charge_j = np.zeros(length)
    before = 0
    for row, (t, at, taken, sensed, charged) in enumerate(chain):
        k = int(t) - start_step
        cell[k], sense[k], charge_j[k] = int(at), bool(sensed), charged
        if row and taken >= 0.0:
            arc[before] = int(taken)
        before = k
    cell[before:] = cell[before]
    return Route(robot_class, cell, arc, sense, charge_j)
