"""Smoothed ways: the time of a drive against the simulator's, and what a way may never become."""

from __future__ import annotations

from itertools import pairwise
from math import hypot, pi

import numpy as np
import pytest

from react_opt.energy import RobotProfile
from react_opt.limits import ride as simulated
from react_opt.orchestrator.smooth import drive_s, law_of, smoothed

JACKAL = RobotProfile(
    length_m=0.508, width_m=0.43, speed_max_m_s=0.89, speed_min_m_s=0.3, full_speed_clearance_m=0.6, accel_m_s2=1.0,
    turn_rad_s=1.5, idle_w=2.0, motion_w=7.0, turn_w=9.0, sensing_w=16.9, battery_j=8000.0, capacity_j=8000.0,
    reserve_j=0.0, lidar_range_m=8.0, lidar_rays=360,
)  # fmt: skip
OPEN = (np.full((300, 300), 5.0), 0.1)
STANDING = law_of(JACKAL, moving=False)
CORNERS = np.array([(3.0, 3.0), (8.0, 3.0), (8.0, 8.0), (14.0, 9.0), (14.0, 16.0)])


def seconds(way: np.ndarray, ground: tuple[np.ndarray, float] = OPEN, heading: float = 0.0) -> float:  # type: ignore[type-arg]
    return drive_s(way, len(way), heading, ground, STANDING, np.zeros((3, 1200)))


def driven_s(way: np.ndarray) -> float:  # type: ignore[type-arg]
    """Return what the law of the simulated robots takes in the open."""
    room = (np.full((302, 302), 5.0, dtype=np.float32), 0.1)
    law = simulated.law_of(JACKAL, float(way[0, 0]), float(way[0, 1]), 0.0)
    return simulated.TICK_S * simulated.ride(way[1:].copy(), len(way) - 1, room, law, np.empty((4000, 2)))


def walled() -> tuple[np.ndarray, float]:  # type: ignore[type-arg]
    """Return clearances around the inner corner of a wall: the square from (4, 4) m on is solid."""
    v, u = np.indices((160, 160)) * 0.1 + 0.05
    return np.hypot(np.maximum(4.0 - u, 0.0), np.maximum(4.0 - v, 0.0)), 0.1


def test_a_straight_drive_takes_what_acceleration_full_speed_and_braking_take() -> None:
    """10 m from rest to rest: up at 1 m/s^2, down at 0.8 m/s^2, 0.89 m/s in between."""
    up, down = 0.89**2 / 2, 0.89**2 / 1.6
    expected = 0.89 + 0.89 / 0.8 + (10 - up - down) / 0.89
    assert seconds(np.array([(3.0, 3.0), (13.0, 3.0)])) == pytest.approx(expected, rel=0.02)


def test_drives_take_about_as_long_as_the_simulator_says() -> None:
    assert seconds(CORNERS) == pytest.approx(driven_s(CORNERS), rel=0.15)
    gentle = smoothed(CORNERS, 0.0, OPEN, STANDING, np.zeros(len(CORNERS)))
    assert seconds(gentle) == pytest.approx(driven_s(gentle), rel=0.15)


def test_bends_are_spread_out_where_there_is_room() -> None:
    """The simulated robot gains as well, not only the estimate; places that are fixed stay on the way."""
    fixed = np.ones(len(CORNERS))
    way = smoothed(CORNERS, 0.0, OPEN, STANDING, fixed)
    for corner in CORNERS:
        assert np.hypot(*(way - corner).T).min() == 0.0
    free = smoothed(CORNERS, 0.0, OPEN, STANDING, np.zeros(len(CORNERS)))
    assert np.array_equal(free[[0, -1]], CORNERS[[0, -1]])
    assert seconds(free) < seconds(way) <= seconds(CORNERS)
    assert driven_s(free) < 0.85 * driven_s(CORNERS)


@pytest.mark.parametrize("seed", range(20))
def test_no_way_gets_slower_and_the_same_way_comes_out_twice(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ground = (rng.uniform(0.2, 1.5, (100, 100)), 0.1)
    way = rng.uniform(1.0, 9.0, (int(rng.integers(2, 9)), 2))
    heading = float(rng.uniform(-pi, pi))
    one = smoothed(way, heading, ground, STANDING, np.zeros(len(way)))
    assert seconds(one, ground, heading) <= seconds(way, ground, heading) + 1e-9
    assert np.array_equal(one, smoothed(way, heading, ground, STANDING, np.zeros(len(way))))


def test_corners_of_walls_are_not_cut() -> None:
    """Around a solid corner: the straight line between the ends would lead through it."""
    ground = walled()
    way = smoothed([(2.0, 10.0), (2.0, 2.0), (10.0, 2.0)], -pi / 2, ground, STANDING, np.zeros(3))
    assert len(way) > 2
    for (u0, v0), (u1, v1) in pairwise(way):
        for n in range(101):
            u, v = u0 + n / 100 * (u1 - u0), v0 + n / 100 * (v1 - v0)
            gap = hypot(max(4.0 - u, 0.0), max(4.0 - v, 0.0))
            assert gap >= JACKAL.radius_m - 0.1  # blocks are 0.1 m wide


def test_of_long_ways_the_rest_stays_as_it_is() -> None:
    way = np.stack((np.linspace(1.0, 20.0, 60), np.full(60, 5.0)), axis=1)
    smooth = smoothed(way, 0.0, OPEN, STANDING, np.zeros(60))
    assert np.array_equal(smooth[-37:], way[-37:])
    assert np.array_equal(smoothed(way[:1], 0.0, OPEN, STANDING, np.zeros(1)), way[:1])
