"""What sampling-based planners need around them, compiled: join points to a roadmap, bridge its gaps, tighten paths.

Everything is in pixel coordinates on padded grids and is tested with the exact rule of
:mod:`react_opt.geometry.sight`. There are two grids: ``stand``, where the robot may stand and turn, and
``drive``, which a straight drive may pass (the same grid for a disc; see :mod:`react_opt.paths.ompl_costs`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from react_opt.geometry.sight import Padded, point_free_px, segment_free_px
from react_opt.kernels import kernel
from react_opt.paths.motion import Field, segment_px

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
_PASSES = 24
_HALVINGS = 12
_SETTLED = 1e-4
"""A pass that shortens a path by less than this share of its length is the last one."""


@dataclass(frozen=True, eq=False)
class Grids:
    """Where the robot may stand and where it may drive, as padded grids of equal shape, and what they connect.

    Parameters
    ----------
    stand, drive
        ``(rows + 2, cols + 2)`` uint8, non-zero where blocked, for the disc and for a straight drive.
    """

    stand: Padded
    drive: Padded

    def leg_free(self, start_px: FloatArray, end_px: FloatArray) -> bool:
        """Tell whether the robot may drive straight from one point to another."""
        return bool(leg_free(self.stand, self.drive, start_px[0], start_px[1], end_px[0], end_px[1]))


@kernel
def leg_free(stand: Padded, drive: Padded, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Tell whether the robot may stand at both ends and drive straight between them."""
    return bool(
        point_free_px(stand, x0, y0) and point_free_px(stand, x1, y1) and segment_free_px(drive, x0, y0, x1, y1)
    )


@kernel
def _skip(stand: Padded, drive: Padded, path: FloatArray) -> FloatArray:
    """Go from each kept point straight to the farthest later point in sight."""
    kept = np.empty_like(path)
    kept[0] = path[0]
    count, at, last = 1, 0, len(path) - 1
    while at < last:
        to = last
        while to > at + 1 and not leg_free(stand, drive, path[at, 0], path[at, 1], path[to, 0], path[to, 1]):
            to -= 1
        kept[count] = path[to]
        count += 1
        at = to
    return kept[:count].copy()


@kernel
def _bend_free(stand: Padded, drive: Padded, ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> bool:
    """Tell whether both legs of a bend are free.

    The first one is part of a free leg, but at touching lengths rounding may tell the part from the whole.
    """
    for _ in range(2):  # one call in a loop: the kernel is compiled into its caller
        if not leg_free(stand, drive, bx, by, cx, cy):
            return False
        cx, cy = ax, ay
    return True


@kernel
def _pull(stand: Padded, drive: Padded, path: FloatArray) -> FloatArray:
    """Slide each corner back towards its predecessor as far as its successor stays in sight."""
    kept = np.empty_like(path)
    kept[0] = path[0]
    count = 1
    for i in range(1, len(path) - 1):
        ax, ay = kept[count - 1, 0], kept[count - 1, 1]
        bx, by = path[i, 0], path[i, 1]
        cx, cy = path[i + 1, 0], path[i + 1, 1]
        low, high = 0.0, 2.0  # the first try is all the way: the corner goes
        for _ in range(_HALVINGS):
            half = 0.5 * (low + high)
            if _bend_free(stand, drive, ax, ay, bx + half * (ax - bx), by + half * (ay - by), cx, cy):
                low = half
                if low == 1.0:
                    break
            else:
                high = half
        if low < 1.0:
            kept[count, 0] = bx + low * (ax - bx)
            kept[count, 1] = by + low * (ay - by)
            count += 1
    kept[count] = path[-1]
    return kept[: count + 1].copy()


@kernel
def _length(path: FloatArray) -> float:
    total = 0.0
    for i in range(1, len(path)):
        total += np.hypot(path[i, 0] - path[i - 1, 0], path[i, 1] - path[i - 1, 1])
    return total


@kernel
def tighten(stand: Padded, drive: Padded, path: FloatArray) -> FloatArray:
    """Shorten a free path until it is nearly taut: skip points, then pull corners. Deterministic.

    Parameters
    ----------
    stand, drive
        Blocked pixels with their ring, for standing and for driving.
    path
        ``(k, 2)`` points in pixel coordinates, k >= 2, every leg free.

    Returns
    -------
    FloatArray
        ``(k', 2)`` with the same ends, every leg free, no longer than ``path``.
    """
    path = _skip(stand, drive, path)
    length = _length(path)
    for _pass in range(_PASSES):
        if len(path) <= 2:
            break
        for _ in range(2):
            path = _pull(stand, drive, path)[::-1].copy()
        shorter = _length(path)
        settled = length - shorter <= _SETTLED * length
        length = shorter
        if settled:
            break
    return path


@kernel
def join(
    stand: Padded, drive: Padded, points: FloatArray, nodes: FloatArray, near: IntArray, most: int
) -> tuple[IntArray, IntArray, FloatArray]:
    """Join points to the nearest nodes that they see.

    Parameters
    ----------
    stand, drive
        Blocked pixels with their ring.
    points, nodes
        ``(n, 2)`` and ``(v, 2)`` in pixel coordinates.
    near
        ``(n, m)`` candidate nodes of each point, nearest first.
    most
        How many edges a point may get.

    Returns
    -------
    point, node, length
        The edges and their lengths in pixels.
    """
    rows = np.empty(len(points) * most, dtype=np.int64)
    cols = np.empty_like(rows)
    lengths = np.empty(len(rows))
    count = 0
    for i in range(len(points)):
        got = 0
        for node in near[i]:
            if got == most:
                break
            x0, y0, x1, y1 = points[i, 0], points[i, 1], nodes[node, 0], nodes[node, 1]
            if leg_free(stand, drive, x0, y0, x1, y1):
                rows[count], cols[count] = i, node
                lengths[count] = np.hypot(x1 - x0, y1 - y0)
                count += 1
                got += 1
    return rows[:count].copy(), cols[:count].copy(), lengths[:count].copy()


@kernel
def leg_times(field: Field, nodes: FloatArray, pairs: IntArray) -> FloatArray:
    """Return the driving times of straight legs, s.

    Parameters
    ----------
    field
        The map and the robot (:func:`react_opt.paths.motion.terrain`).
    nodes
        ``(v, 2)`` pixel coordinates.
    pairs
        ``(e, 2)`` nodes that the legs join.
    """
    times = np.empty(len(pairs))
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        times[k] = segment_px(field, nodes[a, 0], nodes[a, 1], nodes[b, 0], nodes[b, 1])
    return times


@kernel
def flood(stand: Padded, sources: IntArray) -> NDArray[np.int32]:
    """Search breadth-first from pixels through pixel sides.

    Parameters
    ----------
    stand
        Blocked pixels with their ring.
    sources
        Flat indices into the padded grid, all free.

    Returns
    -------
    NDArray[np.int32]
        For each pixel of the padded grid, flat: the pixel it was reached from, itself for a source, -1 where
        nothing leads to it.
    """
    cols = stand.shape[1]
    blocked = stand.ravel()
    before = np.full(blocked.size, -1, dtype=np.int32)
    queue = np.empty(blocked.size, dtype=np.int32)
    head, tail = 0, 0
    for source in sources:
        if before[source] < 0:
            before[source] = source
            queue[tail] = source
            tail += 1
    while head < tail:
        at = np.int64(queue[head])
        head += 1
        for step in (-cols, -1, 1, cols):
            to = at + step
            if blocked[to] == 0 and before[to] < 0:
                before[to] = at
                queue[tail] = to
                tail += 1
    return before
