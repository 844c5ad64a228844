"""Exact any-angle shortest paths: a taut visibility graph of the inflated map.

A shortest path among polygons is straight but for bends at their convex corners, and at each bend it wraps
around the corner (Lozano-Pérez and Wesley 1979; Liu and Arimoto 1992 for the reduction to tangents). The
polygons are the blocked pixels of the inflated map, so a convex corner is a grid corner with exactly one blocked
pixel. Lengths are exact for that map. Time and energy are those of the shortest path, bends included.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from react_opt.energy import RobotProfile
from react_opt.geometry.inflation import FreeSpace
from react_opt.paths.motion import drive, terrain, totals
from react_opt.paths.protocol import CostTable, Path
from react_opt.paths.tautgraph import taut_graph
from react_opt.paths.tautsearch import all_pairs, bends_between


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
        self._graph = taut_graph(space, self._field)

    @property
    def corner_count(self) -> int:
        """Number of corners in the graph; its preparation grows with the square of it."""
        return int(self._graph[0].shape[0])

    def cost_table(self, points_m: ArrayLike) -> CostTable:
        """Return length, time and energy of the shortest paths between all pairs of ``(n, 2)`` points, m."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        pixels = np.ascontiguousarray(self.space.to_pixels(points))
        length, drive_s, turned = all_pairs(self.space.padded, self._graph, self._field, pixels)
        length_m = length * self.space.resolution_m
        time_s, energy_j = totals(self.profile, length_m, drive_s, turned)
        method = f"visibility graph, {self.corner_count} corners, refine {self.space.refine}"
        return CostTable(points, ~np.isnan(length), length_m, time_s, energy_j, method)

    def path(self, start_m: ArrayLike, goal_m: ArrayLike) -> Path | None:
        """Return the shortest path between two points, m, tested against the footprint; None without any."""
        ends = np.array((start_m, goal_m), dtype=np.float64)
        if not self.space.points_free(ends).all():
            return None
        pixels = self.space.to_pixels(ends)
        bends = bends_between(self.space.padded, self._graph, pixels)
        if bends.size == 1 and bends[0] < 0:
            return None
        way = np.concatenate((pixels[:1], self._graph[0][bends, :2], pixels[1:]))
        points = np.concatenate((ends[:1], self.space.to_world(way[1:-1]), ends[1:]))
        return drive(self.space, self.profile, points, way)
