"""The best plan found when the whole map is known, driven in the simulator: what an explorer is measured against.

It is no bound: a better plan may exist. It is a plan, though: every path is handed to the simulated robots as orders,
and the time is what the simulator measures, with the sensors on all the time and without noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import Mission
from react_opt.limits.drive import Drive, nominal
from react_opt.limits.outlook import Outlook, look_out
from react_opt.limits.polish import MOST_POINTS, polish
from react_opt.limits.ride import law_of
from react_opt.limits.routes import MOST_STOPS, NEAR, anneal
from react_opt.orchestrator.strategy import Point
from react_opt.paths.grid import pull_straight
from react_opt.paths.motion import terrain
from react_opt.sim.loop import SCAN_S, Simulation
from react_opt.sim.summary import coverage_times
from react_opt.sim.world import World

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

ROUNDS = 4
"""A plan is polished and driven so often; each time as much more is wanted of the sample as the simulator missed."""

MORE_ROUNDS = 4
"""So often again at most where it has missed the share each time: it does where hardly anything may be missing."""

_MARGIN = 0.003  # of the sample, more than the share, to begin with
_LEFT = 0.3  # of what can be seen beyond the share, no more is wanted in addition: all that is left takes very long
_SPARE = (0.004, 0.007, 0.002)  # so much more is wanted of routes, in turn: polishing cuts some of it
_PRICE_S = 4000.0  # for seeing nothing of what is wanted
_HEAT_S = ((6.0, 0.05), (0.1, 0.01))  # of the routes and of the way points: at the start and at the end


@dataclass(frozen=True)
class FullMapPlan:
    """A plan made with the whole map known.

    Parameters
    ----------
    share
        The share of the coverable area that it is to see early.
    time_s
        When it has, as measured in the simulator, s; None where it does not.
    planned_s
        What the search expected, s.
    paths_m
        Way points per robot, m.
    coverage
        The share seen when all paths are driven.
    """

    share: float
    time_s: float | None
    planned_s: float
    paths_m: dict[str, tuple[Point, ...]]
    coverage: float


def best_plan(
    mission: Mission,
    truth: OccupancyMap,
    share: float,
    *,
    outlook: Outlook | None = None,
    restarts: int = 3,
    steps: int = 600_000,
    seed: int = 0,
    on_progress: Callable[[], None] | None = None,
) -> FullMapPlan:
    """Search for the plan that sees a share of a known building earliest, and drive the best ones.

    Parameters
    ----------
    mission
        The team, its starts and its horizon.
    truth
        The map.
    share
        Share of the coverable area wanted, in (0, 1].
    outlook
        :func:`outlook_of` the mission; by default made here.
    restarts
        How many searches; the best plan as driven is returned.
    steps
        Moves that each search tries on routes; on way points it tries a tenth of that, in each of :data:`ROUNDS`.
    seed
        Seed of the first search.
    on_progress
        Called :data:`ROUNDS` times in each search.
    """
    view = outlook_of(mission, truth) if outlook is None else outlook
    used = [RobotProfile(**mission.profiles[robot.profile].model_dump()) for robot in mission.robots]
    laws = _laws(mission, truth, used)
    most = _most(view, len(used))
    driven: list[FullMapPlan] = []
    for n in range(restarts):
        needed, more = _wanted(share, n, most, view.samples)
        ways, counts = _routes(view, used, laws, more, steps, seed + n)
        reached = False
        for k in range(ROUNDS + MORE_ROUNDS):
            if k >= ROUNDS and reached:
                break
            planned = polish(
                view.space.padded, 1 / view.space.resolution_m, ways, counts, view.ground, laws, view.lattice,
                needed, max(1, steps // 10), *_HEAT_S[1], seed + n + 1000 * k,
            )  # fmt: skip
            plan, seen = _driven(mission, truth, share, float(planned), ways, counts)
            driven.append(plan)
            reached = reached or plan.time_s is not None
            # The sample counts squares, the simulator pixels from where the robot is: want as much more as was missing.
            missing = int(np.ceil((share - seen) * view.samples)) + (0 if reached else 1 + k)
            needed = min(most, max(1, needed + missing))
            if on_progress is not None and k < ROUNDS:
                on_progress()
    return min(driven, key=lambda plan: (np.inf if plan.time_s is None else plan.time_s, -plan.coverage))


def outlook_of(mission: Mission, truth: OccupancyMap) -> Outlook:
    """Return what the planner knows of a building: for a mission's robots, at their starts."""
    used = [RobotProfile(**mission.profiles[robot.profile].model_dump()) for robot in mission.robots]
    starts = np.array([(robot.x_m, robot.y_m) for robot in mission.robots])
    widest = max(used, key=lambda profile: profile.radius_m)
    world = World(truth, min(p.radius_m for p in used), max(p.lidar_range_m for p in used), starts)
    return look_out(world, widest, starts)


