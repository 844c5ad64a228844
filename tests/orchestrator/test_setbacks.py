"""A robot that does not get away from where it is leaves its work to the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from react_opt.orchestrator.belief import RobotView
from react_opt.orchestrator.registry import make_strategy
from react_opt.orchestrator.setbacks import STUCK_S, Setbacks
from react_opt.orchestrator.strategy import StrategyOptions

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
