"""Way points made better one by one: moved, dropped, added and rounded, driven tick by tick each time.

A search over routes knows standing points and straight lines between them. Here a way point may lie anywhere, bends
become arcs that a robot drives without braking, and a glance around a corner goes no further than it must: simulated
annealing at a low temperature on the time at which the share is seen by the law of :mod:`react_opt.limits.ride`.
"""

from __future__ import annotations

from math import hypot, log

import numpy as np
from numpy.typing import NDArray

from react_opt.geometry.sight import segment_free_px
from react_opt.kernels import kernel
from react_opt.limits.legs import Lattice, place_at
from react_opt.limits.ride import SCAN_TICKS, Ground, ride
from react_opt.sim.loop import SCAN_S

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MOST_POINTS = 400
_PENALTY_S = 10_000.0  # for seeing nothing of what is wanted
_TAIL = 0.04  # so large a share of what is wanted counts as its last part
_LATE = 0.5  # weight of when that comes on average
_LENGTH_S = 0.002  # per scan that a robot's route lasts: of equal plans the shorter


@kernel
def first_seen(
    way: FloatArray, count: int, ground: Ground, law: FloatArray, lattice: Lattice, places: FloatArray, first: IntArray
) -> int:
    """Drive along a way; write at which scan each sampled pixel is first seen, and return how many scans there are."""
    ticks = ride(way, count, ground, law, places)
    sees = lattice[2]
    words = sees.shape[1]
    known = np.zeros(words, dtype=np.uint64)
    first[:] = 1 << 40
    last, scans = -1, 0
    for tick in range(0, min(ticks + SCAN_TICKS, places.shape[0]), SCAN_TICKS):
        place = place_at(lattice, places[tick, 0], places[tick, 1])
        if place >= 0 and place != last:
            last = place
            for w in range(words):
                new = sees[place, w] & ~known[w]
                if new:
                    known[w] |= new
                    for bit in range(64):
                        if new >> np.uint64(bit) & np.uint64(1):
                            first[64 * w + bit] = scans
        scans += 1
    return scans


@kernel
def done_s(first: IntArray, scans: IntArray, needed: int, histogram: IntArray) -> tuple[float, float]:
    """Return when a team has seen so many sampled pixels, s, and when on average the last ones of them, s.

    Between scans by proportion; both later by a penalty where it never has. Of several robots each may bring what is
    still missing: one that gets faster alone moves the average, and the time itself only when the others do too.
    """
    robots, pixels = first.shape
    histogram[:] = 0
    longest = 0
    for r in range(robots):
        longest = max(longest, scans[r])
    for p in range(pixels):
        when = first[0, p]
        for r in range(1, robots):
            when = min(when, first[r, p])
        if when < longest:
            histogram[when] += 1
    total, tail = 0, max(1, int(_TAIL * needed))
    late = 0.0
    for n in range(longest):
        then = total + histogram[n]
        late += SCAN_S * n * max(0, min(then, needed) - max(total, needed - tail))
        if then >= needed:
            return SCAN_S * (n - 1 + (needed - total) / histogram[n]), late / tail
        total = then
    worse = SCAN_S * longest + _PENALTY_S * (needed - total) / needed
    return worse, worse


@kernel
def polish(
    padded: NDArray[np.uint8], per_m: float, ways: FloatArray, counts: IntArray, ground: Ground, laws: FloatArray,
    lattice: Lattice, needed: int, steps: int, hot_s: float, cold_s: float, seed: int,
) -> float:  # fmt: skip
    """Improve a team's way points in place; return when it has seen what is wanted, s.

    Parameters
    ----------
    padded, per_m
        Blocked pixels with their ring, and pixels per metre.
    ways, counts
        ``(robots, MOST_POINTS, 2)`` way points, grid metres, and how many count.
    ground, laws, lattice
        As in :mod:`react_opt.limits.ride`, one law per robot; what is seen from each place.
    needed
        Sampled pixels wanted.
    steps
        Changes to try.
    hot_s, cold_s
        Temperature at the start and at the end, s.
    seed
        Seed of the changes.
    """
    np.random.seed(seed)  # noqa: NPY002  (numba's own generator)
    robots = counts.shape[0]
    places = np.empty((20_000, 2))
    first = np.empty((robots, 64 * lattice[2].shape[1]), dtype=np.int64)
    scans, histogram = np.zeros(robots, dtype=np.int64), np.zeros(20_000, dtype=np.int64)
    for r in range(robots):
        scans[r] = first_seen(ways[r], counts[r], ground, laws[r], lattice, places, first[r])
    now = _cost(first, scans, needed, histogram)
    best, best_ways, best_counts = now, ways.copy(), counts.copy()
    old_way, old_first = ways[0].copy(), first[0].copy()
    for step in range(steps):
        heat = hot_s * (cold_s / hot_s) ** (step / steps)
        r = np.random.randint(robots)  # noqa: NPY002
        count, old_scans = counts[r], scans[r]
        old_way[:count] = ways[r, :count]
        if _change(ways[r], counts, r) and _free(padded, per_m, ways[r], counts[r], laws[r], old_way, count):
            old_first[:] = first[r]
            scans[r] = first_seen(ways[r], counts[r], ground, laws[r], lattice, places, first[r])
            then = _cost(first, scans, needed, histogram)
            if then <= now - heat * log(1.0 - np.random.random()):  # noqa: NPY002
                now = then
                if then < best:
                    best = then
                    best_ways[:], best_counts[:] = ways, counts
                continue
            first[r], scans[r] = old_first, old_scans
        counts[r] = count
        ways[r, :count] = old_way[:count]
    ways[:], counts[:] = best_ways, best_counts
    for r in range(robots):
        scans[r] = first_seen(ways[r], counts[r], ground, laws[r], lattice, places, first[r])
    return done_s(first, scans, needed, histogram)[0]


