"""The best plan found when the whole map is known, driven in the simulator: what an explorer is measured against.

It is no bound: a better plan may exist. It is a plan, though: every path is handed to the simulated robots as orders,
and the time is what the simulator measures, with the sensors on all the time and without noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import hypot

import numpy as np
from numpy.typing import NDArray

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import Mission, canonical
from react_opt.jsonio import parse
from react_opt.limits.outlook import Outlook, look_out
from react_opt.limits.routes import MOST_STOPS, anneal, walk
from react_opt.orchestrator.belief import Belief
from react_opt.orchestrator.strategy import Decision, Order, Point
from react_opt.paths.grid import pull_straight
from react_opt.paths.motion import terrain
from react_opt.sim.loop import Simulation
from react_opt.sim.summary import coverage_times
from react_opt.sim.world import World

MARGINS = (0.002, 0.006, 0.012)
"""So much more than the share wanted is planned for, in turn: the search counts a sample of the pixels and scans at
the standing points, the simulator counts all and its robots cut corners."""


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


class Drive:
    """An order source that has robots drive given paths (a :class:`react_opt.orchestrator.strategy.Strategy`)."""

    def __init__(self, paths_m: dict[str, tuple[Point, ...]]) -> None:
        self._left = {name: list(path) for name, path in paths_m.items()}
        self._sent: set[str] = set()

    def decide(self, belief: Belief) -> Decision:
        """Send every robot on its way once, and on again where traffic has stopped it."""
        orders = []
        for robot in belief.robots:
            left = self._left.get(robot.id, [])
            if robot.state not in ("idle", "stuck") or not left:
                continue
            way: tuple[Point, ...] = ()
            if robot.id in self._sent:
                away = [hypot(x - robot.x_m, y - robot.y_m) for x, y in left]
                at = int(np.argmin(away))
                del left[: at + 1 if away[at] < 0.5 else at]
                way = belief.path(robot, left[0], optimistic=True) if left else ()
            if left:
                orders.append(Order(robot.id, (*way, *left)))
            self._sent.add(robot.id)
        busy = any(robot.state in ("driving", "yielding") for robot in belief.robots)
        return Decision(orders, done=not orders and not busy)


def nominal(mission: Mission) -> Mission:
    """Return a mission without noise, failures and radio, its sensors never off: what limits are stated for."""
    data = canonical(mission)
    data.update(noise={}, failures=[], link=None, always_on=True, prior_map=None)
    plain: Mission = parse(data, kind="mission")
    return plain


def best_plan(
    mission: Mission,
    truth: OccupancyMap,
    share: float,
    *,
    outlook: Outlook | None = None,
    restarts: int = 3,
    steps: int = 60_000,
    seed: int = 0,
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
        :func:`outlook_of` the mission or of one with more robots; by default made here.
    restarts
        How many searches; each one's plan is driven in the simulator and the best measured one returned.
    steps
        Moves that each search tries.
    seed
        Seed of the first search.
    """
    seen = outlook_of(mission, truth) if outlook is None else outlook
    driven = []
    for n in range(restarts):
        margin = MARGINS[n % len(MARGINS)]
        for planned_s, paths in _search(mission, seen, share, margin, steps, seed + n):
            driven.append(_driven(mission, truth, share, planned_s, paths))
    return min(driven, key=lambda plan: np.inf if plan.time_s is None else plan.time_s)


def outlook_of(mission: Mission, truth: OccupancyMap) -> Outlook:
    """Return the standing points for a mission's robots."""
    used = [RobotProfile(**mission.profiles[robot.profile].model_dump()) for robot in mission.robots]
    starts = np.array([(robot.x_m, robot.y_m) for robot in mission.robots])
    widest = max(used, key=lambda profile: profile.radius_m)
    world = World(truth, min(p.radius_m for p in used), max(p.lidar_range_m for p in used), starts)
    return look_out(world, widest, starts)


