"""OROS on the belief: an instance built from what the fleet knows, solved, and read as a route of areas per robot.

Distances between areas come from the belief alone. Unknown space counts as free (a passage at cruise speed) until
the belief shows a wall; then the way around is what it costs, and where that way leads through another area there is
no arc of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from react_opt.geometry.occupancy import UNKNOWN, OccupancyMap
from react_opt.instance import Cell, OrosInstance, OrosRobot, TravelArc
from react_opt.orchestrator.belief import AreaView, Belief, FloatArray, RobotView
from react_opt.orchestrator.strategy import Note, Point, StrategyOptions
from react_opt.orchestrator.survey import Survey
from react_opt.plan import OrosPlan
from react_opt.planner import solve

WORK_LIMIT = 4000  # of one high-level solve: counted, so that the same mission gives the same plan
VIA = 1.1  # a way through another area that is at most so much longer stands for the direct one
NEAR_BLOCKS = 10  # an area is left from the drivable block nearest to its middle, at most so many away
IDLE_S = 1e-6


@dataclass(frozen=True)
class Place:
    """Where a robot enters the high-level plan: the area it is in or on its way to, and the seconds until then."""

    robot: RobotView
    area: str
    busy_s: float = 0.0


@dataclass(frozen=True)
class HighLevelPlan:
    """A route of areas per robot, without the area it starts from; robots that were left out are absent.

    Parameters
    ----------
    routes
        Per robot the areas in the order it drives to them.
    explored_by
        Per area that the plan newly explores, the robot that does.
    note
        The replan, for the trace.
    """

    routes: Mapping[str, tuple[str, ...]]
    explored_by: Mapping[str, str]
    note: Note


def area_at(belief: Belief, point: Point) -> AreaView:
    """Return the area whose centre is nearest to a point by the larger of both offsets: the square it lies in."""
    return min(belief.areas, key=lambda area: max(abs(area.x_m - point[0]), abs(area.y_m - point[1])))


def goal_of(source: OccupancyMap, area: AreaView) -> Point:
    """Return where to drive to in an area: its centre while nobody knows what is there, then its standing point."""
    centre = (area.x_m, area.y_m)
    unknown = int(source.values_at(np.array(centre))) == UNKNOWN
    return centre if unknown and not area.unreachable else area.stand_m


def area_times(survey: Survey, areas: Sequence[AreaView]) -> FloatArray:
    """Return time (s) between where areas are driven to as ``(n, n)``, NaN where walls are known all around."""
    points = [goal_of(survey.map, area) for area in areas]
    blocks = [survey.nearest_block(survey.block_of(*point), survey.may, NEAR_BLOCKS) for point in points]
    time_s = np.full((len(areas), len(areas)), np.nan)
    for row, point in enumerate(points):
        if blocks[row] is not None:
            field = survey.times_from(*point, optimistic=True)
            time_s[row] = [np.nan if block is None else field[block] for block in blocks]
    time_s[~np.isfinite(time_s)] = np.nan
    np.fill_diagonal(time_s, 0.0)
    return np.asarray((time_s + time_s.T) / 2)


def direct_pairs(time_s: FloatArray, beside: FloatArray) -> list[tuple[int, int]]:
    """Return the pairs of areas that are joined by an arc.

    Neighbours are joined where no way through a third area is about as short: else a wall is known to stand between
    them. An area that is cut off by this is joined along its shortest ways.

    Parameters
    ----------
    time_s
        ``(n, n)`` s between areas, NaN where there is no way.
    beside
        ``(n, n)`` true where areas share a side.
    """
    far = np.where(np.isnan(time_s), np.inf, time_s)
    n = len(far)
    direct = np.isfinite(far)
    for k in range(n):
        via = far[:, k, None] + far[None, k, :]
        via[k, :], via[:, k] = np.inf, np.inf
        direct &= ~(via <= VIA * far)
    np.fill_diagonal(direct, False)
    joined = direct & beside.astype(bool)
    group = np.arange(n)
    for i, j in np.argwhere(joined):
        group[group == group[j]] = group[i]
    order = sorted((far[i, j], i, j) for i in range(n) for j in range(i) if np.isfinite(far[i, j]))
    for _, i, j in order:
        if group[i] != group[j]:
            joined[i, j] = joined[j, i] = True
            group[group == group[j]] = group[i]
    return [(int(i), int(j)) for i, j in np.argwhere(joined)]


def neighbours(areas: Sequence[AreaView]) -> FloatArray:
    """Return ``(n, n)`` 1.0 where two areas share a side, by their ids ``a,b``."""
    at = np.array([[int(part) for part in area.id.split(",")] for area in areas]).reshape(-1, 2)
    return np.asarray(np.abs(at[:, None] - at[None]).sum(axis=2) == 1, dtype=np.float64)


def high_level(
    belief: Belief,
    survey: Survey,
    options: StrategyOptions,
    places: Sequence[Place],
    explored: frozenset[str],
) -> HighLevelPlan:
    """Build an OROS instance from the belief, solve it and return routes.

    Parameters
    ----------
    belief, survey, options
        What is known, its map's survey, and the step, horizon and window.
    places
        The robots that take part. A busy robot enters with the area it is on its way to as its start and the steps
        until it is there, rounded up. One that cannot even idle through the window is left out.
    explored
        Ids of the areas that count as explored; areas proven unreachable leave the problem.
    """
    step_s = options.step_s
    left = int((options.horizon_s - belief.t_s) / step_s + 1e-9)
    window = left if options.window_steps is None else min(left, options.window_steps)
    taking_part = [
        place
        for place in places
        if window >= 1
        and ceil(place.busy_s / step_s - IDLE_S) <= window
        and place.robot.profile.idle_w * window * step_s <= place.robot.battery_j - place.robot.profile.reserve_j
    ]
    if not taking_part:
        return HighLevelPlan({}, {}, Note("replan", reason="OROS: no robot can take part for a step of the window"))
    starts = {place.area for place in taking_part}
    areas = [area for area in belief.areas if not area.unreachable or area.id in starts]
    instance = _instance(survey, options, taking_part, areas, explored, window)
    plan: OrosPlan = solve(instance, time_limit_s=None, work_limit=WORK_LIMIT, threads=1, seed=0, explain=False)
    claim = plan.claim.model_copy(update={"certificate": None, "wall_s": {}})
    routes = {robot.id: _route(robot.steps) for robot in plan.robots}
    note = Note("replan", reason=f"OROS: {len(areas)} areas, {len(plan.explored)} to be explored", claim=claim)
    return HighLevelPlan(routes, {row.cell: row.robot for row in plan.explored}, note)


def _route(steps: Sequence[object]) -> tuple[str, ...]:
    """Return the areas of a robot's steps after its first one, without those after its last sensing."""
    route: list[str] = []
    last = 0
    before = None
    for step in steps:
        cell = step.cell  # type: ignore[attr-defined]
        if cell is not None and cell != before:
            if before is not None:
                route.append(cell)
            before = cell
        if step.sensing:  # type: ignore[attr-defined]
            last = len(route)
    return tuple(route[:last])


