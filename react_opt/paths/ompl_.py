"""Path costs from OMPL's sampling-based planners, for the robot's real footprint, with an exact motion check.

The only module that touches OMPL, which is imported when it is first used. What its Python wheel gets wrong, and
what is done about it here:

* Its default motion check samples a segment and accepts some that cross walls: every motion is tested by the
  exact rule of :mod:`react_opt.geometry.sight` instead.
* ``PRM.solve`` may deadlock with a Python termination function: a roadmap is only ever *grown*
  (``growRoadmapPtc``), read out once (decoupled from its planner first), and searched with SciPy's Dijkstra.
  One roadmap answers all queries, so a cost matrix is not N² searches.
* An exception in a Python callback aborts the process: the callbacks here cannot raise.
* Some planners hang or answer nonsense on easy queries: they are not offered (SORRTstar, AORRTC), points in
  sight of each other are answered directly, and single-query planners run in a child process that is killed
  when it does not answer (:mod:`react_opt.paths.ompl_child`).
* Wall-clock budgets are not reproducible: everything counts samples or iterations, with a seed.

The state is a point of the plane, the robot's centre. For the disc around the footprint that is exact. A robot that
turns on the spot and drives straight, as skid-steered ones do, sweeps a rectangle while it drives and a disc
where it turns; with ``footprint="rectangle"`` a drive needs only half the robot's *width* to either side, and its
ends the disc's radius: together they hold the swept rectangle exactly, heading included, without a third dimension.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from itertools import combinations, pairwise
from types import SimpleNamespace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from react_opt.energy import RobotProfile
from react_opt.errors import MissingPartError, ReactError, UsageError
from react_opt.geometry.inflation import Footprint, FreeSpace, inflate
from react_opt.geometry.sight import Padded, segment_free_px
from react_opt.paths.grid import pull_straight
from react_opt.paths.motion import polyline_px, terrain, totals
from react_opt.paths.ompl_child import SearchProcess
from react_opt.paths.protocol import CostTable, Path
from react_opt.paths.roadmap import Roadmap, flat_pixels
from react_opt.paths.sampled import FloatArray, Grids, IntArray, leg_times, tighten

PlannerName = Literal["PRMstar", "BITstar", "InformedRRTstar", "RRTstar", "RRTConnect"]
PLANNERS: tuple[PlannerName, ...] = get_args(PlannerName)
"""Planners of OMPL's wheel that answered every test query here, or said that they found nothing."""

_ITERATIONS: dict[str, int] = {"BITstar": 4000, "InformedRRTstar": 6000, "RRTstar": 6000, "RRTConnect": 20000}


def ompl() -> SimpleNamespace:
    """Return OMPL's modules ``base``, ``geometric`` and ``util``.

    Raises
    ------
    MissingPartError
        Where OMPL is not installed, naming what to install.
    """
    try:
        from ompl import base, geometric, util
    except ImportError as error:
        raise MissingPartError(
            f"OMPL path costs need the package ompl: pip install ompl (Linux and macOS) ({error})"
        ) from error
    return SimpleNamespace(base=base, geometric=geometric, util=util)


@contextmanager
def quiet() -> Iterator[None]:
    """Silence OMPL, which writes its messages to standard output (and calls reseeding an error)."""
    util = ompl().util
    level = util.getLogLevel()
    util.setLogLevel(util.LOG_NONE)
    try:
        yield
    finally:
        util.setLogLevel(level)


class _Samples:
    """Points for the planner to take one after the other.

    It knows nothing of OMPL: a reference back to OMPL's objects would be a cycle through C++ that nobody frees.
    """

    def __init__(self) -> None:
        self.points: FloatArray = np.empty((0, 2))
        self.taken = 0

    def more(self) -> bool:
        return self.taken < len(self.points)

    def put(self, state: Any) -> bool:
        if not self.more():
            return False
        state[0], state[1] = self.points[self.taken]
        self.taken += 1
        return True


def space(grids: Grids, seed: int, samples: _Samples | None = None) -> Any:
    """Return OMPL's space information over grids: the plane in pixels, with the exact checks.

    Parameters
    ----------
    grids
        Where the robot may stand and drive.
    seed
        OMPL's own random numbers start here.
    samples
        If given, the valid samples of the planner, instead of OMPL's own.
    """
    parts = ompl()
    base = parts.base
    parts.util.RNG.setSeed(1 + seed % 2**31)
    stand, drive = grids.stand, grids.drive
    rows, cols = stand.shape[0] - 2, stand.shape[1] - 2

    class Validity(base.StateValidityChecker):  # type: ignore[misc, name-defined]
        def isValid(self, state: Any) -> bool:
            x, y = state[0], state[1]
            return bool(0 <= x < cols and 0 <= y < rows and stand[int(y) + 1, int(x) + 1] == 0)

    class Motion(base.MotionValidator):  # type: ignore[misc, name-defined]
        def checkMotion(self, one: Any, other: Any) -> bool:
            return bool(segment_free_px(drive, one[0], one[1], other[0], other[1]))

    plane = base.RealVectorStateSpace(2)
    bounds = base.RealVectorBounds(2)
    for axis, high in enumerate((cols, rows)):
        bounds.setLow(axis, 0.0)
        bounds.setHigh(axis, float(high))
    plane.setBounds(bounds)
    information = base.SpaceInformation(plane)
    information.setStateValidityChecker(Validity(information))
    information.setMotionValidator(Motion(information))
    if samples is not None:
        put = samples.put

        class Sampler(base.ValidStateSampler):  # type: ignore[misc, name-defined]
            def sample(self, state: Any) -> bool:
                return put(state)

            def sampleNear(self, state: Any, near: Any, distance: float) -> bool:
                return False

        information.setValidStateSamplerAllocator(lambda of: Sampler(of))
    information.setup()
    return information


