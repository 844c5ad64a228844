"""Exact any-angle shortest paths: a taut visibility graph of the inflated map.

A shortest path among polygons is straight but for bends at their convex corners, and at each bend it wraps
around the corner (Lozano-Pérez and Wesley 1979; Liu and Arimoto 1992 for the reduction to tangents). The
polygons are the blocked pixels of the inflated map, so a convex corner is a grid corner with exactly one blocked
pixel. Lengths are exact for that map. Time and energy are those of the shortest path, bends included.
"""

from __future__ import annotations

from math import hypot

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.energy import RobotProfile
from react_opt.geometry.inflation import FreeSpace
from react_opt.geometry.sight import clear_between_px, point_free_px
from react_opt.kernels import kernel
from react_opt.paths.motion import Field, drive, segment_px, terrain, totals, turn_px
from react_opt.paths.protocol import CostTable, FloatArray, Path

IntArray = NDArray[np.int64]


# Corners ``(n, 4)``: column, row, direction (+-1, +-1) of the blocked pixel; then adjacency rows of the taut segments:
# where corner i's begin, the other corner, length in pixels, driving time in s.
Graph = tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray]


class VisibilityCosts:
    """Shortest paths of one robot on one map, exact in length (an implementation of ``PathCosts``).

    Parameters
    ----------
    space
        Where the footprint may be.
    profile
        The robot.
    """

    def __init__(self, space: FreeSpace, profile: RobotProfile) -> None:
        self.space = space
        self.profile = profile
        self._field = terrain(space, profile)
        self._graph = _build(space, self._field)

    @property
    def corner_count(self) -> int:
        """Number of corners in the graph; its preparation grows with the square of it."""
        return int(self._graph[0].shape[0])

    def cost_table(self, points_m: ArrayLike) -> CostTable:
        """Return length, time and energy of the shortest paths between all pairs of ``(n, 2)`` points, m."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        pixels = np.ascontiguousarray(self.space.to_pixels(points))
        length, drive_s, turned = _all_pairs(self.space.padded, self._graph, self._field, pixels)
        length_m = length * self.space.resolution_m
        time_s, energy_j = totals(self.profile, length_m, drive_s, turned)
        method = f"visibility graph, {self.corner_count} corners, refine {self.space.refine}"
        return CostTable(points, ~np.isnan(length), length_m, time_s, energy_j, method)

    def path(self, start_m: ArrayLike, goal_m: ArrayLike) -> Path | None:
        """Return the shortest path between two points, m, tested against the footprint; None without any."""
        ends = np.array((start_m, goal_m), dtype=np.float64)
        if not self.space.points_free(ends).all():
            return None
        bends = _bends(self.space.padded, self._graph, self._field, self.space.to_pixels(ends))
        if bends.size == 1 and bends[0] < 0:
            return None
        between = self.space.to_world(self._graph[0][bends, :2])
        return drive(self.space, self.profile, np.concatenate((ends[:1], between, ends[1:])))


def count_corners(space: FreeSpace) -> int:
    """Return how many corners the visibility graph of a map has."""
    return int(_corners(space).shape[0])


def _corners(space: FreeSpace) -> FloatArray:
    """Return ``(n, 4)`` convex corners of the blocked pixels: column, row, direction of the blocked pixel."""
    around = space.padded
    quarters = (around[:-1, :-1], around[:-1, 1:], around[1:, :-1], around[1:, 1:])
    alone = quarters[0] + quarters[1] + quarters[2] + quarters[3] == 1
    row, col = np.nonzero(alone)
    to_right = (quarters[1] + quarters[3])[row, col]
    upward = (quarters[2] + quarters[3])[row, col]
    return np.stack((col, row, 2.0 * to_right - 1.0, 2.0 * upward - 1.0), axis=1)


def _build(space: FreeSpace, field: Field) -> Graph:
    """Return the taut visibility graph of a map."""
    corners = _corners(space)
    one, two = _taut_segments(space.padded, corners)
    start, end = np.concatenate((one, two)), np.concatenate((two, one))
    order = np.lexsort((end, start))
    start, end = start[order], end[order]
    first = np.searchsorted(start, np.arange(corners.shape[0] + 1)).astype(np.int64)
    length, time = _measure(field, corners, start, end)
    return corners, first, end, length, time


@kernel
def _wraps(dx: float, dy: float, qx: float, qy: float) -> bool:
    """Tell whether a path that leaves a corner along (dx, dy) can be taut there.

    (qx, qy) points to the corner's blocked pixel. Into it nothing leads; away from it on both axes, the path
    could be cut short. A point that lies on the corner itself always counts.
    """
    u, v = dx * qx, dy * qy
    return (u > 0.0 and v <= 0.0) or (v > 0.0 and u <= 0.0) or (u == 0.0 and v == 0.0)


@kernel
def _taut_segments(padded: NDArray[np.uint8], corners: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the pairs of corners that see each other along segments taut at both ends."""
    size, found = 1024, 0
    one, two = np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64)
    for i in range(corners.shape[0]):
        x, y, qx, qy = corners[i, 0], corners[i, 1], corners[i, 2], corners[i, 3]
        for j in range(i + 1, corners.shape[0]):
            dx, dy = corners[j, 0] - x, corners[j, 1] - y
            if not (_wraps(dx, dy, qx, qy) and _wraps(-dx, -dy, corners[j, 2], corners[j, 3])):
                continue
            if not clear_between_px(padded, x, y, corners[j, 0], corners[j, 1]):
                continue
            if found == size:
                size *= 2
                more_one, more_two = np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64)
                more_one[:found], more_two[:found] = one, two
                one, two = more_one, more_two
            one[found], two[found] = i, j
            found += 1
    return one[:found].copy(), two[:found].copy()


