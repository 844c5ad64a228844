"""Shortest paths over a taut visibility graph: one search per point, one answer per pair."""

from __future__ import annotations

from math import hypot

import numpy as np

from react_opt.geometry.sight import Padded, clear_between_px, point_free_px
from react_opt.kernels import kernel
from react_opt.paths.motion import Field, segment_px, turn_px
from react_opt.paths.protocol import FloatArray
from react_opt.paths.tautgraph import Graph, IntArray, seen_from


@kernel
def _reach(
    graph: Graph, seen: IntArray, leg_s: FloatArray, x: float, y: float
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Return, per corner, the length (pixels), time (s) and turned angle (rad) from a point, and the corner before.

    ``seen`` are the corners that the point sees, ``leg_s`` the times of driving straight to them.
    Dijkstra's algorithm with a binary heap that holds each corner once. The corner before is -1 where the path
    comes straight from the point; lengths are infinite where there is no path.
    """
    corners, first, other, edge_length, edge_time = graph
    count = corners.shape[0]
    length, time, turned = np.empty(count), np.empty(count), np.empty(count)
    before, edge = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    heap, place = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for k in range(count):  # one loop compiles faster than seven fills
        length[k], time[k], turned[k], before[k], place[k] = np.inf, 0.0, 0.0, -1, -1
    size = 0
    for n in range(seen.shape[0]):
        k = seen[n]
        length[k] = hypot(corners[k, 0] - x, corners[k, 1] - y)
        time[k] = leg_s[n]
        size = _raise_in_heap(heap, place, length, k, size)
    while size > 0:
        k = heap[0]
        size = _pop(heap, place, length, size)
        last = before[k]
        if last >= 0:  # settled before k, so its own measures are final
            beyond = before[last]
            px, py = (corners[beyond, 0], corners[beyond, 1]) if beyond >= 0 else (x, y)
            time[k] = time[last] + edge_time[edge[k]]
            angle = turn_px(px, py, corners[last, 0], corners[last, 1], corners[k, 0], corners[k, 1])
            turned[k] = turned[last] + angle
        for e in range(first[k], first[k + 1]):
            to = other[e]
            reached = length[k] + edge_length[e]
            if reached < length[to]:
                length[to], before[to], edge[to] = reached, k, e
                size = _raise_in_heap(heap, place, length, to, size)
    return length, time, turned, before


@kernel
def _raise_in_heap(heap: IntArray, place: IntArray, key: FloatArray, item: int, size: int) -> int:
    """Put an item whose key has fallen (or that is new) where it belongs; return the heap's size."""
    at = place[item]
    if at < 0:
        at = size
        size += 1
    while at > 0:
        parent = (at - 1) // 2
        if key[heap[parent]] <= key[item]:
            break
        heap[at] = heap[parent]
        place[heap[at]] = at
        at = parent
    heap[at] = item
    place[item] = at
    return size


@kernel
def _pop(heap: IntArray, place: IntArray, key: FloatArray, size: int) -> int:
    """Take the first item off the heap; return the heap's size."""
    place[heap[0]] = -2  # settled: its key never falls again
    size -= 1
    if size == 0:
        return 0
    item, at = heap[size], 0
    while True:
        child = 2 * at + 1
        if child >= size:
            break
        if child + 1 < size and key[heap[child + 1]] < key[heap[child]]:
            child += 1
        if key[heap[child]] >= key[item]:
            break
        heap[at] = heap[child]
        place[heap[at]] = at
        at = child
    heap[at] = item
    place[item] = at
    return size


@kernel
def _last_bend(corners: FloatArray, length: FloatArray, seen: IntArray, x: float, y: float) -> tuple[float, int]:
    """Return the length of the shortest path to a point over a corner it sees, and its place in ``seen`` or -1."""
    best, last = np.inf, -1
    for n in range(seen.shape[0]):
        k = seen[n]
        reached = length[k] + hypot(x - corners[k, 0], y - corners[k, 1])
        if reached < best:
            best, last = reached, n
    return best, last


@kernel
def bends_between(padded: Padded, graph: Graph, ends: FloatArray) -> IntArray:
    """Return the corners along the shortest path between two free points; [-1] where there is none."""
    forth = _comes_first(ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1])
    one, two = (0, 1) if forth else (1, 0)
    x0, y0, x1, y1 = ends[one, 0], ends[one, 1], ends[two, 0], ends[two, 1]
    if clear_between_px(padded, x0, y0, x1, y1):
        return np.empty(0, dtype=np.int64)
    corners = graph[0]
    near_start, near_end = seen_from(padded, corners, x0, y0), seen_from(padded, corners, x1, y1)
    length, _, _, before = _reach(graph, near_start, np.zeros(near_start.shape[0]), x0, y0)
    _, place = _last_bend(corners, length, near_end, x1, y1)
    last = near_end[place] if place >= 0 else -1
    bends = np.full(corners.shape[0] + 1, -1, dtype=np.int64)
    found = 0
    while last >= 0:
        bends[found] = last
        last = before[last]
        found += 1
    bends = bends[: max(found, 1)]
    return bends[::-1].copy() if forth else bends.copy()


@kernel
def _comes_first(x0: float, y0: float, x1: float, y1: float) -> bool:
    """Tell from which of two points a search starts: among equally long paths a table and a path then hold the same."""
    return x0 < x1 or (x0 == x1 and y0 <= y1)


@kernel
def all_pairs(
    padded: Padded,
    graph: Graph,
    field: Field,
    pixels: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return length (pixels), driving time (s) and turned angle (rad) between all pairs, NaN where unreachable."""
    corners = graph[0]
    n = pixels.shape[0]
    length, time = np.full((n, n), np.nan), np.full((n, n), np.nan)
    turned = np.full((n, n), np.nan)
    seen, leg_s = [np.empty(0, dtype=np.int64) for _ in range(n)], [np.empty(0) for _ in range(n)]
    free = np.zeros(n, dtype=np.bool_)
    for s in range(n):
        x, y = pixels[s, 0], pixels[s, 1]
        free[s] = point_free_px(padded, x, y)
        if free[s]:
            seen[s] = seen_from(padded, corners, x, y)
            leg_s[s] = np.array([segment_px(field, x, y, corners[k, 0], corners[k, 1]) for k in seen[s]])
            length[s, s], time[s, s], turned[s, s] = 0.0, 0.0, 0.0
    for s in range(n):
        if not free[s]:
            continue
        x, y = pixels[s, 0], pixels[s, 1]
        to_corner, corner_time, corner_turned, before = _reach(graph, seen[s], leg_s[s], x, y)
        for t in range(n):
            tx, ty = pixels[t, 0], pixels[t, 1]
            if not free[t] or t == s or not _comes_first(x, y, tx, ty):
                continue
            if clear_between_px(padded, x, y, tx, ty):
                length[s, t] = hypot(tx - x, ty - y)
                time[s, t] = segment_px(field, x, y, tx, ty)
                turned[s, t] = 0.0
            else:
                best, place = _last_bend(corners, to_corner, seen[t], tx, ty)
                if place < 0:
                    continue
                k = seen[t][place]
                cx, cy = corners[k, 0], corners[k, 1]
                px, py = (corners[before[k], 0], corners[before[k], 1]) if before[k] >= 0 else (x, y)
                length[s, t] = best
                time[s, t] = corner_time[k] + leg_s[t][place]
                turned[s, t] = corner_turned[k] + turn_px(px, py, cx, cy, tx, ty)
            length[t, s], time[t, s], turned[t, s] = length[s, t], time[s, t], turned[s, t]
    return length, time, turned
