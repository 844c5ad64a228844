"""A good OROS plan broken in at least one way per rule of the checker: exactly the broken rules are named."""

from __future__ import annotations

import copy
from collections.abc import Callable

import pytest
from good_plan import Break, Data, certify, charged, instance_data, restate, rows

from react_opt.certify_oros import RULES
from react_opt.jsonio import parse, sha256

BREAKS: list[tuple[str, set[str], Break]] = []


def breaks(*rules: str) -> Callable[[Break], Break]:
    """Register a way to break the good plan and exactly the rules that must be named."""

    def register(change: Break) -> Break:
        BREAKS.append((change.__name__, set(rules), change))
        return change

    return register


# --- whose plan it is, robots and rows ---


@breaks("instance")
def another_sha256(case: Data, plan: Data) -> None:
    plan["instance"]["sha256"] = "0" * 64


@breaks("instance")
def another_instance_of_the_same_name(case: Data, plan: Data) -> None:
    plan["instance"]["sha256"] = sha256(parse(instance_data()))
    case["cells"][0]["x_m"] = 0.5


@breaks("instance")
def another_name(case: Data, plan: Data) -> None:
    plan["instance"]["name"] = "column"


@breaks("robots")
def a_robot_missing(case: Data, plan: Data) -> None:
    del plan["robots"][1]


@breaks("robots")
def a_robot_twice(case: Data, plan: Data) -> None:
    plan["robots"].append(copy.deepcopy(plan["robots"][0]))


@breaks("robots")
def a_robot_too_many(case: Data, plan: Data) -> None:
    plan["robots"].append({"id": "r3", "steps": []})


@breaks("robots")
def a_robot_renamed(case: Data, plan: Data) -> None:
    plan["robots"][0]["id"] = "r9"


@breaks("steps")
def a_row_missing_in_the_middle(case: Data, plan: Data) -> None:
    del rows(plan, 0)[3]


@breaks("steps")
def the_last_row_missing(case: Data, plan: Data) -> None:
    del rows(plan, 0)[-1]


@breaks("steps")
def a_row_after_the_horizon(case: Data, plan: Data) -> None:
    rows(plan, 0).append({"t": 7, "cell": "b", "battery_j": 350.0})


@breaks("steps")
def a_row_before_the_late_start(case: Data, plan: Data) -> None:
    rows(plan, 1).insert(0, {"t": 0, "cell": "c", "battery_j": 300.0})


@breaks("steps")
def rows_out_of_order(case: Data, plan: Data) -> None:
    rows(plan, 1)[1:3] = rows(plan, 1)[2:0:-1]


@breaks("steps")
def no_rows(case: Data, plan: Data) -> None:
    rows(plan, 0).clear()


# --- motion ---


@breaks("start")
def another_start(case: Data, plan: Data) -> None:
    case["robots"][0]["start"] = "d"


@breaks("arc", "motion", "speed", "battery", "objective", "claim")
def an_arc_that_does_not_exist(case: Data, plan: Data) -> None:
    rows(plan, 1)[3]["arc"] = 8


@breaks("arc", "motion")
def an_arc_that_leaves_another_cell(case: Data, plan: Data) -> None:
    rows(plan, 1)[3]["arc"] = 5


@breaks("arc", "horizon", "battery", "objective", "claim")
def an_arc_started_under_way(case: Data, plan: Data) -> None:
    rows(plan, 0)[5] |= {"arc": 3, "speed_m_s": 1.0}


@breaks("motion")
def a_jump_while_waiting(case: Data, plan: Data) -> None:
    rows(plan, 1)[5]["cell"] = "b"


@breaks("motion")
def a_move_without_an_arc(case: Data, plan: Data) -> None:
    rows(plan, 1)[3] |= {"arc": None, "speed_m_s": None}
    for later in rows(plan, 1)[4:]:
        later["battery_j"] += 5.0
    restate(plan, 5.0)


@breaks("motion")
def an_arrival_somewhere_else(case: Data, plan: Data) -> None:
    rows(plan, 1)[5] |= {"cell": "c"}
    rows(plan, 1)[4] |= {"cell": "c", "sensing": False}
    for later in rows(plan, 1)[4:]:
        later["battery_j"] += 20.0
    del plan["explored"][2]
    restate(plan, 20.0, coverage=24.0)


