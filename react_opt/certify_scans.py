"""Scanning again what a trace says was scanned: the checker's own LiDAR, without compiled code.

A ray goes from pixel to pixel in the order in which it crosses the grid's lines (through a corner along the columns
first), as far as its range, and ends in the first pixel that is not free. What it passes or ends in becomes known,
but for pixels that the map file does not know.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

FREE, OPAQUE_UNKNOWN = 0, 2
NOT_SEEN = np.inf

FloatArray = NDArray[np.float64]
_SCANS_AT_ONCE = 48


def first_seen(
    cells: NDArray[np.uint8],
    resolution_m: float,
    poses: FloatArray,
    times: FloatArray,
    rays: int,
    range_m: float,
    seen: FloatArray,
) -> None:
    """Lower the times at which pixels were first seen by the scans of one robot.

    Parameters
    ----------
    cells
        The truth: 0 free, 1 occupied, 2 unknown in the map file.
    resolution_m
        Side of a pixel, m.
    poses
        ``(n, 3)`` poses on the grid, m and rad.
    times
        When, ``n`` of them.
    rays, range_m
        Of the LiDAR.
    seen
        ``(rows, cols)`` times so far, infinite where not seen; updated.
    """
    angles = np.arange(rays) * (2.0 * np.pi / rays)
    table_c, table_s = np.cos(angles), np.sin(angles)
    for begin in range(0, len(poses), _SCANS_AT_ONCE):
        part = poses[begin : begin + _SCANS_AT_ONCE]
        turn_c = np.array([cos(yaw) for yaw in part[:, 2]])[:, None]
        turn_s = np.array([sin(yaw) for yaw in part[:, 2]])[:, None]
        dx = (table_c * turn_c - table_s * turn_s).ravel()
        dy = (table_c * turn_s + table_s * turn_c).ravel()
        x = np.repeat(part[:, 0] / resolution_m, rays)
        y = np.repeat(part[:, 1] / resolution_m, rays)
        _cast(cells, x, y, dx, dy, range_m / resolution_m, np.repeat(times[begin : begin + len(part)], rays), seen)


def _cast(
    cells: NDArray[np.uint8],
    x: FloatArray,
    y: FloatArray,
    dx: FloatArray,
    dy: FloatArray,
    reach: float,
    when: FloatArray,
    seen: FloatArray,
) -> None:
    rows, cols = cells.shape
    c, r = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    step_c, step_r = np.where(dx > 0, 1, -1), np.where(dy > 0, 1, -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        delta_c, delta_r = np.abs(1.0 / dx), np.abs(1.0 / dy)
        next_c = np.where(dx != 0, np.where(dx > 0, c + 1 - x, x - c) * delta_c, np.inf)
        next_r = np.where(dy != 0, np.where(dy > 0, r + 1 - y, y - r) * delta_r, np.inf)
    flat, first = cells.ravel(), seen.ravel()
    while len(c):
        inside = (r >= 0) & (r < rows) & (c >= 0) & (c < cols)
        at = np.where(inside, r * cols + c, 0)
        value = flat[at]
        learns = inside & (value != OPAQUE_UNKNOWN) & (when < first[at])
        if learns.any():
            np.minimum.at(first, at[learns], when[learns])
        along_c = next_c <= next_r
        goes = inside & (value == FREE) & (np.where(along_c, next_c, next_r) < reach)
        c = np.where(along_c, c + step_c, c)[goes]
        r = np.where(along_c, r, r + step_r)[goes]
        next_c = np.where(along_c, next_c + delta_c, next_c)[goes]
        next_r = np.where(along_c, next_r, next_r + delta_r)[goes]
        step_c, step_r, delta_c, delta_r, when = (v[goes] for v in (step_c, step_r, delta_c, delta_r, when))
