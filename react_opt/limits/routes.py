"""Routes of a team through standing points that see a share of a known building early: simulated annealing.

A solution is a list of points to visit per robot; robots drive the fastest ways between them and scan at every point
they come by. Its worth is the time at which the team has seen the share wanted, turns and stops included. Moves:
insert, drop, replace (often by a point near by), move to another place or robot, exchange, and reverse a stretch
(Kirkpatrick, Gelatt and Vecchi 1983; the neighbourhoods are those of vehicle routing).
"""

from __future__ import annotations

from math import atan2, exp, pi

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
# Points (n, 2), m; times (n, n), s; points before (n, n); what each sees (n, words).
View = tuple[FloatArray, FloatArray, NDArray[np.int32], NDArray[np.uint64]]

MOST_STOPS = 120
_PENALTY_S = 1500.0  # for seeing nothing of what is wanted
_SHARP_RAD = 0.6  # beyond this a robot slows down, or turns on the spot


@kernel
def popcount(word: np.uint64) -> int:
    """Return how many bits are set."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@kernel
def walk(
    view: View, stops: IntArray, count: int, start: int, motion: FloatArray, node: IntArray, at_s: FloatArray
) -> int:
    """Write the points that a robot comes by, and when, and return how many.

    Parameters
    ----------
    view
        The standing points.
    stops, count
        The points to visit, and how many count.
    start
        The point where the robot starts.
    motion
        Its heading (rad), speed of turning (rad/s), and what a stop costs (s).
    node, at_s
        Receive the points and the times, s.
    """
    points, time, before, _ = view
    node[0], at_s[0] = start, 0.0
    heading, size, clock = motion[0], 1, motion[2] / 2
    for n in range(count):
        here, goal = node[size - 1], stops[n]
        if here == goal or not np.isfinite(time[here, goal]):
            continue
        length, k = 0, goal
        while k != here:
            length += 1
            k = before[here, k]
        if size + length >= node.shape[0]:
            return size
        k = goal
        for back in range(length):
            node[size + length - 1 - back] = k
            k = before[here, k]
        for m in range(size, size + length):
            a, b = node[m - 1], node[m]
            direction = atan2(points[b, 1] - points[a, 1], points[b, 0] - points[a, 0])
            turn = abs(direction - heading)
            turn = min(turn, 2 * pi - turn)
            if turn > _SHARP_RAD:
                clock += turn / motion[1] + motion[2]
            heading = direction
            clock += time[here, b] - time[here, a]
            at_s[m] = clock
        size += length
    return size


@kernel
def seen_s(
    view: View, stops: IntArray, counts: IntArray, starts: IntArray, motion: FloatArray, needed: int,
    node: IntArray, at_s: FloatArray, seen: NDArray[np.uint64],
) -> float:  # fmt: skip
    """Return when a team has seen so many sampled pixels, s; later than its end by a penalty where it never has."""
    sees = view[3]
    robots, words = counts.shape[0], sees.shape[1]
    size, at = np.zeros(robots, dtype=np.int64), np.zeros(robots, dtype=np.int64)
    for r in range(robots):
        size[r] = walk(view, stops[r], counts[r], starts[r], motion[r], node[r], at_s[r])
    seen[:] = 0
    total, clock = 0, 0.0
    while True:
        best = -1
        for r in range(robots):
            if at[r] < size[r] and (best < 0 or at_s[r, at[r]] < at_s[best, at[best]]):
                best = r
        if best < 0:
            return float(clock + _PENALTY_S * (needed - total) / needed)
        k, clock = node[best, at[best]], at_s[best, at[best]]
        at[best] += 1
        for w in range(words):
            new = sees[k, w] & ~seen[w]
            if new:
                total += popcount(new)
                seen[w] |= new
        if total >= needed:
            return float(clock)


@kernel
def anneal(
    view: View, stops: IntArray, counts: IntArray, starts: IntArray, motion: FloatArray, needed: int, steps: int,
    hot_s: float, seed: int,
) -> float:  # fmt: skip
    """Improve a team's routes in place; return when they have seen what is wanted, s.

    Parameters
    ----------
    view, starts, motion
        As in :func:`walk`, one row per robot.
    stops, counts
        ``(robots, MOST_STOPS)`` points to visit, and how many count.
    needed
        Sampled pixels wanted.
    steps
        Moves to try.
    hot_s
        Temperature at the start, s; a thousandth of it at the end.
    seed
        Seed of the moves.
    """
    np.random.seed(seed)  # noqa: NPY002  (numba's own generator)
    robots, points = counts.shape[0], view[0].shape[0]
    longest = 4096
    node, at_s = np.empty((robots, longest), dtype=np.int64), np.empty((robots, longest))
    seen = np.zeros(view[3].shape[1], dtype=np.uint64)
    now = seen_s(view, stops, counts, starts, motion, needed, node, at_s, seen)
    best, best_stops, best_counts = now, stops.copy(), counts.copy()
    old_stops, old_counts = stops.copy(), counts.copy()
    for step in range(steps):
        heat = hot_s * 0.001 ** (step / steps)
        old_stops[:], old_counts[:] = stops, counts
        _move(view, stops, counts, points)
        if np.random.random() < 0.3:  # noqa: NPY002
            _move(view, stops, counts, points)
        then = seen_s(view, stops, counts, starts, motion, needed, node, at_s, seen)
        then += 0.002 * counts.sum()
        if then <= now or np.random.random() < exp((now - then) / heat):  # noqa: NPY002
            now = then
            if then < best:
                best = then
                best_stops[:], best_counts[:] = stops, counts
        else:
            stops[:], counts[:] = old_stops, old_counts
    stops[:], counts[:] = best_stops, best_counts
    return seen_s(view, stops, counts, starts, motion, needed, node, at_s, seen)


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
def _near(view: View, point: int, within_m: float) -> int:
    """Return a random point near another one, itself where none is found quickly."""
    points = view[0]
    for _ in range(60):
        k = np.random.randint(points.shape[0])  # noqa: NPY002
        if abs(points[k, 0] - points[point, 0]) < within_m and abs(points[k, 1] - points[point, 1]) < within_m:
            return k
    return point


@kernel
def _move(view: View, stops: IntArray, counts: IntArray, points: int) -> None:
    """Change the routes at random."""
    robots = counts.shape[0]
    r, q = np.random.randint(robots), np.random.randint(robots)  # noqa: NPY002
    kind = np.random.randint(8)  # noqa: NPY002
    if counts[r] == 0 or kind == 0:
        _put(stops, counts, r, np.random.randint(counts[r] + 1), np.random.randint(points))  # noqa: NPY002
        return
    at = np.random.randint(counts[r])  # noqa: NPY002
    if kind == 1:
        _drop(stops, counts, r, at)
    elif kind == 2 or kind == 3:
        stops[r, at] = _near(view, stops[r, at], 1.1 if kind == 2 else 4.0)
    elif kind == 4:
        point = _drop(stops, counts, r, at)
        _put(stops, counts, q, np.random.randint(counts[q] + 1), point)  # noqa: NPY002
    elif kind == 5:
        if counts[q] > 0:
            other = np.random.randint(counts[q])  # noqa: NPY002
            stops[r, at], stops[q, other] = stops[q, other], stops[r, at]
    elif kind == 6:
        last = np.random.randint(at, counts[r])  # noqa: NPY002
        while at < last:
            stops[r, at], stops[r, last] = stops[r, last], stops[r, at]
            at, last = at + 1, last - 1
    elif q != r and counts[q] > 0:  # exchange the tails
        other = np.random.randint(counts[q])  # noqa: NPY002
        mine, theirs = stops[r, at : counts[r]].copy(), stops[q, other : counts[q]].copy()
        if at + theirs.shape[0] <= stops.shape[1] and other + mine.shape[0] <= stops.shape[1]:
            stops[r, at : at + theirs.shape[0]] = theirs
            stops[q, other : other + mine.shape[0]] = mine
            counts[r], counts[q] = at + theirs.shape[0], other + mine.shape[0]
    else:
        _put(stops, counts, r, at, _near(view, stops[r, at], 4.0))
