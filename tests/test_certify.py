"""The checker of OROS plans: good plans are left in peace, broken ones found, absurd ones reported."""

from __future__ import annotations

import sys
import types
from collections.abc import Callable
from typing import Any

import pytest
from good_plan import Break, Data, certify, instance_data, plan_data, restate, rows
from hypothesis import given, settings
from strategies import MIDDLE, TINY, Size, random_oros, random_plan, seeds

from react_opt.certify import check
from react_opt.certify_base import Violation
from react_opt.errors import InputError, UsageError
from react_opt.instance import Fleet, OrosInstance
from react_opt.jsonio import parse, sha256
from react_opt.plan import OrosPlan

calm = settings(derandomize=True, deadline=None, max_examples=60)


def test_the_good_plan_is_good() -> None:
    certificate = certify()
    assert certificate.violations == ()
    assert certificate.ok
    assert certificate.objective == pytest.approx(30.9)


# --- what is not a violation ---


def optimal_within_its_tolerance(case: Data, plan: Data) -> None:
    plan["claim"] |= {"status": "optimal", "bound": 30.9 + 2e-5, "gap": 2e-5 / 30.9}


def the_dearer_arc_paid_for(case: Data, plan: Data) -> None:
    rows(plan, 0)[0]["arc"] = 7
    for later in rows(plan, 0)[1:]:
        later["battery_j"] -= 1.0
    restate(plan, -1.0)


def both_sense_a_cell_at_once(case: Data, plan: Data) -> None:
    """r2's c is sensed by nobody at t = 1; r1 and r2 sense it together at t = 4, and either may be named."""
    rows(plan, 1)[0] |= {"sensing": False}
    rows(plan, 1)[3] |= {"sensing": True}
    rows(plan, 0)[4] |= {"sensing": True}
    for row in rows(plan, 1)[:3]:
        row["battery_j"] += 20.0
    for row in rows(plan, 0)[4:]:
        row["battery_j"] -= 20.0
    plan["explored"][1] |= {"step": 4, "robot": "r1"}
    restate(plan, -20.0, coverage=25.0 - 3 * 2.0)


def a_meeting_at_the_end_of_an_arc(case: Data, plan: Data) -> None:
    """r1 reaches c at t = 4, the instant at which r2 leaves c for b: their open intervals only touch."""
    rows(plan, 1)[3] |= {"arc": 3}
    rows(plan, 1)[4] |= {"cell": None, "sensing": False, "battery_j": 235.0}
    rows(plan, 1)[5] |= {"cell": "b", "battery_j": 235.0}
    del plan["explored"][2]
    restate(plan, 5.0, coverage=24.0)


def no_plan(case: Data, plan: Data) -> None:
    plan |= {"robots": [], "explored": [], "objective": None}
    plan["claim"] = {"status": "no_plan", "bound": 99.0, "limit": "time", "reason": "out of time"}


def infeasible(case: Data, plan: Data) -> None:
    plan |= {"robots": [], "explored": [], "objective": None}
    plan["claim"] = {"status": "infeasible", "reason": "robot r1: return_to"}


@pytest.mark.parametrize(
    "change",
    [
        optimal_within_its_tolerance,
        the_dearer_arc_paid_for,
        both_sense_a_cell_at_once,
        a_meeting_at_the_end_of_an_arc,
        no_plan,
        infeasible,
    ],
)
def test_what_is_allowed_is_left_in_peace(change: Break) -> None:
    assert certify(change).violations == ()


@calm
@given(seeds())
@pytest.mark.parametrize("size", [TINY, MIDDLE], ids=["tiny", "middle"])
def test_good_plans_raise_no_alarm(size: Size, seed: int) -> None:
    instance = random_oros(seed, size)
    plan = random_plan(instance, seed, tries=15)
    if plan is not None:
        certificate = check(instance, plan)
        assert certificate.violations == ()
        assert plan.objective is not None
        assert certificate.objective == pytest.approx(plan.objective.total)


def good_case(seed: int) -> tuple[OrosInstance, OrosPlan]:
    """Return the first good plan with a moving, a sensing and a waiting robot at or after a seed."""
    while True:
        instance = random_oros(seed, MIDDLE)
        plan = random_plan(instance, seed, tries=5)
        if plan is not None and plan.explored:
            steps = [row for robot in plan.robots for row in robot.steps]
            if any(row.arc is not None for row in steps) and all(len(robot.steps) > 1 for robot in plan.robots):
                return instance, plan
        seed = (seed + 1) % 2**32


