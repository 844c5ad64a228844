"""Maps of fine pixels shown in blocks, which keeps a mission's page small."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.trace import NEVER, Trace, pixel_data

BLOCK_M = 0.1
"""Pixels finer than this are shown in blocks of about this side, m."""


def in_blocks(trace: Trace) -> Trace:
    """Return a trace whose pixel maps are no finer than :data:`BLOCK_M`; the same one where they are not.

    A block becomes known when the last of its pixels does that ever do, and is a wall where one of those is, so the
    replay never shows more than was known. Where none becomes known it is a hidden wall if any of its pixels is one.
    """
    grid = trace.known
    side = int(BLOCK_M / grid.resolution_m + 1e-6)
    if side < 2:
        return trace
    known = _blocks(trace.known.array("<u2").astype(np.int64), side, NEVER)
    truth = _blocks(trace.truth.array("u1").astype(np.int64), side, 2)
    ever = known != NEVER
    last = np.where(ever, known, -1).max(axis=2)
    counts = np.where(ever.any(axis=2)[:, :, None], ever, True)
    value = truth & 3
    wall, free = ((counts & (value == code)).any(axis=2) for code in (1, 0))
    shown = np.where(wall, 1, np.where(free, 0, 2)) + (truth & 4).max(axis=2)
    shape = {"rows": last.shape[0], "cols": last.shape[1], "resolution_m": grid.resolution_m * side}
    times = np.where(last < 0, NEVER, last).astype(np.uint16)
    return trace.model_copy(
        update={
            "known": trace.known.model_copy(update={**shape, "data": pixel_data(times)}),
            "truth": trace.truth.model_copy(update={**shape, "data": pixel_data(shown.astype(np.uint8))}),
        }
    )


def _blocks(pixels: NDArray[np.int64], side: int, beyond: int) -> NDArray[np.int64]:
    """Return ``(rows, cols, side * side)`` the pixels of each block."""
    rows, cols = pixels.shape
    padded = np.pad(pixels, ((0, -rows % side), (0, -cols % side)), constant_values=beyond)
    parts = padded.reshape(padded.shape[0] // side, side, padded.shape[1] // side, side)
    return parts.transpose(0, 2, 1, 3).reshape(parts.shape[0], parts.shape[2], side * side)
