from __future__ import annotations

import numpy as np
import pytest
from primal_cases import all_routes, best_value, random_problem

from react_opt.models.replay import feasible, value
from react_opt.route_problem import Route, RouteProblem
from react_opt.solvers.routes.beam import best_response


def _others(problem: RouteProblem, rng: np.random.Generator) -> list[Route] | None:
    """Routes of all robots but the last that keep the limits among themselves, drawn at random."""
    order = [k for k, group in enumerate(problem.classes) for _ in group.robots]
    chosen: list[Route] = []
    for k in order[:-1]:
        choices = list(all_routes(problem, k))
        for index in rng.permutation(len(choices))[:30]:
            if not _faults(problem, [*chosen, choices[index]]):
                chosen.append(choices[index])
                break
        else:
            return None
    return chosen


def _faults(problem: RouteProblem, routes: list[Route]) -> list[str]:
    """Faults of the first robots' routes alone."""
    from dataclasses import replace

    counts: dict[int, int] = {}
    for route in routes:
        counts[route.robot_class] = counts.get(route.robot_class, 0) + 1
    classes = tuple(replace(group, robots=group.robots[: counts.get(k, 0)]) for k, group in enumerate(problem.classes))
    return feasible(replace(problem, classes=classes), routes)


@pytest.mark.parametrize("seed", range(120))
def test_unlimited_width_is_the_best_response(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, horizon=int(rng.integers(2, 5)))
    others = _others(problem, rng)
    if others is None:
        return
    mine = len(problem.classes) - 1
    fixed = value(problem, others)
    plans = [[*others, route] for route in all_routes(problem, mine, free_charge=problem.n_robots > 1)]
    expected = best_value([value(problem, plan) for plan in plans if not _faults(problem, plan)])
    response = best_response(problem, mine, others)
    assert response.exact
    if response.route is None:
        assert expected == -np.inf
        return
    assert not feasible(problem, [*others, response.route])
    assert value(problem, [*others, response.route]) == pytest.approx(expected)
    assert fixed + response.value == pytest.approx(expected)
    assert fixed + response.bound >= expected - 1e-9
