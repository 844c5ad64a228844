"""A good OROS plan broken in its batteries and the fleet's limits: exactly the broken rules are named."""

from __future__ import annotations

import pytest
from broken_rules import Breaks, expect
from good_plan import Break, Data, certify, charged, restate, rows

breaks = Breaks()


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


@pytest.mark.parametrize(("rules", "change"), breaks.parameters())
def test_every_broken_rule_is_named(rules: set[str], change: Break) -> None:
    expect(rules, change)


def test_a_violation_says_which_robot_when_and_by_how_much() -> None:
    (found,) = certify(a_battery_misstated).violations
    assert (found.rule, found.place, found.step) == ("battery", "r1", 3)
    assert found.amount == pytest.approx(0.01)
    assert str(found) == "battery: r1, step 3: expected battery_j 390, found 390.01 (by 0.01)"
