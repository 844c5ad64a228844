"""LiDAR rays over a pixel grid, exactly: which pixels a turn of rays crosses, and where each ray ends.

A ray visits every pixel that it enters before its range, one after the other, in the order in which it crosses the
grid's lines (through a corner it goes first along the columns). It ends in the first opaque pixel, or at its range.
Directions are rotated from one table of cosines and sines, so that a replay in other code gets the same pixels.
"""

from __future__ import annotations

from functools import lru_cache
from math import floor

import numpy as np
from numpy.typing import NDArray

from react_opt.geometry.occupancy import OCCUPIED, UNKNOWN
from react_opt.kernels import kernel

FloatArray = NDArray[np.float64]
Cells = NDArray[np.uint8]


@lru_cache(maxsize=64)
def ray_table(rays: int) -> FloatArray:
    """Return ``(rays, 2)`` cosines and sines of a turn of rays; the first looks ahead."""
    angles = np.arange(rays) * (2.0 * np.pi / rays)
    table = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    table.setflags(write=False)
    return table


@kernel
def _enter_px(x: float, y: float, dx: float, dy: float) -> tuple[int, int, int, int, float, float, float, float]:
    """Start a grid traversal: pixel, steps, and along the ray the distance per pixel and to the next border.

    Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987.
    """
    c, r = floor(x), floor(y)
    step_c = 1 if dx > 0 else -1
    step_r = 1 if dy > 0 else -1
    delta_c = abs(1.0 / dx) if dx != 0 else np.inf
    delta_r = abs(1.0 / dy) if dy != 0 else np.inf
    next_c = ((c + 1 - x) if dx > 0 else (x - c)) * delta_c if dx != 0 else np.inf
    next_r = ((r + 1 - y) if dy > 0 else (y - r)) * delta_r if dy != 0 else np.inf
    return c, r, step_c, step_r, delta_c, delta_r, next_c, next_r


@kernel
def scan_px(
    truth: Cells,
    known: Cells,
    x: float,
    y: float,
    cos_yaw: float,
    sin_yaw: float,
    table: FloatArray,
    range_px: float,
    found: NDArray[np.int64],
) -> int:
    """Scan once: write what is seen into ``known`` and list the pixels that were not known before.

    Parameters
    ----------
    truth
        The map as it is. Pixels that are unknown there stop a ray and stay unknown.
    known
        The map as known so far, of the same shape; updated.
    x, y, cos_yaw, sin_yaw
        Pose, pixel coordinates (column, row).
    table
        :func:`ray_table`.
    range_px
        Range in pixels.
    found
        ``truth.size`` numbers; the first of them receive ``row * cols + col`` of the pixels newly known.

    Returns
    -------
    int
        How many pixels became known.
    """
    rows, cols = truth.shape
    count = 0
    for n in range(table.shape[0]):
        dx = table[n, 0] * cos_yaw - table[n, 1] * sin_yaw
        dy = table[n, 0] * sin_yaw + table[n, 1] * cos_yaw
        c, r, step_c, step_r, delta_c, delta_r, next_c, next_r = _enter_px(x, y, dx, dy)
        while 0 <= r < rows and 0 <= c < cols:
            value = truth[r, c]
            if value != UNKNOWN and known[r, c] == UNKNOWN:
                known[r, c] = value
                found[count] = r * cols + c
                count += 1
            if value != 0:
                break
            if next_c >= range_px and next_r >= range_px:
                break
            if next_c <= next_r:
                c += step_c
                next_c += delta_c
            else:
                r += step_r
                next_r += delta_r
    return count


