"""The checker of traces: a good trace passes, and each rule that is broken is named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from react_opt.certify_trace import _Replay, check_trace
from react_opt.instance import Mission, Noise
from react_opt.sim.loop import Simulation
from react_opt.trace import NEVER, Trace, pixel_data, track_data
from tests.sim.missions import JACKAL, TWO_ROOMS, mission

MISSION: Mission = mission([(1.5, 1.5), (1.5, 4.0)], noise=Noise(speed=0.05, waiting_s=0.3, power=0.02), horizon_s=30.0)


@pytest.fixture(scope="module")
def good() -> Trace:
    return Simulation(MISSION, TWO_ROOMS).run()


def rules(trace: Trace, of: Mission = MISSION, cells: Any = None) -> set[str]:
    return {violation.rule for violation in check_trace(of, trace, cells).violations}


def with_frames(trace: Trace, change: Any) -> Trace:
    """Return a trace whose frames a function has changed (as plain data)."""
    data = trace.model_dump(mode="json", by_alias=True)
    change(data["frames"])
    return Trace.model_validate(data)


def with_track(trace: Trace, change: Any) -> Trace:
    """Return a trace in which the first robot's track is changed."""
    rows = trace.tracks[0].array().copy()
    change(rows)
    track = trace.tracks[0].model_copy(update={"data": track_data(rows)})
    return trace.model_copy(update={"tracks": (track, *trace.tracks[1:])})


def with_known(trace: Trace, change: Any) -> Trace:
    known = trace.known.array("<u2").copy()
    change(known)
    return trace.model_copy(update={"known": trace.known.model_copy(update={"data": pixel_data(known)})})


def test_a_good_trace_breaks_no_rule(good: Trace) -> None:
    certificate = check_trace(MISSION, good, TWO_ROOMS.cells)
    assert certificate.violations == ()
    assert certificate.objective == pytest.approx(good.frames[-1].coverage, abs=2e-6)


def test_another_mission_or_map_is_named(good: Trace) -> None:
    assert rules(good, MISSION.model_copy(update={"delta": 0.5})) == {"mission"}
    other = TWO_ROOMS.cells.copy()
    other[40, 40] = 1
    assert rules(good, cells=other) == {"truth"}


def test_a_battery_that_rises_without_a_charger_is_named(good: Trace) -> None:
    def change(frames: Any) -> None:
        frames[10]["robots"][0]["battery_j"] += 40.0

    assert "battery" in rules(with_frames(good, change))


def test_sensing_that_costs_nothing_is_named(good: Trace) -> None:
    def change(frames: Any) -> None:
        saved = 0.0
        for frame in frames[1:]:
            saved += 16.9
            frame["robots"][0]["battery_j"] += saved

    assert "battery" in rules(with_frames(good, change))


def test_creeping_back_between_two_instants_is_paid_for_beside_walls_alone() -> None:
    exact = mission([(0.5, 1.5)], horizon_s=15.0)
    trace = Simulation(exact, TWO_ROOMS).run()
    replay = _Replay(trace)
    most_j = [replay._spent(0, float(t), t + 1.0)[1] for t in range(14)]
    replay.cells = np.zeros_like(TWO_ROOMS.cells)  # the same poses in a desert
    open_j = [replay._spent(0, float(t), t + 1.0)[1] for t in range(14)]
    blocked = np.argwhere(TWO_ROOMS.cells != 0)[:, ::-1] * 0.1 + 0.05
    gap_m = np.array([np.hypot(*(blocked - pose[:2]).T).min() for pose in trace.tracks[0].array()])
    step_j = 0.1 * 0.25 * JACKAL.motion_w / JACKAL.speed_max_m_s  # 0.1 m/s to and fro for half a step each
    assert gap_m[0] < 0.5  # it starts beside a wall
    assert step_j - 1e-9 <= most_j[0] - open_j[0] <= 4 * step_j + 1e-9
    amid = [t for t in range(14) if (gap_m[4 * t : 4 * t + 4] > 0.8).all()]
    assert amid
    assert [most_j[t] for t in amid] == [open_j[t] for t in amid]


def test_turning_to_and_fro_within_one_step_of_a_second_is_paid_for() -> None:
    """A robot on the spot turns by whole steps and is then told to turn back: its track shows less than it turned."""
    trace = Simulation(mission([(2.5, 2.5)], horizon_s=5.0), TWO_ROOMS).run()
    replay = _Replay(trace)
    track = np.zeros((5, 4))
    track[:, :2] = trace.tracks[0].array()[0, :2]
    replay.tracks = [track]
    still_j = replay._spent(0, 0.0, 1.0)[1]
    step_rad = 0.25 * JACKAL.turn_rad_s
    track[:, 2] = step_rad * np.array([0, 1, 2, 3, 3])
    assert replay._spent(0, 0.0, 1.0)[1] - still_j == pytest.approx(4 * 0.25 * JACKAL.turn_w)
    track[:, 2] = step_rad * np.array([0, 1, 2, 3, 4])
    assert replay._spent(0, 0.0, 1.0)[1] - still_j == pytest.approx(4 * 0.25 * JACKAL.turn_w)  # no step is left for it


def test_a_coverage_that_is_not_so_is_named(good: Trace) -> None:
    def change(frames: Any) -> None:
        frames[-1]["coverage"] -= 0.01

    assert rules(with_frames(good, change)) == {"coverage"}


def test_a_pixel_that_nobody_scanned_and_one_forgotten_are_named(good: Trace) -> None:
    unseen = np.argwhere(good.known.array("<u2") == NEVER)[0]
    seen = np.argwhere(good.known.array("<u2") == 0)[0]

    def claim(known: Any) -> None:
        known[tuple(unseen)] = 3

    def forget(known: Any) -> None:
        known[tuple(seen)] = NEVER

    assert "known" in rules(with_known(good, claim))
    assert "known" in rules(with_known(good, forget))


def test_a_jump_a_wall_and_a_collision_are_named(good: Trace) -> None:
    def jump(rows: Any) -> None:
        rows[20:, 0] += 1.0

    def wall(rows: Any) -> None:
        rows[:, 0] = 6.0
        rows[:, 1] = 1.0

    assert "speed" in rules(with_track(good, jump))
    assert "wall" in rules(with_track(good, wall))
    other = good.tracks[1].array()

    def collide(rows: Any) -> None:
        rows[:] = other
        rows[:, 0] += 0.1

    assert "collision" in rules(with_track(good, collide))


def test_a_robot_that_should_be_dead_is_named(good: Trace) -> None:
    failing = {"failures": [{"robot": "r1", "t_s": 5.0}]}
    told = good.model_copy(update={"mission": mission_with(failing)})
    assert "death" in rules(told, mission_with(failing))


def mission_with(changes: dict[str, Any]) -> Mission:
    return Mission.model_validate({**MISSION.model_dump(), **changes})