@breaks("motion")
def an_arrival_one_step_early(case: Data, plan: Data) -> None:
    rows(plan, 0)[5]["cell"] = "b"
    rows(plan, 0)[6]["battery_j"] -= 10.0
    restate(plan, -10.0)


@breaks("motion")
def an_arrival_one_step_late(case: Data, plan: Data) -> None:
    case["travel"][0]["steps"] = 2


@breaks("motion", "explored", "claim", "objective")
def a_cell_that_does_not_exist(case: Data, plan: Data) -> None:
    rows(plan, 1)[4]["cell"] = rows(plan, 1)[5]["cell"] = "z"
    case["travel"][4]["to"] = "b"


@breaks("horizon", "return_to")
def an_arc_that_ends_after_the_horizon(case: Data, plan: Data) -> None:
    case["travel"].append({"from": "c", "to": "b", "steps": 3, "energy_j": 30.0, "speed_m_s": 1.0})
    rows(plan, 0)[4]["arc"] = 8
    rows(plan, 0)[6]["cell"] = None


@breaks("speed")
def another_speed(case: Data, plan: Data) -> None:
    rows(plan, 0)[0]["speed_m_s"] = 0.9


@breaks("speed")
def no_speed(case: Data, plan: Data) -> None:
    rows(plan, 0)[0]["speed_m_s"] = None


@breaks("speed")
def a_speed_while_waiting(case: Data, plan: Data) -> None:
    rows(plan, 0)[1]["speed_m_s"] = 1.0


@breaks("return_to")
def another_place_of_return(case: Data, plan: Data) -> None:
    case["robots"][0]["return_to"] = "c"


# --- sensing and exploration ---


@breaks("sensing")
def sensing_under_way(case: Data, plan: Data) -> None:
    rows(plan, 0)[5]["sensing"] = True
    for later in rows(plan, 0)[5:]:
        later["battery_j"] -= 20.0
    restate(plan, -20.0)


@breaks("sensing")
def sensing_at_instant_0(case: Data, plan: Data) -> None:
    rows(plan, 0)[0]["sensing"] = True
    for row in rows(plan, 0):
        row["battery_j"] -= 20.0
    restate(plan, -20.0)


def sense_again(plan: Data, robot: int, t: int) -> None:
    for row in rows(plan, robot):
        if row["t"] == t:
            row["sensing"] = True
        if row["t"] >= t:
            row["battery_j"] -= 20.0
    restate(plan, -20.0)


@breaks("useful_sensing")
def sensing_what_the_same_robot_explored(case: Data, plan: Data) -> None:
    sense_again(plan, 1, 2)


@breaks("useful_sensing")
def sensing_what_another_robot_explored(case: Data, plan: Data) -> None:
    sense_again(plan, 0, 4)


@breaks("useful_sensing")
def sensing_what_was_known(case: Data, plan: Data) -> None:
    case["cells"][3]["explored"] = True
    del plan["explored"][2]
    restate(plan, 0.0, coverage=29.0)


@breaks("useful_sensing")
def sensing_after_the_deadline(case: Data, plan: Data) -> None:
    case["cells"][3]["deadline_step"] = 4
    restate(plan, 0.0, coverage=24.0)


@breaks("useful_sensing")
def sensing_what_has_no_weight(case: Data, plan: Data) -> None:
    case["cells"][3]["weight"] = 0.0
    restate(plan, 0.0, coverage=24.0)


@breaks("explored")
def an_explored_cell_not_listed(case: Data, plan: Data) -> None:
    del plan["explored"][0]


@breaks("explored")
def a_known_cell_listed(case: Data, plan: Data) -> None:
    plan["explored"].append({"cell": "a", "step": 0, "robot": "r1"})


@breaks("explored")
def a_cell_listed_that_does_not_exist(case: Data, plan: Data) -> None:
    plan["explored"].append({"cell": "z", "step": 0, "robot": "r1"})


@breaks("explored")
def a_cell_listed_twice(case: Data, plan: Data) -> None:
    plan["explored"].append(dict(plan["explored"][0]))


@breaks("explored")
def explored_too_early(case: Data, plan: Data) -> None:
    plan["explored"][2]["step"] = 4


@breaks("explored")
def explored_by_another_robot(case: Data, plan: Data) -> None:
    plan["explored"][0]["robot"] = "r2"


@breaks("explored", "objective", "claim")
def explored_without_sensing(case: Data, plan: Data) -> None:
    rows(plan, 1)[4]["sensing"] = False
    for later in rows(plan, 1)[4:]:
        later["battery_j"] += 20.0


