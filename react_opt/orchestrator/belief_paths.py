"""Fastest drives over the blocks of a believed map, by the speed law: one compiled search serves costs and paths.

Nodes are the centres of passable blocks; moves lead to the 8 blocks around (a diagonal only between two passable
ones) and cost their length times the mean slowness of their ends. The search is Dijkstra's with a wheel of buckets
no wider than the cheapest move, which makes it exact without a heap. It stops where all that has been asked for is
settled, and is taken up again when more is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.energy import RobotProfile, speed_at
from react_opt.geometry.occupancy import FloatArray
from react_opt.kernels import kernel

IntArray = NDArray[np.int64]
Numbers = NDArray[np.int32]
Flags = NDArray[np.bool_]
Slowness = NDArray[np.float32]
Cells = NDArray[np.uint8]


MOVES = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
"""Rows and columns from a block to those around it, in the order in which they are looked at."""


class Ground:
    """What drives lead over: for all fields on the same slowness.

    Parameters
    ----------
    slow
        :func:`slowness`; must not change any more.
    """

    def __init__(self, slow: Slowness) -> None:
        self.slow = slow
        self.slowest = float(slow.max(initial=0.0))
        self.rimmed = np.zeros((slow.shape[0] + 2, slow.shape[1] + 2), dtype=np.float32)
        """With a rim of impassable blocks."""
        self.rimmed[1:-1, 1:-1] = slow
        self.moves = moves_from(self.rimmed)


class Field:
    """Drives from some blocks to all others, worked out as far as they are asked for.

    A search that is taken up again goes on exactly as if it had never stopped: what a field says does not depend on
    what it was asked before. Inside, the grid has a rim of impassable blocks.

    Parameters
    ----------
    ground
        What the drives lead over.
    starts
        Numbers of the blocks to start from, row by row, none of them twice (they may be impassable: moves lead out).
    side_m
        Side of a block, m.
    fastest_m_s
        The largest speed.
    """

    def __init__(self, ground: Ground, starts: Sequence[int], side_m: float, fastest_m_s: float) -> None:
        self._ground, self._side_m = ground, side_m
        self._cols = ground.slow.shape[1]
        self._width_s = side_m / fastest_m_s
        slowest = max(ground.slowest, 1.0 / fastest_m_s)
        self._start_slow = np.float32(slowest)
        size = ground.rimmed.size
        self._time_s = np.full(size, np.inf)
        self._settled = np.zeros(size, dtype=np.bool_)
        self._before, self._after, self._ahead = (np.empty(size, dtype=np.int32) for _ in range(3))
        buckets = int(np.sqrt(2.0) * side_m * slowest / self._width_s) + 3
        self._head = np.full(1 << (buckets - 1).bit_length(), -1, dtype=np.int32)
        self._state = np.zeros(2, dtype=np.int64)
        _begin(self._inside(starts), self._time_s, self._before, self._after, self._ahead, self._head, self._state)

    def times_s(self, blocks: ArrayLike) -> FloatArray:
        """Return s to blocks, infinite where there is no way."""
        at = self._settle(blocks)
        return np.asarray(self._time_s[at])

    def reached_s(self, blocks: IntArray) -> FloatArray:
        """Return s to blocks (-1: to nowhere), NaN where there is no way."""
        times = np.full(len(blocks), np.nan)
        times[blocks >= 0] = self.times_s(blocks[blocks >= 0])
        times[np.isinf(times)] = np.nan
        return times

    def lengths_m(self, blocks: ArrayLike) -> FloatArray:
        """Return m to blocks on the ways that are fastest, 0 where there is none."""
        return lengths(self._before, self._time_s, self._settle(blocks), self._cols + 2, self._side_m)

    def way(self, block: int) -> IntArray:
        """Return the blocks of the drive to one, pulled straight where that is no slower; empty without a way."""
        (goal,) = self._settle([block])
        way = way_to(self._ground.rimmed, self._before, self._time_s, goal, self._side_m)
        return np.asarray(way - 2 * (way // (self._cols + 2)) - self._cols - 1)

    def all_times_s(self) -> FloatArray:
        """Return s to every block, row by row, infinite where there is no way."""
        self._advance(np.array([-1], dtype=np.int64))
        return self._time_s.reshape(self._ground.rimmed.shape)[1:-1, 1:-1].ravel()

    def _inside(self, blocks: ArrayLike) -> IntArray:
        """Return the numbers of blocks in the grid with its rim."""
        numbers = np.asarray(blocks, dtype=np.int64)
        return np.asarray(numbers + 2 * (numbers // self._cols) + self._cols + 3)

    def _settle(self, blocks: ArrayLike) -> IntArray:
        at = self._inside(blocks)
        self._advance(at)
        return at

    def _advance(self, goals: IntArray) -> None:
        _search(
            self._ground.rimmed, self._ground.moves, goals, self._side_m, self._width_s, self._start_slow,
            self._time_s, self._settled, self._before, self._after, self._ahead, self._head, self._state,
        )  # fmt: skip


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
def moves_from(slow: Slowness) -> Cells:
    """Return for each block of a grid with a rim which of :data:`MOVES` lead on, one bit each."""
    rows, cols = slow.shape
    free = np.empty((rows, cols), dtype=np.uint8)
    for r in range(rows):
        for c in range(cols):
            free[r, c] = slow[r, c] > 0
    moves = np.zeros((rows, cols), dtype=np.uint8)
    for r in range(1, rows - 1):
        high, same, low, out = free[r - 1], free[r], free[r + 1], moves[r]
        for c in range(1, cols - 1):  # an oblique move leads between two passable blocks
            left, right = same[c - 1], same[c + 1]
            out[c] = (
                (high[c] & left & high[c - 1])
                | (high[c] << 1)
                | ((high[c] & right & high[c + 1]) << 2)
                | (left << 3)
                | (right << 4)
                | ((low[c] & left & low[c - 1]) << 5)
                | (low[c] << 6)
                | ((low[c] & right & low[c + 1]) << 7)
            )
    return moves


@kernel
def _begin(
    starts: IntArray,
    time: FloatArray,
    before: Numbers,
    after: Numbers,
    ahead: Numbers,
    head: Numbers,
    state: IntArray,
) -> None:
    """Put the blocks to start from into the first bucket."""
    for n in range(starts.shape[0]):
        start = starts[n]
        time[start], before[start] = 0.0, -1
        after[start], ahead[start] = head[0], -1
        if head[0] >= 0:
            ahead[head[0]] = start
        head[0] = start
    state[0], state[1] = starts.shape[0], 0


@kernel
def _search(
    ground: Slowness,
    moves: Cells,
    goals: IntArray,
    side_m: float,
    width: float,
    start_slow: np.float32,
    time: FloatArray,
    settled: Flags,
    before: Numbers,
    after: Numbers,
    ahead: Numbers,
    head: Numbers,
    state: IntArray,
) -> None:
    """Go on until the goals are settled (a goal of -1: everything) or nothing is left; all in place.

    ``after`` and ``ahead`` are doubly linked lists of waiting blocks, one per bucket, from ``head`` on. ``state``
    holds how many wait and the number of the bucket whose turn it is.
    """
    slow, may = ground.reshape(-1), moves.reshape(-1)
    steps, metres = np.empty(8, dtype=np.int64), np.empty(8)
    for k in range(8):
        steps[k] = MOVES[k][0] * ground.shape[1] + MOVES[k][1]
        metres[k] = 0.5 * (side_m * np.sqrt(2.0) if MOVES[k][0] != 0 and MOVES[k][1] != 0 else side_m)
    mask = head.shape[0] - 1
    waiting, bucket = state[0], state[1]
    for n in range(goals.shape[0]):
        goal = goals[n]
        while waiting > 0 and (goal < 0 or not settled[goal]):
            here = head[bucket & mask]
            if here < 0:
                bucket += 1
                continue
            following = after[here]
            head[bucket & mask] = following
            if following >= 0:
                ahead[following] = -1
            waiting -= 1
            settled[here] = True
            mine = slow[here] if slow[here] > 0 else start_slow
            for k in range(8):
                if not (may[here] >> k) & 1:
                    continue
                there = here + steps[k]
                t = time[here] + metres[k] * (mine + slow[there])
                known = time[there]
                if t >= known or settled[there]:
                    continue
                if known < np.inf:  # take it out of its bucket
                    low, high = after[there], ahead[there]
                    if high >= 0:
                        after[high] = low
                    else:
                        head[int(known / width) & mask] = low
                    if low >= 0:
                        ahead[low] = high
                else:
                    waiting += 1
                time[there], before[there] = t, here
                slot = int(t / width) & mask
                low = head[slot]
                after[there], ahead[there] = low, -1
                if low >= 0:
                    ahead[low] = there
                head[slot] = there
    state[0], state[1] = waiting, bucket


@kernel
def lengths(before: Numbers, time: FloatArray, goals: IntArray, cols: int, side_m: float) -> FloatArray:
    """Return the lengths of the ways to goals, m, summed up from their starts on; 0 where there is no way."""
    out = np.zeros(goals.shape[0])
    slants = np.empty(before.shape[0], dtype=np.bool_)
    diagonal = side_m * np.sqrt(2.0)
    for n in range(goals.shape[0]):
        if not np.isfinite(time[goals[n]]):
            continue
        count, at = 0, goals[n]
        while before[at] >= 0:
            gap = abs(at - before[at])
            slants[count] = gap != 1 and gap != cols
            count += 1
            at = before[at]
        for k in range(count - 1, -1, -1):
            out[n] += diagonal if slants[k] else side_m
    return out


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
def nearest_blocks(slow: Slowness, points: FloatArray, reach: float) -> IntArray:
    """Return :func:`nearest_block` of each of ``(n, 2)`` points (column, row)."""
    out = np.empty(points.shape[0], dtype=np.int64)
    for n in range(points.shape[0]):
        out[n] = nearest_block(slow, points[n, 0], points[n, 1], reach)
    return out


@kernel
def way_to(slow: Slowness, before: Numbers, time: FloatArray, goal: int, side_m: float) -> IntArray:
    """Return the blocks of the drive to a goal, the start first, pulled straight where that is free and no slower.

    All is in terms of the grid with its rim.
    """
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
def _straight_s(slow: Slowness, start: int, goal: int, side_m: float) -> float:
    """Return the time of a straight drive between two blocks, -1 where it leaves the passable blocks."""
    cols = slow.shape[1]
    y0, x0 = start // cols - 1, start % cols - 1
    dx, dy = goal % cols - 1 - x0, goal // cols - 1 - y0
    length = np.sqrt(float(dx * dx + dy * dy))
    pieces = int(2.0 * length) + 1
    total = 0.0
    for n in range(pieces):
        share = (n + 0.5) / pieces
        value = slow[1 + int(y0 + share * dy + 0.5), 1 + int(x0 + share * dx + 0.5)]
        if value <= 0:
            return -1.0
        total += value
    return float(total / pieces * length * side_m)
