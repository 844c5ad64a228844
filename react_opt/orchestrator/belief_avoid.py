"""Ways around other robots, and places off another robot's way: on the same blocks and by the same speed law."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.geometry.occupancy import FloatArray
from react_opt.kernels import kernel

SLOWER = 4.0
"""Blocks near another robot's way are entered, but count as so many times slower."""


@kernel
def without_discs(slow: NDArray[np.float32], discs: FloatArray, factor: float) -> NDArray[np.float32]:
    """Return slowness with discs cut out (factor 0) or made slower; rows of ``discs`` are x, y, radius in blocks."""
    rows, cols = slow.shape
    out = slow.copy()
    hit = np.zeros(slow.shape, dtype=np.bool_)
    for n in range(discs.shape[0]):
        x, y, radius = discs[n, 0], discs[n, 1], discs[n, 2]
        for r in range(max(0, int(y - radius) - 1), min(rows, int(y + radius) + 2)):
            for c in range(max(0, int(x - radius) - 1), min(cols, int(x + radius) + 2)):
                if not hit[r, c] and (r + 0.5 - y) ** 2 + (c + 0.5 - x) ** 2 < radius * radius:
                    hit[r, c] = True
                    out[r, c] *= factor
    return out


@kernel
def first_clear(time: FloatArray, cols: int, way: FloatArray, longest_s: float) -> int:
    """Return the block reached soonest that lies outside all discs of a way (x, y, radius in blocks), -1 for none."""
    best, found = longest_s, -1
    for block in range(time.shape[0]):
        if time[block] >= best:
            continue
        y, x = block // cols + 0.5, block % cols + 0.5
        clear = True
        for n in range(way.shape[0]):
            if (way[n, 0] - x) ** 2 + (way[n, 1] - y) ** 2 < way[n, 2] * way[n, 2]:
                clear = False
                break
        if clear:
            best, found = time[block], block
    return found