# --- battery ---


@breaks("battery")
def a_battery_misstated(case: Data, plan: Data) -> None:
    rows(plan, 0)[3]["battery_j"] += 0.01


@breaks("battery")
def sensing_that_costs_nothing(case: Data, plan: Data) -> None:
    for later in rows(plan, 1)[4:]:
        later["battery_j"] += 20.0


@breaks("battery")
def waiting_at_the_charger_that_costs_nothing(case: Data, plan: Data) -> None:
    for later in rows(plan, 0)[2:]:
        later["battery_j"] += 10.0


@breaks("battery")
def a_long_arc_paid_on_arrival(case: Data, plan: Data) -> None:
    rows(plan, 0)[3]["battery_j"] += 30.0


@breaks("battery")
def a_long_arc_paid_when_it_starts(case: Data, plan: Data) -> None:
    rows(plan, 0)[2]["battery_j"] -= 30.0


@breaks("battery")
def the_later_steps_of_a_long_arc_cost_idle_energy(case: Data, plan: Data) -> None:
    for later in rows(plan, 0)[4:]:
        later["battery_j"] -= 10.0


@breaks("battery", "objective", "claim")
def the_dearer_arc_paid_like_the_cheaper(case: Data, plan: Data) -> None:
    rows(plan, 0)[0]["arc"] = 7


@breaks("reserve")
def below_the_reserve(case: Data, plan: Data) -> None:
    case["robots"][1]["reserve_j"] = 232.0


@breaks("reserve")
def below_the_reserve_for_a_while(case: Data, plan: Data) -> None:
    case["robots"][0]["reserve_j"] = 375.0
    charged(plan, 0.0)
    for row in rows(plan, 0)[2:]:
        row["battery_j"] += 30.0
    rows(plan, 0)[2]["charging_j"] += 30.0
    case["chargers"][0]["power_w"] = 9.0
    restate(plan, 30.0)


@breaks("capacity")
def above_the_capacity(case: Data, plan: Data) -> None:
    case["robots"][0]["capacity_j"] = 419.0


@breaks("charging_place")
def charging_without_a_charger(case: Data, plan: Data) -> None:
    case["chargers"][0]["cell"] = "c"


@breaks("charging_place")
def charging_on_arrival(case: Data, plan: Data) -> None:
    rows(plan, 0)[6] |= {"charging_j": 5.0, "battery_j": 365.0}
    restate(plan, 5.0)


@breaks("charging_place")
def charging_under_way(case: Data, plan: Data) -> None:
    rows(plan, 0)[5] |= {"charging_j": 5.0, "battery_j": 365.0}
    rows(plan, 0)[6] |= {"battery_j": 365.0}
    restate(plan, 5.0)


@breaks("charging_place")
def charging_before_the_first_wait(case: Data, plan: Data) -> None:
    case["robots"][0]["start"] = "b"
    case["travel"][0] |= {"from": "b", "to": "c"}
    case["travel"].append({"from": "c", "to": "b", "steps": 1, "energy_j": 0.0, "speed_m_s": None})
    rows(plan, 0)[0] |= {"cell": "b", "charging_j": 5.0, "battery_j": 405.0}
    rows(plan, 0)[1] |= {"cell": "b"}
    rows(plan, 0)[0] |= {"arc": None, "speed_m_s": None}
    for later in rows(plan, 0)[1:]:
        later["battery_j"] += 5.0
    restate(plan, 5.0)


@breaks("charging_power")
def charging_too_fast(case: Data, plan: Data) -> None:
    charged(plan, 0.5)


@breaks("charging_power")
def charging_backwards(case: Data, plan: Data) -> None:
    charged(plan, -61.0)


@breaks("charging_slots")
def no_slot(case: Data, plan: Data) -> None:
    case["chargers"][0]["slots"] = 0


# --- limits of the fleet ---


@breaks("robots_per_cell")
def too_many_in_a_cell(case: Data, plan: Data) -> None:
    case["limits"]["robots_per_cell"] = 1