@kernel
def unknown_ahead_px(
    known: Cells,
    x: float,
    y: float,
    cos_yaw: float,
    sin_yaw: float,
    table: FloatArray,
    range_px: float,
    marks: NDArray[np.int32],
    mark: int,
    enough: int,
) -> int:
    """Count the unknown pixels that a scan would reveal if unknown space were free; stop at ``enough``.

    Parameters
    ----------
    known
        The map as known, 0 free, 1 occupied, else unknown.
    x, y, cos_yaw, sin_yaw, table, range_px
        As in :func:`scan_px`.
    marks, mark
        Memory of the map's shape, and a number that is nowhere in it yet.
    enough
        Largest number to count to.
    """
    rows, cols = known.shape
    count = 0
    for n in range(table.shape[0]):
        dx = table[n, 0] * cos_yaw - table[n, 1] * sin_yaw
        dy = table[n, 0] * sin_yaw + table[n, 1] * cos_yaw
        c, r, step_c, step_r, delta_c, delta_r, next_c, next_r = _enter_px(x, y, dx, dy)
        while 0 <= r < rows and 0 <= c < cols:
            value = known[r, c]
            if value == OCCUPIED:
                break
            if value != 0 and marks[r, c] != mark:
                marks[r, c] = mark
                count += 1
                if count >= enough:
                    return count
            if next_c >= range_px and next_r >= range_px:
                break
            if next_c <= next_r:
                c += step_c
                next_c += delta_c
            else:
                r += step_r
                next_r += delta_r
    return count


@kernel
def sees_any_px(truth: Cells, goal: NDArray[np.bool_], x: float, y: float, table: FloatArray, range_px: float) -> bool:
    """Tell whether one of the rays from a point meets a pixel of ``goal`` before anything opaque."""
    rows, cols = truth.shape
    for n in range(table.shape[0]):
        dx, dy = table[n, 0], table[n, 1]
        c, r, step_c, step_r, delta_c, delta_r, next_c, next_r = _enter_px(x, y, dx, dy)
        while 0 <= r < rows and 0 <= c < cols:
            if truth[r, c] != 0:
                break
            if goal[r, c]:
                return True
            if next_c >= range_px and next_r >= range_px:
                break
            if next_c <= next_r:
                c += step_c
                next_c += delta_c
            else:
                r += step_r
                next_r += delta_r
    return False


def rays_px(
    x: float, y: float, angles_rad: FloatArray, ranges_px: FloatArray, range_max_px: float
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the pixels along measured rays: ``(n, 2)`` rows and columns, and which of them are hits.

    Hits come last, so that merging in order lets them win over rays that graze the same pixel.

    Parameters
    ----------
    x, y
        Where the rays start, pixel coordinates.
    angles_rad, ranges_px
        Directions on the grid, and lengths in pixels.
    range_max_px
        Rays of this length or more hit nothing.
    """
    ends = np.minimum(ranges_px, range_max_px)
    room = int(3 * np.sum(ends)) + 3 * len(ends) + 3
    out = np.empty((room, 2), dtype=np.int64)
    hit = np.zeros(room, dtype=np.bool_)
    count = _trace_px(x, y, np.cos(angles_rad), np.sin(angles_rad), ends, ranges_px < range_max_px, out, hit)
    pixels, hits = out[:count], hit[:count]
    return np.concatenate((pixels[~hits], pixels[hits])), np.sort(hits)


@kernel
def _trace_px(
    x: float,
    y: float,
    cos: FloatArray,
    sin: FloatArray,
    ends: FloatArray,
    hits: NDArray[np.bool_],
    out: NDArray[np.int64],
    hit: NDArray[np.bool_],
) -> int:
    count = 0
    for n in range(cos.shape[0]):
        dx, dy = cos[n], sin[n]
        c, r, step_c, step_r, delta_c, delta_r, next_c, next_r = _enter_px(x, y, dx, dy)
        while True:
            out[count, 0], out[count, 1] = r, c
            if min(next_c, next_r) >= ends[n]:
                hit[count] = hits[n]
                count += 1
                break
            count += 1
            if next_c <= next_r:
                c += step_c
                next_c += delta_c
            else:
                r += step_r
                next_r += delta_r
    return count
