from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from primal_cases import all_routes, best_value, random_problem

from react_opt.models.replay import feasible, tidy, value
from react_opt.route_problem import RobotClass, Route, RouteProblem
from react_opt.solvers.routes.greedy import greedy, route_classes
from react_opt.solvers.routes.search import improve
from react_opt.solvers.routes.sequences import applies, decode, encode, sequence_model


def _grid(rows: int, cols: int, robots: int, horizon: int, spare: float = 1.0) -> RouteProblem:
    """4-neighbour grid without walls: unit steps, 70 J a move, 169 J a sensing, robots in the corner."""
    n = rows * cols
    pairs = [(i, i + 1) for i in range(n) if (i + 1) % cols] + [(i, i + cols) for i in range(n - cols)]
    arcs = sorted([*pairs, *((j, i) for i, j in pairs)])
    arc_from = np.array([i for i, _ in arcs], dtype=np.int64)
    reward = np.tile(np.maximum(0.0, horizon + 1.0 - np.arange(horizon + 1)), (n, 1))
    reward[:, 0] = 0.0
    battery = spare * horizon * 239.0 + 1.0
    group = RobotClass(tuple(range(robots)), 0, 0, battery, battery, 0.0, 20.0, 169.0)
    return RouteProblem(
        horizon, n, reward, arc_from, np.array([j for _, j in arcs], dtype=np.int64),
        np.ones(len(arcs), dtype=np.int64), np.full(len(arcs), 70.0), np.arange(len(arcs)),
        np.searchsorted(arc_from, np.arange(n + 1)).astype(np.int64), 1.0 / (1.0 + robots * battery), (group,),
        np.zeros(n), np.ones(n, dtype=np.int64),
    )  # fmt: skip


def _start(problem: RouteProblem) -> list[Route]:
    routes = greedy(problem).routes
    assert routes is not None
    return routes


def _bytes(routes: Sequence[Route]) -> bytes:
    return b"".join(a.tobytes() for r in routes for a in (r.cell, r.arc, r.sense, r.charge_j))


@pytest.mark.parametrize("seed", range(60))
def test_never_worse_and_always_feasible_with_every_option(seed: int) -> None:
    problem = random_problem(np.random.default_rng(7000 + seed), cells=4, horizon=6)
    given = greedy(problem).routes
    if given is None:
        return
    seen: list[float] = []
    better = improve(problem, given, work_limit=25, seed=seed, on_improve=lambda _, worth: seen.append(worth))
    assert not feasible(problem, better)
    assert value(problem, better) >= value(problem, given)
    assert seen == sorted(seen)
    assert value(problem, better) == pytest.approx(seen[-1] if seen else value(problem, given))


@pytest.mark.parametrize("seed", range(12))
def test_reaches_the_joint_optimum_of_tiny_problems(seed: int) -> None:
    problem = random_problem(np.random.default_rng(seed), cells=3, horizon=3, robots=2, chargers=False)
    given = greedy(problem).routes
    if given is None:
        return
    options = [list(all_routes(problem, k)) for k in route_classes(problem)]
    expected = best_value([value(problem, p) for p in product(*options) if not feasible(problem, p)])
    better = improve(problem, given, work_limit=60, seed=1)
    assert value(problem, better) == pytest.approx(expected)


def test_an_open_grid_is_swept_without_going_back() -> None:
    """A 3 x 4 grid has a path through all cells: one robot senses a new cell at every instant from 1 on."""
    problem = _grid(3, 4, 1, 12)
    better = improve(problem, _start(problem), work_limit=60)
    # Waiting one step in the corner and then driving 11, or leaving it for the end: 12 + 11 + ... + 1 either way.
    coverage = 78.0
    left_j = 12 * 239.0 + 1.0 - 12 * 169.0 - 11 * 70.0 - 20.0
    assert value(problem, better) == pytest.approx(coverage + problem.sigma * left_j)


def test_two_robots_share_a_grid() -> None:
    """Of a 4 x 4 grid, T = 8: two new cells at every instant from 1 on is the most that two robots can sense."""
    problem = _grid(4, 4, 2, 8)
    better = improve(problem, _start(problem), work_limit=80)
    assert value(problem, better) == pytest.approx(72.0, abs=1.0)


@pytest.mark.parametrize(
    "limit", ["robots_per_cell", "forbid_swaps", "sensing_robots_per_step", "return_to", "battery"]
)
def test_limits_between_robots_hold_on_a_grid(limit: str) -> None:
    problem = _grid(4, 5, 3, 14, spare=0.4 if limit == "battery" else 1.0)
    if limit == "return_to":
        problem = replace(problem, classes=(replace(problem.classes[0], return_to=0),))
    elif limit == "forbid_swaps":
        problem = replace(problem, forbid_swaps=True)
    elif limit == "robots_per_cell":
        arrivals = tuple(replace(problem.classes[0], robots=(k,), start_step=k + 1) for k in range(3))
        problem = replace(problem, classes=arrivals, robots_per_cell=1)
    elif limit == "sensing_robots_per_step":
        problem = replace(problem, sensing_robots_per_step=2)
    given = _start(problem)
    better = improve(problem, given, work_limit=60)
    assert not feasible(problem, better)
    assert value(problem, better) > value(problem, given) - 1e-12


def test_same_seed_and_work_same_plan() -> None:
    problem = _grid(4, 4, 2, 10)
    given = _start(problem)
    assert _bytes(improve(problem, given, work_limit=30, seed=4)) == _bytes(
        improve(problem, given, work_limit=30, seed=4)
    )


def test_stops_when_asked_and_at_a_deadline_past() -> None:
    problem = _grid(4, 4, 2, 10)
    given = _start(problem)
    asked = []
    improve(problem, given, should_stop=lambda: asked.append(0) is None and len(asked) > 3)
    assert 3 < len(asked) < 8
    best = tidy(problem, given)
    assert _bytes(improve(problem, given, deadline=time.perf_counter() - 1.0)) == _bytes(best)


@pytest.mark.parametrize("seed", range(40))
def test_sequences_stand_for_the_routes_they_came_from(seed: int) -> None:
    """Reading a plan as sequences and writing it out again keeps every limit of a robot alone."""
    problem = random_problem(np.random.default_rng(seed), chargers=False, coupled=False)
    given = greedy(problem).routes
    if given is None:
        return
    model = sequence_model(problem)
    if not applies(problem, model):
        return
    order, lengths = encode(problem, given)
    if any(group.battery_j < 100.0 for group in problem.classes):
        return  # fastest ways may spend more than the plan did
    again = decode(problem, model, order, lengths)
    faults = feasible(problem, again)
    assert not [fault for fault in faults if "battery" not in fault]
    coverage = value(replace(problem, sigma=0.0), again)
    assert coverage >= value(replace(problem, sigma=0.0), given) - 1e-9
