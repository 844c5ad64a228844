"""Dijkstra over pixels: fastest paths where speed depends on clearance, or shortest ones on maps of many corners.

Nodes are the centres of free pixels; moves lead to the 8 pixels around, with ``connectivity=16`` also to the 8 a
knight's move away, through free pixels only. A move costs its length times the mean slowness (1 / speed) of its
ends when time is minimised, its length otherwise. The found way is then pulled straight wherever that is free
and no slower, and it is this final path that is measured (turns included), so the result is never worse than the
search's own way. What is exact is the search on its graph; moves at 8 (16) headings can be up to 8.2 % (2.8 %)
longer than the straight line before they are pulled straight.
"""

from __future__ import annotations

from math import hypot
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.energy import RobotProfile, speed_at
from react_opt.errors import UsageError
from react_opt.geometry.inflation import FreeSpace, clearance_px
from react_opt.geometry.sight import Padded, clear_between_px, point_free_px
from react_opt.kernels import kernel
from react_opt.paths.motion import Field, drive, polyline_px, segment_px, terrain, totals, turn_px
from react_opt.paths.protocol import CostTable, FloatArray, Path

IntArray = NDArray[np.int64]

# Column and row of each move; side moves, diagonals, then the knight's moves.
_MOVES = np.array(
    (
        *((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)),
        *((2, 1), (1, 2), (-1, 2), (-2, 1), (-2, -1), (-1, -2), (1, -2), (2, -1)),
    ),
    dtype=np.int64,
)


