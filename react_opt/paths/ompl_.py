"""OMPL's sampling-based planners over padded grids, with an exact motion check.

The only module that imports OMPL, when it is first used; :mod:`react_opt.paths.ompl_costs` makes path costs of it.
What its Python wheel gets wrong, and what is done about it here:

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
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import FrameType, SimpleNamespace
from typing import Any, Literal, get_args

import numpy as np

from react_opt.errors import MissingPartError, UsageError
from react_opt.geometry.sight import segment_free_px
from react_opt.paths.sampled import FloatArray, Grids, IntArray

PlannerName = Literal["PRMstar", "BITstar", "InformedRRTstar", "RRTstar", "RRTConnect"]
Parameters = Mapping[str, float]
PLANNERS: tuple[PlannerName, ...] = get_args(PlannerName)
"""Planners of OMPL's wheel that answered every test query here, or said that they found nothing."""


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
    """Silence OMPL, which writes its messages to standard output (and calls reseeding an error).

    An interrupt waits until the end: raised in one of OMPL's callbacks, it would abort the process.
    """
    util = ompl().util
    level = util.getLogLevel()
    util.setLogLevel(util.LOG_NONE)
    caught: list[tuple[int, FrameType | None]] = []
    main = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGINT, lambda number, frame: caught.append((number, frame))) if main else None
    try:
        yield
    finally:
        util.setLogLevel(level)
        if main:
            signal.signal(signal.SIGINT, handler)
        if caught and callable(handler):
            handler(*caught[0])


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


def space_information(grids: Grids, seed: int, samples: _Samples | None = None) -> Any:
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
    parameters
        See :class:`react_opt.paths.ompl_costs.OmplPathCosts`.
    seed
        Seed of OMPL's own random numbers.
    """

    def __init__(self, grids: Grids, parameters: Parameters, seed: int) -> None:
        parts = ompl()
        self._samples = _Samples()
        with quiet():
            self._information = space_information(grids, seed, self._samples)
            self._planner = planner_named(self._information, "PRMstar", parameters)
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


def planner_named(information: Any, name: str, parameters: Parameters) -> Any:
    """Return one of OMPL's planners with parameters set.

    Parameters
    ----------
    information
        OMPL's space information.
    name
        The planner.
    parameters
        What its setters are called with.

    Raises
    ------
    UsageError
        Where the planner has no such parameter, or not with such a value.
    """
    planner = getattr(ompl().geometric, name)(information)
    known = _parameters(planner)
    for key, value in parameters.items():
        setter = getattr(planner, f"set{key}", None)
        if setter is None or key not in known:
            raise UsageError(f"expected a parameter of {name} ({', '.join(known)}), found {key!r}")
        try:
            setter(value)
        except Exception as error:  # whatever the binding or OMPL itself objects to
            raise UsageError(f"{name} does not take {key} = {value!r}") from error
    return planner


def _parameters(planner: Any) -> list[str]:
    """Return the names of a planner's parameters."""
    apart = {"Name", "ProblemDefinition", "DefaultConnectionStrategy"}
    return [
        name[3:] for name in dir(planner) if name.startswith("set") and name[3:4].isupper() and name[3:] not in apart
    ]


def search(
    grids: Grids, planner: str, parameters: Parameters, iterations: int, seed: int, start: FloatArray, goal: FloatArray
) -> FloatArray | None:
    """Run one single-query planner; it may hang, so only a child process calls this.

    Parameters
    ----------
    grids
        Where the robot may stand and drive.
    planner
        One of :data:`PLANNERS` but PRMstar.
    parameters
        See :class:`react_opt.paths.ompl_costs.OmplPathCosts`.
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
        information = space_information(grids, seed)
        ends = []
        for point in (start, goal):
            ends.append(information.allocState())
            ends[-1][0], ends[-1][1] = float(point[0]), float(point[1])
        problem = parts.base.ProblemDefinition(information)
        problem.setStartAndGoalStates(*ends)
        problem.setOptimizationObjective(parts.base.PathLengthOptimizationObjective(information))
        solver = planner_named(information, planner, parameters)
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
