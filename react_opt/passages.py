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
from react_opt.paths.protocol import CostTable, PathCosts

PathKind = Literal["exact", "ompl"]
Area = tuple[int, int]
_ROUNDING = 1e-9  # of a step: a drive of two steps but for rounding takes two
_SAMPLES_PER_M2 = 2.0  # of OMPL's roadmap: random milestones, 64 to 2000 of them


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
        lengths = [
            (float(self._whole[0][0].cost_table(np.stack((self.standing[a], self.standing[b]))).length_m[0, 1]), a, b)
            for a, b in divided
            if not together.connected(a, b)
        ]
        for _, one, other in sorted(lengths):
            if together.merge(one, other):
                self.detours.append((one, other))
                yield from self._both_ways(self._whole, one, other)

    def _neighbours(self) -> Iterator[tuple[Area, Area]]:
        for a, b in sorted(self.standing):
            for other in ((a, b + 1), (a + 1, b)):
                if other in self.standing:
                    yield (a, b), other

    def _planners(self, space: FreeSpace) -> list[list[PathCosts]]:
        """Return for each profile the ways to plan a drive."""
        if self.kind == "exact":
            return [[exact_costs(space, each), exact_costs(space, each, method="fastest16")] for each in self.profiles]
        from react_opt.paths.ompl_ import OmplPathCosts

        free_m2 = np.count_nonzero(space.blocked == 0) * space.resolution_m**2
        samples = int(np.clip(_SAMPLES_PER_M2 * free_m2, 64, 2000))
        return [
            [OmplPathCosts(space, each, samples=samples, minimise=what) for what in ("length", "time")]
            for each in self.profiles
        ]

    @cached_property
    def _whole(self) -> list[list[PathCosts]]:
        """The planners of the whole map, for what a window of two areas cannot answer."""
        return self._planners(self.grid.space)

    def _both_ways(self, planners: list[list[PathCosts]], one: Area, other: Area) -> Iterator[tuple[Area, Area, Mode]]:
        ends = [self.standing[one], self.standing[other]]
        starts = [*self.poses.get(one, []), *self.poses.get(other, [])]
        first = len(self.poses.get(one, []))
        points = np.array([*ends, *starts])
        tables = [[each.cost_table(points) for each in own] for own in planners]
        if not all(table.reachable.all() for own in tables for table in own):
            tables = [[each.cost_table(points) for each in own] for own in self._whole]
        at_one, at_other = [0, *range(2, 2 + first)], [1, *range(2 + first, len(points))]
        yield from ((one, other, mode) for mode in self._modes(tables, at_one, 1))
        yield from ((other, one, mode) for mode in self._modes(tables, at_other, 0))

    def _modes(self, tables: list[list[CostTable]], starts: list[int], end: int) -> list[Mode]:
        """Return the speed modes of one arc that no other beats, fast ones first.

        Each way to plan makes one mode: the most steps and the most joules of any profile from any start. The
        energy of standing for the rest of the last step is part of it.
        """
        modes = []
        for way in range(len(tables[0])):
            times = np.array([own[way].time_s[starts, end] for own in tables])
            steps = max(1, ceil(float(times.max()) / self.step_s - _ROUNDING))
            energies = np.array([own[way].energy_j[starts, end] for own in tables])
            idle = np.array([[profile.idle_w] for profile in self.profiles])
            energy = float((energies + idle * (steps * self.step_s - times)).max())
            slowest = np.unravel_index(np.argmax(times), times.shape)
            length = float(tables[slowest[0]][way].length_m[starts, end][slowest[1]])
            modes.append(Mode(steps, energy, length / float(times.max())))
        waiting_j = min(profile.idle_w for profile in self.profiles) * self.step_s
        kept: list[Mode] = []
        for mode in sorted(modes, key=lambda each: (each.steps, each.energy_j)):
            if all(mode.energy_j < each.energy_j + waiting_j * (mode.steps - each.steps) - 1e-6 for each in kept):
                kept.append(mode)
        return kept