def _laws(mission: Mission, truth: OccupancyMap, used: list[RobotProfile]) -> FloatArray:
    """Return each robot's start pose on the grid and its limits."""
    rows = []
    for row, profile in zip(mission.robots, used, strict=True):
        u, v = truth.world_to_pixel((row.x_m, row.y_m)) * truth.resolution_m
        rows.append(law_of(profile, float(u), float(v), row.yaw_rad - truth.origin_yaw_rad))
    return np.array(rows)


def _most(view: Outlook, robots: int) -> int:
    """Return how many sampled pixels are seen from anywhere that the robots' ways lead; no plan here sees more."""
    n = len(view.chosen)
    reached = np.flatnonzero(np.isfinite(view.time_s[n - robots :]).any(axis=0))
    alone = view.seen[reached * (reached + 1) // 2 + reached]
    return int(np.bitwise_count(np.bitwise_or.reduce(alone, axis=0)).sum())


def _wanted(share: float, search: int, most: int, samples: int) -> tuple[int, int]:
    """Return how many sampled pixels are wanted of ways at first, and of the routes they begin with."""
    lowest = int(np.ceil(share * samples))
    left = int(_LEFT * max(0, most - lowest))
    needed = min(most, lowest + min(left, int(np.ceil(_MARGIN * samples))))
    spare = int(_SPARE[search % len(_SPARE)] * samples)
    return needed, min(most, needed + min(left, spare))


def _routes(
    view: Outlook, used: list[RobotProfile], laws: FloatArray, needed: int, steps: int, seed: int
) -> tuple[FloatArray, IntArray]:
    """Return the way points of good routes, ``(robots, MOST_POINTS, 2)`` grid metres, and how many count."""
    robots, points = len(used), len(view.chosen)
    starts = np.arange(points - robots, points)
    near = np.ascontiguousarray(np.argsort(view.time_s, axis=1, kind="stable")[:, 1 : 1 + NEAR])
    stops, counts = np.zeros((robots, MOST_STOPS), dtype=np.int64), np.zeros(robots, dtype=np.int64)
    net = (view.time_s, view.out_rad, view.into_rad, view.loss_s, view.seen)
    price_s = _PRICE_S / max(1, needed)
    anneal(net, near, stops, counts, starts, laws[:, 2].copy(), needed, price_s, steps, *_HEAT_S[0], seed)
    ways, found = np.zeros((robots, MOST_POINTS, 2)), np.zeros(robots, dtype=np.int64)
    for r, profile in enumerate(used):
        field, here, way = terrain(view.space, profile), int(starts[r]), []
        for stop in stops[r, : counts[r]].tolist():
            if stop != here and np.isfinite(view.time_s[here, stop]):
                leg = view.pixels(view.way(here, stop))
                way.append(pull_straight(view.space.padded, field, leg, True, 1 / profile.turn_rad_s)[1:])
                here = stop
        if way:
            joined = np.concatenate(way)[:MOST_POINTS] * view.space.resolution_m
            found[r], ways[r, : len(joined)] = len(joined), joined
    return ways, found


def _driven(
    mission: Mission, truth: OccupancyMap, share: float, planned_s: float, ways: FloatArray, counts: IntArray
) -> tuple[FullMapPlan, float]:
    """Drive ways in the simulator; return the plan with what was measured, and the share seen soon after its end.

    Soon after: a glance into a room, or a robot that waits for another one, may make the difference within two scans.
    """
    world = [truth.pixel_to_world(ways[r, :count] / truth.resolution_m) for r, count in enumerate(counts)]
    paths = {
        row.id: tuple((float(x), float(y)) for x, y in points)
        for row, points in zip(mission.robots, world, strict=True)
    }
    trace = Simulation(nominal(mission), truth, strategy=Drive(paths)).run()
    times = coverage_times(trace)
    at = float(times[max(0, int(np.ceil(share * len(times) - 1e-9)) - 1)])
    coverage = float(np.isfinite(times).mean())
    plan = FullMapPlan(share, at if np.isfinite(at) else None, planned_s, paths, coverage)
    return plan, float((times <= planned_s + 2 * SCAN_S).mean())