@kernel
def _measure(
    field: Field,
    corners: FloatArray,
    start: IntArray,
    end: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the length (pixels) and driving time (s) of segments between corners."""
    length, time = np.empty(start.shape[0]), np.empty(start.shape[0])
    for n in range(start.shape[0]):
        x0, y0 = corners[start[n], 0], corners[start[n], 1]
        x1, y1 = corners[end[n], 0], corners[end[n], 1]
        length[n] = hypot(x1 - x0, y1 - y0)
        time[n] = segment_px(field, x0, y0, x1, y1)[0]
    return length, time


@kernel
def _seen(padded: NDArray[np.uint8], corners: FloatArray, x: float, y: float) -> IntArray:
    """Return the corners that a point sees along segments taut at the corner."""
    seen = np.empty(corners.shape[0], dtype=np.int64)
    found = 0
    for k in range(corners.shape[0]):
        dx, dy = x - corners[k, 0], y - corners[k, 1]
        if _wraps(dx, dy, corners[k, 2], corners[k, 3]) and clear_between_px(
            padded, x, y, corners[k, 0], corners[k, 1]
        ):
            seen[found] = k
            found += 1
    return seen[:found].copy()


@kernel
def _reach(
    graph: Graph,
    field: Field,
    seen: IntArray,
    x: float,
    y: float,
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Return, per corner, the length (pixels), time (s) and turned angle (rad) from a point, and the corner before.

    Dijkstra's algorithm with a binary heap that holds each corner once. The corner before is -1 where the path
    comes straight from the point; lengths are infinite where there is no path.
    """
    corners, first, other, edge_length, edge_time = graph
    count = corners.shape[0]
    length = np.full(count, np.inf)
    time, turned = np.zeros(count), np.zeros(count)
    before, edge = np.full(count, -1, dtype=np.int64), np.full(count, -1, dtype=np.int64)
    heap, place = np.empty(count, dtype=np.int64), np.full(count, -1, dtype=np.int64)
    size = 0
    for k in seen:
        length[k] = hypot(corners[k, 0] - x, corners[k, 1] - y)
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
        else:
            time[k] = segment_px(field, x, y, corners[k, 0], corners[k, 1])[0]
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
    """Return the length of the shortest path to a point over a corner it sees, and that corner (-1: none)."""
    best, last = np.inf, -1
    for k in seen:
        reached = length[k] + hypot(x - corners[k, 0], y - corners[k, 1])
        if reached < best:
            best, last = reached, k
    return best, last


@kernel
def _bends(
    padded: NDArray[np.uint8],
    graph: Graph,
    field: Field,
    ends: FloatArray,
) -> IntArray:
    """Return the corners along the shortest path between two free points; [-1] where there is none."""
    x0, y0, x1, y1 = ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1]
    if clear_between_px(padded, x0, y0, x1, y1):
        return np.empty(0, dtype=np.int64)
    corners = graph[0]
    length, _, _, before = _reach(graph, field, _seen(padded, corners, x0, y0), x0, y0)
    _, last = _last_bend(corners, length, _seen(padded, corners, x1, y1), x1, y1)
    bends = np.full(corners.shape[0] + 1, -1, dtype=np.int64)
    found = 0
    while last >= 0:
        bends[found] = last
        last = before[last]
        found += 1
    return bends[: max(found, 1)][::-1].copy()


@kernel
def _all_pairs(
    padded: NDArray[np.uint8],
    graph: Graph,
    field: Field,
    pixels: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return length (pixels), driving time (s) and turned angle (rad) between all pairs, NaN where unreachable."""
    corners = graph[0]
    n = pixels.shape[0]
    length, time = np.full((n, n), np.nan), np.full((n, n), np.nan)
    turned = np.full((n, n), np.nan)
    seen = [np.empty(0, dtype=np.int64) for _ in range(n)]
    free = np.zeros(n, dtype=np.bool_)
    for s in range(n):
        x, y = pixels[s, 0], pixels[s, 1]
        free[s] = point_free_px(padded, x, y)
        if free[s]:
            seen[s] = _seen(padded, corners, x, y)
            length[s, s], time[s, s], turned[s, s] = 0.0, 0.0, 0.0
    for s in range(n):
        if not free[s]:
            continue
        x, y = pixels[s, 0], pixels[s, 1]
        to_corner, corner_time, corner_turned, before = _reach(graph, field, seen[s], x, y)
        for t in range(s + 1, n):
            if not free[t]:
                continue
            tx, ty = pixels[t, 0], pixels[t, 1]
            if clear_between_px(padded, x, y, tx, ty):
                length[s, t] = hypot(tx - x, ty - y)
                time[s, t] = segment_px(field, x, y, tx, ty)[0]
                turned[s, t] = 0.0
            else:
                best, k = _last_bend(corners, to_corner, seen[t], tx, ty)
                if k < 0:
                    continue
                cx, cy = corners[k, 0], corners[k, 1]
                px, py = (corners[before[k], 0], corners[before[k], 1]) if before[k] >= 0 else (x, y)
                length[s, t] = best
                time[s, t] = corner_time[k] + segment_px(field, cx, cy, tx, ty)[0]
                turned[s, t] = corner_turned[k] + turn_px(px, py, cx, cy, tx, ty)
            length[t, s], time[t, s], turned[t, s] = length[s, t], time[s, t], turned[s, t]
    return length, time, turned
