from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from primal_cases import all_routes, random_problem

from react_opt.models.replay import coupling_faults, feasible, value
from react_opt.route_problem import Route, RouteProblem
from react_opt.solvers.routes.greedy import Greedy, InfeasibleRobot, greedy, route_classes


def _plan_exists(problem: RouteProblem) -> bool:
    """Whether any set of routes keeps all limits, by trying all of them (none senses)."""
    options = []
    for k in route_classes(problem):
        mine = {}
        for route in all_routes(problem, k, free_charge=True):
            if not route.sense.any():
                mine[route.cell.tobytes() + route.arc.tobytes() + (route.charge_j > 0).tobytes()] = route
        options.append(list(mine.values()))

    def search(chosen: list[Route]) -> bool:
        if coupling_faults(problem, chosen):
            return False
        if len(chosen) == len(options):
            return True
        return any(search([*chosen, route]) for route in options[len(chosen)])

    return search([])


@pytest.mark.parametrize("seed", range(300))
def test_a_plan_is_found_where_there_is_one(seed: int) -> None:
    rng = np.random.default_rng(1000 + seed)
    problem = random_problem(rng, horizon=int(rng.integers(1, 4)))
    answer = greedy(problem)
    if answer.routes is not None:
        assert answer.reason is None
        assert not feasible(problem, answer.routes)
        assert np.isfinite(value(problem, answer.routes))
        return
    assert answer.reason is not None
    assert not _plan_exists(problem)


def _proof(problem: RouteProblem) -> InfeasibleRobot:
    answer = greedy(problem)
    assert answer.routes is None
    assert isinstance(answer.reason, InfeasibleRobot)
    return answer.reason


def test_a_robot_that_cannot_last_or_return_is_named() -> None:
    problem = random_problem(np.random.default_rng(3), robots=1, chargers=False, coupled=False, horizon=5)
    group = replace(problem.classes[0], start_step=0, return_to=-1, reserve_j=5.0, wait_j=4.0)
    # The cheapest way to spend five steps is known: wait, or drive the arc with the fewest joules per step.
    rate = min(4.0, float((problem.arc_energy_j / problem.arc_steps).min()))
    poor = replace(problem, classes=(replace(group, battery_j=5.0 + 5 * rate - 4.5, capacity_j=99.0),))
    assert _proof(poor).rule == "battery"
    rich = replace(group, battery_j=99.0, capacity_j=99.0)
    late = replace(rich, start_step=5, return_to=(rich.start + 1) % problem.n_cells)
    assert _proof(replace(problem, classes=(late,))).rule == "return_to"
    crowd = replace(rich, robots=(0, 1), return_to=rich.start)
    assert _proof(replace(problem, classes=(crowd,), robots_per_cell=1)).rule == "robots_per_cell"


def test_a_crowd_that_cannot_disperse_is_named() -> None:
    """Three robots in one cell that only one arc leaves: at instant 1 there is room for one in each of two cells."""
    base = random_problem(np.random.default_rng(3), cells=2, robots=1, chargers=False, coupled=False, horizon=5)
    ends = (base.arc_steps == 1) | (base.arc_steps == base.arc_steps.min())
    group = replace(base.classes[0], start_step=0, return_to=-1, battery_j=999.0, capacity_j=999.0)
    short = replace(
        base,
        arc_from=base.arc_from[ends],
        arc_to=base.arc_to[ends],
        arc_steps=np.ones(ends.sum(), dtype=np.int64),
        arc_energy_j=base.arc_energy_j[ends],
        arc_travel=np.arange(ends.sum()),
        out_start=np.searchsorted(base.arc_from[ends], np.arange(3)).astype(np.int64),
        robots_per_cell=1,
    )
    three = replace(group, robots=(0, 1, 2))
    assert _proof(replace(short, classes=(three,))).rule == "robots_per_cell"
    assert greedy(replace(short, classes=(replace(group, robots=(0, 1)),))).routes is not None


def test_same_seed_same_plan() -> None:
    for seed in range(20):
        problem = random_problem(np.random.default_rng(seed), robots=3)
        first, second = greedy(problem, seed=5), greedy(problem, seed=5)
        assert _bytes(first) == _bytes(second)


def _bytes(answer: Greedy) -> bytes:
    return b"".join(
        part.tobytes() for route in answer.routes or [] for part in (route.cell, route.arc, route.sense, route.charge_j)
    )
