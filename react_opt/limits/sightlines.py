"""Which tiles can see which, for certain: every tile from some point of which some point of a tile is visible.

Exact and permissive: two tiles see each other when any straight segment from a point of the one to a point of the other
meets no opaque tile in between. So whatever a LiDAR of any number of rays, at any pose within a tile, reveals is
contained in what is found here. The set of lines that are still free is kept as views, each between a shallow and a
steep line that touch the obstacles seen so far, as the tiles of a quadrant are visited diagonal by diagonal (Duerig's
"precise permissive field of view"). All arithmetic is in whole numbers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

IntArray = NDArray[np.int64]
# Lines of the views: near x, near y, far x, far y of the shallow one, then of the steep one, and the last bump of each.
# Bumps: x, y, the bump before. Order: the views from shallow to steep.
Memory = tuple[IntArray, IntArray, IntArray]

_VIEWS, _BUMPS = 4096, 65536


def memory() -> Memory:
    """Return working memory for :func:`tiles_in_sight`."""
    return np.zeros((_VIEWS, 10), np.int64), np.zeros((_BUMPS, 3), np.int64), np.zeros(_VIEWS, np.int64)


@kernel
def tiles_in_sight(opaque: NDArray[np.uint8], row: int, col: int, reach: float, work: Memory, found: IntArray) -> int:
    """List the tiles that see a tile.

    Parameters
    ----------
    opaque
        ``(rows, cols)`` non-zero where nothing sees through; the tiles beyond the rim are opaque.
    row, col
        The tile.
    reach
        Range in tile sides: tiles no point of which is nearer than that to the tile are left out.
    work
        :func:`memory`.
    found
        ``opaque.size`` numbers; the first of them receive ``row * cols + col``, opaque tiles included.

    Returns
    -------
    int
        How many were found.
    """
    cols = opaque.shape[1]
    found[0] = row * cols + col
    count = 1
    for quadrant in range(4):
        sy, sx = (1 if quadrant < 2 else -1), (1 if quadrant % 2 == 0 else -1)
        count = _quadrant(opaque, row, col, sx, sy, reach, work, found, count)
    return count


@kernel
def _side(line: IntArray, at: int, x: int, y: int) -> int:
    """Return a number that is positive where a line of a view runs below a point, negative where above."""
    nx, ny, fx, fy = line[at], line[at + 1], line[at + 2], line[at + 3]
    return int((fy - ny) * (fx - x) - (fx - nx) * (fy - y))


@kernel
def _quadrant(
    opaque: NDArray[np.uint8], row: int, col: int, sx: int, sy: int, reach: float, work: Memory, found: IntArray,
    count: int,
) -> int:  # fmt: skip
    views, bumps, order = work
    rows, cols = opaque.shape
    wide = cols - 1 - col if sx > 0 else col
    high = rows - 1 - row if sy > 0 else row
    limit = int(np.ceil(reach)) + 1
    wide, high = min(wide, limit), min(high, limit)
    far = wide + high + 4
    views[0, 0], views[0, 1], views[0, 2], views[0, 3] = 0, 1, far, 0
    views[0, 4], views[0, 5], views[0, 6], views[0, 7] = 1, 0, 0, far
    views[0, 8], views[0, 9] = -1, -1
    order[0] = 0
    live, made, bumped = 1, 1, 0
    for i in range(1, wide + high + 1):
        if live == 0:
            break
        at = 0
        for y in range(max(0, i - wide), min(i, high) + 1):
            x = i - y
            gap_x, gap_y = max(0, x - 1), max(0, y - 1)
            if gap_x * gap_x + gap_y * gap_y >= reach * reach:
                continue
            while at < live and _side(views[order[at]], 4, x + 1, y) >= 0:
                at += 1
            if at == live:
                break
            view = order[at]
            if _side(views[view], 0, x, y + 1) <= 0:
                continue
            r, c = row + sy * y, col + sx * x
            found[count] = r * cols + c
            count += 1
            if opaque[r, c] == 0:
                continue
            under, over = _side(views[view], 0, x + 1, y) < 0, _side(views[view], 4, x, y + 1) > 0
            if made >= views.shape[0] - 1 or bumped >= bumps.shape[0] - 2:
                continue  # out of memory: the tile counts as transparent, which still contains what is visible
            if under and over:  # it fills the view
                live = _take_out(order, at, live)
                continue
            if not under and not over:  # it splits the view: the part below keeps its place
                views[made] = views[view]
                for k in range(live, at, -1):
                    order[k] = order[k - 1]
                order[at + 1] = made
                live += 1
                bumped = _bump_shallow(views, bumps, made, x, y + 1, bumped)
                bumped = _bump_steep(views, bumps, view, x + 1, y, bumped)
                made += 1
                if _void(views, order[at + 1]):
                    live = _take_out(order, at + 1, live)
                if _void(views, view):
                    live = _take_out(order, at, live)
                continue
            if under:
                bumped = _bump_shallow(views, bumps, view, x, y + 1, bumped)
            else:
                bumped = _bump_steep(views, bumps, view, x + 1, y, bumped)
            if _void(views, view):
                live = _take_out(order, at, live)
    return count


@kernel
def _take_out(order: IntArray, at: int, live: int) -> int:
    for k in range(at, live - 1):
        order[k] = order[k + 1]
    return live - 1


@kernel
def _bump_shallow(views: IntArray, bumps: IntArray, view: int, x: int, y: int, bumped: int) -> int:
    """Raise the shallow line of a view over the point (x, y)."""
    line = views[view]
    line[2], line[3] = x, y
    bumps[bumped, 0], bumps[bumped, 1], bumps[bumped, 2] = x, y, line[8]
    line[8] = bumped
    k = line[9]
    while k >= 0:
        if _side(line, 0, bumps[k, 0], bumps[k, 1]) < 0:
            line[0], line[1] = bumps[k, 0], bumps[k, 1]
        k = bumps[k, 2]
    return bumped + 1


@kernel
def _bump_steep(views: IntArray, bumps: IntArray, view: int, x: int, y: int, bumped: int) -> int:
    """Lower the steep line of a view under the point (x, y)."""
    line = views[view]
    line[6], line[7] = x, y
    bumps[bumped, 0], bumps[bumped, 1], bumps[bumped, 2] = x, y, line[9]
    line[9] = bumped
    k = line[8]
    while k >= 0:
        if _side(line, 4, bumps[k, 0], bumps[k, 1]) > 0:
            line[4], line[5] = bumps[k, 0], bumps[k, 1]
        k = bumps[k, 2]
    return bumped + 1


@kernel
def _void(views: IntArray, view: int) -> bool:
    """Tell whether a view has shrunk to a single line along the rim of the tile, which sees nothing."""
    line = views[view]
    same = _side(line, 0, line[4], line[5]) == 0 and _side(line, 0, line[6], line[7]) == 0
    return same and (_side(line, 0, 0, 1) == 0 or _side(line, 0, 1, 0) == 0)