@breaks("swaps")
def a_swap(case: Data, plan: Data) -> None:
    rows(plan, 1)[2] |= {"arc": 3, "speed_m_s": 1.0}
    rows(plan, 1)[3] |= {"cell": None, "arc": None, "speed_m_s": None, "battery_j": 245.0 - 5.0}
    rows(plan, 1)[4] |= {"cell": "b", "sensing": False, "battery_j": 240.0}
    rows(plan, 1)[5] |= {"cell": "b", "battery_j": 235.0}
    del plan["explored"][2]
    restate(plan, 5.0, coverage=24.0)


@breaks("sensing_robots_per_step")
def too_many_sense_at_once(case: Data, plan: Data) -> None:
    case["limits"]["sensing_robots_per_step"] = 1


# --- objective and claim ---


@breaks("objective")
def a_coverage_misstated(case: Data, plan: Data) -> None:
    plan["objective"]["coverage"] += 1.0


@breaks("objective")
def a_battery_term_misstated(case: Data, plan: Data) -> None:
    plan["objective"]["battery"] *= 1.0001


@breaks("objective")
def the_joules_left_misstated(case: Data, plan: Data) -> None:
    plan["objective"]["battery_j"] += 0.1


@breaks("objective")
def a_total_misstated(case: Data, plan: Data) -> None:
    plan["objective"]["total"] += 0.001


@breaks("objective")
def no_objective(case: Data, plan: Data) -> None:
    plan["objective"] = None


@breaks("claim")
def another_objective_claimed(case: Data, plan: Data) -> None:
    plan["claim"] |= {"objective": 30.91, "gap": 0.09 / 30.91}


@breaks("claim")
def no_objective_claimed(case: Data, plan: Data) -> None:
    plan["claim"] |= {"objective": None, "gap": None}


@breaks("claim")
def a_gap_misstated(case: Data, plan: Data) -> None:
    plan["claim"]["gap"] = 0.001


@breaks("claim")
def no_gap_where_it_is_known(case: Data, plan: Data) -> None:
    plan["claim"]["gap"] = None


@breaks("claim")
def a_gap_without_a_bound(case: Data, plan: Data) -> None:
    plan["claim"]["bound"] = None


@breaks("claim")
def a_bound_below_the_objective(case: Data, plan: Data) -> None:
    plan["claim"] |= {"bound": 30.8, "gap": 0.1 / 30.9}


@breaks("claim")
def optimal_without_a_bound(case: Data, plan: Data) -> None:
    plan["claim"] |= {"status": "optimal", "bound": None, "gap": None}


@breaks("claim")
def optimal_with_a_gap(case: Data, plan: Data) -> None:
    """1e-6 of 30.9 is allowed (less than sigma * 1 J = 0.01); this is twice as much."""
    plan["claim"] |= {"status": "optimal", "bound": 30.9 + 6.2e-5, "gap": 6.2e-5 / 30.9}


@breaks("claim")
def no_plan_with_a_plan(case: Data, plan: Data) -> None:
    plan["claim"] = {"status": "no_plan"}


@breaks("claim")
def infeasible_with_a_plan(case: Data, plan: Data) -> None:
    plan["claim"] = {"status": "infeasible", "reason": "robot r1: battery"}


@breaks("claim", "robots", "objective")
def feasible_without_a_plan(case: Data, plan: Data) -> None:
    plan |= {"robots": [], "explored": [], "objective": None}


@breaks("claim")
def infeasible_without_a_reason(case: Data, plan: Data) -> None:
    plan |= {"robots": [], "explored": [], "objective": None, "claim": {"status": "infeasible"}}


@pytest.mark.parametrize(("rules", "change"), [pytest.param(r, c, id=n) for n, r, c in BREAKS])
def test_every_broken_rule_is_named(rules: set[str], change: Break) -> None:
    certificate = certify(change)
    assert not certificate.ok
    assert {violation.rule for violation in certificate.violations} == rules, certificate.violations
    for violation in certificate.violations:
        assert violation.message
        assert violation.rule in str(violation)


def test_every_rule_is_broken_at_least_once() -> None:
    assert {rule.__name__ for rule in RULES} | {"instance"} == set().union(*(rules for _, rules, _ in BREAKS))


def test_a_violation_says_which_robot_when_and_by_how_much() -> None:
    (found,) = certify(too_late := a_battery_misstated).violations
    assert (found.rule, found.place, found.step) == ("battery", "r1", 3)
    assert found.amount == pytest.approx(0.01)
    assert str(found) == "battery: r1, step 3: expected battery_j 390, found 390.01 (by 0.01)"
    assert too_late is a_battery_misstated