class PixelCosts:
    """Fastest or shortest paths over the pixels of one map for one robot (an implementation of ``PathCosts``).

    Parameters
    ----------
    space
        Where the footprint may be.
    profile
        The robot.
    minimise
        ``time`` by the speed law, or ``length``.
    connectivity
        8 or 16 headings.

    Raises
    ------
    UsageError
        Where an option is not one of those above.
    """

    def __init__(
        self,
        space: FreeSpace,
        profile: RobotProfile,
        *,
        minimise: Literal["time", "length"] = "time",
        connectivity: Literal[8, 16] = 16,
    ) -> None:
        if minimise not in ("time", "length") or connectivity not in (8, 16):
            raise UsageError("pixel paths minimise time or length over 8 or 16 headings")
        self.space = space
        self.profile = profile
        self.minimise = minimise
        self.connectivity = connectivity
        self._field = terrain(space, profile)
        self._slowness = _slowness(space.padded, self._field, minimise == "time")
        # Turns on the spot are not searched for, but a straighter way may win by turning less.
        self._per_radian = 1 / profile.turn_rad_s if minimise == "time" else 0.0

    def cost_table(self, points_m: ArrayLike) -> CostTable:
        """Return length, time and energy of the paths between all pairs of ``(n, 2)`` points, m."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        pixels = np.ascontiguousarray(self.space.to_pixels(points))
        n = pixels.shape[0]
        measures = np.full((3, n, n), np.nan)  # length, driving time, turned angle
        for start in range(n):
            measures[:, start, start] = 0.0 if self.space.points_free(points[start])[0] else np.nan
            for goal, way in zip(range(start + 1, n), self._ways(pixels[start:]), strict=True):
                if way.shape[0]:
                    length, seconds, _, turned = polyline_px(self._field, way)
                    measures[:, start, goal] = measures[:, goal, start] = length, seconds, turned
        length_m, drive_s, turned_rad = measures
        time_s, energy_j = totals(self.profile, length_m, drive_s, turned_rad)
        method = f"Dijkstra, {self.connectivity} headings, least {self.minimise}, refine {self.space.refine}"
        return CostTable(points, ~np.isnan(length_m), length_m, time_s, energy_j, method)

    def path(self, start_m: ArrayLike, goal_m: ArrayLike) -> Path | None:
        """Return the path between two points, m, tested against the footprint; None without any."""
        ends = np.array((start_m, goal_m), dtype=np.float64)
        (way,) = self._ways(np.ascontiguousarray(self.space.to_pixels(ends)))
        if way.shape[0] == 0:
            return None
        points = np.concatenate((ends[:1], self.space.to_world(way[1:-1]), ends[1:]))
        return drive(self.space, self.profile, points, way)

    def costs_from(self, start_m: ArrayLike) -> FloatArray:
        """Return ``(rows, cols)`` costs from the centre of a point's pixel to every pixel's, s or m.

        Infinite where there is no way. This is what the search minimises, before any path is pulled straight.
        """
        pixels = np.ascontiguousarray(self.space.to_pixels(start_m).reshape(1, 2))
        start = _home(self.space.padded, pixels[0, 0], pixels[0, 1])
        cost, _ = self._search(start, np.empty(0, dtype=np.int64))
        unit = self.space.resolution_m
        return cost.reshape(self.space.padded.shape)[1:-1, 1:-1] * unit

    def _search(self, start: int, goals: IntArray) -> tuple[FloatArray, NDArray[np.int8]]:
        return _dijkstra(self.space.padded, self._slowness, self.connectivity, start, goals)

    def _ways(self, pixels: FloatArray) -> list[FloatArray]:
        """Return the pixel ways from the first point to each other one; empty where there is none."""
        padded = self.space.padded
        homes = np.array([_home(padded, x, y) for x, y in pixels], dtype=np.int64)
        if pixels.shape[0] < 2 or homes[0] < 0:
            return [np.empty((0, 2))] * (pixels.shape[0] - 1)
        cost, step = self._search(homes[0], homes[1:][homes[1:] >= 0])
        ways = []
        for n in range(1, pixels.shape[0]):
            if homes[n] < 0 or not np.isfinite(cost[homes[n]]):
                ways.append(np.empty((0, 2)))
                continue
            raw = _trace(padded, step, homes[0], homes[n], pixels[0], pixels[n])
            timed = self.minimise == "time"
            ways.append(pull_straight(padded, self._field, raw, timed, self._per_radian))
        return ways


@kernel
def _slowness(padded: Padded, field: Field, timed: bool) -> FloatArray:
    """Return the cost of a metre at the centre of every padded pixel: s where timed, else 1."""
    clearance_m, slow, law = field
    slowness = np.ones(padded.shape)
    if timed:
        for r in range(slow.shape[0]):
            for c in range(slow.shape[1]):
                speed = speed_at(clearance_px(clearance_m, c + 0.5, r + 0.5), law[1], law[2], law[3], law[4])
                slowness[r + 1, c + 1] = 1.0 / (speed * law[5] if slow[r, c] else speed)
    return slowness


@kernel
def _home(padded: Padded, x: float, y: float) -> int:
    """Return the padded pixel (as a flat index) that a free point lies in or on the rim of, else -1."""
    if not point_free_px(padded, x, y):
        return -1
    for shift in (0, 4, 1, 3, 5, 7, 2, 6, 8):
        dx, dy = (shift % 3 - 1) * 2e-6, (shift // 3 - 1) * 2e-6
        c, r = int(np.floor(x + dx)) + 1, int(np.floor(y + dy)) + 1
        if padded[r, c] == 0:
            return int(r * padded.shape[1] + c)
    return -1


@kernel
def _dijkstra(
    padded: Padded, slowness: FloatArray, connectivity: int, start: int, goals: IntArray
) -> tuple[FloatArray, NDArray[np.int8]]:
    """Return the cost (pixels times slowness) to each flat padded pixel, and the move that led there (-1: none).

    With goals it stops when all are settled. The queue is a ring of buckets as wide as the cheapest move, so what
    a bucket holds can no longer improve when its turn comes (Denardo and Fox 1979).
    """
    cols = padded.shape[1]
    grid, slow = padded.ravel(), slowness.ravel()
    cost = np.full(grid.shape[0], np.inf)
    step = np.full(grid.shape[0], -1, dtype=np.int8)
    if start < 0:
        return cost, step
    least, most = np.inf, 0.0
    for k in range(grid.shape[0]):
        if grid[k] == 0:
            least, most = min(least, slow[k]), max(most, slow[k])
    offset, length = np.empty(connectivity, dtype=np.int64), np.empty(connectivity)
    through = np.zeros((connectivity, 2), dtype=np.int64)
    for m in range(connectivity):
        dx, dy = _MOVES[m, 0], _MOVES[m, 1]
        offset[m], length[m] = dy * cols + dx, hypot(dx, dy)
        if m >= 8:  # a knight's move crosses the two pixels between
            sx, sy = int(np.sign(dx)), int(np.sign(dy))
            through[m, 0] = sx if abs(dx) == 2 else sy * cols
            through[m, 1] = sy * cols + sx
        elif m >= 4:  # a diagonal needs one of the two beside it
            through[m, 0], through[m, 1] = dx, dy * cols
    ring = int(np.sqrt(5.0) * most / least) + 3
    head = np.full(ring, -1, dtype=np.int64)
    after, prior = np.empty(grid.shape[0], dtype=np.int64), np.empty(grid.shape[0], dtype=np.int64)
    slot = np.full(grid.shape[0], -1, dtype=np.int64)
    wanted = np.zeros(grid.shape[0], dtype=np.bool_)
    left = 0
    for goal in goals:
        if not wanted[goal]:
            wanted[goal] = True
            left += 1
    cost[start], slot[start], head[0], after[start], prior[start] = 0.0, 0, start, -1, -1
    queued, turn = 1, 0
    while queued > 0:
        here = turn % ring
        while head[here] >= 0:
            k = head[here]
            head[here] = after[k]
            if after[k] >= 0:
                prior[after[k]] = -1
            slot[k] = -1
            queued -= 1
            if wanted[k]:
                wanted[k] = False
                left -= 1
                if left == 0 and goals.shape[0] > 0:
                    return cost, step
            for m in range(connectivity):
                to = k + offset[m]
                if m >= 8:
                    if grid[k + through[m, 0]] or grid[k + through[m, 1]] or grid[to]:
                        continue
                elif grid[to] or (m >= 4 and grid[k + through[m, 0]] and grid[k + through[m, 1]]):
                    continue
                reached = cost[k] + length[m] * (slow[k] + slow[to]) / 2
                if reached >= cost[to]:
                    continue
                cost[to], step[to] = reached, m
                if slot[to] >= 0:
                    _unlink(head, after, prior, slot[to], to)
                    queued -= 1
                slot[to] = int(reached / least) % ring
                prior[to], after[to] = -1, head[slot[to]]
                if after[to] >= 0:
                    prior[after[to]] = to
                head[slot[to]] = to
                queued += 1
        turn += 1
    return cost, step


@kernel
def _unlink(head: IntArray, after: IntArray, prior: IntArray, bucket: int, item: int) -> None:
    """Take an item out of its bucket."""
    if prior[item] >= 0:
        after[prior[item]] = after[item]
    else:
        head[bucket] = after[item]
    if after[item] >= 0:
        prior[after[item]] = prior[item]


@kernel
def _trace(
    padded: Padded, step: NDArray[np.int8], start: int, goal: int, first: FloatArray, last: FloatArray
) -> FloatArray:
    """Return the way from one point to another: its ends, and the pixel centres where it changes heading."""
    cols = padded.shape[1]
    count, k, heading = 3, goal, -1
    while k != start:
        m = step[k]
        if m != heading:
            count, heading = count + 1, m
        k -= _MOVES[m, 1] * cols + _MOVES[m, 0]
    way = np.empty((count, 2))
    way[count - 1] = last
    at, k, heading = count - 2, goal, -1
    while k != start:
        m = step[k]
        if m != heading:
            way[at, 0], way[at, 1] = k % cols - 0.5, k // cols - 0.5
            at, heading = at - 1, m
        k -= _MOVES[m, 1] * cols + _MOVES[m, 0]
    way[at, 0], way[at, 1] = start % cols - 0.5, start // cols - 0.5
    way[0] = first
    return way


@kernel
def pull_straight(padded: Padded, field: Field, way: FloatArray, timed: bool, per_radian: float) -> FloatArray:
    """Return a way with every run of way points left out that a free and no slower straight segment replaces.

    Parameters
    ----------
    padded
        Blocked pixels with their ring.
    field
        The map and the robot (:func:`react_opt.paths.motion.terrain`).
    way
        ``(k, 2)`` way points in pixel coordinates, every leg free.
    timed
        Whether slower means more time, or longer.
    per_radian
        What a radian of turning costs, s.
    """
    count = way.shape[0]
    cost, turns = np.zeros(count), np.zeros(count)  # up to each way point
    for n in range(1, count):
        x0, y0, x1, y1 = way[n - 1, 0], way[n - 1, 1], way[n, 0], way[n, 1]
        cost[n] = cost[n - 1] + (segment_px(field, x0, y0, x1, y1) if timed else hypot(x1 - x0, y1 - y0))
        turns[n] = turns[n - 1]
        if n > 1:
            turns[n] += turn_px(way[n - 2, 0], way[n - 2, 1], x0, y0, x1, y1)
    kept = np.empty((count, 2))
    kept[0], found, at = way[0], 1, 0
    while at < count - 1:
        best = at + 1
        for n in range(at + 2, count):
            x0, y0, x1, y1 = way[at, 0], way[at, 1], way[n, 0], way[n, 1]
            if not clear_between_px(padded, x0, y0, x1, y1):
                break
            straight = segment_px(field, x0, y0, x1, y1) if timed else hypot(x1 - x0, y1 - y0)
            if straight <= cost[n] - cost[at] + (turns[n] - turns[at + 1]) * per_radian + 1e-12:
                best = n
        kept[found] = way[best]
        found, at = found + 1, best
    return kept[:found].copy()
