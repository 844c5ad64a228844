"""From a map and a fleet to an explicit OROS instance.

What becomes what
-----------------
Cells
    The areas of :mod:`react_opt.areas` that hold a point which the robots reach; each gets one standing point
    (at its charger where it has one), which is the cell's ``x_m, y_m``. Its id is ``g<column>_<row>``.
Travel arcs
    Between the standing points of neighbouring areas (left, right, up, down: areas that share only a corner
    share no passage), by a path that stays within the two areas. A wall between them means no arc, however near
    the other side is. Only where this would cut a cell off though the robots can reach it (a wall divides an
    area), two areas that share a crossing are joined by a path through those around, and a note says so.
Steps and joules
    Time by the speed law, rounded up to whole steps; energy of driving, turning and, for the rest of the last
    step, of standing. Sensing is not in it. Speed modes are the fastest path, which keeps away from walls, and
    the shortest one, which costs least to drive; a mode that another one beats is left out (a slower mode must
    save more than the robot spends by arriving early and waiting).
Start poses
    A robot stands in the area of its pose from the start. Since it is not at the standing point yet, arcs that
    leave the area are timed for the worst of the standing point and the poses there.
Several profiles
    Arcs are shared, so each is timed for the slowest and charged for the hungriest, along paths that the largest
    footprint can drive.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from math import floor, isfinite
from typing import NamedTuple, get_args

import numpy as np

from react_opt.areas import AreaGrid, lay_grid
from react_opt.energy import RobotProfile
from react_opt.errors import Fault, InputError, UsageError
from react_opt.geometry.inflation import Footprint, FreeSpace, UnknownSpace, inflate
from react_opt.geometry.occupancy import FREE, FloatArray, OccupancyMap
from react_opt.instance import MAX_HORIZON_STEPS, Cell, Charger, Fleet, OrosInstance, OrosRobot, TravelArc
from react_opt.passages import Area, Mode, Passages, PathKind


class Drop(NamedTuple):
    """Something that did not become part of the instance: what it is, where, and why."""

    what: str
    place: str
    why: str

    def __str__(self) -> str:
        return f"dropped {self.what} {self.place}: {self.why}"


@dataclass(frozen=True)
class BuildReport:
    """An instance built from a map, and what a reader of it should know.

    Parameters
    ----------
    instance
        The instance.
    dropped
        What was left out and why.
    notes
        What was decided where map and fleet left a choice.
    """

    instance: OrosInstance
    dropped: list[Drop]
    notes: list[str]


def build(
    source: OccupancyMap,
    fleet: Fleet,
    *,
    cell_m: float,
    horizon_s: float,
    step_s: float,
    paths: PathKind = "exact",
    unknown: UnknownSpace = "blocked",
    name: str | None = None,
    map_file: str = "<map>",
    fleet_file: str = "<fleet>",
) -> BuildReport:
    """Build an OROS instance from a map and a fleet (see this module for what becomes what).

    Parameters
    ----------
    source
        The map.
    fleet
        The robots, their profiles and start poses, and the chargers.
    cell_m, horizon_s, step_s
        Side of an area, m; time to plan for and length of a step, s. What is left of the horizon after its last
        whole step is not planned for.
    paths
        ``exact``: any-angle shortest paths and fastest pixel paths. ``ompl``: both by OMPL's PRM*.
    unknown
        How unknown pixels count.
    name
        Name of the instance, by default the fleet's.
    map_file, fleet_file
        Names of the files, for messages.

    Raises
    ------
    UsageError
        Where a number or option makes no sense.
    InputError
        Where the map has no free space, or robots of the fleet start where they cannot be: all of them at once.
    MissingPartError
        Where ``paths`` is ``ompl`` and OMPL is not installed.
    """
    steps = _horizon_steps(cell_m, horizon_s, step_s, paths)
    if not fleet.robots:
        raise InputError.single(fleet_file, "robots", "expected at least one")
    used = dict.fromkeys(robot.profile for robot in fleet.robots)
    profiles = [RobotProfile(**fleet.profiles[key].model_dump()) for key in used]
    radius = max(profile.radius_m for profile in profiles)
    space = inflate(source, Footprint(radius), unknown=unknown)
    if not space.regions.any():
        raise InputError.single(map_file, "", f"expected free space for a robot of {radius:.3f} m radius, found none")

    dropped: list[Drop] = []
    notes: list[str] = []
    points = _start_points(space, fleet, map_file, fleet_file, notes)
    region = _main_region(space, fleet, points, dropped)
    grid = lay_grid(space, region, cell_m)
    starts = {
        index: (_area(grid, point), point) for index, point in points.items() if space.regions_at(point)[0] == region
    }
    chargers, beside = _chargers(grid, region, fleet, dropped, notes)
    easy_m = max(profile.full_speed_clearance_m for profile in profiles)
    standing = _standing_points(grid, beside, easy_m, dropped)
    poses: dict[Area, list[FloatArray]] = {}
    for area, point in starts.values():
        poses.setdefault(area, []).append(point)
    passages = Passages(grid, standing, poses, profiles, step_s, paths)
    travel = tuple(
        TravelArc.model_validate({"from": _id(one), "to": _id(other), **_rounded(mode)})
        for one, other, mode in passages.arcs()
    )
    notes += [
        f"{_id(one)} and {_id(other)}: no way within the two of them, timed along a way through other cells"
        for one, other in passages.detours
    ]
    if len(profiles) > 1:
        notes.append(f"{len(profiles)} profiles share the arcs: timed and charged for the worst of them")
    left_s = horizon_s - steps * step_s
    if left_s > 1e-6 * step_s:
        notes.append(f"the last {left_s:g} s of the horizon are less than a step and are not planned for")
    instance = OrosInstance(
        name=name or fleet.name,
        horizon_steps=steps,
        step_s=float(step_s),
        cells=tuple(
            Cell(id=_id(area), x_m=round(float(at[0]), 6), y_m=round(float(at[1]), 6)) for area, at in standing.items()
        ),
        travel=travel,
        robots=tuple(_robot(fleet, index, area) for index, (area, _) in starts.items()),
        chargers=tuple(chargers),
    )
    return BuildReport(instance, dropped, notes)


def _horizon_steps(cell_m: float, horizon_s: float, step_s: float, paths: str) -> int:
    """Return the horizon in steps, after checking what the caller chose."""
    for label, value in (("cell_m", cell_m), ("horizon_s", horizon_s), ("step_s", step_s)):
        if not (isfinite(value) and value > 0):
            raise UsageError(f"{label} is a positive number, not {value}")
    if paths not in get_args(PathKind):
        raise UsageError(f"paths are exact or ompl, not {paths!r}")
    steps = horizon_s / step_s + 1e-9
    if not 1 <= steps < MAX_HORIZON_STEPS + 1:
        raise UsageError(f"a horizon has 1 to {MAX_HORIZON_STEPS} steps, {horizon_s:g} s of {step_s:g} s are {steps:g}")
    return floor(steps)


def _id(area: Area) -> str:
    return f"g{area[0]}_{area[1]}"


def _rounded(mode: Mode) -> dict[str, float]:
    """Return a mode as fields of an arc, to microjoules: the last digits differ between machines."""
    return {"steps": mode.steps, "energy_j": round(mode.energy_j, 6), "speed_m_s": round(mode.speed_m_s, 6)}


def _area(grid: AreaGrid, point: FloatArray) -> Area:
    """Return the area of a reachable point: the grid covers all of them."""
    area = grid.area_of(point)
    if area is None:
        raise AssertionError(f"{point} lies in no area")
    return area


def _robot(fleet: Fleet, index: int, area: Area) -> OrosRobot:
    robot = fleet.robots[index]
    profile = fleet.profiles[robot.profile]
    return OrosRobot(
        id=robot.id,
        start=_id(area),
        battery_j=profile.battery_j,
        capacity_j=profile.capacity_j,
        reserve_j=profile.reserve_j,
        idle_w=profile.idle_w,
        sensing_w=profile.sensing_w,
    )


def _start_points(
    space: FreeSpace, fleet: Fleet, map_file: str, fleet_file: str, notes: list[str]
) -> dict[int, FloatArray]:
    """Return where each robot starts, or raise every pose that is no good.

    A pose within the disc's reach of a wall is good if the robot's outline may still fit, turned the right way
    (clearance of half its width): the robot is then taken to stand at the nearest point where it can turn.
    """
    result: dict[int, FloatArray] = {}
    faults = []
    for index, robot in enumerate(fleet.robots):
        point = np.array((robot.x_m, robot.y_m))
        why = space.why_not(point)
        if why is not None:
            profile = fleet.profiles[robot.profile]
            fits = float(space.clearance_at(point)[0]) >= min(profile.length_m, profile.width_m) / 2
            moved = space.nearest_free_point(point) if fits else None
            if moved is None or np.hypot(*(moved - point)) > 2 * space.footprint.radius_m:
                expected = f"expected a start in the free space of {map_file}"
                found = f"({robot.x_m:g}, {robot.y_m:g}) is {why}"
                faults.append(Fault(fleet_file, f"robots[{index}]", f"{expected}, {robot.id!r} at {found}"))
                continue
            notes.append(f"robot {robot.id} starts {why}; it is taken to stand at ({moved[0]:.2f}, {moved[1]:.2f})")
            point = moved
        result[index] = point
    if faults:
        raise InputError(faults)
    return result


def _main_region(space: FreeSpace, fleet: Fleet, points: dict[int, FloatArray], dropped: list[Drop]) -> int:
    """Return the connected region of most robots, the largest on ties; robots elsewhere are dropped."""
    regions = {index: int(space.regions_at(point)[0]) for index, point in points.items()}
    sizes = np.bincount(space.regions.ravel())
    count = Counter(regions.values())
    main = max(count, key=lambda region: (count[region], sizes[region], -region))
    dropped += [
        Drop("robot", fleet.robots[index].id, "walled off from the others; it needs an instance of its own")
        for index, region in regions.items()
        if region != main
    ]
    return main


def _chargers(
    grid: AreaGrid, region: int, fleet: Fleet, dropped: list[Drop], notes: list[str]
) -> tuple[list[Charger], dict[Area, FloatArray]]:
    """Return the chargers by cell, and the point beside the first charger of each area.

    Several chargers in one area become one, with all their slots and the smallest power.
    """
    found: dict[Area, Charger] = {}
    beside: dict[Area, FloatArray] = {}
    reach_m = 2 * grid.space.footprint.radius_m
    for index, charger in enumerate(fleet.chargers):
        point = np.array((charger.x_m, charger.y_m))
        with np.errstate(over="ignore"):  # a charger may be far off any map
            near = grid.space.nearest_free_point(point, region)
        if near is None or np.hypot(*(near - point)) > reach_m:
            dropped.append(Drop("charger", f"chargers[{index}]", f"no robot gets to within {reach_m:.2f} m of it"))
            continue
        area = _area(grid, near)
        power_w, slots = charger.power_w, charger.slots
        if area in found:
            power_w, slots = min(power_w, found[area].power_w), slots + found[area].slots
            notes.append(f"the chargers of {_id(area)} count as one of {power_w:g} W with {slots} slots")
        found[area] = Charger(cell=_id(area), power_w=power_w, slots=slots)
        beside.setdefault(area, near)
    return list(found.values()), beside


def _standing_points(
    grid: AreaGrid, beside: dict[Area, FloatArray], easy_m: float, dropped: list[Drop]
) -> dict[Area, FloatArray]:
    """Return the standing point of every area that has one; the others are dropped, if they have floor at all."""
    result: dict[Area, FloatArray] = {}
    columns, rows = grid.shape
    fine = grid.space.refine
    for a in range(columns):
        for b in range(rows):
            point = grid.standing_point(a, b, easy_m, beside.get((a, b)))
            if point is not None:
                result[a, b] = point
                continue
            low_row, high_row, low_col, high_col = (bound // fine for bound in grid.window(a, b))
            floor_px = np.count_nonzero(grid.space.source.cells[low_row:high_row, low_col:high_col] == FREE)
            why = "too narrow, or walled off from the robots" if floor_px else "no free space"
            dropped.append(Drop("cell", _id((a, b)), why))
    return result
