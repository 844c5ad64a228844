"""Unknown regions of a belief: labelled area by area, joined through unknown space, and where to see them from.

A region is a set of deep blocks (see :mod:`react_opt.orchestrator.belief_map`) of one area that hang together through
their sides. Only areas that a map update touched are labelled anew. Regions of neighbouring areas that touch are
joined: a region counts when its joined whole borders known free space somewhere, which is "connects through unknown
to known free space" in passages of at least two blocks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

IntArray = NDArray[np.int64]
Labels = NDArray[np.int32]
Grid16 = NDArray[np.int16]
Bools = NDArray[np.bool_]

SIZE, SUM_ROW, SUM_COL, FRONTIER, OLD = range(5)
"""Columns of :func:`label_window`: blocks, sums of their rows and columns, sides to free space, region before."""


@kernel
def free_block(known: Grid16, solid: Grid16, r: int, c: int) -> bool:
    """Tell whether a block is known free."""
    return bool(known[r, c] > 0 and solid[r, c] == 0)


@kernel
def label_window(
    deep: Bools, known: Grid16, solid: Grid16, labels: Labels, window: IntArray, first: int
) -> tuple[IntArray, int]:
    """Label the regions of one area anew, in place.

    Parameters
    ----------
    deep, known, solid
        The belief's blocks.
    labels
        Region of each block, -1 for none: those of the last time in, the new ones out.
    window
        First and one past the last row, then columns, of the area's blocks.
    first
        Number of the first new region; they count upward.

    Returns
    -------
    ndarray, int
        One row per region (columns above), and how many there are. ``OLD`` is the region before of which most of
        its blocks were, -1 for none.
    """
    r0, r1, c0, c1 = window[0], window[1], window[2], window[3]
    height, width = r1 - r0, c1 - c0
    old = labels[r0:r1, c0:c1].copy()
    labels[r0:r1, c0:c1] = -1
    stats = np.zeros((height * width // 4 + 2, 5), dtype=np.int64)
    stack = np.empty(height * width + 1, dtype=np.int64)
    members = np.empty(height * width + 1, dtype=np.int64)
    count = 0
    for r in range(r0, r1):
        for c in range(c0, c1):
            if not deep[r, c] or labels[r, c] >= 0:
                continue
            top, size = 1, 0
            stack[0] = (r - r0) * width + (c - c0)
            labels[r, c] = first + count
            while top > 0:
                top -= 1
                at = stack[top]
                members[size] = at
                size += 1
                u, v = r0 + at // width, c0 + at % width
                stats[count, SUM_ROW] += u
                stats[count, SUM_COL] += v
                for n in range(4):
                    p = u + (1 if n == 0 else -1 if n == 1 else 0)
                    q = v + (1 if n == 2 else -1 if n == 3 else 0)
                    if p < 0 or q < 0 or p >= deep.shape[0] or q >= deep.shape[1]:
                        continue
                    if free_block(known, solid, p, q):
                        stats[count, FRONTIER] += 1
                    if r0 <= p < r1 and c0 <= q < c1 and deep[p, q] and labels[p, q] < 0:
                        labels[p, q] = first + count
                        stack[top] = (p - r0) * width + (q - c0)
                        top += 1
            stats[count, SIZE] = size
            stats[count, OLD] = _most_common(old, members[:size], width)
            count += 1
    return stats[:count].copy(), count


@kernel
def missed_pixels(deep: Bools, known: Grid16, solid: Grid16, window: IntArray, per_block: int) -> int:
    """Count the unknown pixels of an area that lie between rays in known free space: in no region, but unknown.

    Those of blocks that are known in part and hold nothing solid, and whole blocks that are not deep with known free
    ones on at least two sides. (A block missing in a wall's face has one on one side only.)
    """
    rows, cols = deep.shape
    count = 0
    for r in range(window[0], window[1]):
        for c in range(window[2], window[3]):
            if deep[r, c] or solid[r, c] > 0:
                continue
            if known[r, c] > 0:
                count += per_block - known[r, c]
                continue
            sides = 0
            for n in range(4):
                p = r + (1 if n == 0 else -1 if n == 1 else 0)
                q = c + (1 if n == 2 else -1 if n == 3 else 0)
                if 0 <= p < rows and 0 <= q < cols and free_block(known, solid, p, q):
                    sides += 1
            if sides >= 2:
                count += per_block
    return count


@kernel
def _most_common(old: Labels, members: IntArray, width: int) -> int:
    """Return the old region of the strict majority of what had one (Boyer-Moore), else that of the last survivor."""
    best, votes = -1, 0
    for n in range(members.shape[0]):
        value = old[members[n] // width, members[n] % width]
        if value < 0:
            continue
        if votes == 0:
            best, votes = value, 1
        elif value == best:
            votes += 1
        else:
            votes -= 1
    return best


@kernel
def touching(labels: Labels, row_lines: IntArray, col_lines: IntArray) -> IntArray:
    """Return ``(n, 2)`` pairs of regions that touch across the given lines between areas (pairs may repeat)."""
    rows, cols = labels.shape
    pairs = np.empty((row_lines.shape[0] * cols + col_lines.shape[0] * rows, 2), dtype=np.int64)
    count = 0
    for n in range(row_lines.shape[0]):
        r, last_a, last_b = row_lines[n], -1, -1
        if not 0 < r < rows:
            continue
        for c in range(cols):
            a, b = labels[r - 1, c], labels[r, c]
            if a >= 0 and b >= 0 and a != b and (a != last_a or b != last_b):
                pairs[count, 0], pairs[count, 1] = a, b
                count, last_a, last_b = count + 1, a, b
    for n in range(col_lines.shape[0]):
        c, last_a, last_b = col_lines[n], -1, -1
        if not 0 < c < cols:
            continue
        for r in range(rows):
            a, b = labels[r, c - 1], labels[r, c]
            if a >= 0 and b >= 0 and a != b and (a != last_a or b != last_b):
                pairs[count, 0], pairs[count, 1] = a, b
                count, last_a, last_b = count + 1, a, b
    return pairs[:count].copy()


@kernel
def joined_to_open(pairs: IntArray, open_: Bools) -> Bools:
    """Return the regions that hang together with an open one; rows of ``pairs`` are regions that touch."""
    root = np.arange(open_.shape[0])
    for n in range(pairs.shape[0]):
        a, b = pairs[n, 0], pairs[n, 1]
        while root[a] != a:
            root[a] = root[root[a]]
            a = root[a]
        while root[b] != b:
            root[b] = root[root[b]]
            b = root[b]
        root[max(a, b)] = min(a, b)  # so that no region stands before its root
    good = np.zeros(open_.shape[0], dtype=np.bool_)
    for n in range(open_.shape[0]):
        root[n] = root[root[n]]
        good[root[n]] |= open_[n]
    return good[root]


@kernel
def flood(passable: Bools, starts: IntArray) -> Bools:
    """Return the blocks that are reached from some through sides of passable ones (starts count in any case)."""
    rows, cols = passable.shape
    wide = cols + 2
    closed = np.ones((rows + 2) * wide, dtype=np.bool_)  # with a rim; what has been reached is closed too
    for r in range(rows):
        for c in range(cols):
            closed[(r + 1) * wide + c + 1] = not passable[r, c]
    reached = np.zeros((rows + 2) * wide, dtype=np.bool_)
    stack = np.empty(passable.size + starts.shape[0], dtype=np.int32)
    top = 0
    for n in range(starts.shape[0]):
        at = starts[n] + 2 * (starts[n] // cols) + wide + 1
        if not reached[at]:
            closed[at] = reached[at] = True
            stack[top] = at
            top += 1
    while top > 0:
        top -= 1
        at = stack[top]
        for step in (1, -1, wide, -wide):
            there = at + step
            if not closed[there]:
                closed[there] = reached[there] = True
                stack[top] = there
                top += 1
    return reached.reshape(rows + 2, wide)[1:-1, 1:-1].copy()


@kernel
def sight(open_: Bools, r0: int, c0: int, r1: int, c1: int) -> bool:
    """Tell whether only open blocks lie between the centres of two blocks (their own blocks do not count)."""
    dr, dc = r1 - r0, c1 - c0
    pieces = 2 * max(abs(dr), abs(dc)) + 1
    for n in range(1, pieces):
        r = int(r0 + dr * n / pieces + 0.5)
        c = int(c0 + dc * n / pieces + 0.5)
        if not open_[r, c] and not ((r == r0 and c == c0) or (r == r1 and c == c1)):
            return False
    return True


@kernel
def stand_for(
    labels: Labels, region: int, window: IntArray, start: int, open_: Bools, reached: Bools, range_blocks: float
) -> int:
    """Return the reached block from which a region is best looked at, -1 for none.

    A breadth-first search spreads from ``start``, the region's block nearest to its centroid, through open blocks
    (known free or deep) until it meets a block that a robot reaches and from which the part of the region that the
    search came through is in sight: the centroid made accessible.
    """
    rows, cols = labels.shape
    reach = int(range_blocks)
    top, bottom = max(0, window[0] - reach), min(rows, window[1] + reach)
    left, right = max(0, window[2] - reach), min(cols, window[3] + reach)
    height, width = bottom - top, right - left
    start = (start // cols - top) * width + (start % cols - left)
    source = np.full(height * width, -1, dtype=np.int32)
    queue = np.empty(height * width, dtype=np.int32)
    source[start], queue[0] = start, start
    head, tail = 0, 1
    while head < tail:
        at = queue[head]
        head += 1
        r, c = top + at // width, left + at % width
        if labels[r, c] == region:
            source[at] = at
        sr, sc = top + source[at] // width, left + source[at] % width
        if (r - sr) ** 2 + (c - sc) ** 2 > range_blocks * range_blocks:
            continue
        if reached[r, c] and sight(open_, r, c, sr, sc):
            return int(r * cols + c)
        for n in range(4):
            p = r + (1 if n == 0 else -1 if n == 1 else 0)
            q = c + (1 if n == 2 else -1 if n == 3 else 0)
            if p < top or q < left or p >= bottom or q >= right:
                continue
            there = (p - top) * width + (q - left)
            if source[there] < 0 and open_[p, q]:
                source[there] = source[at]
                queue[tail] = there
                tail += 1
    return -1


@kernel
def unknown_around(labels: Labels, counted: Bools, row: float, col: float, reach: float, own: int) -> int:
    """Count the blocks of counted regions but one within a distance (every second row and column is looked at)."""
    rows, cols = labels.shape
    count = 0
    for r in range(max(0, int(row - reach)), min(rows, int(row + reach) + 1), 2):
        for c in range(max(0, int(col - reach)), min(cols, int(col + reach) + 1), 2):
            label = labels[r, c]
            if label >= 0 and label != own and counted[label] and (r - row) ** 2 + (c - col) ** 2 <= reach * reach:
                count += 4
    return count


@kernel
def look_at(
    labels: Labels,
    regions: IntArray,
    windows: IntArray,
    centres: NDArray[np.float64],
    bordered: Bools,
    open_: Bools,
    reached: Bools,
    counted: Bools,
    range_blocks: float,
) -> tuple[IntArray, IntArray]:
    """Return for each of some regions :func:`stand_for` it and :func:`unknown_around` it.

    Parameters
    ----------
    regions, windows, centres, bordered
        Their numbers, the windows of their areas, their centroids (row, column), and whether they border free space
        (others are not looked at from anywhere).
    labels, open_, reached, counted, range_blocks
        As there.
    """
    stands, around = np.full(regions.shape[0], -1, dtype=np.int64), np.empty(regions.shape[0], dtype=np.int64)
    middles = _middles(labels, regions, windows, centres)
    for n in range(regions.shape[0]):
        if bordered[n]:
            stands[n] = stand_for(labels, regions[n], windows[n], middles[n], open_, reached, range_blocks)
        around[n] = unknown_around(labels, counted, centres[n, 0], centres[n, 1], range_blocks, regions[n])
    return stands, around


@kernel
def _middles(labels: Labels, regions: IntArray, windows: IntArray, centres: NDArray[np.float64]) -> IntArray:
    """Return of each region the block nearest to its centroid; those of one area stand together."""
    middles = np.full(regions.shape[0], -1, dtype=np.int64)
    gaps = np.full(regions.shape[0], np.inf)
    first = 0
    while first < regions.shape[0]:
        window, last = windows[first], first + 1
        while last < regions.shape[0] and (windows[last] == window).all():
            last += 1
        low = regions[first:last].min()
        place = np.full(regions[first:last].max() - low + 1, -1, dtype=np.int64)
        for n in range(first, last):
            place[regions[n] - low] = n
        for r in range(window[0], window[1]):
            for c in range(window[2], window[3]):
                at = labels[r, c] - low
                if at < 0 or at >= place.shape[0] or place[at] < 0:
                    continue
                n = place[at]
                gap = (r - centres[n, 0]) ** 2 + (c - centres[n, 1]) ** 2
                if gap < gaps[n]:
                    gaps[n], middles[n] = gap, r * labels.shape[1] + c
        first = last
    return middles


@kernel
def provably_unseen(
    labels: Labels, counted: Bools, window: IntArray, solid: Grid16, reached: Bools, range_blocks: float
) -> bool:
    """Tell whether no counted unknown block of an area can be seen from any reached block.

    Each looks around in 64 directions as far as the LiDAR's range, through everything that is not known to be solid.
    """
    rows, cols = labels.shape
    for r in range(window[0], window[1]):
        for c in range(window[2], window[3]):
            if labels[r, c] >= 0 and reached[r, c] and counted[labels[r, c]]:
                return False
    for r in range(window[0], window[1]):
        for c in range(window[2], window[3]):
            if labels[r, c] < 0 or not counted[labels[r, c]]:
                continue
            for n in range(64):
                angle = n * np.pi / 32.0
                dr, dc = np.sin(angle), np.cos(angle)
                for step in range(1, int(range_blocks) + 1):
                    u, v = int(r + 0.5 + step * dr), int(c + 0.5 + step * dc)
                    if u < 0 or v < 0 or u >= rows or v >= cols or solid[u, v] > 0:
                        break
                    if reached[u, v]:
                        return False
    return True
