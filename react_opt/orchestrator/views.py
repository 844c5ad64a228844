"""Where to look from: lines of sight over the blocks of a survey, hidden ones taken to be clear."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.orchestrator.survey_drives import nearest_passable
from react_opt.orchestrator.survey_kernels import SOLID

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Grid = NDArray[np.uint8]
Counts = NDArray[np.int32]
Flags = NDArray[np.bool_]

ENOUGH = 0.75
"""A place that sees this share of what the best place sees will do, if it is nearer."""
NEAREST_BLOCKS = 8
"""The nearest place of all is looked for so many coarse blocks up and down."""


@kernel
def best_view(
    blocks: Grid,
    solids: Counts,
    time_s: FloatArray,
    may_stand: Flags,
    row: float,
    col: float,
    offsets: FloatArray,
    targets: IntArray,
    coarse: int,
    reach: float,
) -> tuple[int, int, int]:
    """Return the coarse block, soonest to be reached, that sees enough of some others, and how many it sees (0: none).

    Parameters
    ----------
    blocks, solids
        What there is, and how many solid ones there are before each, as of ``survey_blocks`` and ``count_solids`` in
        :mod:`react_opt.orchestrator.survey_kernels`.
    time_s, may_stand
        ``(rows, cols)`` s to each coarse block, and whether it is a place to look from (all those can be reached).
    row, col, offsets
        A middle, and the places around it that are tried, coarse blocks; the place nearest to it is tried too.
    targets, coarse, reach
        As of :func:`count_seen`.
    """
    places = np.empty((offsets.shape[0] + 1, 2), dtype=np.int64)
    count = 0
    for n in range(offsets.shape[0]):
        r, c = int(row + offsets[n, 0]), int(col + offsets[n, 1])
        if 0 <= r < time_s.shape[0] and 0 <= c < time_s.shape[1] and may_stand[r, c]:
            count = _with_place(places, count, r, c)
    r, c = nearest_passable(may_stand, int(row), int(col), NEAREST_BLOCKS)
    if r >= 0:
        count = _with_place(places, count, r, c)
    seen = np.zeros(count, dtype=np.int64)
    most, soonest = 0, np.inf
    for n in range(count):
        time = time_s[places[n, 0], places[n, 1]]
        if most == targets.shape[0] and time >= soonest:
            continue  # one that sees all will do, and is there sooner
        seen[n] = count_seen(blocks, solids, places[n, 0], places[n, 1], targets, coarse, reach, ENOUGH * most)
        if seen[n] > most:
            most, soonest = seen[n], np.inf
            for k in range(n + 1):
                if seen[k] >= ENOUGH * most:
                    soonest = min(soonest, time_s[places[k, 0], places[k, 1]])
        elif seen[n] >= ENOUGH * most:
            soonest = min(soonest, time)
    for n in range(count):
        if most > 0 and seen[n] >= ENOUGH * most and time_s[places[n, 0], places[n, 1]] == soonest:
            return places[n, 0], places[n, 1], seen[n]
    return -1, -1, 0


@kernel
def _with_place(places: IntArray, count: int, r: int, c: int) -> int:
    """Add a place, unless it is there; return how many there are."""
    for n in range(count):
        if places[n, 0] == r and places[n, 1] == c:
            return count
    places[count, 0], places[count, 1] = r, c
    return count + 1


@kernel
def count_seen(
    blocks: Grid, solids: Counts, row: int, col: int, targets: IntArray, coarse: int, reach: float, least: float
) -> int:
    """Return how many of some coarse blocks are in line of sight of one, hidden blocks being clear.

    A line is looked at in as many steps as it is blocks long.

    Parameters
    ----------
    blocks, solids
        What there is, as of :func:`best_view`.
    row, col, targets
        The coarse block to look from, and ``(n, 2)`` rows and columns of those to look at.
    coarse
        Blocks per side of a coarse one; even, so that lines join corners of blocks and whole numbers do.
    reach
        Range, blocks.
    least
        Fewer than this are as good as none: the count may end as soon as they cannot be reached.
    """
    rows, cols = blocks.shape
    flat = blocks.reshape(-1)
    # the middle of a coarse block at the far edges of the map may lie beyond the last block
    y0, x0 = min(row * coarse + coarse // 2, rows - 1), min(col * coarse + coarse // 2, cols - 1)
    seen = 0
    for k in range(targets.shape[0]):
        if seen + targets.shape[0] - k < least:
            break
        y1 = min(targets[k, 0] * coarse + coarse // 2, rows - 1)
        x1 = min(targets[k, 1] * coarse + coarse // 2, cols - 1)
        dy, dx = y1 - y0, x1 - x0
        gap = np.sqrt(float(dx * dx + dy * dy))
        if gap > reach:
            continue
        low, high, left, right = min(y0, y1), max(y0, y1) + 1, min(x0, x1), max(x0, x1) + 1
        if solids[high, right] - solids[low, right] - solids[high, left] + solids[low, left] == 0:
            seen += 1  # there is nothing solid anywhere between them
            continue
        pieces = int(gap) + 1
        # what a step leaves of a whole block is carried over, in pieces; backwards, blocks end at their other side
        step_y, step_x = cols if dy > 0 else -cols, 1 if dx > 0 else -1
        over_y, over_x = 0 if dy > 0 else pieces - 1, 0 if dx > 0 else pieces - 1
        dy, dx = abs(dy), abs(dx)
        at = y0 * cols + x0
        clear = True
        for _ in range(1, pieces):
            over_y += dy
            over_x += dx
            down, aside = over_y >= pieces, over_x >= pieces
            over_y -= pieces * down
            over_x -= pieces * aside
            at += step_y * down + step_x * aside
            if flat[at] == SOLID:
                clear = False
                break
        if clear:
            seen += 1
    return seen
