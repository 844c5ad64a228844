"""Chargers in the decomposition: optima known by reasoning, bounds confirmed by the independent check."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from react_opt import check, solve
from react_opt.certify_bound import recompute_bound
from react_opt.instance import OrosInstance
from react_opt.solvers.routes.engine import solve_routes
from react_opt.timegraph import route_problem


def line(robots: int = 1, slots: int = 1, **more: Any) -> OrosInstance:
    """Three cells in a row, robots in the first, where a charger gives 100 J a step; moving takes 100 J, sensing 50."""
    robot = {"start": "c0", "battery_j": 60.0, "capacity_j": 200.0, "idle_w": 0.0, "sensing_w": 50.0}
    data: dict[str, Any] = {
        "kind": "oros",
        "name": "line",
        "horizon_steps": 6,
        "step_s": 1.0,
        "cells": [{"id": f"c{i}", "x_m": float(i), "y_m": 0.0} for i in range(3)],
        "travel": [
            {"from": f"c{i}", "to": f"c{j}", "steps": 1, "energy_j": 100.0} for i, j in ((0, 1), (1, 0), (1, 2), (2, 1))
        ],
        "robots": [{"id": f"r{k}", **robot} for k in range(robots)],
        "chargers": [{"cell": "c0", "power_w": 100.0, "slots": slots}],
        "objective": {"sigma": 1e-4},
    }
    return OrosInstance.model_validate({**data, **more})


def test_a_robot_charges_before_it_leaves() -> None:
    """It senses c0 at 1 and charges to 60 + 100 - 50 = 110 J, at 2 to 200 J (full), is in c1 at 3 with 100 J and senses
    it: 6 + 4. The other 50 J do not take it to c2. It could reach c1 at 2 only with 10 J left, too few to sense."""
    plan = solve(line(), method="routes", threads=1)
    assert plan.claim.status == "optimal"
    assert plan.objective.coverage == 10.0
    assert [step.charging_j for step in plan.robots[0].steps][:3] == [0.0, 100.0, 90.0]
    assert check(line(), plan, bound=True).ok


@pytest.mark.parametrize(("slots", "coverage"), [(2, 6 + 5), (1, 6 + 5), (0, 6)])
def test_slots_of_a_charger_are_shared(slots: int, coverage: float) -> None:
    """One senses c0 at 1, the other charges to 160 J and has 60 J left in c1 at 2. Sensing c2 takes 250 J, more than a
    battery holds. Without a slot nobody leaves c0."""
    instance = line(robots=2, slots=slots)
    plan = solve(instance, threads=1, time_limit_s=60.0)
    assert plan.claim.status == "optimal"
    assert plan.objective.coverage == coverage
    used = [sum(robot.steps[t].charging_j > 0 for robot in plan.robots) for t in range(7)]
    assert max(used) <= slots


def test_what_a_charger_gives_back_may_be_spent_on_little() -> None:
    """Sensing c0 earns less than its 50 J are worth, but at the charger they come back in the same step."""
    cells = [{"id": "c0", "x_m": 0.0, "y_m": 0.0, "weight": 0.01}, {"id": "c1", "x_m": 1.0, "y_m": 0.0, "weight": 0.0}]
    travel = [{"from": "c0", "to": "c1", "steps": 1, "energy_j": 100.0}]
    instance = line(cells=cells, travel=travel, objective={"sigma": 0.01})
    result = solve_routes(route_problem(instance), work_limit=100)
    assert result.status == "optimal"
    # Full, 200 J, whether it senses at 1 or not; sensing at 1 earns 0.01 in each of the 6 instants.
    best = 6 * 0.01 + 0.01 * 200.0
    assert result.objective == pytest.approx(best)
    assert best - 1e-9 <= recompute_bound(instance, result.certificate) <= result.bound + 1e-9


def grid(seed: int) -> OrosInstance:
    """A 3 x 3 grid for two robots whose batteries are short, with two chargers and odd numbers throughout."""
    rng = np.random.default_rng(seed)
    edges = [(i, i + 1) for i in range(9) if (i + 1) % 3] + [(i, i + 3) for i in range(6)]
    battery_j = float(rng.uniform(150.0, 500.0))
    robot = {"battery_j": battery_j, "capacity_j": battery_j + 150.0, "idle_w": 2.0, "sensing_w": 16.9}
    return OrosInstance.model_validate(
        {
            "kind": "oros",
            "name": f"grid {seed}",
            "horizon_steps": 9,
            "step_s": 10.0,
            "cells": [
                {"id": f"c{i}", "x_m": float(i % 3), "y_m": float(i // 3), "weight": float(rng.uniform(0.3, 3.0))}
                for i in range(9)
            ],
            "travel": [
                {"from": f"c{i}", "to": f"c{j}", "steps": 1, "energy_j": float(rng.uniform(30.0, 80.0))}
                for edge in edges
                for i, j in (edge, edge[::-1])
            ],
            "robots": [{"id": f"r{k}", "start": "c0", **robot} for k in range(2)],
            "chargers": [
                {"cell": "c1", "power_w": float(rng.uniform(5.0, 40.0)), "slots": 1},
                {"cell": "c8", "power_w": float(rng.uniform(5.0, 40.0)), "slots": 2},
            ],
        }
    )


@pytest.mark.parametrize("seed", range(8))
def test_bounds_with_chargers_are_recomputed_and_forged_ones_found_out(seed: int) -> None:
    """Stopped early or late, the certificate proves the claim; lowering what a class is worth gains nothing."""
    instance = grid(seed)
    problem = route_problem(instance)
    best = solve_routes(problem, work_limit=600)
    assert best.objective is not None
    for work in (8, 40, 600):
        result = solve_routes(problem, work_limit=work)
        if not result.certificate:
            continue
        bound = recompute_bound(instance, result.certificate)
        assert best.objective - 1e-9 <= bound <= result.bound * (1 + 1e-8)
    if best.certificate["kind"] == "lagrangian":
        classes = [{**group, "best": group["best"] - 2.0} for group in best.certificate["classes"]]
        assert recompute_bound(instance, {**best.certificate, "classes": classes}) >= best.objective - 1e-9
