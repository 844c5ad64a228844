"""Line of sight restated in rational arithmetic, piece by piece: slow, and sharing nothing with the kernels."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from math import floor

import numpy as np


def free_pixels_at(blocked: np.ndarray, x: Fraction, y: Fraction) -> set[tuple[int, int]]:
    """Return the free pixels (row, column) whose closed square holds the point."""
    cols = {floor(x)} | ({floor(x) - 1} if x.denominator == 1 else set())
    rows = {floor(y)} | ({floor(y) - 1} if y.denominator == 1 else set())
    height, width = blocked.shape
    return {(r, c) for r in rows for c in cols if 0 <= r < height and 0 <= c < width and not blocked[r, c]}


def _beside(one: tuple[int, int], two: tuple[int, int]) -> bool:
    return abs(one[0] - two[0]) + abs(one[1] - two[1]) <= 1


def point_free(blocked: np.ndarray, x: Fraction, y: Fraction) -> bool:
    """Tell whether the free pixels around a point are one connected group, not two that meet in a corner."""
    around = sorted(free_pixels_at(blocked, x, y))
    return bool(around) and not (len(around) == 2 and not _beside(*around))


def segment_free(blocked: np.ndarray, a: tuple[Fraction, Fraction], b: tuple[Fraction, Fraction]) -> bool:
    """Tell whether a segment stays in closed free pixels and goes through their sides, never a mere corner."""
    if not (point_free(blocked, *a) and point_free(blocked, *b)):
        return False
    (x0, y0), (x1, y1) = a, b
    cuts = {Fraction(0), Fraction(1)}
    for p0, p1 in ((x0, x1), (y0, y1)):
        low, high = min(p0, p1), max(p0, p1)
        if low != high:
            cuts |= {(n - p0) / (p1 - p0) for n in range(floor(low), floor(high) + 2) if low <= n <= high}
    pieces = []
    for s, t in pairwise(sorted(cuts)):
        m = (s + t) / 2
        pieces.append(free_pixels_at(blocked, x0 + m * (x1 - x0), y0 + m * (y1 - y0)))
        if not pieces[-1]:
            return False
    for t, (before, after) in zip(sorted(cuts)[1:-1], pairwise(pieces), strict=True):
        around = free_pixels_at(blocked, x0 + t * (x1 - x0), y0 + t * (y1 - y0))
        reached = set(before)
        for _ in range(3):
            reached |= {p for p in around if any(_beside(p, q) for q in reached)}
        if not reached & after:
            return False
    return True
