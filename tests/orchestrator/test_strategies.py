"""What every strategy does on small drawn buildings."""

from __future__ import annotations

import pytest

from react_opt.errors import UsageError
from react_opt.orchestrator.registry import make_strategy, strategy_names
from react_opt.orchestrator.strategy import StrategyOptions

from .drawn import Loop, drawn, robot_at

OPTIONS = StrategyOptions(delta=0.95, step_s=5.0, horizon_s=200.0, window_steps=None, postpone_below=0.5)
TWO_ROOMS = drawn("""
####################
#        #         #
#        #         #
#                  #
#        #         #
#        #         #
#####  ######  #####
#        #         #
#        #         #
#        #         #
#                  #
#        #         #
####################
""")


@pytest.mark.parametrize("name", strategy_names())
def test_explores_a_building_and_says_that_it_is_done(name: str) -> None:
    loop = Loop(TWO_ROOMS, make_strategy(name, OPTIONS), [robot_at("a", 1.0, 1.0), robot_at("b", 1.0, 2.0)])
    loop.run(200.0)
    assert loop.done, "nothing is left to do long before the time is up"
    assert loop.known_share() > 0.9


@pytest.mark.parametrize("name", strategy_names())
def test_decides_the_same_twice(name: str) -> None:
    logs = []
    for _ in range(2):
        loop = Loop(TWO_ROOMS, make_strategy(name, OPTIONS), [robot_at("a", 1.0, 1.0), robot_at("b", 1.0, 2.0)])
        loop.run(30.0)
        logs.append([(t_s, list(decision.orders)) for t_s, decision in loop.log])
    assert logs[0] == logs[1]


def test_an_unknown_strategy_is_named_with_those_there_are() -> None:
    with pytest.raises(UsageError, match=r"expected one of oros, react, .* found 'raect'"):
        make_strategy("raect", OPTIONS)
