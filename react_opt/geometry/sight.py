"""Line of sight on a pixel grid, exactly: one rule for every motion check and every visibility graph.

The rule: a segment is free when it lies in the union of the closed free pixels and never slips between two
blocked pixels that touch at one corner only. Grazing a blocked pixel's edge or corner is allowed, so shortest
paths exist and bend at corners. Lengths below ``TOUCH`` pixels count as touching; a segment is tested in one
canonical direction, so the answer never depends on which end comes first.

Grids are *padded*: a uint8 array with one ring of blocked pixels around the map, so that nothing leaves it and
the kernels need no bounds.
"""

from __future__ import annotations

from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

TOUCH = 1e-6
"""Overlaps below this many pixels count as touching: far below any map's accuracy, far above rounding."""

Padded = NDArray[np.uint8]


@kernel
def _at(padded: Padded, steep: bool, i: int, j: int) -> bool:
    """Tell whether the pixel at major index ``i`` and minor index ``j`` is blocked."""
    if steep:
        return bool(padded[i + 1, j + 1] != 0)
    return bool(padded[j + 1, i + 1] != 0)


@kernel
def _snap(value: float) -> float:
    nearest = floor(value + 0.5)
    return float(nearest) if abs(value - nearest) <= TOUCH else value


@kernel
def point_free_px(padded: Padded, x: float, y: float) -> bool:
    """Tell whether a point may be stood on.

    Parameters
    ----------
    padded
        ``(rows + 2, cols + 2)`` grid, non-zero where blocked.
    x, y
        Pixel coordinates (column, row).

    Returns
    -------
    bool
        True in a free pixel or on its rim; False in blocked pixels, off the map and on a corner where only
        two diagonally opposite pixels are free.
    """
    rows, cols = padded.shape[0] - 2, padded.shape[1] - 2
    x, y = _snap(x), _snap(y)
    if not (0.0 <= x <= cols and 0.0 <= y <= rows):
        return False
    right, upper = floor(x), floor(y)
    left = right - 1 if x == right else right
    lower = upper - 1 if y == upper else upper
    low_left, low_right = _at(padded, False, left, lower), _at(padded, False, right, lower)
    up_left, up_right = _at(padded, False, left, upper), _at(padded, False, right, upper)
    if low_left and low_right and up_left and up_right:
        return False
    pinched = low_left == up_right and low_right == up_left and low_left != low_right
    return not (pinched and left != right and lower != upper)


@kernel
def segment_free_px(padded: Padded, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Tell whether the straight segment between two points is free, by the rule of this module.

    Parameters
    ----------
    padded
        ``(rows + 2, cols + 2)`` grid, non-zero where blocked.
    x0, y0, x1, y1
        Pixel coordinates (column, row) of the ends.

    Notes
    -----
    The segment is cut into unit strips along its major axis. Its overlap with a strip is an interval of at
    most one unit on the minor axis, so it meets at most two pixels there; an empty interval means that it
    runs along a grid line, where one side must be free. At a grid corner it must go on along one side.
    """
    if not (point_free_px(padded, x0, y0) and point_free_px(padded, x1, y1)):
        return False
    return clear_between_px(padded, x0, y0, x1, y1)


@kernel
def clear_between_px(padded: Padded, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Tell whether a segment is free, given that its two ends are (see :func:`segment_free_px`)."""
    x0, y0, x1, y1 = _snap(x0), _snap(y0), _snap(x1), _snap(y1)
    steep = abs(y1 - y0) > abs(x1 - x0)
    if steep:
        x0, y0, x1, y1 = y0, x0, y1, x1
    if x0 > x1:
        x0, y0, x1, y1 = x1, y1, x0, y0
    if x0 == x1:
        return True
    slope = (y1 - y0) / (x1 - x0)
    if x1 - x0 > 16.0:  # a few probes deep inside pixels settle most of the segments that are not free
        for n in range(1, 8):
            x = x0 + (x1 - x0) * n / 8.0
            y = y0 + (x - x0) * slope
            i, j = floor(x), floor(y)
            inside = min(x - i, i + 1 - x, y - j, j + 1 - y) > 1e-3
            if inside and _at(padded, steep, i, j):
                return False
    first, last = floor(x0), ceil(x1) - 1
    here = y0
    for i in range(first, last + 1):
        if i > first:
            corner = floor(here + 0.5)
            if abs(here - corner) <= TOUCH:
                below = _at(padded, steep, i - 1, corner - 1) or _at(padded, steep, i, corner - 1)
                if below and (_at(padded, steep, i - 1, corner) or _at(padded, steep, i, corner)):
                    return False
        there = y1 if i == last else y0 + (i + 1 - x0) * slope
        low, high = (here, there) if here < there else (there, here)
        j, k = floor(low + TOUCH), ceil(high - TOUCH) - 1
        if k < j:
            if _at(padded, steep, i, j - 1) and _at(padded, steep, i, j):
                return False
        elif _at(padded, steep, i, j) or _at(padded, steep, i, k):
            return False
        here = there
    return True
