"""One small instance and one good plan of it, made by hand, to be broken by the tests of the checker."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from react_opt.certify import Certificate, check
from react_opt.jsonio import parse, sha256

Data = dict[str, Any]
Break = Callable[[Data, Data], None]


def instance_data() -> Data:
    """Four cells in a row a - b - c - d, a charger at b, two robots, every option used and none binding by much."""

    def arc(i: str, j: str, steps: int, joules: float, speed: float) -> Data:
        return {"from": i, "to": j, "steps": steps, "energy_j": joules, "speed_m_s": speed}

    return {
        "kind": "oros",
        "name": "row",
        "horizon_steps": 6,
        "step_s": 10.0,
        "cells": [
            {"id": "a", "x_m": 0.0, "y_m": 0.0, "explored": True},
            {"id": "b", "x_m": 10.0, "y_m": 0.0},
            {"id": "c", "x_m": 30.0, "y_m": 0.0, "weight": 2.0},
            {"id": "d", "x_m": 40.0, "y_m": 0.0, "deadline_step": 5},
        ],
        "travel": [
            arc("a", "b", 1, 10.0, 1.0),  # 0
            arc("b", "a", 1, 10.0, 1.0),  # 1
            arc("b", "c", 2, 30.0, 1.0),  # 2
            arc("c", "b", 2, 30.0, 1.0),  # 3
            arc("c", "d", 1, 10.0, 1.0),  # 4
            arc("d", "c", 1, 10.0, 1.0),  # 5
            arc("a", "b", 2, 4.0, 0.5),  # 6: the slower speed mode
            arc("a", "b", 1, 11.0, 1.0),  # 7: as 0, but dearer
        ],
        "robots": [
            {"id": "r1", "start": "a", "battery_j": 400.0, "capacity_j": 500.0, "reserve_j": 50.0}
            | {"idle_w": 1.0, "sensing_w": 2.0, "return_to": "b"},
            {"id": "r2", "start": "c", "start_step": 1, "battery_j": 300.0, "capacity_j": 300.0}
            | {"idle_w": 0.5, "sensing_w": 2.0},
        ],
        "chargers": [{"cell": "b", "power_w": 6.0, "slots": 1}],
        "limits": {"robots_per_cell": 2, "forbid_swaps": True, "sensing_robots_per_step": 2},
        "objective": {"sigma": 0.01},
    }


def plan_data() -> Data:
    """Both robots at t = 1 sense where they stand; r1 charges at b, drives to c and back; r2 explores d at t = 5.

    b is explored for t = 1..6 (6), c for t = 1..6 at weight 2 (12), d at t = 5, its deadline (1), and a was known
    (6): coverage 25. r1 ends with 400 - 10 - 20 - 10 + 60 - 30 - 30 = 360 J, r2 with 300 - 20 - 3 * 5 - 10 - 20
    - 5 = 230 J; 590 J at 0.01 per J make 5.9.
    """

    def row(t: int, cell: str | None, battery: float, **more: Any) -> Data:
        return {"t": t, "cell": cell, "battery_j": battery} | more

    return {
        "kind": "oros_plan",
        "instance": {"name": "row", "sha256": ""},
        "claim": {"status": "feasible", "objective": 30.9, "bound": 31.0, "gap": 0.1 / 30.9},
        "robots": [
            {
                "id": "r1",
                "steps": [
                    row(0, "a", 400.0, arc=0, speed_m_s=1.0),
                    row(1, "b", 370.0, sensing=True),
                    row(2, "b", 420.0, arc=2, speed_m_s=1.0, charging_j=60.0),
                    row(3, None, 390.0),
                    row(4, "c", 390.0, arc=3, speed_m_s=1.0),
                    row(5, None, 360.0),
                    row(6, "b", 360.0),
                ],
            },
            {
                "id": "r2",
                "steps": [
                    row(1, "c", 280.0, sensing=True),
                    row(2, "c", 275.0),
                    row(3, "c", 270.0),
                    row(4, "c", 265.0, arc=4, speed_m_s=1.0),
                    row(5, "d", 235.0, sensing=True),
                    row(6, "d", 230.0),
                ],
            },
        ],
        "explored": [
            {"cell": "b", "step": 1, "robot": "r1"},
            {"cell": "c", "step": 1, "robot": "r2"},
            {"cell": "d", "step": 5, "robot": "r2"},
        ],
        "objective": {"coverage": 25.0, "battery": 5.9, "battery_j": 590.0, "total": 30.9},
    }


def certify(change: Break | None = None) -> Certificate:
    """Check the good plan, or what a change makes of instance and plan (the change may set the SHA-256 itself)."""
    case, plan = instance_data(), plan_data()
    if change is not None:
        change(case, plan)
    instance = parse(case)
    plan["instance"]["sha256"] = plan["instance"]["sha256"] or sha256(instance)
    return check(instance, parse(plan))


def rows(plan: Data, robot: int) -> list[Data]:
    return plan["robots"][robot]["steps"]


def restate(plan: Data, by_j: float = 0.0, coverage: float = 25.0) -> None:
    """Restate the objective and the claim for a plan whose robots end with ``by_j`` more."""
    total = coverage + 0.01 * (590.0 + by_j)
    plan["objective"] = {
        "coverage": coverage,
        "battery": 0.01 * (590.0 + by_j),
        "battery_j": 590.0 + by_j,
        "total": total,
    }
    plan["claim"] = {"status": "feasible", "objective": total}


def charged(plan: Data, joules: float) -> None:
    """Let r1 charge this much more at t = 2, everything else restated."""
    rows(plan, 0)[2]["charging_j"] += joules
    for later in rows(plan, 0)[2:]:
        later["battery_j"] += joules
    restate(plan, joules)
