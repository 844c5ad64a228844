"""Travel arcs between areas: which neighbours a robot can drive between, in how many steps, for how many joules."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from math import ceil
from typing import Literal, NamedTuple

import numpy as np
from scipy.cluster.hierarchy import DisjointSet

from react_opt.areas import AreaGrid, cut
from react_opt.energy import RobotProfile
from react_opt.geometry.inflation import FreeSpace
from react_opt.geometry.occupancy import FloatArray
from react_opt.paths.exact import exact_costs
from react_opt.paths.protocol import PathCosts

Planners = list[list[PathCosts]]
"""For each profile the ways to plan a drive."""

PathKind = Literal["exact", "ompl"]
Area = tuple[int, int]
_ROUNDING = 1e-9  # of a step: a drive of two steps but for rounding takes two
_SAMPLES_PER_M2 = 2.0  # of OMPL's roadmap: random milestones, 64 to 2000 of them

_AROUND = 3  # areas on each side in which a detour is looked for first: searches of a large map take long


class Mode(NamedTuple):
    """One way to drive an arc: whole steps, J without sensing, and the mean speed, m/s."""

    steps: int
    energy_j: float
    speed_m_s: float


class Passages:
    """Travel arcs between the standing points of areas.

    Parameters
    ----------
    grid
        The areas.
    standing
        Where a robot stands in each area, m.
    poses
        Where else robots may leave an area from: their start poses, m.
    profiles
        The robots' profiles; an arc is timed for the slowest and charged for the hungriest.
    step_s
        Length of a step, s.
    kind
        ``exact`` (shortest any-angle and fastest pixel paths) or ``ompl`` (shortest and fastest by PRM*).
    """

    def __init__(
        self,
        grid: AreaGrid,
        standing: dict[Area, FloatArray],
        poses: dict[Area, list[FloatArray]],
        profiles: list[RobotProfile],
        step_s: float,
        kind: PathKind,
    ) -> None:
        self.grid = grid
        self.standing = standing
        self.poses = poses
        self.profiles = profiles
        self.step_s = step_s
        self.kind = kind
        self.detours: list[tuple[Area, Area]] = []
        """Neighbours that :meth:`arcs` had to join by a path through other areas."""

    def arcs(self) -> Iterator[tuple[Area, Area, Mode]]:
        """Yield every arc ``(from, to, mode)``: neighbours in order of columns and rows, fast modes first."""
        together = DisjointSet(self.standing)
        divided = []
        for one, other in self._neighbours():
            window = cut(self.grid.space, self.grid.window(*one, *other))
            ends = np.stack((self.standing[one], self.standing[other]))
            if np.ptp(window.regions_at(ends)) == 0:
                together.merge(one, other)
                yield from self._both_ways(self._planners(window), one, other)
            elif self.grid.touches(*one, *other):
                divided.append((one, other))
        ways = []
        for one, other in divided:
            if not together.connected(one, other):
                planners = self._planners(self._around(one, other))
                table = planners[0][0].cost_table(np.stack((self.standing[one], self.standing[other])))
                ways.append((float(table.length_m[0, 1]), one, other, planners))
        for _, one, other, planners in sorted(ways, key=lambda way: way[:3]):
            if together.merge(one, other):
                self.detours.append((one, other))
                yield from self._both_ways(planners, one, other)

    def _around(self, one: Area, other: Area) -> FreeSpace:
        """Return the window of two areas and those around them if they are connected in it, else the whole map."""
        columns, rows = self.grid.shape
        low = max(0, one[0] - _AROUND), max(0, one[1] - _AROUND)
        high = min(columns - 1, other[0] + _AROUND), min(rows - 1, other[1] + _AROUND)
        window = cut(self.grid.space, self.grid.window(*low, *high))
        ends = np.stack((self.standing[one], self.standing[other]))
        return window if np.ptp(window.regions_at(ends)) == 0 else self.grid.space

    def _neighbours(self) -> Iterator[tuple[Area, Area]]:
        for a, b in sorted(self.standing):
            for other in ((a, b + 1), (a + 1, b)):
                if other in self.standing:
                    yield (a, b), other

    def _planners(self, space: FreeSpace) -> Planners:
        """Return the planners of a map."""
        if self.kind == "exact":
            return [[exact_costs(space, each), exact_costs(space, each, method="fastest16")] for each in self.profiles]
        from react_opt.paths.ompl_costs import OmplPathCosts

        free_m2 = np.count_nonzero(space.blocked == 0) * space.resolution_m**2
        samples = int(np.clip(_SAMPLES_PER_M2 * free_m2, 64, 2000))
        return [
            [OmplPathCosts(space, each, samples=samples, minimise=what) for what in ("length", "time")]
            for each in self.profiles
        ]

    @cached_property
    def _whole(self) -> Planners:
        """The planners of the whole map, for start poses that a window of two areas cannot answer."""
        return self._planners(self.grid.space)

    def _both_ways(self, planners: Planners, one: Area, other: Area) -> Iterator[tuple[Area, Area, Mode]]:
        starts = [self.poses.get(one, []), self.poses.get(other, [])]
        points = np.array([self.standing[one], self.standing[other], *starts[0], *starts[1]])
        drives = _measured(planners, points)
        if np.isnan(drives[..., 1]).any():  # a start pose that a wall parts from its area's standing point
            drives = np.where(np.isnan(drives), _measured(self._whole, points), drives)
        first = 2 + len(starts[0])
        yield from ((one, other, mode) for mode in self._modes(drives[..., [0, *range(2, first)], 1]))
        yield from ((other, one, mode) for mode in self._modes(drives[..., [1, *range(first, len(points))], 0]))

    def _modes(self, drives: FloatArray) -> list[Mode]:
        """Return the speed modes of one arc that no other beats, fast ones first.

        Each way to plan makes one mode: the most steps and the most joules of any profile from any start. The
        energy of standing for the rest of the last step is part of it.

        Parameters
        ----------
        drives
            ``(ways, profiles, 3, starts)``: s, J and m of each drive.
        """
        modes = []
        idle_w = np.array([[profile.idle_w] for profile in self.profiles])
        for time_s, energy_j, length_m in np.moveaxis(drives, 2, 1):
            steps = max(1, ceil(float(time_s.max()) / self.step_s - _ROUNDING))
            with_rest_j = energy_j + idle_w * (steps * self.step_s - time_s)
            slowest = np.unravel_index(np.argmax(time_s), time_s.shape)
            modes.append(Mode(steps, float(with_rest_j.max()), float(length_m[slowest] / time_s[slowest])))
        waiting_j = float(idle_w.min()) * self.step_s
        kept: list[Mode] = []
        for mode in sorted(modes):
            if all(mode.energy_j < each.energy_j + waiting_j * (mode.steps - each.steps) - 1e-6 for each in kept):
                kept.append(mode)
        return kept


def _measured(planners: Planners, points: FloatArray) -> FloatArray:
    """Return s, J and m between points as ``(ways, profiles, 3, n, n)``, NaN where there is no path."""
    tables = [[way.cost_table(points) for way in own] for own in planners]
    each = [[(table.time_s, table.energy_j, table.length_m) for table in own] for own in tables]
    return np.swapaxes(np.array(each), 0, 1)