@kernel
def _cost(first: IntArray, scans: IntArray, needed: int, histogram: IntArray) -> float:
    done, late = done_s(first, scans, needed, histogram)
    return float(done + _LATE * late + _LENGTH_S * scans.sum())


@kernel
def _free(
    padded: NDArray[np.uint8], per_m: float, way: FloatArray, count: int, law: FloatArray, old: FloatArray, before: int
) -> bool:
    """Tell whether the robot fits wherever its way has changed."""
    same, back = 0, 0
    while same < min(count, before) and way[same, 0] == old[same, 0] and way[same, 1] == old[same, 1]:
        same += 1
    while (
        back < min(count, before) - same
        and way[count - 1 - back, 0] == old[before - 1 - back, 0]
        and way[count - 1 - back, 1] == old[before - 1 - back, 1]
    ):
        back += 1
    for n in range(same, min(count, count - back + 1)):
        u, v = (way[n - 1, 0], way[n - 1, 1]) if n > 0 else (law[0], law[1])
        if not segment_free_px(padded, u * per_m, v * per_m, way[n, 0] * per_m, way[n, 1] * per_m):
            return False
    return True


@kernel
def _change(way: FloatArray, counts: IntArray, r: int) -> bool:
    """Change one way at random; False where that was not possible."""
    count = counts[r]
    kind = np.random.randint(10)  # noqa: NPY002
    size = 0.1 * 8.0 ** np.random.random()  # noqa: NPY002
    du, dv = np.random.normal() * size, np.random.normal() * size  # noqa: NPY002
    if count == 0 or kind == 0:  # one more, between two or at the end
        if count == 0 or count >= way.shape[0]:
            return False
        at = np.random.randint(1, count + 1)  # noqa: NPY002
        share = np.random.random() if at < count else 0.0  # noqa: NPY002
        other = min(at, count - 1)
        u = way[at - 1, 0] + share * (way[other, 0] - way[at - 1, 0]) + du
        v = way[at - 1, 1] + share * (way[other, 1] - way[at - 1, 1]) + dv
        for k in range(count, at, -1):
            way[k] = way[k - 1]
        way[at, 0], way[at, 1] = u, v
        counts[r] += 1
        return True
    at = np.random.randint(count)  # noqa: NPY002
    if kind <= 4:  # one or several beside each other are moved
        last = min(count, at + (1 if kind <= 3 else 2 + np.random.randint(3)))  # noqa: NPY002
        for k in range(at, last):
            way[k, 0] += du
            way[k, 1] += dv
        return True
    if kind <= 7:  # some are left out
        gone = 1 if kind <= 6 else min(count - at, 2 + np.random.randint(4))  # noqa: NPY002
        for k in range(at, count - gone):
            way[k] = way[k + gone]
        counts[r] -= gone
        return True
    if at == 0 or at == count - 1 or count >= way.shape[0]:
        return False
    before = hypot(way[at - 1, 0] - way[at, 0], way[at - 1, 1] - way[at, 1])
    after = hypot(way[at + 1, 0] - way[at, 0], way[at + 1, 1] - way[at, 1])
    cut = min(0.2 + np.random.random(), 0.5 * before, 0.5 * after)  # noqa: NPY002
    if cut < 0.1:
        return False
    u, v = way[at, 0], way[at, 1]
    for k in range(count, at, -1):
        way[k] = way[k - 1]
    for k, other, far in ((at, at - 1, before), (at + 1, at + 2, after)):
        way[k, 0] = u + (way[other, 0] - u) * cut / far
        way[k, 1] = v + (way[other, 1] - v) * cut / far
    counts[r] += 1
    return True
