"""A good OROS plan broken in its rows, its motion and its sensing: exactly the broken rules are named."""

from __future__ import annotations

import copy

import pytest
from broken_rules import Breaks, expect
from good_plan import Break, Data, instance_data, restate, rows

from react_opt.jsonio import parse, sha256

breaks = Breaks()


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


@pytest.mark.parametrize(("rules", "change"), breaks.parameters())
def test_every_broken_rule_is_named(rules: set[str], change: Break) -> None:
    expect(rules, change)
