"""Ways that are quick to drive: bends spread out, so that a robot need not brake for them.

A way over a grid leads from corner to corner. A robot brakes before each corner, since it turns only so fast, and
turns on the spot where the corner is sharp: on ways that change every few seconds that is a sixth of the time. Here
way points are moved, put in and left out by a local search as long as the drive gets quicker. What is minimised is
the time of a drive with limited acceleration, with the speed law of clearances (:mod:`react_opt.energy`), and with
speeds in bends that keep the robot near its way; the way keeps clear of what is known to be solid.
"""

from __future__ import annotations

from math import atan2, cos, floor, hypot, pi, sin, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.energy import RobotProfile, speed_at
from react_opt.kernels import kernel

FloatArray = NDArray[np.float64]
Flags = NDArray[np.bool_]

OFF_M = 0.05
"""A robot in a bend may leave its way by so much."""
SHARP_RAD = 0.8
"""For a sharper bend it stops and turns on the spot."""
BRAKING = 0.8
"""It brakes with this share of its acceleration."""
MOST_POINTS = 48
TRIES = 600
MOVES_M = 0.7
STEP_M = 0.1
CLOSER_S_PER_M = 20.0
"""What a metre of way that leads a metre too near to something solid counts for, s."""

_STEPS = 1200  # of a drive, beyond which a way is not looked at

# Clearance (m) of the centres of square blocks, side of a block (m).
Ground = tuple[FloatArray, float]


def law_of(profile: RobotProfile, *, moving: bool) -> FloatArray:
    """Return a robot's limits as :func:`drive_s` takes them."""
    return np.array(
        (profile.radius_m, profile.full_speed_clearance_m, profile.speed_min_m_s, profile.speed_max_m_s,
         profile.accel_m_s2, profile.turn_rad_s, profile.speed_max_m_s if moving else 0.0)
    )  # fmt: skip


