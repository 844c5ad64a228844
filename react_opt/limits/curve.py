"""How much of a building a team can have seen by each time at most: the bound beside a mission's coverage curve.

Reachability alone (:mod:`react_opt.limits.bound`): a tile is not seen before some robot can be where a point of it is
visible, so the share known at t is at most the share of the tiles for which that is so.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.limits.hidden import survey
from react_opt.sim.world import World
from react_opt.trace import Trace

FloatArray = NDArray[np.float64]
DEVIATIONS = 3.0
"""The simulator's noise of the speed is cut off at so many standard deviations."""


CoverageBound = tuple[FloatArray, FloatArray]
"""``(n,)`` rising times, s, and ``(n,)`` shares: up to the next of the times no team of these robots has seen more."""


def share_at(bound: CoverageBound, t_s: FloatArray) -> FloatArray:
    """Return the largest share that can be known at given times, s."""
    times, shares = bound
    return np.concatenate(([0.0], shares))[np.searchsorted(times, t_s + 1e-9, side="right")]


def coverage_bound(trace: Trace) -> CoverageBound | None:
    """Return a proven bound on the known share of the coverable area over time; takes seconds on a large map.

    Parameters
    ----------
    trace
        A mission's record: its truth, its robots and their profiles.

    Returns
    -------
    CoverageBound or None
        Holds even for a team that knows the building. None with a prior map, which may show anything at once.

    Raises
    ------
    UsageError
        Where a robot cannot stand at its start: the trace is of another building.
    """
    mission, grid = trace.mission, trace.truth
    if mission.prior_map is not None:
        return None
    cells = (grid.array("u1") & 3).astype(np.uint8)
    truth = OccupancyMap(cells, grid.resolution_m, grid.origin_x_m, grid.origin_y_m, grid.origin_yaw_rad)
    profiles = [RobotProfile(**mission.profiles[robot.profile].model_dump()) for robot in mission.robots]
    starts = np.array([(robot.x_m, robot.y_m) for robot in mission.robots])
    radius = min(profile.radius_m for profile in profiles)
    world = World(truth, radius, max(profile.lidar_range_m for profile in profiles), starts)
    hidden = survey(world, profiles, starts)
    earliest = hidden.earliest_s.min(axis=0) / (1.0 + DEVIATIONS * mission.noise.speed)
    order = np.argsort(earliest, kind="stable")
    order = order[np.isfinite(earliest[order])]
    times, last = np.unique(earliest[order][::-1], return_index=True)
    seen = np.cumsum(hidden.weight[order]) / max(1, hidden.total)
    return times, seen[len(order) - 1 - last]