def nudge(plan: Data, place: str) -> str:
    """Change one field of a good plan; return a rule that must be among those named."""
    if place == "battery_j":
        rows(plan, -1)[-1]["battery_j"] += 0.5
        return "battery"
    if place == "cell":
        rows(plan, 0)[-1]["cell"] = "elsewhere"
        return "motion"
    if place == "start":
        rows(plan, 0)[0]["cell"] = "elsewhere"
        return "start"
    if place == "t":
        rows(plan, 0)[-1]["t"] += 1
        return "steps"
    if place == "charging_j":
        rows(plan, 0)[0]["charging_j"] = 2.5
        return "charging_place"
    if place == "explored":
        plan["explored"][0]["step"] += 1
        return "explored"
    if place == "total":
        plan["objective"]["total"] += 0.5
        return "objective"
    if place == "claim":
        plan["claim"]["objective"] -= 0.5
        return "claim"
    first = next(row for robot in plan["robots"] for row in robot["steps"] if row["arc"] is not None)
    first |= {"arc": None, "speed_m_s": None}
    return "motion"


@calm
@given(seeds())
@pytest.mark.parametrize(
    "place", ["battery_j", "cell", "start", "t", "charging_j", "explored", "total", "claim", "arc"]
)
def test_any_good_plan_broken_in_one_field_is_found(place: str, seed: int) -> None:
    instance, plan = good_case(seed)
    data = plan.model_dump(mode="json")
    rule = nudge(data, place)
    assert rule in {violation.rule for violation in check(instance, parse(data)).violations}


# --- errors in the energy law or in the time graph, made on purpose ---


def remade(plan: OrosPlan, levels: Callable[[int, Any], float]) -> OrosPlan:
    """Return the plan with every battery replaced by what another energy law says."""
    data = plan.model_dump(mode="json")
    for index, robot in enumerate(data["robots"]):
        for k, row in enumerate(robot["steps"]):
            row["battery_j"] = levels(index, k)
    return parse(data)


@calm
@given(seeds())
@pytest.mark.parametrize("law", ["arcs 1 % dearer", "no idle energy", "sensing a step late"])
def test_another_energy_law_is_found(law: str, seed: int) -> None:
    instance, plan = good_case(seed)
    wrong: list[list[float]] = []
    for robot, part in zip(instance.robots, plan.robots, strict=True):
        level, levels, late = robot.battery_j, [], 0.0
        for k, row in enumerate(part.steps):
            before = part.steps[k - 1] if k else None
            if before is not None and before.arc is not None:
                level -= instance.travel[before.arc].energy_j * (1.01 if law.startswith("arcs") else 1.0)
            elif before is not None and before.cell is not None and law != "no idle energy":
                level -= robot.idle_w * instance.step_s
            now = robot.sensing_w * instance.step_s * row.sensing
            level -= late if law.startswith("sensing") else now
            late = now
            level += row.charging_j
            levels.append(level)
        wrong.append(levels)
    other = remade(plan, lambda index, k: wrong[index][k])
    differs = any(
        abs(one.battery_j - two.battery_j) > 1e-3
        for a, b in zip(plan.robots, other.robots, strict=True)
        for one, two in zip(a.steps, b.steps, strict=True)
    )
    found = {violation.rule for violation in check(instance, other).violations}
    assert ("battery" in found) == differs


@calm
@given(seeds())
def test_a_plan_made_for_shorter_arcs_is_found(seed: int) -> None:
    instance, plan = good_case(seed)
    used = {row.arc for robot in plan.robots for row in robot.steps if row.arc is not None}
    data = instance.model_dump(mode="json", by_alias=True)
    for index in used:
        data["travel"][index]["steps"] += 1
    longer = parse(data)
    moved = plan.model_copy(update={"instance": plan.instance.model_copy(update={"sha256": sha256(longer)})})
    found = {violation.rule for violation in check(longer, moved).violations}
    assert found & {"motion", "horizon"}


# --- anything the schema allows is reported, never raised ---

HUGE = 2**63 - 1  # the largest whole number of a file


def huge_numbers(case: Data, plan: Data) -> None:
    rows(plan, 0)[1] |= {"t": HUGE, "arc": HUGE, "battery_j": -1.7e308}
    plan["explored"][0]["step"] = HUGE


