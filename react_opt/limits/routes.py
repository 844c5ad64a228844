"""Routes of a team through standing points that see a share of a known building early: simulated annealing.

A solution is a list of points to visit per robot; robots drive the known ways between them, and see while they drive.
Its cost is the time at which the last robot is done, and a penalty for each pixel that is missing. Moves: insert where
it takes least time, drop, replace by a point near by, move stretches within and between robots, reverse, exchange
tails (Kirkpatrick, Gelatt and Vecchi 1983; the neighbourhoods are those of vehicle routing), and ruin and recreate: a
few stops that follow each other are taken out, and what shows most per second is put in (Schrimpf et al. 2000).
"""

from __future__ import annotations

from math import inf, log

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.limits.legs import Bits, lost_s, turned

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
# Times (n, n), s; headings at both ends, rad; what bends cost, s; what is seen on the ways (react_opt.limits.outlook).
Net = tuple[FloatArray, FloatArray, FloatArray, FloatArray, Bits]

MOST_STOPS = 160
NEAR = 24
"""A stop is replaced by one of so many nearest ones."""

_SPREAD = 0.02  # weight of the sum of all robots' times, beside the longest


@kernel
def popcount(word: np.uint64) -> int:
    """Return how many bits are set."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@kernel
def leg(i: int, j: int) -> int:
    """Return where what is seen on the way between two points stands."""
    return i * (i + 1) // 2 + j if i >= j else j * (j + 1) // 2 + i


@kernel
def route_s(net: Net, stops: IntArray, count: int, start: int, heading: float) -> float:
    """Return how long a robot drives along its stops, s; infinite where there is no way."""
    time, out, into, loss, _ = net
    clock, here = 0.0, start
    for n in range(count):
        goal = stops[n]
        if goal == here:
            continue
        clock += time[here, goal] + lost_s(loss, turned(out[here, goal], heading))
        heading, here = into[here, goal], goal
    return clock


@kernel
def seen_by(net: Net, stops: IntArray, counts: IntArray, starts: IntArray, seen: Bits) -> int:
    """Write what a team sees; return how many sampled pixels."""
    views = net[4]
    words = views.shape[1]
    seen[:] = 0
    for r in range(counts.shape[0]):
        here = starts[r]
        view = views[leg(here, here)]
        for w in range(words):
            seen[w] |= view[w]
        for n in range(counts[r]):
            view = views[leg(here, stops[r, n])]
            for w in range(words):
                seen[w] |= view[w]
            here = stops[r, n]
    total = 0
    for w in range(words):
        total += popcount(seen[w])
    return total


@kernel
def anneal(
    net: Net, near: IntArray, stops: IntArray, counts: IntArray, starts: IntArray, headings: FloatArray, needed: int,
    price_s: float, steps: int, hot_s: float, cold_s: float, seed: int,
) -> float:  # fmt: skip
    """Improve a team's routes in place; return their cost, s.

    Parameters
    ----------
    net, near
        The points and the ways between them; the nearest ones of each.
    stops, counts
        ``(robots, MOST_STOPS)`` points to visit, and how many count.
    starts, headings
        Where the robots start and look, rad.
    needed
        Sampled pixels wanted.
    price_s
        Penalty for each one that is missing, s.
    steps
        Moves to try.
    hot_s, cold_s
        Temperature at the start and at the end, s.
    seed
        Seed of the moves.
    """
    np.random.seed(seed)  # noqa: NPY002  (numba's own generator)
    robots = counts.shape[0]
    seen = np.zeros(net[4].shape[1], dtype=np.uint64)
    now = inf
    best, best_stops, best_counts = inf, stops.copy(), counts.copy()
    old_stops, old_counts = stops.copy(), counts.copy()
    times = np.zeros(robots)
    for step in range(-1, steps):
        heat = hot_s * (cold_s / hot_s) ** (max(0, step) / steps)
        limit = inf
        if step >= 0:
            for r in range(robots):
                old_counts[r] = counts[r]
                old_stops[r, : counts[r]] = stops[r, : counts[r]]
            limit = now - heat * log(1.0 - np.random.random())  # noqa: NPY002
            _move(net, near, stops, counts, starts, headings, seen)
        longest, total = 0.0, 0.0
        for r in range(robots):
            times[r] = route_s(net, stops[r], counts[r], starts[r], headings[r])
            longest, total = max(longest, times[r]), total + times[r]
        cost = longest + _SPREAD * total
        if cost <= limit:
            missing = needed - seen_by(net, stops, counts, starts, seen)
            cost += price_s * max(0, missing)
        if cost <= limit:
            now = cost
            if cost < best:
                best = cost
                best_stops[:], best_counts[:] = stops, counts
        else:
            for r in range(robots):
                counts[r] = old_counts[r]
                stops[r, : counts[r]] = old_stops[r, : counts[r]]
    stops[:], counts[:] = best_stops, best_counts
    return best


@kernel
def _put(stops: IntArray, counts: IntArray, r: int, at: int, point: int) -> None:
    if counts[r] >= stops.shape[1]:
        return
    for k in range(counts[r], at, -1):
        stops[r, k] = stops[r, k - 1]
    stops[r, at] = point
    counts[r] += 1


@kernel
def _drop(stops: IntArray, counts: IntArray, r: int, at: int) -> int:
    point = stops[r, at]
    for k in range(at, counts[r] - 1):
        stops[r, k] = stops[r, k + 1]
    counts[r] -= 1
    return int(point)


@kernel
def _cheapest(net: Net, stops: IntArray, counts: IntArray, starts: IntArray, r: int, point: int) -> tuple[int, float]:
    """Return where in a robot's route a point adds least time, and how much, s (bends aside)."""
    time = net[0]
    best, where, here = inf, 0, starts[r]
    for n in range(counts[r] + 1):
        more = time[here, point]
        if n < counts[r]:
            goal = stops[r, n]
            more += time[point, goal] - time[here, goal]
            here = goal
        if more < best:
            best, where = more, n
    return where, best


