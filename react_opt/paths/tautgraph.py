"""The taut visibility graph of an inflated map: corners of blocked pixels and the segments that may join them.

Nearly all pairs of corners do not see each other. Most fall to two tests of a few operations before a line of
sight is traced: a taut path runs close to a side of the corner's pixel, and on a staircase of pixels the next
step shadows the flat directions.
"""

from __future__ import annotations

from math import hypot

import numpy as np
from numpy.typing import NDArray

from react_opt.geometry.inflation import FreeSpace
from react_opt.geometry.sight import Padded, clear_between_px
from react_opt.kernels import kernel
from react_opt.paths.motion import Field, segment_px
from react_opt.paths.protocol import FloatArray

IntArray = NDArray[np.int64]

_NEAR = 12  # pixels; how far around a corner its shadows are looked for

# Corners ``(n, 6)``: column, row, direction (+-1, +-1) of the blocked pixel, shadows on its two sides. Then the
# taut segments in adjacency rows: where each corner's begin, the other corner, length in pixels, driving time in s.
Graph = tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray]


def count_corners(space: FreeSpace) -> int:
    """Return how many corners the visibility graph of a map has."""
    return int(corners_of(space).shape[0])


def corners_of(space: FreeSpace) -> FloatArray:
    """Return ``(n, 6)`` convex corners of the blocked pixels (see ``Graph``), their shadows still 0."""
    around = space.padded
    quarters = (around[:-1, :-1], around[:-1, 1:], around[1:, :-1], around[1:, 1:])
    alone = quarters[0] + quarters[1] + quarters[2] + quarters[3] == 1
    row, col = np.nonzero(alone)
    to_right = (quarters[1] + quarters[3])[row, col]
    upward = (quarters[2] + quarters[3])[row, col]
    zero = np.zeros(row.shape)
    return np.stack((col, row, 2.0 * to_right - 1.0, 2.0 * upward - 1.0, zero, zero), axis=1)


def taut_graph(space: FreeSpace, field: Field) -> Graph:
    """Return the taut visibility graph of a map."""
    corners = corners_of(space)
    _shadows(space.padded, corners)
    count = corners.shape[0]
    partners = [_partners(space.padded, corners, i) for i in range(count)]
    one = np.repeat(np.arange(count), [seen.size for seen in partners])
    two = np.concatenate([np.empty(0, dtype=np.int64), *partners])
    start, end = np.concatenate((one, two)), np.concatenate((two, one))
    order = np.lexsort((end, start))
    start, end = start[order], end[order]
    first = np.searchsorted(start, np.arange(count + 1)).astype(np.int64)
    length, time = _measure(field, corners, start, end)
    return corners, first, end, length, time


@kernel
def _lean(corners: FloatArray, k: int, dx: float, dy: float) -> bool:
    """Tell whether a segment that leaves corner ``k`` along (dx, dy) can be free there and part of a taut path.

    Into the corner's blocked pixel nothing leads; away from it on both axes, the path could be cut short. What
    remains runs close to one of the pixel's two sides, and is known to be blocked when it is long and flatter
    than the corner's shadow on that side. A point on the corner itself always counts.
    """
    u, v = dx * corners[k, 2], dy * corners[k, 3]
    if u > 0.0 and v <= 0.0:
        along, off, shadow = u, -v, corners[k, 4]
    elif v > 0.0 and u <= 0.0:
        along, off, shadow = v, -u, corners[k, 5]
    else:
        return bool(u == 0.0 and v == 0.0)
    return bool(off == 0.0 or (along < _NEAR and off < _NEAR) or off >= shadow * along)


@kernel
def _shadows(padded: Padded, corners: FloatArray) -> None:
    """Fill in the slopes below which every ray off a side of a corner's pixel is blocked within ``_NEAR`` pixels.

    A blocked pixel ``a`` further along the side and ``b`` away from it stops the slopes between b / (a + 1) and
    (b + 1) / a; the shadow is the union of such intervals that begins at the side, less a margin for touching.
    """
    for k in range(corners.shape[0]):
        qx, qy = int(corners[k, 2]), int(corners[k, 3])
        col, row = int(corners[k, 0]) + (1 if qx > 0 else 0), int(corners[k, 1]) + (1 if qy > 0 else 0)
        for side in range(2):
            shadow, grown = 0.0, True
            while grown:
                grown = False
                for a in range(1, _NEAR):
                    for b in range(_NEAR):
                        if (b + 1) <= shadow * a or (b > 0 and b >= shadow * (a + 1)):
                            continue
                        r = row - (b + 1) * qy if side == 0 else row + a * qy
                        c = col + a * qx if side == 0 else col - (b + 1) * qx
                        if 0 <= r < padded.shape[0] and 0 <= c < padded.shape[1] and padded[r, c] != 0:
                            shadow, grown = (b + 1) / a, True
            corners[k, 4 + side] = max(0.0, shadow - 1e-4)


@kernel
def _partners(padded: Padded, corners: FloatArray, i: int) -> IntArray:
    """Return the later corners that a corner sees along segments taut at both ends."""
    count = corners.shape[0]
    seen, found = np.empty(count - i, dtype=np.int64), 0
    x, y = corners[i, 0], corners[i, 1]
    for j in range(i + 1, count):
        dx, dy = corners[j, 0] - x, corners[j, 1] - y
        if (
            _lean(corners, i, dx, dy)
            and _lean(corners, j, -dx, -dy)
            and clear_between_px(padded, x, y, corners[j, 0], corners[j, 1])
        ):
            seen[found] = j
            found += 1
    return seen[:found]


@kernel
def _measure(
    field: Field,
    corners: FloatArray,
    start: IntArray,
    end: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the length (pixels) and driving time (s) of segments between corners."""
    length, time = np.empty(start.shape[0]), np.empty(start.shape[0])
    for n in range(start.shape[0]):
        x0, y0 = corners[start[n], 0], corners[start[n], 1]
        x1, y1 = corners[end[n], 0], corners[end[n], 1]
        length[n] = hypot(x1 - x0, y1 - y0)
        time[n] = segment_px(field, x0, y0, x1, y1)
    return length, time


@kernel
def seen_from(padded: Padded, corners: FloatArray, x: float, y: float) -> IntArray:
    """Return the corners that a point sees along segments taut at the corner."""
    seen = np.empty(corners.shape[0], dtype=np.int64)
    found = 0
    for k in range(corners.shape[0]):
        if _lean(corners, k, x - corners[k, 0], y - corners[k, 1]) and clear_between_px(
            padded, x, y, corners[k, 0], corners[k, 1]
        ):
            seen[found] = k
            found += 1
    return seen[:found]
