"""REACT and OROS in the loop on drawn buildings: what is postponed, what is left for the inspection, who plans what."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from react_opt.orchestrator.belief import RobotView
from react_opt.orchestrator.highlevel import Place, direct_pairs, high_level
from react_opt.orchestrator.registry import make_strategy
from react_opt.orchestrator.strategy import Point, StrategyOptions

from .drawn import DrawnBelief, Loop, drawn, robot_at

OPTIONS = StrategyOptions(delta=0.95, step_s=5.0, horizon_s=300.0, window_steps=None, postpone_below=0.3)
NICHE = drawn("""
########################################
#   #                                  #
#                                      #
#   #                                  #
#####                                  #
#                                      #
#                                      #
#                                      #
#                                      #
#                                      #
#                                      #
########################################
""")
"""Two areas of 10 m x 6 m, and a niche at the upper left behind an opening of half a metre."""


def notes_of(loop: Loop, kind: str) -> list[str | None]:
    return [note.reason for _, decision in loop.log for note in decision.notes if note.type == kind]


def test_react_postpones_and_inspects_at_the_end() -> None:
    options = replace(OPTIONS, postpone_below=10.0)  # everything has a lower priority than this
    loop = Loop(NICHE, make_strategy("react", options), [robot_at("a", 10.0, 2.0)], area_m=10.0)
    loop.run(300.0)
    assert notes_of(loop, "target_postponed")
    gates = notes_of(loop, "inspection_gate")
    assert gates
    assert str(gates[0]).startswith("entered"), "time and battery suffice, and no area is left"
    assert loop.done


def test_naive_never_postpones_by_priority() -> None:
    options = replace(OPTIONS, postpone_below=10.0)
    loop = Loop(NICHE, make_strategy("naive", options), [robot_at("a", 10.0, 2.0)], area_m=10.0)
    loop.run(300.0)
    assert not [why for why in notes_of(loop, "target_postponed") if str(why).startswith("priority")]


def test_the_fleet_goes_on_without_a_robot_that_dies() -> None:
    for name in ("oros", "react", "react_plus", "nearest"):
        loop = Loop(NICHE, make_strategy(name, OPTIONS), [robot_at("a", 10.0, 2.0), robot_at("b", 11.0, 2.0)])
        loop.run(3.0)
        dead = replace(loop.belief.robots[0], state="dead")
        loop.belief.robots = (dead, *loop.belief.robots[1:])
        loop.run(300.0)
        assert loop.done, name
        assert loop.known_share() > 0.9, name
        assert all(order.robot == "b" for t_s, decision in loop.log if t_s >= 4.0 for order in decision.orders), name


def test_neighbours_are_joined_until_a_wall_is_known_between_them() -> None:
    """A square of areas 0 1 / 2 3, 10 s apart; with a wall between 0 and 1 the way leads through 2 and 3."""
    beside = np.array([[0, 1, 1, 0], [1, 0, 0, 1], [1, 0, 0, 1], [0, 1, 1, 0]], dtype=float)
    time_s = np.array([[0, 10, 10, 14], [10, 0, 14, 10], [10, 14, 0, 10], [14, 10, 10, 0]], dtype=float)
    assert set(direct_pairs(time_s, beside)) == {(0, 1), (0, 2), (1, 0), (1, 3), (2, 0), (2, 3), (3, 1), (3, 2)}
    time_s[0, 1] = time_s[1, 0] = 30.0
    assert (0, 1) not in direct_pairs(time_s, beside)
    time_s[0, :] = time_s[:, 0] = 50.0  # nothing leads out of 0 but long ways: it stays connected by one of them
    assert any(0 in pair for pair in direct_pairs(time_s, beside))


def test_a_robot_that_cannot_idle_through_the_window_is_left_out() -> None:
    cells = np.full((60, 200), 2, dtype=np.uint8)
    cells[5:55, 5:100] = 0
    robots = (robot_at("rich", 2.0, 3.0), robot_at("poor", 3.0, 3.0, battery_j=100.0))
    belief = DrawnBelief(cells, robots, area_m=10.0)
    places = [Place(robot, "0,0") for robot in robots]
    plan = high_level(belief, belief.survey(), OPTIONS, places, frozenset())
    assert set(plan.routes) == {"rich"}, "100 J do not last 300 s at 2 W"
    assert plan.routes["rich"] == ("1,0",)
    assert "OROS" in str(plan.note.reason)
    assert plan.note.claim is not None


def test_a_busy_robot_starts_where_it_is_going_and_when_it_is_there() -> None:
    cells = np.full((60, 300), 2, dtype=np.uint8)
    cells[5:55, 5:100] = 0
    robot = robot_at("a", 2.0, 3.0)
    belief = DrawnBelief(cells, (robot,), area_m=10.0)
    plan = high_level(belief, belief.survey(), OPTIONS, [Place(robot, "1,0", busy_s=11.0)], frozenset({"0,0"}))
    assert plan.routes["a"] == ("2,0",), "it explores 1,0 where it starts, after three steps of 5 s, and goes on"
    late = high_level(belief, belief.survey(), OPTIONS, [Place(robot, "1,0", busy_s=299.0)], frozenset({"0,0"}))
    assert set(late.explored_by) <= {"1,0"}


class Walled(DrawnBelief):
    """A belief in which nothing leads into the area in the middle, though nothing proves it."""

    def path(self, robot: RobotView, goal_m: Point, *, optimistic: bool = False) -> tuple[Point, ...]:
        return () if 10.0 < goal_m[0] < 20.0 else super().path(robot, goal_m, optimistic=optimistic)


def test_an_area_without_a_way_is_passed_over_at_once() -> None:
    """A robot that stood and waited would see nothing new, and nobody would ask again."""
    cells = np.full((60, 300), 2, dtype=np.uint8)
    cells[0:60, 0:100] = 0
    belief = Walled(cells, (robot_at("a", 2.0, 3.0),), area_m=10.0)
    decision = make_strategy("react", replace(OPTIONS, postpone_below=10.0)).decide(belief)
    last = {order.robot: order for order in decision.orders}["a"]
    assert last.target == "2,0"
    assert last.path_m
    passed = [note.target for note in decision.notes if note.type == "area_explored" and note.robot == "a"]
    assert passed[-1:] == ["1,0"]