def huge_energies(case: Data, plan: Data) -> None:
    for robot in case["robots"]:
        robot |= {"idle_w": 1e30, "sensing_w": 1e30, "battery_j": 1e30, "capacity_j": 1e30}
    case["chargers"][0]["power_w"] = 1e30
    for row in rows(plan, 0):
        row["charging_j"] = 1e30


def huge_weights_and_sigma(case: Data, plan: Data) -> None:
    case["objective"]["sigma"] = 1e30
    for cell in case["cells"]:
        cell["weight"] = 1e30
    plan["claim"] |= {"bound": -1.7e308, "objective": 1.7e308, "gap": 1.7e308}


def huge_steps_and_limits(case: Data, plan: Data) -> None:
    for arc in case["travel"]:
        arc["steps"] = HUGE
    case["limits"] = {"robots_per_cell": HUGE, "sensing_robots_per_step": HUGE, "forbid_swaps": True}
    case["chargers"][0]["slots"] = HUGE
    case["cells"][1]["deadline_step"] = HUGE


def odd_text(case: Data, plan: Data) -> None:
    plan["robots"][0]["id"] = "\ud800"
    plan["explored"][0]["cell"] = "x" * 100_000


@pytest.mark.parametrize(
    "change",
    [huge_numbers, huge_energies, huge_weights_and_sigma, huge_steps_and_limits, odd_text],
)
def test_absurd_plans_are_reported(change: Break) -> None:
    certificate = certify(change)
    assert not certificate.ok
    assert all(len(str(violation)) < 1000 for violation in certificate.violations)


def test_a_plan_of_another_kind_is_a_violation() -> None:
    instance = parse(instance_data())
    other = {"kind": "assignment_plan", "instance": {"name": "row", "sha256": ""}, "claim": {"status": "no_plan"}}
    (found,) = check(instance, parse(other)).violations
    assert found.rule == "instance"


def test_a_fleet_has_no_plans() -> None:
    fleet = Fleet.model_construct(name="f", profiles={}, robots=())
    with pytest.raises(UsageError, match="fleet"):
        check(fleet, parse(plan_data()))  # type: ignore[arg-type]


def test_an_instance_without_robots_has_an_empty_plan() -> None:
    def change(case: Data, plan: Data) -> None:
        case["robots"] = []
        plan |= {"robots": [], "explored": []}
        plan["objective"] = {"coverage": 6.0, "battery": 0.0, "battery_j": 0.0, "total": 6.0}
        plan["claim"] = {"status": "optimal", "objective": 6.0, "bound": 6.0, "gap": 0.0}

    assert certify(change).violations == ()


def test_violations_print_without_a_step_or_an_amount() -> None:
    assert str(Violation("claim", "", None, None, "no bound")) == "claim: no bound"


# --- the bound recomputed from the claim's certificate ---


def bound_case(certificate: Data | None, bound: float | None = 31.0) -> tuple[Any, Any]:
    data = plan_data()
    instance = parse(instance_data())
    data["instance"]["sha256"] = sha256(instance)
    data["claim"] |= {
        "bound": bound,
        "certificate": certificate,
        "gap": None if bound is None else (bound - 30.9) / 30.9,
    }
    return instance, parse(data)


@pytest.mark.parametrize(("proven", "rules"), [(30.95, set()), (31.0, set()), (31.0 + 1e-9, set()), (31.1, {"bound"})])
def test_the_recomputed_bound_may_not_be_above_the_claimed_one(
    proven: float, rules: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    part = types.ModuleType("react_opt.certify_bound")
    part.recompute_bound = lambda instance, certificate, tell: certificate["value"]  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "react_opt.certify_bound", part)
    found = check(*bound_case({"value": proven}), bound=True)
    assert {violation.rule for violation in found.violations} == rules
    assert found.bound == proven


def test_a_certificate_that_makes_no_sense_is_a_violation(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(instance: Any, certificate: Any, tell: Any) -> float:
        raise InputError.single("<data>", "claim.certificate.prices", "required, but missing")

    part = types.ModuleType("react_opt.certify_bound")
    part.recompute_bound = refuse  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "react_opt.certify_bound", part)
    (found,) = check(*bound_case({}), bound=True).violations
    assert found.rule == "bound"
    assert "claim.certificate.prices" in found.message


def test_a_bound_without_a_certificate_cannot_be_recomputed() -> None:
    (found,) = check(*bound_case(None), bound=True).violations
    assert (found.rule, found.amount) == ("bound", None)
    assert check(*bound_case(None)).ok
    assert check(*bound_case(None, bound=None), bound=True).ok
