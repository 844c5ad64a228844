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
    height, width = cells.shape
    rows, cols = (height + k - 1) // k, (width + k - 1) // k
    blocks = np.empty((rows, cols), dtype=np.uint8)
    blank = np.empty((rows, cols), dtype=np.bool_)
    free, solid = np.empty(cols * k, dtype=np.bool_), np.empty(cols * k, dtype=np.bool_)
    for r in range(rows):
        free[:] = False
        solid[:] = False
        for y in range(r * k, min((r + 1) * k, height)):
            row = cells[y]
            for x in range(width):
                free[x] |= row[x] == 0
                solid[x] |= row[x] == 1
        for c in range(cols):
            some_free, some_solid = False, False
            for x in range(c * k, (c + 1) * k):
                some_free |= free[x]
                some_solid |= solid[x]
            blocks[r, c] = SOLID if some_solid else OPEN if some_free else BLURRED
            blank[r, c] = not (some_solid or some_free)
    square = np.zeros((rows + 1, cols + 1), dtype=np.bool_)  # of blank blocks around each corner
    for r in range(rows - 1):
        for c in range(cols - 1):
            square[r + 1, c + 1] = blank[r, c] & blank[r, c + 1] & blank[r + 1, c] & blank[r + 1, c + 1]
    for r in range(rows):
        for c in range(cols):
            if square[r, c] | square[r, c + 1] | square[r + 1, c] | square[r + 1, c + 1]:
                blocks[r, c] = HIDDEN
    return blocks


@kernel
def count_solids(blocks: Grid) -> NDArray[np.int32]:
    """Return ``(rows + 1, cols + 1)`` how many solid blocks there are in all rows and columns before each."""
    rows, cols = blocks.shape
    solids = np.zeros((rows + 1, cols + 1), dtype=np.int32)
    for r in range(rows):
        row = 0
        for c in range(cols):
            row += blocks[r, c] == SOLID
            solids[r + 1, c + 1] = solids[r, c + 1] + row
    return solids


@kernel
def newly_solid(before: Grid, now: Grid) -> tuple[IntArray, bool]:
    """Return ``(n, 2)`` rows and columns of the pixels that have become occupied, and whether none ceased to be."""
    found = np.empty((now.size, 2), dtype=np.int64)
    count, kept = 0, True
    for r in range(now.shape[0]):
        for c in range(now.shape[1]):
            if now[r, c] == 1 and before[r, c] != 1:
                found[count, 0], found[count, 1] = r, c
                count += 1
            elif now[r, c] != 1 and before[r, c] == 1:
                kept = False
    return found[:count].copy(), kept


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
    for a in range(shape[0]):
        for b in range(shape[1]):
            for r in range(a * m, min((a + 1) * m, rows)):
                for c in range(b * m, min((b + 1) * m, cols)):
                    value = blocks[r, c]
                    if value == SOLID:
                        continue
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
def cut(
    blocks: IntArray,
    begin: IntArray,
    border: IntArray,
    shortest_m: float,
    widest_m: float,
    block_m: float,
    coarse_m: float,
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Cut pieces of the frontier that are too wide in two across their longer side, until none is.

    Parameters
    ----------
    blocks, begin
        ``(n, 2)`` rows and columns of coarse blocks, piece after piece, and where each begins, with the end of the
        last; the blocks are put in the order of the pieces returned, those of pieces left out among them.
    border
        ``(rows, cols)`` number of frontier blocks in each coarse block.
    shortest_m, widest_m
        Pieces with a shorter border are left out; the largest extent of a piece, m.
    block_m, coarse_m
        Sides of a block and of a coarse one, m.

    Returns
    -------
    first, last, middle, length
        Per piece where its blocks begin and end in ``blocks``, which of them is nearest to their mean, and how many
        frontier blocks it has.
    """
    size = blocks.shape[0]
    first, last = np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64)
    middle, length = np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64)
    ends, apart = np.empty(size + 1, dtype=np.int64), np.empty((size, 2), dtype=np.int64)
    count = 0
    for piece in range(begin.shape[0] - 1):
        low, waiting = begin[piece], 1
        ends[0] = begin[piece + 1]  # of the pieces still to be looked at, the next one last
        while waiting > 0:
            high = ends[waiting - 1]
            total, sum_row, sum_col = 0, 0, 0
            r0, r1, c0, c1 = blocks[low, 0], blocks[low, 0], blocks[low, 1], blocks[low, 1]
            for n in range(low, high):
                r, c = blocks[n, 0], blocks[n, 1]
                total, sum_row, sum_col = total + border[r, c], sum_row + r, sum_col + c
                r0, r1, c0, c1 = min(r0, r), max(r1, r), min(c0, c), max(c1, c)
            axis = 0 if r1 - r0 >= c1 - c0 else 1
            extent = max(r1 - r0, c1 - c0)
            if total * block_m >= shortest_m and extent * coarse_m > widest_m:
                edge = (r0 if axis == 0 else c0) + extent // 2
                kept, moved = low, 0
                for n in range(low, high):
                    if blocks[n, axis] <= edge:
                        blocks[kept] = blocks[n]
                        kept += 1
                    else:
                        apart[moved] = blocks[n]
                        moved += 1
                blocks[kept:high] = apart[:moved]
                ends[waiting] = kept
                waiting += 1
                continue
            if total * block_m >= shortest_m:
                best, at = np.inf, low
                for n in range(low, high):
                    dr, dc = blocks[n, 0] - sum_row / (high - low), blocks[n, 1] - sum_col / (high - low)
                    if dr * dr + dc * dc < best:
                        best, at = dr * dr + dc * dc, n
                first[count], last[count], middle[count], length[count] = low, high, at, total
                count += 1
            low = high
            waiting -= 1
    return first[:count], last[:count], middle[:count], length[:count]


@kernel
def sight_codes(blocks: Grid, m: int) -> Grid:
    """Return what ``m`` x ``m`` blocks are together: SOLID where half of them are, HIDDEN where any is, else OPEN."""
    rows, cols = blocks.shape
    out = np.zeros(((rows + m - 1) // m, (cols + m - 1) // m), dtype=np.uint8)
    for a in range(out.shape[0]):
        for b in range(out.shape[1]):
            solid, hidden = 0, 0
            for r in range(a * m, min((a + 1) * m, rows)):
                for c in range(b * m, min((b + 1) * m, cols)):
                    solid += blocks[r, c] == SOLID
                    hidden += blocks[r, c] == HIDDEN
            out[a, b] = SOLID if 2 * solid >= m * m else HIDDEN if hidden > 0 else OPEN
    return out
