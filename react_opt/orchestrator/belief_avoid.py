"""Ways around other robots, through narrow gaps, and places off another robot's way: by the same speed law."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import FloatArray
from react_opt.kernels import kernel

SLOWER = 4.0
"""Blocks near another robot's way are entered, but count as so many times slower."""
GAP_M = 0.1
"""A robot that is closed in may leave through gaps that are narrower than its disc by so much on either side, m."""
GAP_SLOWER = 3.0
"""There a metre takes so many times what it takes at contact."""


def with_gaps(
    slow: NDArray[np.float32],
    clear_px: NDArray[np.float32],
    known: NDArray[np.bool_],
    profile: RobotProfile,
    resolution_m: float,
) -> NDArray[np.float32]:
    """Return slowness with narrow gaps as slow ways: a robot passes lengthwise where it could not turn.

    Parameters
    ----------
    slow
        Slowness (s per m) for the robot's disc.
    clear_px, known
        Clearance of the blocks, pixels, and which of them have been seen.
    profile, resolution_m
        The robot, and the side of a pixel, m.
    """
    room_px = max(profile.width_m / 2, profile.radius_m - GAP_M) / resolution_m
    gap = (slow == 0) & known & (clear_px >= room_px)
    return np.where(gap, np.float32(GAP_SLOWER / profile.speed_min_m_s), slow)


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