class RoadmapPlanner:
    """OMPL's PRM*, grown by given samples, never asked to solve.

    Parameters
    ----------
    grids
        Where the robot may stand and drive.
    seed
        Seed of OMPL's own random numbers.
    """

    def __init__(self, grids: Grids, seed: int) -> None:
        parts = ompl()
        self._samples = _Samples()
        with quiet():
            self._information = space(grids, seed, self._samples)
            self._planner = parts.geometric.PRMstar(self._information)
            self._problem = parts.base.ProblemDefinition(self._information)
            self._planner.setProblemDefinition(self._problem)
            self._planner.setup()

    def grow(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """Take points as milestones and return the whole roadmap.

        Parameters
        ----------
        points
            ``(m, 2)`` pixel coordinates where the robot may stand.

        Returns
        -------
        nodes, edges
            ``(v, 2)`` pixel coordinates and ``(e, 2)`` pairs of nodes. A milestone that the planner could join to
            no other is not among them.
        """
        samples = self._samples
        samples.points, samples.taken = points, 0
        base = ompl().base
        with quiet():
            self._planner.growRoadmapPtc(base.PlannerTerminationCondition(lambda: not samples.more()))
            data = base.PlannerData(self._information)
            self._planner.getPlannerData(data)
            data.decoupleFromPlanner()
        count = data.numVertices()
        states = [data.getVertex(index).getState() for index in range(count)]
        nodes = np.array([(state[0], state[1]) for state in states], dtype=np.float64).reshape(-1, 2)
        ends = [np.asarray(data.getEdges(index), dtype=np.int64) for index in range(count)]
        starts = np.repeat(np.arange(count), [len(each) for each in ends])
        return nodes, np.stack((starts, np.concatenate([*ends, np.empty(0, dtype=np.int64)])), axis=1)


def search(grids: Grids, planner: str, iterations: int, seed: int, start: FloatArray, goal: FloatArray) -> Any:
    """Run one single-query planner; it may hang, so only a child process calls this.

    Parameters
    ----------
    grids
        Where the robot may stand and drive.
    planner
        One of :data:`PLANNERS` but PRMstar.
    iterations
        The planner stops when it has asked this often whether to stop.
    seed
        Seed of its random numbers.
    start, goal
        ``(2,)`` pixel coordinates.

    Returns
    -------
    FloatArray | None
        ``(k, 2)`` pixel coordinates of an exact solution, None without any.
    """
    parts = ompl()
    with quiet():
        information = space(grids, seed)
        ends = []
        for point in (start, goal):
            ends.append(information.allocState())
            ends[-1][0], ends[-1][1] = float(point[0]), float(point[1])
        problem = parts.base.ProblemDefinition(information)
        problem.setStartAndGoalStates(*ends)
        problem.setOptimizationObjective(parts.base.PathLengthOptimizationObjective(information))
        solver = getattr(parts.geometric, planner)(information)
        solver.setProblemDefinition(problem)
        solver.setup()
        left = iterations

        def stop() -> bool:
            nonlocal left
            left -= 1
            return left < 0

        solver.solve(parts.base.PlannerTerminationCondition(stop))
        if not problem.hasExactSolution():
            return None
        states = problem.getSolutionPath().getStates()
        return np.array([(state[0], state[1]) for state in states])


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
        ompl()
        self.space = space
        self.profile = profile
        self._field = terrain(space, profile)
        drive = space.padded if footprint == "disc" else _straight(space, profile)
        self._grids = Grids(space.padded, drive)
        self._timed = minimise == "time"
        self._child: SearchProcess | None = None
        if planner == "PRMstar":
            planned = RoadmapPlanner(self._grids, seed)
            self._raw = Roadmap(self._grids, planned.grow, self._weigh, samples, seed).paths
            work = f"{samples} samples"
        else:
            count = _ITERATIONS[planner] if iterations is None else iterations
            self._child = SearchProcess(self._grids, planner, count, seed, patience_s)
            self._raw = partial(_searched_paths, self._child, self._grids)
            work = f"{count} iterations"
        self.method = f"OMPL {planner}, {work}, least {minimise}, seed {seed}, {footprint}, refine {space.refine}"

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


def _searched_paths(
    child: SearchProcess, grids: Grids, points: FloatArray
) -> Iterator[tuple[tuple[int, int], FloatArray]]:
    regions = np.asarray(ndimage.label(grids.drive == 0)[0], dtype=np.int32).ravel()
    at = regions[flat_pixels(grids.stand, points)] if len(points) else np.empty(0, np.int32)
    for i, j in combinations(range(len(points)), 2):
        if grids.leg_free(points[i], points[j]):
            yield (i, j), points[[i, j]]
        elif at[i] == at[j]:
            path = child.ask(points[i], points[j])
            if path is not None:
                yield (i, j), path