def smoothed(way_m: ArrayLike, heading_rad: float, ground: Ground, law: FloatArray, fixed: ArrayLike) -> FloatArray:
    """Return a way that is no slower to drive, with the same ends; of a long one the rest stays as it is.

    Parameters
    ----------
    way_m
        ``(n, 2)`` way points (column, row), m from the corner of the grid of clearances.
    heading_rad
        Where the robot looks, in the grid's axes.
    ground, law
        What the way must keep clear of, and :func:`law_of` the robot.
    fixed
        Way points that stay where they are, besides the ends.
    """
    way = np.asarray(way_m, dtype=np.float64)
    head, rest = way[: MOST_POINTS // 2], way[MOST_POINTS // 2 :]
    if len(head) < 2:
        return way
    points, stays = np.zeros((MOST_POINTS, 2)), np.zeros(MOST_POINTS, dtype=np.bool_)
    points[: len(head)] = head
    stays[: len(head)] = np.asarray(fixed, dtype=np.bool_)[: len(head)]
    stays[0] = stays[len(head) - 1] = True
    count = improve(points, stays, len(head), heading_rad, ground, law, TRIES)
    return np.concatenate((points[:count], rest))


@kernel
def _turned(one: float, other: float) -> float:
    angle = abs(one - other) % (2 * pi)
    return float(min(angle, 2 * pi - angle))


@kernel
def drive_s(points: FloatArray, count: int, heading: float, ground: Ground, law: FloatArray, room: FloatArray) -> float:
    """Return how long a drive along way points takes, s, and what it costs to lead too near to solid things.

    Parameters
    ----------
    points, count
        Way points, m from the corner of the grid of clearances, and how many count.
    heading
        Where the robot looks at the start, rad.
    ground, law
        Clearances, and :func:`law_of` the robot.
    room
        ``(3, n)`` scratch space: lengths of steps, and speeds at their ends.
    """
    clear, side = ground
    rows, cols = clear.shape
    contact, full, slowest, fastest, accel, turning = law[0], law[1], law[2], law[3], law[4], law[5]
    total, near = 0.0, 0.0
    steps = 0
    speed_in = law[6]
    for n in range(1, count):
        du, dv = points[n, 0] - points[n - 1, 0], points[n, 1] - points[n - 1, 1]
        length = hypot(du, dv)
        if length < 1e-6:
            continue
        ahead = atan2(dv, du)
        bend = _turned(ahead, heading)
        heading = ahead
        if bend > SHARP_RAD:
            cap = 0.0
            total += bend / turning
        elif bend > 1e-3:
            cap = min(fastest, 2.0 * OFF_M * turning / (bend * bend))
        else:
            cap = fastest
        if steps == 0:
            total += max(0.0, speed_in - cap) / accel  # it brakes first
            speed_in = min(speed_in, cap)
        else:
            room[1, steps - 1] = min(room[1, steps - 1], cap)
        pieces = int(length / STEP_M) + 1
        if steps + pieces > room.shape[1]:
            return np.inf
        for p in range(pieces):
            share = (p + 0.5) / pieces
            r = floor((points[n - 1, 1] + share * dv) / side)
            c = floor((points[n - 1, 0] + share * du) / side)
            free = 0.0
            if 0 <= r < rows and 0 <= c < cols:
                free = clear[r, c]
            if free < contact:
                near += (contact - free) * length / pieces
            room[0, steps] = length / pieces
            room[1, steps] = speed_at(free, contact, full, slowest, fastest)
            steps += 1
    if steps == 0:
        return total
    room[1, steps - 1] = 0.0
    for k in range(steps - 2, -1, -1):
        before = room[1, k + 1]
        room[1, k] = min(room[1, k], sqrt(before * before + 2.0 * BRAKING * accel * room[0, k + 1]))
    speed = speed_in
    for k in range(steps):
        after = min(room[1, k], sqrt(speed * speed + 2.0 * accel * room[0, k]))
        total += 2.0 * room[0, k] / max(speed + after, 0.1)
        speed = after
    return total + CLOSER_S_PER_M * near


@kernel
def _round(points: FloatArray, stays: Flags, count: int, k: int, cut: float) -> int:
    """Replace a bend by gentler ones, beginning ``cut`` before it; return how many way points there are then."""
    u0, v0 = points[k - 1, 0] - points[k, 0], points[k - 1, 1] - points[k, 1]
    u1, v1 = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
    one, two = hypot(u0, v0), hypot(u1, v1)
    if one < 1e-6 or two < 1e-6:
        return count
    cut = min(cut, 0.5 * one, 0.5 * two)
    begin, end = atan2(-v0, -u0), atan2(v1, u1)
    bend = (end - begin + pi) % (2 * pi) - pi
    many = int(abs(bend) / 0.39) + 1
    if many < 2 or count + many > points.shape[0] or abs(bend) > 2.8:
        return count
    radius = cut / np.tan(0.5 * abs(bend))
    edge = 2.0 * radius * np.tan(0.5 * abs(bend) / many)
    for n in range(count - 1, k, -1):
        points[n + many - 1], stays[n + many - 1] = points[n], stays[n]
    u, v = points[k, 0] + u0 / one * cut, points[k, 1] + v0 / one * cut
    heading = begin
    for n in range(many):
        along = 0.5 * edge if n == 0 else edge
        u, v = u + along * cos(heading), v + along * sin(heading)
        points[k + n, 0], points[k + n, 1], stays[k + n] = u, v, False
        heading += bend / many
    return count + many - 1


@kernel
def improve(
    points: FloatArray, stays: Flags, count: int, heading: float, ground: Ground, law: FloatArray, tries: int
) -> int:
    """Make a way quicker, in place; return how many way points it has then.

    Deterministic: what is tried is drawn by a generator of its own.

    Parameters
    ----------
    points, stays, count
        ``(MOST_POINTS, 2)`` way points, those that must not move, and how many count.
    heading, ground, law
        As of :func:`drive_s`.
    tries
        Changes to try.
    """
    room = np.zeros((3, _STEPS))
    best = drive_s(points, count, heading, ground, law, room)
    if not np.isfinite(best):
        return count
    trial, still = points.copy(), stays.copy()
    dice = 24691
    for n in range(tries):
        trial[:count], still[:count] = points[:count], stays[:count]
        now, moved = count, False
        dice = (dice * 1103515245 + 12345) % 2147483648
        kind = (dice >> 15) % 100
        dice = (dice * 1103515245 + 12345) % 2147483648
        k = 1 + (dice >> 15) % (count - 1)
        dice = (dice * 1103515245 + 12345) % 2147483648
        one = (dice >> 15) / 65536.0
        dice = (dice * 1103515245 + 12345) % 2147483648
        two = (dice >> 15) / 65536.0
        reach = MOVES_M * (1.0 - 0.8 * n / tries) * sqrt(one)
        if kind < 30:
            if k < count - 1 and not still[k]:
                now = _round(trial, still, count, k, 0.15 + 0.85 * two)
                moved = now != count
        elif kind < 70:
            if not still[k]:
                trial[k, 0] += reach * cos(2 * pi * two)
                trial[k, 1] += reach * sin(2 * pi * two)
                moved = True
        elif kind < 85:
            if not still[k]:
                for m in range(k, count - 1):
                    trial[m], still[m] = trial[m + 1], still[m + 1]
                now, moved = count - 1, True
        elif count < trial.shape[0]:
            for m in range(count, k, -1):
                trial[m], still[m] = trial[m - 1], still[m - 1]
            trial[k] = trial[k - 1] + (0.2 + 0.6 * one) * (trial[k + 1] - trial[k - 1])
            trial[k, 0] += 0.5 * reach * cos(2 * pi * two)
            trial[k, 1] += 0.5 * reach * sin(2 * pi * two)
            still[k] = False
            now, moved = count + 1, True
        if not moved:
            continue  # there is nothing new to look at
        cost = drive_s(trial, now, heading, ground, law, room)
        if cost < best - 1e-4:
            best, count = cost, now
            points[:now], stays[:now] = trial[:now], still[:now]
    return count