def _search(
    mission: Mission, seen: Outlook, share: float, margin: float, steps: int, seed: int
) -> list[tuple[float, dict[str, tuple[Point, ...]]]]:
    """Return when a team is expected to have seen a share, s, and its paths: as searched, and with corners cut."""
    places = np.array([(robot.x_m, robot.y_m) for robot in mission.robots])
    apart = np.hypot(*(seen.points_m[:, None, :] - places[None, :, :]).transpose(2, 0, 1))
    starts = len(apart) - 1 - np.argmin(apart[::-1], axis=0)
    used = [mission.profiles[robot.profile] for robot in mission.robots]
    motion = np.array(
        [
            (row.yaw_rad, profile.turn_rad_s, profile.speed_max_m_s / profile.accel_m_s2)
            for row, profile in zip(mission.robots, used, strict=True)
        ]
    )
    needed = min(_visible(seen, starts), int(np.ceil((share + margin) * seen.samples)))
    stops, counts = _greedy(seen, starts, needed)
    view = (seen.points_m, seen.time_s, seen.before, seen.sees)
    planned = anneal(view, stops, counts, starts, motion, needed, steps, 8.0, seed)
    paths: dict[str, tuple[Point, ...]] = {}
    cut: dict[str, tuple[Point, ...]] = {}
    for r, row in enumerate(mission.robots):
        node, at_s = np.empty(4096, dtype=np.int64), np.empty(4096)
        size = walk(view, stops[r], int(counts[r]), int(starts[r]), motion[r], node, at_s)
        size = int(np.searchsorted(at_s[:size], planned + 1e-9, side="right"))  # what comes later serves nothing
        profile = RobotProfile(**used[r].model_dump())
        paths[row.id] = tuple((float(x), float(y)) for x, y in seen.points_m[node[1:size]])
        cut[row.id] = _straightened(seen, profile, node[:size], stops[r, : counts[r]])
    return [(float(planned), paths), (float(planned), cut)]


def _visible(seen: Outlook, starts: NDArray[np.int64]) -> int:
    """Return how many sampled pixels are seen from anywhere the robots can come; no plan here sees more."""
    reached = np.isfinite(seen.time_s[starts]).any(axis=0)
    return int(np.bitwise_count(np.bitwise_or.reduce(seen.sees[reached], axis=0)).sum())


def _greedy(seen: Outlook, starts: NDArray[np.int64], needed: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return first routes: the robot that is free first takes the point that shows most per second of driving."""
    robots = len(starts)
    stops, counts = np.zeros((robots, MOST_STOPS), dtype=np.int64), np.zeros(robots, dtype=np.int64)
    at, clock = starts.copy(), np.zeros(robots)
    known = np.bitwise_or.reduce(seen.sees[starts], axis=0)
    while int(np.bitwise_count(known).sum()) < needed and counts.max() < MOST_STOPS // 2:
        r = int(np.argmin(clock))
        gain = np.bitwise_count(seen.sees & ~known).sum(axis=1) / (seen.time_s[at[r]] + 2.0)
        best = int(np.argmax(gain))
        if gain[best] <= 0:
            break
        stops[r, counts[r]] = best
        counts[r] += 1
        clock[r] += seen.time_s[at[r], best] + 1.0
        known |= seen.sees[best]
        at[r] = best
    return stops, counts


def _straightened(
    seen: Outlook, profile: RobotProfile, nodes: NDArray[np.int64], stops: NDArray[np.int64]
) -> tuple[Point, ...]:
    """Return way points: between the points to visit, bends that serve nothing are left out."""
    field = terrain(seen.space, profile)
    pixels = np.ascontiguousarray(seen.space.to_pixels(seen.points_m[nodes]))
    cuts, at = [0], 0
    for stop in stops:
        later = np.flatnonzero(nodes[at:] == stop)
        if len(later):
            at += int(later[0])
            cuts.append(at)
    cuts.append(len(nodes) - 1)
    points: list[Point] = []
    for first, last in pairwise(cuts):
        if last > first:
            leg = pull_straight(seen.space.padded, field, pixels[first : last + 1], True, 1 / profile.turn_rad_s)
            points += [(float(x), float(y)) for x, y in seen.space.to_world(leg[1:])]
    return tuple(points)


def _driven(
    mission: Mission, truth: OccupancyMap, share: float, planned_s: float, paths: dict[str, tuple[Point, ...]]
) -> FullMapPlan:
    """Drive paths in the simulator and see when the share is known."""
    trace = Simulation(nominal(mission), truth, strategy=Drive(paths)).run()
    times = coverage_times(trace)
    at = float(times[max(0, int(np.ceil(share * len(times) - 1e-9)) - 1)])
    return FullMapPlan(share, at if np.isfinite(at) else None, planned_s, paths, float(np.isfinite(times).mean()))
