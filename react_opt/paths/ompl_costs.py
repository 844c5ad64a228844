"""Path costs from OMPL's planners, for the robot's real footprint (an implementation of ``PathCosts``).

The state is a point of the plane, the robot's centre. For the disc around the footprint that is exact. A robot that
turns on the spot and drives straight, as skid-steered ones do, sweeps a rectangle while it drives and a disc
where it turns; with ``footprint="rectangle"`` a drive needs only half the robot's *width* to either side, and its
ends the disc's radius: together they hold the swept rectangle exactly, heading included, without a third dimension.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.energy import RobotProfile
from react_opt.errors import ReactError, UsageError
from react_opt.geometry.inflation import Footprint, FreeSpace, inflate
from react_opt.geometry.sight import Padded
from react_opt.paths.grid import pull_straight
from react_opt.paths.motion import polyline_px, terrain, totals
from react_opt.paths.ompl_ import (
    PLANNERS,
    Parameters,
    PlannerName,
    RoadmapPlanner,
    planner_named,
    quiet,
    space_information,
)
from react_opt.paths.ompl_child import SearchProcess
from react_opt.paths.protocol import CostTable, Path
from react_opt.paths.roadmap import Roadmap
from react_opt.paths.sampled import FloatArray, Grids, IntArray, leg_times, tighten

_ITERATIONS: dict[str, int] = {"BITstar": 4000, "InformedRRTstar": 6000, "RRTstar": 6000, "RRTConnect": 20000}
"""How often a planner may ask whether to stop: about a second each."""


class OmplPathCosts:
    """Path costs of one robot on one map, by a planner of OMPL (an implementation of ``PathCosts``).

    Parameters
    ----------
    space
        Where the disc around the footprint may be.
    profile
        The robot.
    planner
        ``PRMstar`` grows one roadmap and answers every query from it. The others search once per pair, in a child
        process; points in sight of each other are answered without them.
    samples
        Random milestones of the roadmap.
    minimise
        ``length``, or ``time`` by the speed law (PRMstar only): the roadmap's legs then cost what they take to drive,
        and a path keeps away from walls.
    iterations
        How often a single-query planner may ask whether to stop; by default what suits it.
    seed
        Same seed, same queries in the same order: same answers.
    parameters
        Parameters of the planner by the names of OMPL's setters, for instance ``{"SamplesPerBatch": 200}`` for
        ``setSamplesPerBatch`` of BITstar; lengths are in pixels of ``space``.
    footprint
        ``disc``, or ``rectangle`` for a robot that turns on the spot and drives straight (see this module).
    patience_s
        A single-query planner that has not answered after this long is killed, and its pair stays absent.

    Raises
    ------
    MissingPartError
        Where OMPL is not installed.
    UsageError
        Where an option is not one of those above.
    """

    def __init__(
        self,
        space: FreeSpace,
        profile: RobotProfile,
        *,
        planner: PlannerName = "PRMstar",
        samples: int = 1000,
        minimise: Literal["length", "time"] = "length",
        iterations: int | None = None,
        seed: int = 0,
        parameters: Parameters | None = None,
        footprint: Literal["disc", "rectangle"] = "disc",
        patience_s: float = 20.0,
    ) -> None:
        if planner not in PLANNERS:
            raise UsageError(f"expected a planner of {', '.join(PLANNERS)}, found {planner!r}")
        if footprint not in ("disc", "rectangle"):
            raise UsageError(f"a footprint is disc or rectangle, not {footprint!r}")
        if samples < 1 or (iterations is not None and iterations < 1) or seed < 0:
            raise UsageError("samples and iterations are at least 1, the seed at least 0")
        if minimise not in ("length", "time") or (minimise == "time" and planner != "PRMstar"):
            raise UsageError("OMPL paths minimise length, or with PRMstar time")
        self.space = space
        self.profile = profile
        self._field = terrain(space, profile)
        drive = space.padded if footprint == "disc" else _straight(space, profile)
        self._grids = Grids(space.padded, drive)
        self._timed = minimise == "time"
        self._child: SearchProcess | None = None
        given = dict(parameters or {})
        with quiet():
            planner_named(space_information(self._grids, seed), planner, given)  # refuses what is wrong, here and now
        if planner == "PRMstar":
            planned = RoadmapPlanner(self._grids, given, seed)
            self._raw = Roadmap(self._grids, planned.grow, self._weigh, samples, seed).paths
            work = f"{samples} samples"
        else:
            count = _ITERATIONS[planner] if iterations is None else iterations
            self._child = SearchProcess(self._grids, (planner, given, count, seed), patience_s)
            self._raw = self._child.paths
            work = f"{count} iterations"
        chosen = "".join(f", {key} {value}" for key, value in given.items())
        self.method = (
            f"OMPL {planner}, {work}{chosen}, least {minimise}, seed {seed}, {footprint}, refine {space.refine}"
        )

    def cost_table(self, points_m: ArrayLike) -> CostTable:
        """Return length, time and energy of paths between all pairs of ``(n, 2)`` points, m."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        n = len(points)
        free = self.space.points_free(points)
        measures = np.full((3, n, n), np.nan)  # length in m, driving time in s, turned angle in rad
        measures[:, np.arange(n)[free], np.arange(n)[free]] = 0.0
        for (i, j), path in self._between(np.ascontiguousarray(self.space.to_pixels(points)), free):
            length, time, _, turned = self._measured(path)
            measures[:, i, j] = measures[:, j, i] = length, time, turned
        time_s, energy_j = totals(self.profile, *measures)
        killed = self._child.killed if self._child else 0
        method = f"{self.method}, {killed} queries killed" if killed else self.method
        return CostTable(points, ~np.isnan(measures[0]), measures[0], time_s, energy_j, method)

    def path(self, start_m: ArrayLike, goal_m: ArrayLike) -> Path | None:
        """Return a path between two points, m, tested against the footprint; None where none was found."""
        ends = np.array((start_m, goal_m), dtype=np.float64)
        for _, path in self._between(np.ascontiguousarray(self.space.to_pixels(ends)), self.space.points_free(ends)):
            length, time, clearance, turned = self._measured(path)
            total, energy = totals(self.profile, length, time, turned)
            points = self.space.to_world(path)
            points[[0, -1]] = ends
            return Path(points, float(length), float(total), float(energy), float(clearance))
        return None

    def _measured(self, path: FloatArray) -> tuple[float, float, float, float]:
        """Return length, driving time, smallest clearance and turned angle, after testing every leg."""
        if not all(self._grids.leg_free(a, b) for a, b in pairwise(path)):
            raise ReactError("a path failed its check against the footprint")
        return polyline_px(self._field, path)

    def _between(self, pixels: FloatArray, free: NDArray[np.bool_]) -> Iterator[tuple[tuple[int, int], FloatArray]]:
        """Yield ``(i, j)``, i < j, and a polished path in pixels, for every pair that has one."""
        index = np.flatnonzero(free)
        for (i, j), path in self._raw(pixels[index]):
            yield (int(index[i]), int(index[j])), self._polished(path)

    def _weigh(self, nodes: FloatArray, pairs: IntArray) -> FloatArray:
        if self._timed:
            return leg_times(self._field, nodes, pairs)
        return np.asarray(np.hypot(*(nodes[pairs[:, 0]] - nodes[pairs[:, 1]]).T))

    def _polished(self, path: FloatArray) -> FloatArray:
        if self._timed:
            return pull_straight(self._grids.drive, self._field, path, True, 1 / self.profile.turn_rad_s)
        return tighten(self._grids.stand, self._grids.drive, path)


def _straight(space: FreeSpace, profile: RobotProfile) -> Padded:
    """Return where a straight drive may go: half the robot's width is enough to either side."""
    width = Footprint(min(profile.width_m / 2, space.footprint.radius_m))
    return inflate(space.source, width, unknown=space.unknown, rule=space.rule, refine=space.refine).padded
