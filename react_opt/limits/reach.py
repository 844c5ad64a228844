"""Lower bounds on driving time from a set of places, valid for every continuous path: certified potentials.

A function that nowhere climbs faster than 1 / speed is a lower bound on time: along any path from A to B,
``f(B) - f(A)`` is the integral of its slope along the path, and so at most the integral of ds / v, the time
(the viscosity subsolutions of the eikonal equation ``|grad f| = 1 / v``; Crandall and Lions 1983).

Here ``f`` is given at the corners of square tiles and is linear along their sides. It bounds the time of driving from
one point of a tile's rim to another through the tile when it differs by no more than their distance over the tile's
greatest speed. For that it is enough that (with ``step`` the least time to drive one tile side in the tile)

- along each side it differs by at most ``step``, and
- where it rises along one side of a corner and falls along the other, the squares of both differences sum to at most
  ``step ** 2``.

Proof. Two points on sides that meet, u and v from their common corner: the values differ by ``|p u - q v|`` with the
differences p, q along the sides. If p and q have one sign that is at most ``step * max(u, v)``, otherwise by Cauchy and
Schwarz at most ``sqrt(p^2 + q^2) * sqrt(u^2 + v^2)``. Two points on opposite sides: for a given offset between them the
difference of the values is linear in where they lie, so it is largest when one of them is a corner, which lies on a
side that meets the other one's.

:func:`reach_s` makes such a function as large as it can: Sethian's fast marching method (1996) gives nearly the exact
times, tiles that climb too fast are made faster until none does, and at the end all tiles are tested once more and
the values divided by the largest excess. The test is the proof: whatever the making did, the result is a bound.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

FloatArray = NDArray[np.float64]

_TOLERANCE_S = 1e-9
_ROUNDS = 8


def reach_s(step_s: FloatArray, source: NDArray[np.bool_]) -> FloatArray:
    """Return a lower bound on the time from a set of tiles to every tile corner.

    Parameters
    ----------
    step_s
        ``(rows, cols)`` least time to drive one tile side within a tile, s; infinite where it cannot be entered.
    source
        ``(rows, cols)`` tiles to start from; those that cannot be entered are left out.

    Returns
    -------
    FloatArray
        ``(rows + 1, cols + 1)`` s; 0 at the corners of sources, infinite where nothing leads.
    """
    start = source & np.isfinite(step_s)
    own = step_s.copy()
    for _ in range(_ROUNDS):
        reached = np.full((step_s.shape[0] + 1, step_s.shape[1] + 1), np.inf)
        for dr in (0, 1):
            for dc in (0, 1):
                reached[dr : dr + step_s.shape[0], dc : dc + step_s.shape[1]][start] = 0.0
        _march(own, reached)
        most = _temper(step_s, reached, own)
        if most <= 1.0:
            break
    return np.asarray(reached / max(1.0, excess(step_s, reached)))


def tile_reach_s(reached: FloatArray) -> FloatArray:
    """Return ``(rows, cols)`` the smallest value of a potential in each tile: that of one of its corners."""
    low = np.minimum(reached[:-1], reached[1:])
    return np.asarray(np.minimum(low[:, :-1], low[:, 1:]))


@kernel
def _slope(reached: FloatArray, r: int, c: int) -> float:
    """Return how fast a potential climbs in a tile at most, per tile side (see this module)."""
    worst = 0.0
    for corner in range(4):
        ar, ac = r + corner // 2, c + corner % 2
        here = reached[ar, ac]
        one, two = here - reached[ar, 2 * c + 1 - ac], here - reached[2 * r + 1 - ar, ac]
        if np.isnan(one) or np.isnan(two):  # two infinite ends, of what nothing leads to
            continue
        worst = max(worst, sqrt(one * one + two * two) if one * two < 0 else max(abs(one), abs(two)))
    return worst


@kernel
def excess(step_s: FloatArray, reached: FloatArray) -> float:
    """Return by which factor a potential climbs too fast at most (see this module); a bound where it is <= 1."""
    worst = 0.0
    for r in range(step_s.shape[0]):
        for c in range(step_s.shape[1]):
            if np.isfinite(step_s[r, c]):
                worst = max(worst, _slope(reached, r, c) / step_s[r, c])
    return worst


@kernel
def _temper(step_s: FloatArray, reached: FloatArray, own: FloatArray) -> float:
    """Shorten the steps where a potential climbs too fast; return by which factor it does at most."""
    worst = 0.0
    for r in range(step_s.shape[0]):
        for c in range(step_s.shape[1]):
            if np.isfinite(step_s[r, c]):
                ratio = _slope(reached, r, c) / step_s[r, c]
                worst = max(worst, ratio)
                if ratio > 1.0:
                    own[r, c] /= ratio * 1.002
    return worst


@kernel
def _most(reached: FloatArray, r: int, c: int, ar: int, ac: int, step: float) -> float:
    """Return the largest value at a tile's corner (ar, ac) by the upwind rule of fast marching, given two others."""
    br, bc = 2 * r + 1 - ar, 2 * c + 1 - ac  # the opposite corner
    along, up = reached[ar, bc], reached[br, ac]
    most = float(min(along, up) + step)
    if np.isfinite(along) and np.isfinite(up) and abs(along - up) < step:
        most = min(most, (along + up + sqrt(2 * step * step - (along - up) ** 2)) / 2)
    return float(most)


@kernel
def _march(step_s: FloatArray, reached: FloatArray) -> None:
    """Fill in the times by the upwind rule, the smallest first."""
    rows, cols = step_s.shape
    wide = cols + 1
    size = reached.size
    heap, place = np.empty(size, dtype=np.int64), np.full(size, -1, dtype=np.int64)
    key = reached.reshape(-1)
    count = 0
    for k in range(size):
        if np.isfinite(key[k]):
            heap[count], place[k] = k, count
            count += 1
            _rise(heap, place, key, k, count - 1)
    while count > 0:
        top = heap[0]
        place[top] = -1
        count -= 1
        if count > 0:
            _sink(heap, place, key, heap[count], 0, count)
        nr, nc = top // wide, top % wide
        for r in range(max(0, nr - 1), min(rows, nr + 1)):
            for c in range(max(0, nc - 1), min(cols, nc + 1)):
                step = step_s[r, c]
                if not np.isfinite(step):
                    continue
                for corner in range(4):
                    ar, ac = r + corner // 2, c + corner % 2
                    k = ar * wide + ac
                    if k == top:
                        continue
                    most = _most(reached, r, c, ar, ac, step)
                    if most < key[k] - _TOLERANCE_S:
                        key[k] = most
                        if place[k] < 0:
                            place[k] = count
                            count += 1
                        _rise(heap, place, key, k, place[k])


@kernel
def _rise(heap: NDArray[np.int64], place: NDArray[np.int64], key: FloatArray, item: int, at: int) -> None:
    while at > 0:
        parent = (at - 1) // 2
        if key[heap[parent]] <= key[item]:
            break
        heap[at] = heap[parent]
        place[heap[at]] = at
        at = parent
    heap[at], place[item] = item, at


@kernel
def _sink(heap: NDArray[np.int64], place: NDArray[np.int64], key: FloatArray, item: int, at: int, count: int) -> None:
    while True:
        child = 2 * at + 1
        if child >= count:
            break
        if child + 1 < count and key[heap[child + 1]] < key[heap[child]]:
            child += 1
        if key[heap[child]] >= key[item]:
            break
        heap[at] = heap[child]
        place[heap[at]] = at
        at = child
    heap[at], place[item] = item, at
