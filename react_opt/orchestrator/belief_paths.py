"""Fastest drives over the blocks of a believed map, by the speed law: one compiled search serves costs and paths.

Nodes are the centres of passable blocks; moves lead to the 8 blocks around (a diagonal only between two passable
ones) and cost their length times the mean slowness of their ends. The search is Dijkstra's with a wheel of buckets
no wider than the cheapest move, which makes it exact without a heap.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.energy import RobotProfile, speed_at
from react_opt.geometry.occupancy import FloatArray
from react_opt.kernels import kernel

IntArray = NDArray[np.int64]
Field = tuple[FloatArray, FloatArray, NDArray[np.int32]]
"""Time (s, inf: no way), length (m) and the block before, for each block, row by row."""


def slowness(
    clear_px: NDArray[np.float32], passable: NDArray[np.bool_], profile: RobotProfile, resolution_m: float
) -> NDArray[np.float32]:
    """Return s per m in each block, 0 where the robot may not stand."""
    out = np.zeros(clear_px.shape, dtype=np.float32)
    _slowness(
        clear_px, passable, out, resolution_m, profile.radius_m, profile.full_speed_clearance_m,
        profile.speed_min_m_s, profile.speed_max_m_s,
    )  # fmt: skip
    return out


def search(slow: NDArray[np.float32], start: int, side_m: float, fastest_m_s: float, goals: IntArray) -> Field:
    """Return the field of drives from a block; it may stop once all goals are reached.

    Parameters
    ----------
    slow
        :func:`slowness`.
    start
        Number of the block to start from (it may be impassable: moves lead out of it).
    side_m
        Side of a block, m.
    fastest_m_s
        The largest speed.
    goals
        Blocks that are wanted; empty for all.
    """
    top = float(slow.max(initial=0.0))
    slowest = max(top, 1.0 / fastest_m_s)
    return _search(slow, start, side_m, side_m / fastest_m_s, slowest, goals)


@kernel
def _slowness(
    clear_px: NDArray[np.float32],
    passable: NDArray[np.bool_],
    out: NDArray[np.float32],
    resolution_m: float,
    contact: float,
    full: float,
    low: float,
    high: float,
) -> None:
    for r in range(out.shape[0]):
        for c in range(out.shape[1]):
            if passable[r, c]:
                out[r, c] = 1.0 / speed_at(clear_px[r, c] * resolution_m, contact, full, low, high)


@kernel
def _search(
    slow: NDArray[np.float32], start: int, side_m: float, width: float, slowest: float, goals: IntArray
) -> tuple[FloatArray, FloatArray, NDArray[np.int32]]:
    rows, cols = slow.shape
    size = rows * cols
    time = np.full(size, np.inf)
    length = np.zeros(size)
    before = np.full(size, -1, dtype=np.int32)
    after = np.full(size, -1, dtype=np.int32)  # doubly linked lists, one per bucket
    ahead = np.full(size, -1, dtype=np.int32)
    closed = np.zeros(size, dtype=np.bool_)
    wanted = np.zeros(size, dtype=np.bool_)
    left = 0
    for n in range(goals.shape[0]):
        if not wanted[goals[n]]:
            wanted[goals[n]] = True
            left += 1
    stop = left > 0
    diagonal = side_m * np.sqrt(2.0)
    buckets = int(diagonal * slowest / width) + 3
    head = np.full(buckets, -1, dtype=np.int32)
    time[start] = 0.0
    head[0] = start
    waiting, bucket = 1, 0
    first = slow[start // cols, start % cols]
    while waiting > 0:
        slot = bucket % buckets
        here = head[slot]
        if here < 0:
            bucket += 1
            continue
        head[slot] = after[here]
        if after[here] >= 0:
            ahead[after[here]] = -1
        waiting -= 1
        closed[here] = True
        if wanted[here]:
            left -= 1
            if stop and left == 0:
                break
        r, c = here // cols, here % cols
        mine = slow[r, c] if slow[r, c] > 0 else max(first, np.float32(slowest))
        for dr in range(-1, 2):
            u = r + dr
            if u < 0 or u >= rows:
                continue
            for dc in range(-1, 2):
                v = c + dc
                if v < 0 or v >= cols or slow[u, v] <= 0 or (dr == 0 and dc == 0):
                    continue
                if dr != 0 and dc != 0 and (slow[r, v] <= 0 or slow[u, c] <= 0):
                    continue
                there = u * cols + v
                if closed[there]:
                    continue
                metres = diagonal if dr != 0 and dc != 0 else side_m
                t = time[here] + metres * 0.5 * (mine + slow[u, v])
                if t >= time[there]:
                    continue
                if time[there] < np.inf:  # take it out of its bucket
                    old = int(time[there] / width) % buckets
                    if ahead[there] >= 0:
                        after[ahead[there]] = after[there]
                    else:
                        head[old] = after[there]
                    if after[there] >= 0:
                        ahead[after[there]] = ahead[there]
                else:
                    waiting += 1
                time[there] = t
                length[there] = length[here] + metres
                before[there] = here
                new = int(t / width) % buckets
                after[there] = head[new]
                ahead[there] = -1
                if head[new] >= 0:
                    ahead[head[new]] = there
                head[new] = there
    return time, length, before


@kernel
def nearest_block(slow: NDArray[np.float32], x: float, y: float, reach: float) -> int:
    """Return the number of the passable block whose centre is nearest to a point (in blocks), -1 beyond reach."""
    rows, cols = slow.shape
    best, found = reach * reach, -1
    for r in range(max(0, int(y - reach - 1)), min(rows, int(y + reach + 2))):
        for c in range(max(0, int(x - reach - 1)), min(cols, int(x + reach + 2))):
            if slow[r, c] > 0:
                gap = (r + 0.5 - y) ** 2 + (c + 0.5 - x) ** 2
                if gap <= best:
                    best, found = gap, r * cols + c
    return found


@kernel
def way_to(
    slow: NDArray[np.float32], before: NDArray[np.int32], time: FloatArray, goal: int, side_m: float
) -> IntArray:
    """Return the blocks of the drive to a goal, the start first, pulled straight where that is free and no slower."""
    if not np.isfinite(time[goal]):
        return np.empty(0, dtype=np.int64)
    count, at = 1, goal
    while before[at] >= 0:
        at = before[at]
        count += 1
    way = np.empty(count, dtype=np.int64)
    at = goal
    for n in range(count - 1, -1, -1):
        way[n] = at
        at = before[at]
    kept = np.empty(count, dtype=np.int64)
    kept[0], found, at = way[0], 1, 0
    while at < count - 1:
        best = at + 1
        misses = 0
        for n in range(at + 2, count):
            straight = _straight_s(slow, way[at], way[n], side_m)
            if straight < 0:
                break
            if straight <= time[way[n]] - time[way[at]] + 1e-9:
                best, misses = n, 0
            else:
                misses += 1
                if misses > 20:
                    break
        kept[found] = way[best]
        found, at = found + 1, best
    return kept[:found].copy()


@kernel
def _straight_s(slow: NDArray[np.float32], start: int, goal: int, side_m: float) -> float:
    """Return the time of a straight drive between two blocks, -1 where it leaves the passable blocks."""
    cols = slow.shape[1]
    y0, x0 = start // cols, start % cols
    y1, x1 = goal // cols, goal % cols
    dx, dy = x1 - x0, y1 - y0
    length = np.sqrt(float(dx * dx + dy * dy))
    pieces = int(2.0 * length) + 1
    total = 0.0
    for n in range(pieces):
        share = (n + 0.5) / pieces
        value = slow[int(y0 + share * dy + 0.5), int(x0 + share * dx + 0.5)]
        if value <= 0:
            return -1.0
        total += value
    return float(total / pieces * length * side_m)
