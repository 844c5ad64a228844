"""Ways between standing points: the fastest ones, turns included, and all that is seen on them."""

from __future__ import annotations

from heapq import heappop, heappush
from math import atan2, floor, hypot, pi

import numpy as np
from numpy.typing import NDArray

from react_opt.geometry.sight import segment_free_px
from react_opt.kernels import kernel
from react_opt.paths.motion import Field, segment_px

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Bits = NDArray[np.uint64]
# Edges leaving each point: where they begin, ends, driving times (s), headings (rad), which undirected edge.
Graph = tuple[IntArray, IntArray, FloatArray, FloatArray, IntArray]
# Numbers of places by row and column (-1: none), their side (m), what is seen from each.
Lattice = tuple[NDArray[np.int32], float, Bits]


@kernel
def turned(one: float, other: float) -> float:
    """Return the angle between two headings, in [0, pi]."""
    angle = abs(one - other) % (2 * pi)
    return float(min(angle, 2 * pi - angle))


@kernel
def lost_s(loss: FloatArray, angle: float) -> float:
    """Return what a bend costs, s, by a table over [0, pi]."""
    return float(loss[min(loss.shape[0] - 1, int(angle / pi * (loss.shape[0] - 1) + 0.5))])


@kernel
def place_at(lattice: Lattice, u: float, v: float) -> int:
    """Return the number of the place nearest to a point (grid metres), -1 where none is near."""
    number, side, _ = lattice
    r, c = floor(v / side), floor(u / side)
    if r < 0 or c < 0 or r >= number.shape[0] or c >= number.shape[1]:
        return -1
    return int(number[r, c])


@kernel
def edges(
    padded: NDArray[np.uint8], field: Field, pixels: FloatArray, far: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the pairs of points that a robot can drive straight between, and how long it takes, s."""
    one, two, seconds = [0 for _ in range(0)], [0 for _ in range(0)], [0.0 for _ in range(0)]
    for i in range(pixels.shape[0]):
        for j in range(i + 1, pixels.shape[0]):
            x0, y0, x1, y1 = pixels[i, 0], pixels[i, 1], pixels[j, 0], pixels[j, 1]
            if abs(x1 - x0) > far or abs(y1 - y0) > far or hypot(x1 - x0, y1 - y0) > far:
                continue
            if segment_free_px(padded, x0, y0, x1, y1):
                one.append(i)
                two.append(j)
                seconds.append(segment_px(field, x0, y0, x1, y1) + 1e-6)
    return np.array(one), np.array(two), np.array(seconds)


@kernel
def edge_views(points: FloatArray, one: IntArray, two: IntArray, lattice: Lattice) -> Bits:
    """Return what is seen along each edge, its ends included."""
    sees = lattice[2]
    seen = np.zeros((one.shape[0], sees.shape[1]), dtype=np.uint64)
    for e in range(one.shape[0]):
        u0, v0, u1, v1 = points[one[e], 0], points[one[e], 1], points[two[e], 0], points[two[e], 1]
        pieces = int(hypot(u1 - u0, v1 - v0) / lattice[1]) + 1
        last = -1
        for n in range(pieces + 1):
            place = place_at(lattice, u0 + (u1 - u0) * n / pieces, v0 + (v1 - v0) * n / pieces)
            if place >= 0 and place != last:
                last = place
                for w in range(sees.shape[1]):
                    seen[e, w] |= sees[place, w]
    return seen


@kernel
def fastest(
    graph: Graph, source: int, loss: FloatArray, before: NDArray[np.int32], order: IntArray, cost: FloatArray,
    first: FloatArray, last: FloatArray,
) -> int:  # fmt: skip
    """Find the fastest ways from a point to all others, bends included; return how many can be reached.

    Each point keeps the one best way to it, so what a later bend costs is not foreseen: a good way, not the best.

    Parameters
    ----------
    graph, source, loss
        The edges, the point, and what bends cost.
    before, order, cost, first, last
        Receive the edge (as numbered in the graph's lists) on which each point is reached, the points in the order of
        their times, the times (s), and the headings at the start and the end of each way (rad).
    """
    begin, to, seconds, heading, _ = graph
    cost[:] = np.inf
    before[:] = -1
    done = np.zeros(cost.shape[0], dtype=np.bool_)
    cost[source] = 0.0
    queue = [(0.0, source)]
    count = 0
    while len(queue) > 0:
        reached, k = heappop(queue)
        if done[k]:
            continue
        done[k] = True
        order[count] = k
        count += 1
        for e in range(begin[k], begin[k + 1]):
            j = to[e]
            if done[j]:
                continue
            then = reached + seconds[e]
            if k != source:
                then += lost_s(loss, turned(heading[e], last[k]))
            if then < cost[j]:
                cost[j], before[j], last[j] = then, e, heading[e]
                first[j] = heading[e] if k == source else first[k]
                heappush(queue, (then, j))
    return count


@kernel
def all_legs(
    graph: Graph, views: Bits, own: Bits, chosen: IntArray, tail: IntArray, loss: FloatArray,
    before: NDArray[np.int32], time: FloatArray, out: FloatArray, into: FloatArray, seen: Bits,
) -> None:  # fmt: skip
    """Fill in the ways between all chosen points, and what is seen on them.

    Parameters
    ----------
    graph, views, own
        The edges, what is seen along each, and from each point.
    chosen, tail
        The chosen points, and the point that each directed edge leaves.
    loss
        What bends cost.
    before
        ``(n, points)`` receives for each chosen point the edge on which its way to each point ends.
    time, out, into
        ``(n, n)`` receive times (s), headings at the start and at the end (rad).
    seen
        ``(n (n + 1) / 2, words)`` receives what is seen on the way between i <= j, at ``j (j + 1) / 2 + i``.
    """
    points, words = own.shape
    cost, first, last = np.empty(points), np.empty(points), np.empty(points)
    order = np.empty(points, dtype=np.int64)
    sofar = np.zeros((points, words), dtype=np.uint64)
    for j in range(chosen.shape[0]):
        source = chosen[j]
        count = fastest(graph, source, loss, before[j], order, cost, first, last)
        sofar[source] = own[source]
        for n in range(1, count):
            k = order[n]
            e = before[j, k]
            for w in range(words):
                sofar[k, w] = sofar[tail[e], w] | views[graph[4][e], w]
        for i in range(j + 1):
            k = chosen[i]
            time[i, j] = time[j, i] = cost[k]
            if k == source or not np.isfinite(cost[k]):
                out[j, i] = into[j, i] = out[i, j] = into[i, j] = 0.0
            else:
                out[j, i], into[j, i] = first[k], last[k]
                out[i, j], into[i, j] = last[k] + pi, first[k] + pi
            if np.isfinite(cost[k]):
                seen[j * (j + 1) // 2 + i] = sofar[k]


def graph_of(points_m: FloatArray, one: IntArray, two: IntArray, seconds: FloatArray) -> tuple[Graph, IntArray]:
    """Return edges in both directions, by the point that they leave, and that point for each of them."""
    tail, head = np.concatenate((one, two)), np.concatenate((two, one))
    number = np.concatenate((np.arange(len(one)), np.arange(len(one))))
    both = np.concatenate((seconds, seconds))
    order = np.argsort(tail, kind="stable")
    tail, head = tail[order], head[order]
    along = points_m[head] - points_m[tail]
    begin = np.searchsorted(tail, np.arange(len(points_m) + 1)).astype(np.int64)
    heading = np.array([atan2(v, u) for u, v in along])
    return (begin, head, both[order], heading, number[order]), tail
