"""How a simulated robot drives along way points when nothing stands in its way, compiled: for searches over routes.

The same law as :class:`react_opt.sim.robot.SimRobot`, tick by tick, without noise, traffic and walls
(``tests/limits/test_fullmap.py`` compares the two). A search tries hundreds of thousands of routes; what counts in
the end is what the simulator itself measures.
"""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from react_opt.energy import RobotProfile, speed_at
from react_opt.geometry.inflation import clearance_px
from react_opt.kernels import kernel
from react_opt.sim.loop import SCAN_S, TICK_S
from react_opt.sim.robot import ARRIVED_M, BEND_M, SHARP_RAD

FloatArray = NDArray[np.float64]
# What blocks: clearance at pixel corners (m), side of a pixel (m).
Ground = tuple[NDArray[np.float32], float]

SCAN_TICKS = round(SCAN_S / TICK_S)
TURNS = 64
"""Angles from 0 to pi in which the loss of time in a bend is tabled."""

_OPEN = (np.full((3, 3), 1e3, dtype=np.float32), 100.0)


def law_of(profile: RobotProfile, u_m: float, v_m: float, heading_rad: float) -> FloatArray:
    """Return the start pose and the limits of a robot as :func:`ride` takes them."""
    return np.array(
        (u_m, v_m, heading_rad, profile.radius_m, profile.full_speed_clearance_m, profile.speed_min_m_s,
         profile.speed_max_m_s, profile.accel_m_s2, profile.turn_rad_s)
    )  # fmt: skip


def turn_loss_s(profile: RobotProfile) -> FloatArray:
    """Return ``(TURNS + 1,)`` how much time bends by 0 to pi cost, s: driven in the open, against straight on."""
    lost = np.zeros(TURNS + 1)
    arm = 4.0 + profile.speed_max_m_s**2 / profile.accel_m_s2
    out = np.empty((20_000, 2))
    for n in range(TURNS + 1):
        angle = n * pi / TURNS
        way = np.array([(100.0 + arm, 100.0), (100.0 + arm + arm * cos(angle), 100.0 + arm * sin(angle))])
        lost[n] = TICK_S * ride(way, 2, _OPEN, law_of(profile, 100.0, 100.0, 0.0), out)
    return np.asarray(np.maximum.accumulate(np.maximum(0.0, lost - lost[0])))


@kernel
def _wrapped(angle: float) -> float:
    while angle > pi:
        angle -= 2 * pi
    while angle <= -pi:
        angle += 2 * pi
    return angle


@kernel
def _bend_m_s(law: FloatArray, angle: float) -> float:
    return np.inf if angle == 0 else 2 * BEND_M * law[8] / (angle * angle)


@kernel
def ride(way: FloatArray, count: int, ground: Ground, law: FloatArray, places: FloatArray) -> int:
    """Drive along way points; write where the robot is at every tick, and return at how many it is somewhere new.

    Parameters
    ----------
    way, count
        ``(k, 2)`` way points, grid metres, and how many of them count.
    ground
        What blocks.
    law
        :func:`law_of` the robot.
    places
        ``(ticks, 2)`` room for the places, grid metres; the ride ends with it at the latest.

    Returns
    -------
    int
        From this tick on it stands at the last place.
    """
    clearance_m, unit = ground
    u, v, heading, accel, turning = law[0], law[1], law[2], law[7] * TICK_S, law[8] * TICK_S
    at = 0
    while at < count and hypot(way[at, 0] - u, way[at, 1] - v) < ARRIVED_M:
        at += 1
    limits = np.zeros(count)
    limit = 0.0
    for n in range(count - 2, at - 1, -1):
        bu, bv = (way[n - 1, 0], way[n - 1, 1]) if n > at else (u, v)
        leg = hypot(way[n + 1, 0] - way[n, 0], way[n + 1, 1] - way[n, 1])
        bend = _wrapped(
            atan2(way[n + 1, 1] - way[n, 1], way[n + 1, 0] - way[n, 0]) - atan2(way[n, 1] - bv, way[n, 0] - bu)
        )
        limit = min(sqrt(limit * limit + 2 * law[7] * leg), _bend_m_s(law, bend))
        limits[n] = limit
    speed, tick = 0.0, 0
    while tick < places.shape[0]:
        places[tick, 0], places[tick, 1] = u, v
        tick += 1
        cap = speed_at(clearance_px(clearance_m, u / unit, v / unit), law[3], law[4], law[5], law[6])
        while at < count:
            away = hypot(way[at, 0] - u, way[at, 1] - v)
            passed = away < ARRIVED_M
            if not passed and at < count - 1 and away <= 0.3:
                du, dv = way[at + 1, 0] - way[at, 0], way[at + 1, 1] - way[at, 1]
                passed = (u - way[at, 0]) * du + (v - way[at, 1]) * dv > 0
            if not passed:
                break
            at += 1
        if at == count:
            if speed == 0.0:
                if tick < places.shape[0]:
                    places[tick, 0], places[tick, 1] = u, v  # for who looks at every other tick
                return tick - 1
            speed = max(0.0, speed - accel)
        else:
            away = hypot(way[at, 0] - u, way[at, 1] - v)
            error = _wrapped(atan2(way[at, 1] - v, way[at, 0] - u) - heading)
            heading = _wrapped(heading + min(max(error, -turning), turning))
            wanted = 0.0
            if abs(error) <= SHARP_RAD:
                brake = sqrt(limits[at] ** 2 + 2 * 0.8 * law[7] * away)
                wanted = min(cap, brake, _bend_m_s(law, error))
            speed = min(max(wanted, speed - accel, 0.0), speed + accel)
        u, v = u + speed * TICK_S * cos(heading), v + speed * TICK_S * sin(heading)
    return tick
