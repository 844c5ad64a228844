"""Orders that lead on: through the next places, under one name as long as they do, and around robots that died."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from react_opt.geometry.occupancy import OCCUPIED
from react_opt.orchestrator.guide import Guide
from react_opt.orchestrator.regions import NONE, Region
from react_opt.orchestrator.strategy import Order

from .drawn import DrawnBelief, drawn, robot_at

HALL = drawn("""
########################
#                      #
#                      #
#                      #
#                      #
#                      #
#                      #
########################
""")


def hall(*robots):  # type: ignore[no-untyped-def]
    belief = DrawnBelief(HALL.copy(), robots)
    return belief, belief.survey()


def under_way(robot, order: Order, x_m: float, y_m: float):  # type: ignore[no-untyped-def]
    return replace(robot, x_m=x_m, y_m=y_m, state="driving", target=order.target)


def gap_m(order: Order, point: tuple[float, float]) -> float:
    return float(np.hypot(*(np.array(order.path_m) - point).T).min())


def test_an_order_leads_on_through_the_next_place_and_is_given_once() -> None:
    robot = robot_at("a", 1.0, 2.0)
    belief, survey = hall(robot)
    stops = [survey.block_of(4.0, 2.0), survey.block_of(7.0, 1.0), survey.block_of(10.0, 3.0)]
    guide = Guide()
    (order,) = guide.go(belief, survey, robot, "one", stops) or []
    assert gap_m(order, survey.point_of(stops[0])) < 0.01
    assert gap_m(order, survey.point_of(stops[1])) < 0.01
    driving = under_way(robot, order, 2.0, 2.0)
    assert guide.go(belief, survey, driving, "one", stops) == []


def test_going_on_to_what_the_order_led_to_is_no_new_task() -> None:
    robot = robot_at("a", 1.0, 2.0)
    belief, survey = hall(robot)
    near, far, back = survey.block_of(4.0, 2.0), survey.block_of(7.0, 1.0), survey.block_of(1.0, 3.0)
    guide = Guide()
    (order,) = guide.go(belief, survey, robot, "one", [near, far]) or []
    driving = under_way(robot, order, 3.0, 2.0)
    (after,) = guide.go(belief, survey, driving, "two", [far]) or []
    assert after.target == order.target
    (other,) = guide.go(belief, survey, driving, "three", [back]) or []
    assert other.target != order.target


def test_no_order_where_there_is_no_way() -> None:
    robot = robot_at("a", 1.0, 2.0)
    belief, survey = hall(robot)
    far = survey.block_of(10.0, 1.0)
    belief.cells[:, 25:30] = OCCUPIED
    belief.version += 1
    survey.update(belief.map, belief.version)
    assert Guide().go(belief, survey, robot, "one", [far]) is None


def test_ways_keep_clear_of_robots_that_died(monkeypatch: pytest.MonkeyPatch) -> None:
    """The belief's way leads around it; straightening would lead through it."""
    robot, dead = robot_at("a", 1.0, 2.0), robot_at("b", 2.5, 2.2, state="dead")
    belief, survey = hall(robot, dead)
    monkeypatch.setattr(belief, "path", lambda *_, **__: ((1.0, 2.0), (2.5, 3.2), (4.1, 2.1)))
    goal = survey.block_of(4.0, 2.0)
    (order,) = Guide().go(belief, survey, robot, "one", [goal]) or []
    path = np.array(order.path_m)
    least = min(
        float(np.hypot(*(one + share * (two - one) - (2.5, 2.2))))
        for one, two in pairwise(path)
        for share in np.linspace(0.0, 1.0, 21)
    )
    assert least > robot.profile.radius_m + dead.profile.radius_m - 0.1


def region(at_m: tuple[float, float], ground: list[int], frontier_m: float = 1.0, area: str = "0,0") -> Region:
    return Region(at_m, at_m, (0, 0), 1.0, 1.0, frontier_m, area, NONE, np.array(ground, dtype=np.int64), 0)


def test_a_region_is_what_is_left_of_another_by_its_hidden_ground() -> None:
    before = region((1.0, 1.0), [1, 2, 3, 4, 5, 6])
    assert region((6.0, 1.0), [4, 5, 6]).is_part_of(before, 2.5), "its frontier moved on, its ground is the same"
    assert not region((6.0, 1.0), [5, 6, 7, 8, 9]).is_part_of(before, 2.5)
    assert region((2.0, 1.0), [20]).is_part_of(before, 2.5), "so near is the same in any case"
    assert not region((9.0, 9.0), [], 0.0).is_part_of(region((1.0, 1.0), [], 0.0), 2.5), "no ground to go by"
