"""The bound beside a mission's coverage curve: above every mission, and as low as a corridor demands."""

from __future__ import annotations

import numpy as np
import pytest

from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import Noise
from react_opt.limits.curve import coverage_bound, share_at
from react_opt.sim.loop import Simulation
from react_opt.trace import Trace
from tests.sim.missions import TWO_ROOMS, building, mission

CORRIDOR = building([], (40.0, 1.6))


def flown(truth: OccupancyMap, starts: list[tuple[float, float]], **changes: object) -> Trace:
    return Simulation(mission(starts, **changes), truth).run()


@pytest.mark.parametrize("strategy", ["nearest", "react_plus", "oros"])
@pytest.mark.parametrize("noise", [Noise(), Noise(speed=0.2)])
def test_no_mission_sees_more(strategy: str, noise: Noise) -> None:
    trace = flown(TWO_ROOMS, [(2.0, 2.0), (2.0, 6.0)], strategy=strategy, noise=noise)
    bound = coverage_bound(trace)
    assert bound is not None
    t = np.array([frame.t_s for frame in trace.frames])
    most = share_at(bound, t)
    assert (most >= np.array([frame.coverage for frame in trace.frames]) - 1e-6).all()
    assert most[0] < 0.9  # the other room is hidden at first
    assert share_at(bound, np.array([1e9]))[0] == pytest.approx(1.0)


def test_in_a_corridor_nothing_beyond_the_way_and_the_range_is_seen() -> None:
    trace = flown(CORRIDOR, [(1.0, 0.8)], horizon_s=12.0)
    bound = coverage_bound(trace)
    assert bound is not None
    t = np.array([0.0, 4.0, 8.0, 20.0])
    # it drives 0.89 m/s at most and sees 5 m; the corridor's inside begins at 0.1 m and is 39.8 m long
    exact = (0.9 + 5.0 + 0.89 * t) / 39.8
    assert share_at(bound, t) == pytest.approx(exact, abs=0.02)


def test_a_prior_map_may_show_anything_at_once() -> None:
    trace = flown(TWO_ROOMS, [(2.0, 2.0)], horizon_s=6.0)
    told = trace.model_copy(update={"mission": trace.mission.model_copy(update={"prior_map": "sketch.yaml"})})
    assert coverage_bound(told) is None
