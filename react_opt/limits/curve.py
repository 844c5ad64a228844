"""How much of a building a team can have seen by each time at most: the bound beside a mission's coverage curve.

Reachability alone (:mod:`react_opt.limits.bound`): a tile is not seen before some robot can be where a point of it is
visible, so the share known at t is at most the share of the tiles for which that is so.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.energy import RobotProfile
from react_opt.errors import UsageError
from react_opt.geometry.occupancy import UNKNOWN, OccupancyMap
from react_opt.limits.hidden import survey
from react_opt.sim.world import World
from react_opt.trace import Trace

FloatArray = NDArray[np.float64]
DEVIATIONS = 3.0
"""The simulator's noise of the speed is cut off at so many standard deviations."""

MOST_PIXELS = 1_500_000
"""The largest map that is looked at: beyond it the sightlines take minutes."""

TOLD_WITHIN = 1e-6
"""A frame's coverage is told with six digits."""

CoverageBound = tuple[FloatArray, FloatArray]
"""``(n,)`` rising times, s, and ``(n,)`` shares: up to the next of the times no team of these robots has seen more."""


def share_at(bound: CoverageBound, t_s: FloatArray) -> FloatArray:
    """Return the largest share that can be known at given times, s."""
    times, shares = bound
    return np.concatenate(([0.0], shares))[np.searchsorted(times, t_s + 1e-9, side="right")]


def coverage_bound(trace: Trace) -> CoverageBound:
    """Return a proven bound on the known share of the coverable area over time; takes seconds on a large map.

    What is coverable is what the trace itself counts, so that the bound speaks of the trace's own coverage.

    Parameters
    ----------
    trace
        A mission's record: its truth, its robots and their profiles.

    Returns
    -------
    CoverageBound
        Holds even for a team that knows the building.

    Raises
    ------
    UsageError
        Where there is none, and why: with a prior map, which may show anything at once; with a map larger than
        :data:`MOST_PIXELS`; where the trace counts nothing as coverable, has robots that its mission does not name,
        or a robot cannot stand at its start; and where the coverage told lies above the bound, so that the trace
        is of other robots than its mission says.
    """
    mission, grid = trace.mission, trace.truth
    if mission.prior_map is not None:
        raise UsageError("a prior map may show anything at once")
    if grid.rows * grid.cols > MOST_PIXELS:
        raise UsageError(f"a map of {grid.rows * grid.cols:,} pixels would take minutes: {MOST_PIXELS:,} at most")
    codes = grid.array("u1")
    coverable = (codes & 4) != 0
    if not coverable.any():
        raise UsageError("the trace counts no pixel of its truth as coverable")
    strange = {robot.id for frame in trace.frames for robot in frame.robots} - {robot.id for robot in mission.robots}
    if strange:
        raise UsageError(f"the mission does not name the robot {min(strange)[:40]!r} of the frames")
    cells = np.minimum(codes & 3, UNKNOWN).astype(np.uint8)
    truth = OccupancyMap(cells, grid.resolution_m, grid.origin_x_m, grid.origin_y_m, grid.origin_yaw_rad)
    profiles = [RobotProfile(**mission.profiles[robot.profile].model_dump()) for robot in mission.robots]
    starts = np.array([(robot.x_m, robot.y_m) for robot in mission.robots])
    radius = min(profile.radius_m for profile in profiles)
    world = World(truth, radius, max(profile.lidar_range_m for profile in profiles), starts)
    world.coverable = coverable
    hidden = survey(world, profiles, starts)
    earliest = hidden.earliest_s.min(axis=0) / (1.0 + DEVIATIONS * mission.noise.speed)
    order = np.argsort(earliest, kind="stable")
    order = order[np.isfinite(earliest[order])]
    times, last = np.unique(earliest[order][::-1], return_index=True)
    seen = np.cumsum(hidden.weight[order]) / hidden.total
    bound = times, seen[len(order) - 1 - last]
    _agree(trace, bound)
    return bound


def _agree(trace: Trace, bound: CoverageBound) -> None:
    """Raise where a trace tells of more coverage than its own robots can have by then."""
    t = np.array([frame.t_s for frame in trace.frames])
    told, most = np.array([frame.coverage for frame in trace.frames]), share_at(bound, t)
    above = np.flatnonzero(told > most + TOLD_WITHIN)
    if len(above):
        n = above[0]
        raise UsageError(
            f"the trace tells of {100 * told[n]:.2f} % known at {t[n]:g} s, where robots with its profiles can have "
            f"seen {100 * most[n]:.2f} % at most: they are faster or see farther than their profiles say"
        )
