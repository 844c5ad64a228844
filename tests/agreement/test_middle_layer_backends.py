"""Assignment and inspection as integer programs: every backend finds what brute force finds."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from react_opt import check, jsonio, solve
from react_opt.errors import MissingPartError
from react_opt.models.assignment import build, is_feasible, objective_of
from react_opt.solvers.registry import backend

NAMES = ("highs", "cp-sat", "scip", "cvxpy")


@pytest.fixture(params=NAMES)
def solver(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    try:
        backend(name)
    except MissingPartError as error:
        pytest.skip(str(error))
    return name


def assignment(seed: int) -> Any:
    """Whole numbers, for who computes in them, and every side constraint of the format."""
    rng = np.random.default_rng(seed)
    return jsonio.parse(
        {
            "kind": "assignment", "name": f"whole {seed}", "weights": {"beta": 0.0},
            "robots": [
                {"id": "r0", "battery_j": 30.0, "reserve_j": 8.0, "capacity": 3},
                {"id": "r1", "battery_j": 20.0, "capacity": 2, "zone": ["k0", "k1", "k2", "k3"]},
                {"id": "r2", "battery_j": 15.0, "reserve_j": 1.0},
            ],
            "targets": [{"id": f"k{k}", "gain": float(gain)} for k, gain in enumerate(rng.integers(4, 12, 6))],
            "costs": [
                {"robot": f"r{r}", "target": f"k{k}", "time_s": float(rng.integers(0, 8)),
                 "energy_j": float(rng.integers(3, 15))}
                for r in range(3) for k in range(6) if (r, k) != (0, 5)
            ],
            "conflicts": [["k0", "k1"], ["k1", "k4"], ["k2", "k5"]],
        }
    )  # fmt: skip


@pytest.mark.parametrize("seed", [0, 1])
def test_an_assignment_on_every_backend(solver: str, seed: int) -> None:
    instance = assignment(seed)
    arrays = build(instance).arrays
    choices = (np.array(c, dtype=np.int64) for c in itertools.product(range(-1, 3), repeat=6))
    best = max(objective_of(arrays, c) for c in choices if is_feasible(arrays, c))
    plan = solve(instance, solver=solver, threads=1)
    assert plan.claim.objective == pytest.approx(best)
    assert plan.claim.bound >= best - 1e-6
    assert check(instance, plan).ok


def inspection(seed: int) -> Any:
    rng = np.random.default_rng(seed)
    names = ["k0", "k1", "k2", "k3", "dock", "exit"]
    time_s = rng.integers(2, 12, (6, 6))
    return jsonio.parse(
        {
            "kind": "inspection", "name": f"whole {seed}", "time_left_s": 20.0,
            "robots": [
                {"id": "r0", "at": "dock", "end": "exit", "battery_j": 60.0, "reserve_j": 5.0},
                {"id": "r1", "at": "exit", "battery_j": 30.0},
            ],
            "targets": [{"id": f"k{k}", "value": 2.0 + k, "service_s": 1.0, "service_energy_j": 2.0} for k in range(4)],
            "travel": [
                {"from": a, "to": b, "time_s": float(time_s[i, j]), "energy_j": 3.0 * float(time_s[i, j])}
                for i, a in enumerate(names) for j, b in enumerate(names) if i != j
            ],
        }
    )  # fmt: skip


def best_visits(instance: Any) -> tuple[float, float]:
    """Most value, then least time, over every two disjoint orders of targets that keep both budgets."""
    drive = {(row.from_, row.to): (row.time_s, row.energy_j) for row in instance.travel}
    worth = {target.id: target.value for target in instance.targets}
    kept: list[list[tuple[tuple[str, ...], float]]] = []
    for robot in instance.robots:
        mine = []
        for size in range(5):
            for order in itertools.permutations(worth, size):
                stops = (robot.at, *order, *([robot.end] if robot.end else []))
                legs = [drive[leg] for leg in itertools.pairwise(stops)]
                time_s, energy_j = sum(t for t, _ in legs) + size, sum(e for _, e in legs) + 2.0 * size
                if time_s <= instance.time_left_s and energy_j <= robot.battery_j - robot.reserve_j:
                    mine.append((order, time_s))
        kept.append(mine)
    best = (-math.inf, -math.inf)
    for (a, time_a), (b, time_b) in itertools.product(*kept):
        if not {*a} & {*b}:
            best = max(best, (sum(worth[k] for k in (*a, *b)), -time_a - time_b))
    return best[0], -best[1]


@pytest.mark.parametrize("seed", [0, 3])
def test_an_inspection_on_every_backend(solver: str, seed: int) -> None:
    instance = inspection(seed)
    value, time_s = best_visits(instance)
    plan = solve(instance, solver=solver, method="monolith", threads=1)
    assert plan.claim.objective == pytest.approx(value)
    assert plan.claim.secondary.objective == pytest.approx(time_s)
    assert plan.claim.bound >= value - 1e-6
    assert check(instance, plan).ok
