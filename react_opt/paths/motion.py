"""Driving along a polyline: its length, time, energy and clearance by the battery law.

Time is the integral of 1 / speed. A segment is cut where it crosses from one pixel into the next; on each piece
the speed at its middle counts (midpoint rule), with the clearance interpolated bilinearly between exact values
at the pixel's corners. That is exact along straight walls and wherever the speed is constant; elsewhere the
error falls with the square of the pixel. At way points the robot turns on the spot; at the start it already
looks ahead. Speed changes at once. All measures are the same in both directions.
"""

from __future__ import annotations

from math import acos, floor, hypot, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.energy import RobotProfile, speed_at
from react_opt.errors import ReactError
from react_opt.geometry.inflation import FreeSpace, clearance_px
from react_opt.kernels import kernel
from react_opt.paths.protocol import FloatArray, Path

# What the kernels need to time a drive: clearance at pixel corners (m), slow pixels (1), and the law: pixel side
# (m), clearance at contact and of full speed (m), smallest and largest speed (m/s), share left in slow pixels.
Field = tuple[NDArray[np.float32], NDArray[np.uint8], FloatArray]


def terrain(space: FreeSpace, profile: RobotProfile) -> Field:
    """Return what the kernels of this module need of a map and a robot.

    Contact is at the radius of the map's own footprint: where the robot's clearance is smallest.
    """
    law = (
        space.resolution_m,
        space.footprint.radius_m,
        profile.full_speed_clearance_m,
        profile.speed_min_m_s,
        profile.speed_max_m_s,
        space.unknown_speed_factor,
    )
    return space.clearance_m, space.slow, np.array(law)


def drive(space: FreeSpace, profile: RobotProfile, points_m: ArrayLike, pixels: FloatArray | None = None) -> Path:
    """Return a path along way points with its measures, after testing it against the footprint.

    Parameters
    ----------
    space
        Where the footprint may be.
    profile
        The robot.
    points_m
        ``(k, 2)`` way points, m.
    pixels
        The same in pixel coordinates, where they are known more exactly: far from a map's origin the way through
        metres moves them by rounding, and a leg along a line of the grid is then cut differently.

    Raises
    ------
    ReactError
        Where the footprint would collide: no path leaves this package untested.
    """
    points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
    if not space.path_free(points):
        raise ReactError("a path failed its check against the footprint")
    way = space.to_pixels(points) if pixels is None else pixels
    length, time, clearance, turned = polyline_px(terrain(space, profile), way)
    total, energy = totals(profile, length, time, turned)
    return Path(points, float(length), float(total), float(energy), float(clearance))


def totals(
    profile: RobotProfile, length_m: ArrayLike, drive_s: ArrayLike, turned_rad: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return time (s) and energy (J) of driving lengths in times and turning by angles, of equal shapes."""
    time = np.asarray(drive_s) + profile.turn_time_s(turned_rad)
    return time, profile.drive_energy_j(length_m, drive_s) + profile.turn_energy_j(turned_rad)


@kernel
def segment_px(
    field: Field,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
) -> float:
    """Return the driving time along one segment, s.

    Parameters
    ----------
    field
        The map and the robot (:func:`terrain`).
    x0, y0, x1, y1
        Pixel coordinates (column, row) of the ends, on the map.
    """
    if x0 > x1 or (x0 == x1 and y0 > y1):  # one canonical direction: the same sums both ways
        x0, y0, x1, y1 = x1, y1, x0, y0
    clearance_m, slow, law = field
    rows, cols = slow.shape
    dx, dy = x1 - x0, y1 - y0
    length_m = hypot(dx, dy) * law[0]
    time, t = 0.0, 0.0
    rising = dy > 0
    next_x = floor(x0) + 1
    next_y = floor(y0) + 1 if rising else -floor(-y0) - 1
    while t < 1.0:
        tx = (next_x - x0) / dx if dx > 0 else 2.0
        ty = (next_y - y0) / dy if dy != 0 else 2.0
        end = min(tx, ty, 1.0)
        if tx <= end:
            next_x += 1
        if ty <= end:
            next_y += 1 if rising else -1
        if end <= t:
            continue
        middle = (t + end) / 2
        x, y = x0 + middle * dx, y0 + middle * dy
        speed = speed_at(clearance_px(clearance_m, x, y), law[1], law[2], law[3], law[4])
        if slow[min(int(y), rows - 1), min(int(x), cols - 1)]:
            speed *= law[5]
        time += (end - t) * length_m / speed
        t = end
    return time


@kernel
def turn_px(x0: float, y0: float, x1: float, y1: float, x2: float, y2: float) -> float:
    """Return the angle in [0, pi] turned at the middle one of three way points, 0 where two coincide."""
    ax, ay, bx, by = x1 - x0, y1 - y0, x2 - x1, y2 - y1
    norm = sqrt((ax * ax + ay * ay) * (bx * bx + by * by))
    if norm == 0.0:
        return 0.0
    return acos(max(-1.0, min(1.0, (ax * bx + ay * by) / norm)))


@kernel
def polyline_px(field: Field, pixels: FloatArray) -> tuple[float, float, float, float]:
    """Return length (m), driving time (s), smallest clearance (m) and turned angle (rad) of a polyline.

    The clearance is sampled every quarter of a pixel and at the way points.
    """
    clearance_m, _, law = field
    length, time, turned = 0.0, 0.0, 0.0
    lowest = np.inf
    if pixels.shape[0] == 1:
        lowest = clearance_px(clearance_m, pixels[0, 0], pixels[0, 1])
    for n in range(1, pixels.shape[0]):
        x0, y0, x1, y1 = pixels[n - 1, 0], pixels[n - 1, 1], pixels[n, 0], pixels[n, 1]
        length += hypot(x1 - x0, y1 - y0) * law[0]
        time += segment_px(field, x0, y0, x1, y1)
        if n > 1:
            turned += turn_px(pixels[n - 2, 0], pixels[n - 2, 1], x0, y0, x1, y1)
        pieces = int(4.0 * hypot(x1 - x0, y1 - y0)) + 1
        for piece in range(pieces + 1):
            share = piece / pieces
            lowest = min(lowest, clearance_px(clearance_m, x0 + share * (x1 - x0), y0 + share * (y1 - y0)))
    return length, time, lowest, turned
