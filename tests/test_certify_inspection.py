"""The checker of inspection plans: a good plan passes, and each rule broken once is named."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import pytest

from react_opt import jsonio
from react_opt.certify import check
from react_opt.options import SolveOptions
from react_opt.plan import InspectionPlan
from react_opt.solvers.inspection import solve_inspection

PLACES = ["k0", "k1", "k2", "dock", "exit"]
DATA: dict[str, Any] = {
    "kind": "inspection",
    "name": "two robots",
    "time_left_s": 30.0,
    "robots": [
        {"id": "a", "at": "dock", "battery_j": 200.0, "reserve_j": 20.0, "end": "exit"},
        {"id": "b", "at": "k1", "battery_j": 100.0},
    ],
    "targets": [
        {"id": "k0", "value": 2.0, "service_s": 3.0, "service_energy_j": 5.0},
        {"id": "k1", "value": 1.0, "service_s": 1.0},
        {"id": "k2", "value": 4.0},
        {"id": "far", "value": 9.0},
        {"id": "deep", "value": 9.0},
        {"id": "lost", "value": 9.0},
    ],
    "travel": [
        *({"from": x, "to": y, "time_s": 6.0, "energy_j": 20.0} for x in PLACES for y in PLACES if x != y),
        {"from": "dock", "to": "k0", "time_s": 7.0, "energy_j": 30.0, "robot": "a"},
        {"from": "dock", "to": "far", "time_s": 60.0, "energy_j": 1.0},
        {"from": "far", "to": "exit", "time_s": 1.0, "energy_j": 1.0},
        {"from": "dock", "to": "deep", "time_s": 1.0, "energy_j": 900.0},
        {"from": "deep", "to": "exit", "time_s": 1.0, "energy_j": 1.0},
    ],
}
INSTANCE = jsonio.parse(DATA)
PLAN = solve_inspection(INSTANCE, SolveOptions(threads=1))
GOOD = PLAN.model_dump(mode="json", by_alias=True)


def rules(change: Callable[[dict[str, Any]], Any]) -> set[str]:
    data = copy.deepcopy(GOOD)
    change(data)
    plan: InspectionPlan = jsonio.parse(data)
    return {violation.rule for violation in check(INSTANCE, plan).violations}


def test_the_solver_s_plan_passes_and_its_reasons_are_true() -> None:
    found = check(INSTANCE, PLAN)
    assert found.ok, found.violations
    # All of k0, k1 and k2 fit; the others do not fit the time, the battery, or cannot be driven to.
    assert found.objective == 7.0
    assert {row.target: row.reason for row in PLAN.skipped} == {
        "far": "time", "deep": "battery", "lost": "unreachable",
    }  # fmt: skip


def _first(data: dict[str, Any]) -> dict[str, Any]:
    route: dict[str, Any] = next(route for route in data["routes"] if route["stops"])
    return route


def _drop_battery(data: dict[str, Any]) -> None:
    _first(data)["stops"][0]["battery_j"] -= 1.0


def _detour(data: dict[str, Any]) -> None:
    """Visit a target that no row leads to."""
    _first(data)["stops"][0]["target"] = "lost"


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (lambda d: d["routes"].pop(), "robot"),
        (lambda d: d["routes"].append(d["routes"][0]), "robot"),
        (lambda d: d["routes"][0].update(robot="z"), "robot"),
        (lambda d: d["skipped"].pop(), "target"),
        (lambda d: d["skipped"].append({"target": "k0", "reason": "outbid"}), "target"),
        (lambda d: d["skipped"].append({"target": "zz", "reason": "outbid"}), "target"),
        (lambda d: d["routes"][0].update(end=None), "end"),
        (_detour, "drive"),
        (lambda d: _first(d)["stops"][0].update(arrive_s=0.5), "time"),
        (lambda d: _first(d)["stops"][0].update(leave_s=99.0), "time"),
        (_drop_battery, "battery"),
        (lambda d: d["routes"][0].update(finish_s=1.0), "time"),
        (lambda d: d["routes"][0].update(finish_battery_j=200.0), "battery"),
        (lambda d: d.update(t_dpi_s=1.0), "t_dpi"),
        (lambda d: d.update(t_dpi_s=None), "t_dpi"),
        (lambda d: d["skipped"][0].update(reason="outbid"), "reason"),
        (lambda d: d["skipped"][2].update(reason="time"), "reason"),
        (lambda d: d["skipped"][0].update(loss=-1.0), "reason"),
        (lambda d: d["claim"].update(objective=8.0), "claim"),
        (lambda d: d["claim"].update(bound=6.0), "claim"),
        (lambda d: d["claim"].update(bound=8.0, gap=1 / 7), "claim"),
        (lambda d: d["claim"].update(status="no_plan"), "claim"),
        (lambda d: d["claim"].update(bound=None, gap=None), "claim"),
        (lambda d: d["claim"].update(gap=0.5), "claim"),
        (lambda d: d["claim"].update(status="infeasible", reason=None), "claim"),
        (lambda d: d["claim"]["secondary"].update(objective=1.0), "secondary"),
        (lambda d: d["claim"]["secondary"].update(objective=None), "secondary"),
        (lambda d: d["claim"]["secondary"].update(bound=1e6), "secondary"),
        (lambda d: d["claim"]["secondary"].update(bound=0.0), "secondary"),
        (lambda d: d["claim"].update(status="feasible"), "secondary"),
        (lambda d: d["instance"].update(sha256="0"), "instance"),
        (lambda d: d["instance"].update(name="another"), "instance"),
    ],
)
def test_each_broken_rule_is_named(change: Callable[[dict[str, Any]], Any], rule: str) -> None:
    assert rule in rules(change)


@pytest.mark.parametrize(
    ("field", "value", "rule"), [("time_left_s", 10.0, "time_left"), ("reserve_j", 190.0, "reserve")]
)
def test_budgets_are_kept(field: str, value: float, rule: str) -> None:
    data = copy.deepcopy(DATA)
    (data if field in data else data["robots"][0])[field] = value
    tighter = jsonio.parse(data)
    mine = copy.deepcopy(GOOD)
    mine["instance"]["sha256"] = jsonio.sha256(tighter)
    assert rule in {violation.rule for violation in check(tighter, jsonio.parse(mine)).violations}


def test_an_end_that_no_row_leads_to_is_named() -> None:
    route = next(route for route in GOOD["routes"] if route["robot"] == "a")
    last = route["stops"][-1]["target"]
    data = copy.deepcopy(DATA)
    data["travel"] = [row for row in data["travel"] if (row["from"], row["to"]) != (last, "exit")]
    broken = jsonio.parse(data)
    mine = copy.deepcopy(GOOD)
    mine["instance"]["sha256"] = jsonio.sha256(broken)
    found = [v for v in check(broken, jsonio.parse(mine)).violations if v.rule == "drive"]
    assert [(v.place, v.message) for v in found] == [("a", f"no row leads from {last!r} to the end 'exit'")]


def test_an_end_out_of_reach_is_infeasible_and_names_the_robot() -> None:
    data = copy.deepcopy(DATA)
    data["time_left_s"] = 1.0
    tight = jsonio.parse(data)
    plan = solve_inspection(tight, SolveOptions(threads=1))
    assert plan.claim.status == "infeasible"
    assert "robot a: end" in (plan.claim.reason or "")
    assert plan.routes == ()
    assert check(tight, plan).ok


def test_nobody_and_nothing() -> None:
    empty = jsonio.parse(
        {"kind": "inspection", "name": "empty", "time_left_s": 1.0, "robots": [], "targets": [], "travel": []}
    )
    plan = solve_inspection(empty, SolveOptions(threads=1))
    assert (plan.claim.status, plan.claim.objective, plan.t_dpi_s) == ("optimal", 0.0, 0.0)
    assert check(empty, plan).ok
