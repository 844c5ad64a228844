"""The checker of assignment plans: a good plan passes, and each rule broken once is named."""

from __future__ import annotations

from typing import Any

import pytest

from react_opt import jsonio
from react_opt.certify import check
from react_opt.options import SolveOptions
from react_opt.plan import AssignmentPlan
from react_opt.solvers.assignment import solve_assignment

DATA: dict[str, Any] = {
    "kind": "assignment",
    "name": "three robots",
    "robots": [
        {"id": "a", "battery_j": 100.0, "reserve_j": 20.0, "capacity": 2},
        {"id": "b", "battery_j": 50.0, "zone": ["k1", "k2", "k4"]},
        {"id": "c", "battery_j": 0.0},
    ],
    "targets": [{"id": f"k{j}", "gain": 10.0 + j} for j in range(8)],
    "costs": [
        *({"robot": "a", "target": f"k{j}", "time_s": 1.0 + j, "energy_j": 30.0} for j in range(6)),
        *({"robot": "b", "target": f"k{j}", "time_s": 2.0, "energy_j": 10.0 * j} for j in range(7)),
        {"robot": "c", "target": "k1", "time_s": 1.0, "energy_j": 0.0},
    ],
    "conflicts": [["k0", "k1"], ["k1", "k2"], ["k4", "k5"]],
}
INSTANCE = jsonio.parse(DATA)
PLAN = solve_assignment(INSTANCE, SolveOptions())


def changed(**update: Any) -> AssignmentPlan:
    data = PLAN.model_dump(mode="json", by_alias=True)
    data["claim"].update(update.pop("claim", {}))
    data.update(update)
    plan: AssignmentPlan = jsonio.parse(data)
    return plan


def rules(plan: AssignmentPlan) -> set[str]:
    return {violation.rule for violation in check(INSTANCE, plan).violations}


def pairs(*rows: tuple[str, str]) -> dict[str, Any]:
    """A plan that assigns these pairs and defers the rest with reasons that are true."""
    taken = {target for _, target in rows}
    true = {row.target: row.reason for row in PLAN.deferred}
    free = [t.id for t in INSTANCE.targets if t.id not in taken]
    return {
        "assigned": [{"robot": robot, "target": target} for robot, target in rows],
        "deferred": [{"target": t, "reason": true.get(t, "outbid")} for t in free],
        "claim": {"status": "feasible", "objective": 0.0, "bound": None, "gap": None},
    }


def test_the_solver_s_plan_passes() -> None:
    found = check(INSTANCE, PLAN)
    assert found.ok, found.violations
    assert found.objective == pytest.approx(PLAN.claim.objective)
    assert {row.target: row.reason for row in PLAN.deferred}["k7"] == "unreachable"
    assert {row.target: row.reason for row in PLAN.deferred}["k6"] == "zone"


@pytest.mark.parametrize(
    ("rows", "rule"),
    [
        ([("a", "k6")], "reach"),
        ([("b", "k3")], "zone"),
        ([("c", "k1")], "energy"),
        ([("b", "k1"), ("b", "k4")], "capacity"),
        ([("a", "k0"), ("a", "k3"), ("a", "k5")], "energy"),
        ([("a", "k0"), ("b", "k1")], "conflict"),
        ([("z", "k0")], "robot"),
        ([("a", "k99")], "target"),
        ([("a", "k0"), ("b", "k0")], "target"),
    ],
)
def test_each_broken_limit_is_named(rows: list[tuple[str, str]], rule: str) -> None:
    assert rule in rules(changed(**pairs(*rows)))


def test_a_missing_target_is_named() -> None:
    assert rules(changed(deferred=[])) == {"target"}


@pytest.mark.parametrize("reason", ["zone", "energy", "no_gain", "conflict", "outbid"])
def test_a_false_reason_is_named(reason: str) -> None:
    rows = [row.model_dump() for row in PLAN.deferred]
    for row in rows:
        if row["target"] == "k7":
            row.update(reason=reason)
    assert "reason" in rules(changed(deferred=rows))


@pytest.mark.parametrize(
    "claim",
    [
        {"objective": 1.0},
        {"bound": 0.0},
        {"gap": 0.5},
        {"status": "no_plan"},
        {"status": "infeasible", "reason": "fleet: none"},
        {"bound": 1000.0, "gap": None},
        {"objective": None, "gap": None},
        {"bound": None, "gap": None},
        {"status": "infeasible", "reason": None, "objective": None, "bound": None, "gap": None},
    ],
)
def test_a_false_claim_is_named(claim: dict[str, Any]) -> None:
    assert "claim" in rules(changed(claim=claim))


def test_a_plan_of_another_instance_is_named() -> None:
    other = jsonio.parse({**DATA, "name": "another"})
    assert {v.rule for v in check(other, PLAN).violations} == {"instance"}


def test_a_plan_of_another_kind_or_under_another_name_is_named() -> None:
    empty = {"name": "none", "time_left_s": 1.0, "robots": [], "targets": [], "travel": []}
    other = jsonio.parse({"kind": "inspection", **empty})
    assert {v.rule for v in check(other, PLAN).violations} == {"instance"}
    assert rules(changed(instance={**PLAN.instance.model_dump(), "name": "another"})) == {"instance"}


def test_a_conflict_of_a_target_that_has_none_is_named() -> None:
    plan = pairs(("a", "k0"))
    for row in plan["deferred"]:
        if row["target"] == "k3":  # no conflict pair holds k3
            row.update(reason="conflict")
    assert "reason" in rules(changed(**plan))
    found = [v.message for v in check(INSTANCE, changed(**plan)).violations if v.place == "k3"]
    assert found == ["found conflict, but no conflict pair names it"]


def test_a_negative_loss_of_an_optimal_plan_is_named() -> None:
    rows = [row.model_dump() for row in PLAN.deferred]
    rows[0].update(loss=-1.0)
    assert rules(changed(deferred=rows)) == {"reason"}