def _instance(
    survey: Survey,
    options: StrategyOptions,
    places: Sequence[Place],
    areas: Sequence[AreaView],
    explored: frozenset[str],
    window: int,
) -> OrosInstance:
    step_s = options.step_s
    slowest = min((place.robot for place in places), key=lambda robot: robot.profile.speed_max_m_s)
    time_s = area_times(survey, areas)
    travel = []
    for i, j in direct_pairs(time_s, neighbours(areas)):
        drive_s = float(time_s[i, j])
        steps = max(1, ceil(drive_s / step_s - 1e-9))
        energy_j = slowest.profile.motion_w * drive_s + slowest.profile.idle_w * steps * step_s
        travel.append(
            TravelArc.model_validate({"from": areas[i].id, "to": areas[j].id, "steps": steps, "energy_j": energy_j})
        )
    robots = []
    for place in places:
        profile = place.robot.profile
        busy = ceil(place.busy_s / step_s - IDLE_S)
        spent_j = busy * step_s * (profile.idle_w + profile.motion_w + profile.sensing_w)
        idle_j = profile.idle_w * (window - busy) * step_s
        robots.append(
            OrosRobot(
                id=place.robot.id,
                start=place.area,
                start_step=busy,
                # what it will have when it is free, as far as can be told, and never less than idling takes
                battery_j=max(place.robot.battery_j - spent_j, profile.reserve_j + idle_j)
                if busy
                else place.robot.battery_j,
                capacity_j=max(profile.capacity_j, place.robot.battery_j, profile.reserve_j + idle_j),
                reserve_j=profile.reserve_j,
                idle_w=profile.idle_w,
                sensing_w=profile.sensing_w,
            )
        )
    cells = tuple(
        Cell(id=area.id, x_m=area.stand_m[0], y_m=area.stand_m[1], explored=area.id in explored or area.unreachable)
        for area in areas
    )
    return OrosInstance(
        name="belief",
        horizon_steps=window,
        step_s=step_s,
        cells=cells,
        travel=tuple(travel),
        robots=tuple(robots),
    )