@kernel
def _insert(net: Net, stops: IntArray, counts: IntArray, starts: IntArray, r: int, point: int) -> None:
    where, _ = _cheapest(net, stops, counts, starts, r, point)
    _put(stops, counts, r, where, point)


@kernel
def _move(
    net: Net, near: IntArray, stops: IntArray, counts: IntArray, starts: IntArray, headings: FloatArray, seen: Bits
) -> None:
    """Change the routes at random."""
    robots, points = counts.shape[0], near.shape[0]
    r, q = np.random.randint(robots), np.random.randint(robots)  # noqa: NPY002
    kind = np.random.randint(100)  # noqa: NPY002
    if counts[r] == 0 or kind < 16:
        _insert(net, stops, counts, starts, r, np.random.randint(points))  # noqa: NPY002
        return
    at = np.random.randint(counts[r])  # noqa: NPY002
    if kind < 30:
        _drop(stops, counts, r, at)
    elif kind < 55:
        stops[r, at] = near[stops[r, at], np.random.randint(near.shape[1])]  # noqa: NPY002
        if kind < 35 and at + 1 < counts[r]:  # and the one after it goes
            _drop(stops, counts, r, at + 1)
    elif kind < 63:
        point = _drop(stops, counts, r, at)
        _insert(net, stops, counts, starts, q, point)
    elif kind < 75:  # a stretch moves, some reversed
        length = min(1 + np.random.randint(8), counts[r] - at)  # noqa: NPY002
        part = stops[r, at : at + length].copy()
        for _ in range(length):
            _drop(stops, counts, r, at)
        if np.random.random() < 0.5:  # noqa: NPY002
            part = part[::-1].copy()
        to, _ = _cheapest(net, stops, counts, starts, q, part[0])
        if np.random.random() < 0.3:  # noqa: NPY002
            to = np.random.randint(counts[q] + 1)  # noqa: NPY002
        for k in range(length):
            _put(stops, counts, q, to + k, part[k])
    elif kind < 86:
        last = min(counts[r] - 1, at + 1 + np.random.randint(30))  # noqa: NPY002
        while at < last:
            stops[r, at], stops[r, last] = stops[r, last], stops[r, at]
            at, last = at + 1, last - 1
    elif kind < 92:
        if q != r and counts[q] > 0:  # exchange the tails
            other = np.random.randint(counts[q] + 1)  # noqa: NPY002
            mine, theirs = stops[r, at : counts[r]].copy(), stops[q, other : counts[q]].copy()
            if at + theirs.shape[0] <= stops.shape[1] and other + mine.shape[0] <= stops.shape[1]:
                stops[r, at : at + theirs.shape[0]] = theirs
                stops[q, other : other + mine.shape[0]] = mine
                counts[r], counts[q] = at + theirs.shape[0], other + mine.shape[0]
        else:
            counts[r] = at  # the rest is left out
    elif kind < 97:
        _put(stops, counts, r, at, near[stops[r, at], np.random.randint(near.shape[1])])  # noqa: NPY002
    else:
        _recreate(net, stops, counts, starts, r, at, seen)


@kernel
def _recreate(net: Net, stops: IntArray, counts: IntArray, starts: IntArray, r: int, at: int, seen: Bits) -> None:
    """Take some stops out and put in what shows most per second."""
    views = net[4]
    words = views.shape[1]
    length = min(2 + np.random.randint(6), counts[r] - at)  # noqa: NPY002
    for _ in range(length):
        _drop(stops, counts, r, at)
    for _ in range(length + np.random.randint(2)):  # noqa: NPY002
        seen_by(net, stops, counts, starts, seen)
        best, point, robot, where = 0.0, -1, 0, 0
        for k in range(net[0].shape[0]):
            if np.random.random() < 0.7:  # noqa: NPY002  (some at a time: quicker, and other ones each time)
                continue
            view, gain = views[leg(k, k)], 0
            for w in range(words):
                gain += popcount(view[w] & ~seen[w])
            if gain == 0:
                continue
            for q in range(counts.shape[0]):
                to, more = _cheapest(net, stops, counts, starts, q, k)
                rate = gain / (1.0 + max(0.0, more))
                if rate > best:
                    best, point, robot, where = rate, k, q, to
        if point < 0:
            return
        _put(stops, counts, robot, where, point)
