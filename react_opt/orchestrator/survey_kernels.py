"""Compiled parts of :mod:`react_opt.orchestrator.survey`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

Grid = NDArray[np.uint8]
Flags = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@kernel
def stamp_clearance(square: NDArray[np.int32], occupied: IntArray, reach: int) -> None:
    """Lower the squared distances (pixels, centre to centre) to the nearest occupied pixel around new ones.

    Parameters
    ----------
    square
        ``(rows, cols)``, changed in place; pixels further than ``reach`` keep their value.
    occupied
        ``(k, 2)`` rows and columns of the new occupied pixels.
    reach
        Pixels.
    """
    rows, cols = square.shape
    for n in range(occupied.shape[0]):
        r0, c0 = occupied[n, 0], occupied[n, 1]
        for r in range(max(0, r0 - reach), min(rows, r0 + reach + 1)):
            for c in range(max(0, c0 - reach), min(cols, c0 + reach + 1)):
                d = (r - r0) ** 2 + (c - c0) ** 2
                if d < square[r, c]:
                    square[r, c] = d


@kernel
def block_sums(
    cells: Grid, square: NDArray[np.int32], contact: float, block: int
) -> tuple[Flags, Flags, FloatArray, IntArray, IntArray, IntArray]:
    """Return per block: drivable and known, drivable if unknown is free, clearance, unknown, border, best pixel.

    The clearance (pixels) and the best pixel (flat index, -1 for none) are those of the drivable pixel with most
    clearance, known ones first. Unknown and border count pixels; a border pixel is a free one with an unknown
    pixel beside it.
    """
    rows, cols = cells.shape
    shape = ((rows + block - 1) // block, (cols + block - 1) // block)
    known, may = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    clear = np.zeros(shape)
    unknown, border = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    pixel = np.full(shape, -1, dtype=np.int64)
    for r in range(rows):
        for c in range(cols):
            value = cells[r, c]
            if value == 1:
                continue
            a, b = r // block, c // block
            if value == 2:
                unknown[a, b] += 1
            elif (
                (r > 0 and cells[r - 1, c] == 2)
                or (r + 1 < rows and cells[r + 1, c] == 2)
                or (c > 0 and cells[r, c - 1] == 2)
                or (c + 1 < cols and cells[r, c + 1] == 2)
            ):
                border[a, b] += 1
            d = float(square[r, c])
            if d <= contact:
                continue
            may[a, b] = True
            if value == 0 and not known[a, b]:
                known[a, b] = True
                clear[a, b] = 0.0
            if (value == 0 or not known[a, b]) and d > clear[a, b]:
                clear[a, b] = d
                pixel[a, b] = r * cols + c
    return known, may, np.sqrt(clear), unknown, border, pixel


@kernel
def drive_times(passable: Flags, slowness: FloatArray, row: int, col: int) -> FloatArray:
    """Return s from a block to every block over eight neighbours, infinite where there is no way.

    ``slowness`` is what crossing a block costs, s. A diagonal step needs one of the two blocks beside it. The queue
    is a ring of buckets a quarter of the cheapest crossing wide: answers are exact to that width.
    """
    rows, cols = passable.shape
    cost = np.full((rows, cols), np.inf)
    least = np.inf
    most = 0.0
    for r in range(rows):
        for c in range(cols):
            if passable[r, c]:
                least, most = min(least, slowness[r, c]), max(most, slowness[r, c])
    if not passable[row, col]:
        return cost
    width = least
    ring = int(1.5 * most / width) + 3
    cap = rows * cols * 8 + 8
    head = np.full(ring, -1, dtype=np.int64)
    after = np.empty(cap, dtype=np.int64)
    item = np.empty(cap, dtype=np.int64)
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
                    if dr == 0 and dc == 0:
                        continue
                    y, x = r + dr, c + dc
                    if not (0 <= y < rows and 0 <= x < cols) or not passable[y, x]:
                        continue
                    if dr != 0 and dc != 0 and not (passable[r, x] or passable[y, c]):
                        continue
                    step = 1.4142135623730951 if dr != 0 and dc != 0 else 1.0
                    reached = cost[r, c] + step * 0.5 * (slowness[r, c] + slowness[y, x])
                    if reached < cost[y, x]:
                        cost[y, x] = reached
                        bucket = int(reached / width) % ring
                        after[used], item[used] = head[bucket], y * cols + x
                        head[bucket] = used
                        used += 1
                        queued += 1
        turn += 1
    return cost


@kernel
def view_gain(cells: Grid, x: float, y: float, reach: float, mean_free: float, rays: int) -> float:
    """Return the expected number of unknown pixels that a scan reveals, by polar integration along rays.

    Parameters
    ----------
    cells
        ``(rows, cols)`` of 0 free, 1 occupied, 2 unknown.
    x, y
        Pixel coordinates (column, row) of the scan.
    reach, mean_free
        Range, and mean length of a ray in unknown space before it meets something, pixels.
    rays
        How many.
    """
    rows, cols = cells.shape
    total, turn = 0.0, 2.0 * np.pi / rays
    for k in range(rays):
        dx, dy = np.cos(k * turn), np.sin(k * turn)
        alive = 1.0
        d = 0.5
        while d < reach:
            c, r = int(np.floor(x + d * dx)), int(np.floor(y + d * dy))
            if not (0 <= r < rows and 0 <= c < cols) or cells[r, c] == 1:
                break
            if cells[r, c] == 2:
                total += alive * d * turn
                alive *= 1.0 - 1.0 / mean_free
            d += 1.0
    return total
