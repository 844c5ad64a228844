"""The distance from points to what blocks, square by square: plain, and sharing nothing with the package."""

from __future__ import annotations

from itertools import pairwise

import numpy as np


def clearances(solid: np.ndarray, pixels: np.ndarray, outside: bool) -> np.ndarray:
    """Return the distance in pixels from ``(n, 2)`` (column, row) points to solid squares and the outside."""
    rows, cols = np.nonzero(solid)
    x, y = pixels[:, :1], pixels[:, 1:]
    dx = np.maximum(np.maximum(cols - x, x - cols - 1), 0)
    dy = np.maximum(np.maximum(rows - y, y - rows - 1), 0)
    nearest = np.hypot(dx, dy).min(axis=1, initial=np.inf)
    if outside:
        height, width = solid.shape
        edge = np.minimum(np.minimum(x, width - x), np.minimum(y, height - y))[:, 0]
        nearest = np.minimum(nearest, np.maximum(edge, 0))
    return nearest


def along(points: np.ndarray, spacing: float) -> np.ndarray:
    """Return points at most ``spacing`` apart along a polyline, its way points included."""
    pieces = [points[:1]]
    for a, b in pairwise(points):
        count = max(1, int(np.ceil(np.hypot(*(b - a)) / spacing)))
        pieces.append(a + (b - a) * np.linspace(0, 1, count + 1)[1:, None])
    return np.concatenate(pieces)
