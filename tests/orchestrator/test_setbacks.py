"""A robot that does not get away from where it is leaves its work to the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from react_opt.orchestrator import react_plus
from react_opt.orchestrator.belief import RobotView
from react_opt.orchestrator.registry import make_strategy
from react_opt.orchestrator.setbacks import STUCK_S, Setbacks
from react_opt.orchestrator.strategy import StrategyOptions
from react_opt.orchestrator.tours import IntArray, Tasks, better_tours

from .drawn import Loop, drawn, robot_at

OPTIONS = StrategyOptions(delta=0.95, step_s=5.0, horizon_s=300.0, window_steps=None, postpone_below=0.3)
CHAMBERS = drawn("""
##############################################################################
#                         #                        #                         #
#                         #                        #                         #
#                         #                        #                         #
#                                                                            #
#                         #                        #                         #
#                         #                        #                         #
#                         #                        #                         #
##############################################################################
""")
"""Three chambers in a row, with doors between them."""


class Wedged(Loop):
    """Robot ``b`` never moves, whatever it is told, and is given up as stuck every twenty seconds."""

    def _moved(self, robot: RobotView, step_s: float) -> RobotView:
        if robot.id != "b" or not self.ways["b"]:
            return super()._moved(robot, step_s)
        stuck = self.belief.t_s % 20.0 == 19.0
        if stuck:
            self.ways["b"] = []
        return replace(robot, state="stuck" if stuck else "driving")


def test_a_robot_that_never_moves_does_not_keep_the_last_room_for_itself() -> None:
    """It stands before the left chamber, so each plan that believes it gives that to it; the other one is far away."""
    loop = Wedged(CHAMBERS, make_strategy("react_plus", OPTIONS), [robot_at("a", 20.0, 2.0), robot_at("b", 17.0, 2.0)])
    took_s = loop.run(300.0)
    assert loop.known_share() > 0.97
    assert took_s < 100.0


def test_plans_expect_a_stuck_robot_late_and_do_not_send_it_where_it_gave_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robot ``b`` was stuck three times where it is, and gave up the place that it would be sent to."""
    tasks: list[Tasks] = []

    def noted(kept: IntArray, given: Tasks, work: int, margin_s: float) -> list[list[int]]:
        tasks.append(given)
        return better_tours(kept, given, work, margin_s)

    monkeypatch.setattr(react_plus, "better_tours", noted)
    fresh, failed = react_plus.ReactPlus(OPTIONS), react_plus.ReactPlus(OPTIONS)
    loop = Loop(CHAMBERS, fresh, [robot_at("a", 20.0, 2.0), robot_at("b", 17.0, 2.0)])
    fresh.decide(loop.belief)
    goal_m = fresh.goals["b"].at_m
    b = loop.belief.robots[1]
    for _ in range(3):
        failed.setbacks.stuck(b)
    failed.setbacks.give_up(b, goal_m, 0.0)
    failed.decide(loop.belief)
    late_s = tasks[1].start_s - tasks[0].start_s
    assert np.all(late_s[0] == 0.0)
    far = tasks[1].start_s[1] == react_plus.FAR_S
    assert far.any()
    assert np.allclose(late_s[1, ~far], 2 * STUCK_S)
    given = failed.goals.get("b")
    assert given is None or given.at_m != goal_m


def test_what_one_robot_gives_up_another_one_may_do_and_only_for_a_while() -> None:
    a, b = robot_at("a", 0.0, 0.0), robot_at("b", 5.0, 0.0)
    setbacks = Setbacks()
    setbacks.give_up(a, (3.0, 3.0), now_s=10.0)
    places = [(3.2, 3.2), (8.0, 3.0)]
    assert setbacks.out_of_reach([a, b], places).tolist() == [[True, False], [False, False]]
    setbacks.forget([a, b], 10.0 + STUCK_S)
    assert not setbacks.out_of_reach([a, b], places).any()
    assert setbacks.out_of_reach([a, b], []).shape == (2, 0)


def test_only_a_robot_stuck_again_at_the_same_place_is_expected_later() -> None:
    a = robot_at("a", 0.0, 0.0)
    setbacks = Setbacks()
    delays = []
    for _ in range(3):
        setbacks.stuck(a)
        delays.append(float(setbacks.delay_s([a])[0]))
    assert delays == [0.0, STUCK_S, 2 * STUCK_S]
    moved = replace(a, x_m=2.0)
    setbacks.forget([moved], 0.0)
    assert np.array_equal(setbacks.delay_s([moved]), [0.0])
