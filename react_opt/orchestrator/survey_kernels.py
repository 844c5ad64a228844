"""Compiled parts of :mod:`react_opt.orchestrator.survey`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

Grid = NDArray[np.uint8]
Flags = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

OPEN, SOLID, HIDDEN, BLURRED = 0, 1, 2, 3
"""A block: some of it known free and nothing occupied; something occupied; hidden; unseen between rays."""


@kernel
def survey_blocks(cells: Grid, k: int) -> Grid:
    """Return what each block of ``k`` x ``k`` pixels is: OPEN, SOLID, HIDDEN or BLURRED.

    Hidden blocks lie in a 2 x 2 square of blocks of which nothing is known. The rays of a LiDAR diverge: single
    unknown blocks between them are no unexplored space.
    """
    rows, cols = (cells.shape[0] + k - 1) // k, (cells.shape[1] + k - 1) // k
    blocks = np.full((rows, cols), BLURRED, dtype=np.uint8)
    for r in range(cells.shape[0]):
        for c in range(cells.shape[1]):
            value = cells[r, c]
            if value == 1:
                blocks[r // k, c // k] = SOLID
            elif value == 0 and blocks[r // k, c // k] == BLURRED:
                blocks[r // k, c // k] = OPEN
    for r in range(rows - 1):
        for c in range(cols - 1):
            if (
                blocks[r, c] >= HIDDEN
                and blocks[r, c + 1] >= HIDDEN
                and blocks[r + 1, c] >= HIDDEN
                and blocks[r + 1, c + 1] >= HIDDEN
            ):
                blocks[r, c] = blocks[r, c + 1] = blocks[r + 1, c] = blocks[r + 1, c + 1] = HIDDEN
    return blocks


@kernel
def stamp_clearance(clear: FloatArray, occupied: IntArray, k: int, reach_px: float) -> None:
    """Lower the clearances (pixels, of block centres) around new occupied pixels, in place.

    Parameters
    ----------
    clear
        ``(rows, cols)`` of blocks of ``k`` x ``k`` pixels.
    occupied
        ``(n, 2)`` rows and columns of pixels.
    k, reach_px
        Pixels; clearances beyond the reach keep their value.
    """
    rows, cols = clear.shape
    reach = int(reach_px / k) + 1
    for n in range(occupied.shape[0]):
        row, col = occupied[n, 0], occupied[n, 1]
        for r in range(max(0, row // k - reach), min(rows, row // k + reach + 1)):
            y = (r + 0.5) * k
            dy = max(row - y, y - row - 1.0, 0.0)
            for c in range(max(0, col // k - reach), min(cols, col // k + reach + 1)):
                x = (c + 0.5) * k
                dx = max(col - x, x - col - 1.0, 0.0)
                gap = np.sqrt(dx * dx + dy * dy)
                if gap < clear[r, c]:
                    clear[r, c] = gap


@kernel
def coarse_blocks(
    blocks: Grid, clear: FloatArray, contact: float, m: int
) -> tuple[Flags, Flags, FloatArray, IntArray, IntArray, IntArray]:
    """Gather ``m`` x ``m`` blocks into coarse ones, for drive times.

    Returns
    -------
    known, may, clearance, border, hidden, best
        Whether a robot can stand there in known-free space, and whether it can if hidden space is free; the
        largest clearance where it can (pixels); number of frontier blocks (open ones beside hidden ones) and of
        hidden ones; and the block (flat index) of largest clearance, open ones first, -1 for none.
    """
    rows, cols = blocks.shape
    shape = ((rows + m - 1) // m, (cols + m - 1) // m)
    known, may = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    best_clear = np.zeros(shape)
    border, hidden = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    best = np.full(shape, -1, dtype=np.int64)
    for r in range(rows):
        for c in range(cols):
            value = blocks[r, c]
            if value == SOLID:
                continue
            a, b = r // m, c // m
            if value == HIDDEN:
                hidden[a, b] += 1
            elif value == OPEN and (
                (r > 0 and blocks[r - 1, c] == HIDDEN)
                or (r + 1 < rows and blocks[r + 1, c] == HIDDEN)
                or (c > 0 and blocks[r, c - 1] == HIDDEN)
                or (c + 1 < cols and blocks[r, c + 1] == HIDDEN)
            ):
                border[a, b] += 1
            if clear[r, c] < contact:
                continue
            may[a, b] = True
            if value == OPEN and not known[a, b]:
                known[a, b] = True
                best_clear[a, b] = 0.0
            if (value == OPEN or not known[a, b]) and clear[r, c] > best_clear[a, b]:
                best_clear[a, b] = clear[r, c]
                best[a, b] = r * cols + c
    return known, may, best_clear, border, hidden, best


@kernel
def drive_times(passable: Flags, slowness: FloatArray, row: int, col: int) -> FloatArray:
    """Return s from a block to every block over eight neighbours, infinite where there is no way.

    ``slowness`` is what crossing a block costs, s. A diagonal step needs one of the two blocks beside it. Dijkstra's
    search with a ring of buckets as wide as the cheapest crossing: no order within a bucket matters.
    """
    rows, cols = passable.shape
    cost = np.full((rows, cols), np.inf)
    if not passable[row, col]:
        return cost
    least, most, count = np.inf, 0.0, 0
    for r in range(rows):
        for c in range(cols):
            if passable[r, c]:
                least, most = min(least, slowness[r, c]), max(most, slowness[r, c])
                count += 1
    ring = int(1.5 * most / least) + 3
    head = np.full(ring, -1, dtype=np.int64)
    after = np.empty(count * 8 + 8, dtype=np.int64)
    item = np.empty(count * 8 + 8, dtype=np.int64)
    used, queued, turn = 1, 1, 0
    cost[row, col] = 0.0
    head[0], after[0], item[0] = 0, -1, row * cols + col
    done = np.zeros((rows, cols), dtype=np.bool_)
    while queued > 0:
        here = turn % ring
        while head[here] >= 0:
            at = head[here]
            head[here] = after[at]
            queued -= 1
            r, c = item[at] // cols, item[at] % cols
            if done[r, c]:
                continue
            done[r, c] = True
            for dr in range(-1, 2):
                for dc in range(-1, 2):
                    y, x = r + dr, c + dc
                    if not (0 <= y < rows and 0 <= x < cols) or not passable[y, x] or done[y, x]:
                        continue
                    if dr != 0 and dc != 0 and not (passable[r, x] or passable[y, c]):
                        continue
                    step = 0.7071067811865476 if dr != 0 and dc != 0 else 0.5
                    reached = cost[r, c] + step * (slowness[r, c] + slowness[y, x])
                    if reached < cost[y, x]:
                        cost[y, x] = reached
                        bucket = int(reached / least) % ring
                        after[used], item[used] = head[bucket], y * cols + x
                        head[bucket] = used
                        used += 1
                        queued += 1
        turn += 1
    return cost


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
    rows, cols = cost.shape
    blocks = places.copy()
    for k in range(places.shape[0]):
        r, c = places[k, 0], places[k, 1]
        if not np.isfinite(cost[r, c]):
            continue
        while cost[r, c] > near:
            best, y, x = cost[r, c], r, c
            for dr in range(-1, 2):
                for dc in range(-1, 2):
                    a, b = r + dr, c + dc
                    if 0 <= a < rows and 0 <= b < cols and cost[a, b] < best:
                        best, y, x = cost[a, b], a, b
            if y == r and x == c:
                break
            r, c = y, x
        blocks[k, 0], blocks[k, 1] = r, c
    return blocks


@kernel
def view_gain(blocks: Grid, x: float, y: float, reach: float, mean_free: float, rays: int) -> float:
    """Return the expected number of hidden blocks that a scan reveals, by polar integration along rays.

    Parameters
    ----------
    blocks
        As of :func:`survey_blocks`.
    x, y
        Block coordinates (column, row) of the scan.
    reach, mean_free
        Range, and mean length of a ray in hidden space before it meets something, blocks.
    rays
        How many.
    """
    rows, cols = blocks.shape
    total, turn = 0.0, 2.0 * np.pi / rays
    for k in range(rays):
        dx, dy = np.cos(k * turn), np.sin(k * turn)
        alive = 1.0
        d = 0.5
        while d < reach:
            c, r = int(np.floor(x + d * dx)), int(np.floor(y + d * dy))
            if not (0 <= r < rows and 0 <= c < cols) or blocks[r, c] == SOLID:
                break
            if blocks[r, c] == HIDDEN:
                total += alive * d * turn
                alive *= 1.0 - 1.0 / mean_free
            d += 1.0
    return total


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
