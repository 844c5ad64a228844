"""The bound beside a mission's coverage curve: above every mission, and as low as a corridor demands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from react_opt.errors import UsageError
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import Noise
from react_opt.jsonio import save
from react_opt.limits.curve import coverage_bound, share_at
from react_opt.report.show import show
from react_opt.sim.loop import Simulation
from react_opt.trace import Trace, pixel_data
from tests.sim.missions import TWO_ROOMS, building, mission

CORRIDOR = building([], (40.0, 1.6))


def flown(truth: OccupancyMap, starts: list[tuple[float, float]], **changes: object) -> Trace:
    return Simulation(mission(starts, **changes), truth).run()


@pytest.mark.parametrize("strategy", ["nearest", "react_plus", "oros"])
@pytest.mark.parametrize("noise", [Noise(), Noise(speed=0.2)])
def test_no_mission_sees_more(strategy: str, noise: Noise) -> None:
    trace = flown(TWO_ROOMS, [(2.0, 2.0), (2.0, 6.0)], strategy=strategy, noise=noise)
    bound = coverage_bound(trace)
    t = np.array([frame.t_s for frame in trace.frames])
    most = share_at(bound, t)
    assert (most >= np.array([frame.coverage for frame in trace.frames]) - 1e-6).all()
    assert most[0] < 0.9  # the other room is hidden at first
    assert share_at(bound, np.array([1e9]))[0] == pytest.approx(1.0)


def test_in_a_corridor_nothing_beyond_the_way_and_the_range_is_seen() -> None:
    trace = flown(CORRIDOR, [(1.0, 0.8)], horizon_s=12.0)
    bound = coverage_bound(trace)
    t = np.array([0.0, 4.0, 8.0, 20.0])
    # it drives 0.89 m/s at most and sees 5 m; the corridor's inside begins at 0.1 m and is 39.8 m long
    exact = (0.9 + 5.0 + 0.89 * t) / 39.8
    assert share_at(bound, t) == pytest.approx(exact, abs=0.02)


def test_a_prior_map_may_show_anything_at_once() -> None:
    trace = flown(TWO_ROOMS, [(2.0, 2.0)], horizon_s=6.0)
    told = trace.model_copy(update={"mission": trace.mission.model_copy(update={"prior_map": "sketch.yaml"})})
    with pytest.raises(UsageError, match="prior map"):
        coverage_bound(told)


# --- traces of other programs ---


def foreign(trace: Trace, coverable: Any = None, coverage: Any = None, **changes: object) -> Trace:
    """Return a trace that another program might have written: with its own flags and its own coverage."""
    if coverable is not None:
        codes = (trace.truth.array("u1") & 3 | 4 * coverable).astype(np.uint8)
        changes["truth"] = trace.truth.model_copy(update={"data": pixel_data(codes)})
    if coverage is not None:
        frames = tuple(frame.model_copy(update={"coverage": coverage(frame)}) for frame in trace.frames)
        changes["frames"] = frames
    return trace.model_copy(update=changes)


def test_the_share_is_of_what_the_trace_itself_counts_as_coverable() -> None:
    trace = flown(CORRIDOR, [(1.0, 0.8)], horizon_s=6.0)
    codes = trace.truth.array("u1")
    half = (codes & 4 != 0) & (np.arange(codes.shape[1]) * trace.truth.resolution_m < 20.0)
    t = np.array([0.0, 4.0, 8.0, 20.0])
    bound = coverage_bound(foreign(trace, half, lambda frame: 0.0))
    # as in the corridor above, but of the 19.9 m from 0.1 m to 20 m alone: all of it can be seen after 16 s
    assert share_at(bound, t) == pytest.approx(np.minimum(1.0, (0.9 + 5.0 + 0.89 * t) / 19.9), abs=0.02)


def test_a_trace_above_its_own_bound_has_none() -> None:
    trace = flown(CORRIDOR, [(1.0, 0.8)], horizon_s=6.0)
    most = coverage_bound(trace)
    at_it = foreign(trace, coverage=lambda frame: float(share_at(most, np.array([frame.t_s]))[0]))
    coverage_bound(at_it)
    above = foreign(trace, coverage=lambda frame: float(share_at(most, np.array([frame.t_s]))[0]) + 2e-6)
    with pytest.raises(UsageError, match=r"at 0 s.*faster or see farther than their profiles say"):
        coverage_bound(above)


def test_no_bound_without_coverable_pixels_on_huge_maps_or_for_unnamed_robots() -> None:
    trace = flown(TWO_ROOMS, [(2.0, 2.0)], horizon_s=6.0)
    with pytest.raises(UsageError, match="no pixel"):
        coverage_bound(foreign(trace, np.zeros((trace.truth.rows, trace.truth.cols), dtype=np.uint8)))
    robots = trace.frames[0].robots
    guest = trace.frames[0].model_copy(update={"robots": (*robots, robots[0].model_copy(update={"id": "guest"}))})
    with pytest.raises(UsageError, match="does not name the robot 'guest'"):
        coverage_bound(foreign(trace, frames=(guest,)))
    huge = trace.truth.model_copy(update={"rows": 1000, "cols": 1501})  # its pixels are not even unpacked
    with pytest.raises(UsageError, match="1,501,000 pixels"):
        coverage_bound(foreign(trace, truth=huge))


def test_robots_of_another_building_are_told_where_this_one_lies() -> None:
    trace = flown(TWO_ROOMS, [(2.0, 2.0)], horizon_s=6.0)
    away = trace.mission.robots[0].model_copy(update={"x_m": 99.0})
    elsewhere = trace.mission.model_copy(update={"robots": (away,)})
    with pytest.raises(UsageError, match=r"its start, \(99, 2\) m: it is off the map, which lies between"):
        coverage_bound(foreign(trace, mission=elsewhere))


def test_show_draws_no_line_above_which_the_trace_lies_and_says_so(tmp_path: Path) -> None:
    trace = foreign(flown(CORRIDOR, [(1.0, 0.8)], horizon_s=6.0), coverage=lambda frame: 1.0)
    save(trace, tmp_path / "trace.json")
    notes = show([tmp_path / "trace.json"], tmp_path / "with.html")
    assert len(notes) == 1
    assert "no bound on the coverage: the trace tells of 100.00 % known at 0 s" in notes[0]
    show([tmp_path / "trace.json"], tmp_path / "without.html", bound=False)
    assert (tmp_path / "with.html").read_bytes() == (tmp_path / "without.html").read_bytes()
