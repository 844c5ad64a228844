"""Compiled parts of :mod:`react_opt.orchestrator.survey` that are about driving over its blocks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

Grid = NDArray[np.uint8]
Flags = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@kernel
def nearest_passable(passable: Flags, row: int, col: int, reach: int) -> tuple[int, int]:
    """Return the passable block nearest to one, within a number of rows and columns, (-1, -1) for none."""
    best, r_best, c_best = np.inf, -1, -1
    for r in range(max(0, row - reach), min(passable.shape[0], row + reach + 1)):
        for c in range(max(0, col - reach), min(passable.shape[1], col + reach + 1)):
            gap = (r - row) ** 2 + (c - col) ** 2
            if gap < best and passable[r, c]:
                best, r_best, c_best = gap, r, c
    return r_best, c_best


class Ground(NamedTuple):
    """What drives lead over, with a rim of one block around."""

    slow: FloatArray
    """What crossing a block costs, s; 0 in the rim and where nothing can pass."""
    moves: Grid
    """Which of :data:`MOVES` lead on from a block, one bit each."""
    least: float
    most: float
    """The smallest and the largest cost where something can pass."""


MOVES = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
"""Rows and columns from a block to those around it."""


@kernel
def ground_of(passable: Flags, slowness: FloatArray) -> Ground:
    """Return what drives lead over. A diagonal step needs one of the two blocks beside it."""
    rows, cols = passable.shape
    slow, moves = np.zeros((rows + 2, cols + 2)), np.zeros((rows + 2, cols + 2), dtype=np.uint8)
    free = np.zeros((rows + 2, cols + 2), dtype=np.uint8)
    least, most = np.inf, 0.0
    for r in range(rows):
        for c in range(cols):
            if passable[r, c]:
                slow[r + 1, c + 1], free[r + 1, c + 1] = slowness[r, c], 1
                least, most = min(least, slowness[r, c]), max(most, slowness[r, c])
    for r in range(1, rows + 1):
        high, same, low, out = free[r - 1], free[r], free[r + 1], moves[r]
        for c in range(1, cols + 1):
            left, right = same[c - 1], same[c + 1]
            out[c] = (
                ((high[c] | left) & high[c - 1])
                | (high[c] << 1)
                | (((high[c] | right) & high[c + 1]) << 2)
                | (left << 3)
                | (right << 4)
                | (((low[c] | left) & low[c - 1]) << 5)
                | (low[c] << 6)
                | (((low[c] | right) & low[c + 1]) << 7)
            )
    return Ground(slow, moves, least, most)


@kernel
def drive_times(ground: Ground, starts: IntArray) -> FloatArray:
    """Return s to every block from the start that is nearest, over eight neighbours, infinite where there is no way.

    Dijkstra's search with a ring of buckets as wide as the cheapest crossing: no order within a bucket matters.

    Parameters
    ----------
    ground
        What the drives lead over.
    starts
        ``(n, 2)`` rows and columns, without the rim.
    """
    slow, moves = ground.slow.reshape(-1), ground.moves.reshape(-1)
    cols, size = ground.slow.shape[1], ground.slow.size
    steps, shares = np.empty(8, dtype=np.int64), np.empty(8)
    for k in range(8):
        steps[k] = MOVES[k][0] * cols + MOVES[k][1]
        shares[k] = 0.7071067811865476 if MOVES[k][0] != 0 and MOVES[k][1] != 0 else 0.5
    cost = np.full(size, np.inf)
    done = np.zeros(size, dtype=np.bool_)
    mask = 1
    while mask < int(1.5 * ground.most / ground.least) + 3:
        mask = 2 * mask + 1
    head = np.full(mask + 1, -1, dtype=np.int32)  # of lists of waiting blocks, linked both ways
    after, ahead = np.empty(size, dtype=np.int32), np.empty(size, dtype=np.int32)
    waiting, turn = 0, 0
    for n in range(starts.shape[0]):
        at = (starts[n, 0] + 1) * cols + starts[n, 1] + 1
        if slow[at] > 0 and cost[at] > 0:
            cost[at], after[at], ahead[at] = 0.0, head[0], -1
            if head[0] >= 0:
                ahead[head[0]] = at
            head[0] = at
            waiting += 1
    while waiting > 0:
        here = head[turn & mask]
        if here < 0:
            turn += 1
            continue
        low = after[here]
        head[turn & mask] = low
        if low >= 0:
            ahead[low] = -1
        waiting -= 1
        done[here] = True
        for k in range(8):
            if not (moves[here] >> k) & 1:
                continue
            there = here + steps[k]
            reached = cost[here] + shares[k] * (slow[here] + slow[there])
            known = cost[there]
            if reached >= known or done[there]:
                continue
            if known < np.inf:  # take it out of its bucket
                low, high = after[there], ahead[there]
                if high >= 0:
                    after[high] = low
                else:
                    head[int(known / ground.least) & mask] = low
                if low >= 0:
                    ahead[low] = high
            else:
                waiting += 1
            cost[there] = reached
            slot = int(reached / ground.least) & mask
            low = head[slot]
            after[there], ahead[there] = low, -1
            if low >= 0:
                ahead[low] = there
            head[slot] = there
    return cost.reshape(ground.slow.shape)[1:-1, 1:-1].copy()


@kernel
def step_back(cost: FloatArray, row: int, col: int) -> tuple[int, int]:
    """Return the block from which the quickest way leads into one, by :func:`drive_times`; itself at a start."""
    best, y, x = cost[row, col], row, col
    for r in range(max(0, row - 1), min(cost.shape[0], row + 2)):
        for c in range(max(0, col - 1), min(cost.shape[1], col + 2)):
            if cost[r, c] < best:
                best, y, x = cost[r, c], r, c
    return y, x


@kernel
def ways_out(cost: FloatArray, places: NDArray[np.int64], near: float) -> NDArray[np.int64]:
    """Return by which block the quickest way to each of some places leaves the block that a field starts from.

    Parameters
    ----------
    cost
        As of :func:`drive_times`.
    places
        ``(K, 2)`` rows and columns.
    near
        The ways are followed back to the first block that is so near, s.

    Returns
    -------
    blocks
        ``(K, 2)`` rows and columns; the place itself where it is that near or has no way.
    """
    blocks = places.copy()
    for k in range(places.shape[0]):
        r, c = places[k, 0], places[k, 1]
        if not np.isfinite(cost[r, c]):
            continue
        while cost[r, c] > near:
            y, x = step_back(cost, r, c)
            if y == r and x == c:
                break
            r, c = y, x
        blocks[k, 0], blocks[k, 1] = r, c
    return blocks


@kernel
def way_is_free(clear: FloatArray, way: FloatArray, contact: float) -> bool:
    """Tell whether nothing known blocks a way, ``(n, 2)`` of (column, row) in blocks, sampled every half block."""
    rows, cols = clear.shape
    for n in range(1, way.shape[0]):
        dx, dy = way[n, 0] - way[n - 1, 0], way[n, 1] - way[n - 1, 1]
        pieces = int(2.0 * np.hypot(dx, dy)) + 1
        for p in range(1, pieces + 1):
            c, r = int(way[n - 1, 0] + dx * p / pieces), int(way[n - 1, 1] + dy * p / pieces)
            if 0 <= r < rows and 0 <= c < cols and clear[r, c] < contact:
                return False
    return True
