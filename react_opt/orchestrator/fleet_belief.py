"""The belief of a fleet, built from what its robots report: the implementation of the view that strategies get.

Feed it with :meth:`FleetBelief.merge` (pixels), :meth:`FleetBelief.merge_scan` (a laser scan) or
:meth:`FleetBelief.merge_map` (a robot's whole map), and :meth:`FleetBelief.report` (a robot's state). Everything
else is worked out from that when it is asked for, and only where the map has changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import FREE, OCCUPIED, OccupancyMap
from react_opt.geometry.raycast import ray_table, rays_px, unknown_ahead_px
from react_opt.orchestrator.belief import AreaView, FloatArray, LocalTarget, RobotView
from react_opt.orchestrator.belief_areas import Areas
from react_opt.orchestrator.belief_avoid import SLOWER, first_clear, with_gaps, without_discs
from react_opt.orchestrator.belief_map import ROOM_M, BeliefMap, clear_at
from react_opt.orchestrator.belief_paths import Field, Ground, Slowness, nearest_block, nearest_blocks, slowness
from react_opt.orchestrator.belief_regions import flood

SNAP_M = 0.5
"""A point is driven to, or left from, at the nearest place within this where the robot can stand."""

BODY_MARGIN_M = 0.06
"""Room that is planned for between a robot and one that died, m."""

IntArray = NDArray[np.int64]
_LOOK_RAYS = 360


class FleetBelief:
    """What a fleet believes (an implementation of :class:`react_opt.orchestrator.belief.Belief`).

    Parameters
    ----------
    frame
        Fixes pixels: origin and resolution of the maps that robots send; its cells do not count.
    extent_m
        What is known of the building's size: ``(x0, y0, x1, y1)``, two opposite corners, m.
    cell_m
        Side of an area, m. Areas start at the first corner.
    profiles
        The kinds of robots there are.
    range_m
        LiDAR range that local targets are judged by, m.
    prior
        A sketch of the building, which may be wrong.
    bodies_block
        Whether robots that died stand in the way of the others.
    """

    def __init__(
        self,
        frame: OccupancyMap,
        extent_m: tuple[float, float, float, float],
        cell_m: float,
        profiles: Sequence[RobotProfile],
        *,
        range_m: float = 8.0,
        prior: OccupancyMap | None = None,
        bodies_block: bool = True,
    ) -> None:
        self._profiles = sorted(dict.fromkeys(profiles), key=lambda profile: profile.radius_m)
        radii = tuple(sorted({profile.radius_m for profile in self._profiles}))
        self._layer = {profile: radii.index(profile.radius_m) for profile in self._profiles}
        cap = max(max(p.full_speed_clearance_m, 3 * p.radius_m) for p in self._profiles)
        corners = frame.world_to_pixel(np.array(extent_m, dtype=np.float64).reshape(2, 2))
        low, high = corners.min(axis=0), corners.max(axis=0)
        room = ceil(ROOM_M / frame.resolution_m)
        window = (floor(low[1]) - room, ceil(high[1]) + room, floor(low[0]) - room, ceil(high[0]) + room)
        self._map = BeliefMap(frame, window, radii, cap, prior)
        self._areas = Areas(self._map, low, high, cell_m, range_m)
        self._robots: dict[str, RobotView] = {}
        self._home: dict[str, tuple[float, float]] = {}
        self._reported = 0
        self._fresh = (-1, -1)
        self._grounds: dict[tuple[int, bool], Ground] = {}
        self._fields: dict[tuple[int, bool, tuple[int, ...]], Field] = {}
        self._planned: tuple[int, tuple[str, ...]] = (-1, ())
        self._bodies_block = bodies_block
        self._marks = np.zeros((1, 1), dtype=np.int32)
        self._mark = 0
        self.t_s = 0.0

    # --- what comes in ---

    def merge(self, t_s: float, rows: ArrayLike, cols: ArrayLike, values: ArrayLike) -> int:
        """Merge pixels observed by a robot (row and column in the frame; 0 free, 1 occupied); the later one wins.

        Returns how many pixels changed.
        """
        self.t_s = max(self.t_s, t_s)
        return self._map.merge(rows, cols, values)

    def merge_scan(
        self, t_s: float, x_m: float, y_m: float, angles_rad: ArrayLike, ranges_m: ArrayLike, range_max_m: float
    ) -> int:
        """Merge a laser scan taken at a place: free along each ray, occupied at its end.

        Parameters
        ----------
        t_s
            When, s.
        x_m, y_m
            Where, m.
        angles_rad, ranges_m
            Directions in the world, rad, and what was measured, m. Rays that measured ``range_max_m`` or more, or
            nothing (infinite), hit nothing; NaN and negative ones are left out.
        range_max_m
            The sensor's range, m.
        """
        angles = np.asarray(angles_rad, dtype=np.float64) - self._map.frame.origin_yaw_rad
        ranges = np.asarray(ranges_m, dtype=np.float64)
        good = ranges >= 0
        x, y = self._map.frame.world_to_pixel((x_m, y_m))
        unit = self._map.frame.resolution_m
        pixels, hits = rays_px(x, y, angles[good], ranges[good] / unit, range_max_m / unit)
        values = np.where(hits, OCCUPIED, FREE).astype(np.uint8)
        return self.merge(t_s, pixels[:, 0], pixels[:, 1], values)

    def merge_map(self, t_s: float, other: OccupancyMap) -> int:
        """Merge all that a robot's own map knows; its resolution is the frame's."""
        rows, cols = np.nonzero(other.cells <= OCCUPIED)
        centres = other.pixel_to_world(np.stack((cols, rows), axis=1) + 0.5)
        pixels = np.floor(self._map.frame.world_to_pixel(centres)).astype(np.int64)
        return self.merge(t_s, pixels[:, 1], pixels[:, 0], other.cells[rows, cols])

    def report(self, robot: RobotView) -> None:
        """Take note of a robot's state; the first report of a robot makes it known."""
        self._robots[robot.id] = robot
        self._home.setdefault(robot.id, (robot.x_m, robot.y_m))  # where it came from it gets back to
        self._reported += 1
        self.t_s = max(self.t_s, robot.heard_s)

    # --- what strategies see ---

    @property
    def version(self) -> int:
        """Grows with every change of the map."""
        return self._map.version

    @property
    def map(self) -> OccupancyMap:
        """The merged map as observed; beyond the areas, what has not been seen counts as occupied."""
        self._areas.fit()
        return self._map.merged()

    @property
    def robots(self) -> tuple[RobotView, ...]:
        """All robots, in the order of their first reports."""
        return tuple(self._robots.values())

    @property
    def areas(self) -> tuple[AreaView, ...]:
        """All areas, in the order they became known."""
        self._refresh()
        return self._areas.views()

    @property
    def targets(self) -> tuple[LocalTarget, ...]:
        """The local targets, in the order they appeared."""
        self._refresh()
        return self._areas.targets()

    def area_of(self, point_m: tuple[float, float]) -> str | None:
        """Return the id of the area that a point lies in, None for none."""
        return self._areas.area_of(point_m)

    def explored_share(self, area: str) -> float:
        """Return c[a,b] of an area by its id, as when it was last asked for."""
        return self._areas.share(area)

    def is_area(self, name: str) -> bool:
        """Tell whether a name is an area's id."""
        return self._areas.is_area(name)

    def costs(
        self, robot: RobotView, points_m: ArrayLike, *, optimistic: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Return time (s) and energy (J, without sensing) for a robot to drive to ``(n, 2)`` points, NaN: no way."""
        return self._read(robot.profile, self._field_from([robot], optimistic), points_m, optimistic)

    def soonest_s(self, robots: Sequence[RobotView], points_m: ArrayLike) -> FloatArray:
        """Return time (s) until the first of some robots is at ``(n, 2)`` points over known-free space, NaN: no way."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        soonest = np.full(len(points), np.nan)
        for profile in dict.fromkeys(robot.profile for robot in robots):
            field = self._field_from([robot for robot in robots if robot.profile == profile], False)
            soonest = np.fmin(soonest, field.reached_s(self._blocks(self._slowness(profile, False), points)))
        return soonest

    def path(
        self, robot: RobotView, goal_m: tuple[float, float], *, optimistic: bool = False
    ) -> tuple[tuple[float, float], ...]:
        """Return way points to the goal, the robot's place first; empty where there is no way.

        A robot that cannot even get back to where it came from has passed a gap narrower than its disc, and may again.
        """
        slow = self._slowness(robot.profile, optimistic)
        (goal,) = self._blocks(slow, [goal_m])
        if goal < 0:
            return ()
        field = self._field_from([robot], optimistic)
        way = self._way(field, int(goal), robot)
        if way:
            return way
        home = self._start(robot.profile, self._home.get(robot.id, (robot.x_m, robot.y_m)), optimistic)
        if np.isfinite(field.times_s([home])[0]):
            return ()
        tight = with_gaps(slow, self._map.clear, self._map.known > 0, robot.profile, self._map.frame.resolution_m)
        tight = without_discs(tight, self._discs(self._bodies(robot.profile)), 0.0)
        return self._way(self._search(tight, robot), int(goal), robot)

    def table(self, profile: RobotProfile, points_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return time (s) and energy (J) between ``(n, 2)`` points over known-free space as ``(n, n)``, NaN: no way."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        times, energies = np.full((2, len(points), len(points)), np.nan)
        starts = self._blocks(self._slowness(profile, False), points)
        for n, start in enumerate(starts):
            if start >= 0:
                field = self._field(profile, (int(start),), False)
                times[n], energies[n] = self._read(profile, field, points, False)
        return times, energies

    def way_open(self, robot: RobotView, points_m: ArrayLike) -> bool:
        """Tell whether a robot can still drive through ``(n, 2)`` points, unknown space taken as free."""
        room = self.clearance_m(points_m) >= robot.profile.radius_m - 0.5 * self._side_m
        return bool(room.all())

    def detour(
        self, robot: RobotView, goal_m: tuple[float, float], blocked: ArrayLike, slower: ArrayLike
    ) -> tuple[float, tuple[tuple[float, float], ...]]:
        """Return time (s, infinite without a way) and way points of a drive around others in known-free space.

        Parameters
        ----------
        robot, goal_m
            Who drives where.
        blocked, slower
            ``(n, 3)`` discs (x, y, radius, m) that its centre stays out of, and those that it rather avoids.
        """
        slow = without_discs(self._slowness(robot.profile, False), self._discs(slower), SLOWER)
        slow = without_discs(slow, self._discs(blocked), 0.0)
        (goal,) = self._blocks(slow, [goal_m])
        if goal < 0:
            return np.inf, ()
        field = self._search(slow, robot)
        return float(field.times_s([goal])[0]), self._way(field, int(goal), robot)

    def refuge(
        self, robot: RobotView, blocked: ArrayLike, way: ArrayLike, longest_s: float
    ) -> tuple[tuple[float, float], ...]:
        """Return way points to the place reached soonest that lies off another robot's way; empty without one.

        Parameters
        ----------
        robot
            Who has to give way.
        blocked, way
            ``(n, 3)`` discs (x, y, radius, m): those of other robots, and those along the way to be left free.
        longest_s
            Places further away do not count, s.
        """
        slow = without_discs(self._slowness(robot.profile, False), self._discs(blocked), 0.0)
        field = self._search(slow, robot)
        place = first_clear(field.all_times_s(), slow.shape[1], self._discs(way), longest_s)
        return () if place < 0 else self._way(field, int(place), robot)

    def would_see(self, point_m: tuple[float, float], range_m: float) -> int:
        """Return how many unknown pixels a scan from a point would reveal if unknown space were free."""
        cells = self._map.cells
        if self._marks.shape != cells.shape:
            self._marks, self._mark = np.zeros(cells.shape, dtype=np.int32), 0
        self._mark += 1
        x, y = self._map.to_canvas(point_m)
        reach = range_m / self._map.frame.resolution_m
        table = ray_table(_LOOK_RAYS)
        return int(unknown_ahead_px(cells, x, y, 1.0, 0.0, table, reach, self._marks, self._mark, cells.size))

    def clearance_m(self, points_m: ArrayLike) -> FloatArray:
        """Return the distance from ``(n, 2)`` points to what is known (or said) to be occupied, m.

        As of the block that each lies in, up to about three robot radii.
        """
        pixels = self._map.to_canvas(np.asarray(points_m, dtype=np.float64).reshape(-1, 2))
        return clear_at(self._map.clear, pixels, self._map.k, self._map.frame.resolution_m)

    # --- how it is worked out ---

    @property
    def _side_m(self) -> float:
        return self._map.k * self._map.frame.resolution_m

    def _refresh(self) -> None:
        """Bring regions and areas up to date with the map and the robots' places."""
        if self._fresh == (self._map.version, self._reported):
            return
        self._fresh = (self._map.version, self._reported)
        self._areas.fit()
        alive = [robot for robot in self._robots.values() if robot.state != "dead"]
        places = [(robot.profile, place) for robot in alive for place in ((robot.x_m, robot.y_m), self._home[robot.id])]
        reached = [flood(self._map.passable(0, unknown), self._starts(places, unknown)) for unknown in (False, True)]
        self._areas.refresh(reached[0], reached[1])

    def _starts(self, places: Sequence[tuple[RobotProfile, tuple[float, float]]], optimistic: bool) -> IntArray:
        return np.array([self._start(profile, place, optimistic) for profile, place in places], dtype=np.int64)

    def _start(self, profile: RobotProfile, point_m: tuple[float, float], optimistic: bool) -> int:
        """Return the block that a robot drives from: the nearest where it may stand, else its own."""
        x, y = (self._map.to_canvas(point_m) / self._map.k).tolist()
        block = nearest_block(self._slowness(profile, optimistic), x, y, SNAP_M / self._side_m)
        if block >= 0:
            return int(block)
        rows, cols = self._map.clear.shape
        return min(max(int(y), 0), rows - 1) * cols + min(max(int(x), 0), cols - 1)

    def _blocks(self, slow: Slowness, points_m: ArrayLike) -> IntArray:
        pixels = self._map.to_canvas(np.asarray(points_m, dtype=np.float64).reshape(-1, 2)) / self._map.k
        return nearest_blocks(slow, pixels, SNAP_M / self._side_m)

    def _slowness(self, profile: RobotProfile, optimistic: bool) -> Slowness:
        return self._ground(profile, optimistic).slow

    def _ground(self, profile: RobotProfile, optimistic: bool) -> Ground:
        self._forget()
        key = (self._profiles.index(profile), optimistic)
        if key not in self._grounds:
            passable = self._map.passable(self._layer[profile], optimistic)
            slow = slowness(self._map.clear, passable, profile, self._map.frame.resolution_m)
            bodies = self._bodies(profile)
            self._grounds[key] = Ground(without_discs(slow, self._discs(bodies), 0.0) if bodies else slow)
        return self._grounds[key]

    def _dead(self) -> list[RobotView]:
        return [robot for robot in self._robots.values() if robot.state == "dead" and self._bodies_block]

    def _bodies(self, profile: RobotProfile) -> list[tuple[float, float, float]]:
        """Return the discs that the centre of a robot stays out of, because dead ones stand there."""
        reach = profile.radius_m + BODY_MARGIN_M
        return [(robot.x_m, robot.y_m, reach + robot.profile.radius_m) for robot in self._dead()]

    def _field(self, profile: RobotProfile, starts: tuple[int, ...], optimistic: bool) -> Field:
        ground = self._ground(profile, optimistic)  # first of all: it forgets fields that are out of date
        key = (self._profiles.index(profile), optimistic, starts)
        if key not in self._fields:
            self._fields[key] = Field(ground, starts, self._side_m, profile.speed_max_m_s)
        return self._fields[key]

    def _field_from(self, robots: Sequence[RobotView], optimistic: bool) -> Field:
        """Return the drives from where robots of one profile are: to each block by the robot that is there first."""
        starts = {self._start(robot.profile, (robot.x_m, robot.y_m), optimistic) for robot in robots}
        return self._field(robots[0].profile, tuple(sorted(starts)), optimistic)

    def _search(self, slow: Slowness, robot: RobotView) -> Field:
        """Search from the nearest block that is left to the robot, which may stand within a disc that is cut out."""
        (block,) = self._blocks(slow, [(robot.x_m, robot.y_m)])
        start = int(block) if block >= 0 else self._start(robot.profile, (robot.x_m, robot.y_m), False)
        return Field(Ground(slow), (start,), self._side_m, robot.profile.speed_max_m_s)

    def _way(self, field: Field, goal: int, robot: RobotView) -> tuple[tuple[float, float], ...]:
        """Return the way points of a field to a block, the robot's place first; empty where there is no way."""
        way = field.way(goal)
        if way.size == 0:
            return ()
        points = [(float(x), float(y)) for x, y in self._map.centres_m(way)]
        return ((robot.x_m, robot.y_m), *points[(1 if len(points) > 1 else 0) :])

    def _discs(self, discs: ArrayLike) -> FloatArray:
        """Return discs in blocks of the canvas."""
        rows = np.array(discs, dtype=np.float64).reshape(-1, 3)
        rows[:, :2] = self._map.to_canvas(rows[:, :2]) / self._map.k
        rows[:, 2] /= self._side_m
        return rows

    def _forget(self) -> None:
        facts = (self._map.version, tuple(robot.id for robot in self._dead()))
        if self._planned != facts:
            self._areas.fit()
            self._planned = (self._map.version, facts[1])  # fitting may have changed the map
            self._grounds.clear()
            self._fields.clear()

    def _read(
        self, profile: RobotProfile, field: Field, points_m: ArrayLike, optimistic: bool
    ) -> tuple[FloatArray, FloatArray]:
        """Return times and energies of a field at points."""
        blocks = self._blocks(self._slowness(profile, optimistic), points_m)
        times = field.reached_s(blocks)
        lengths = np.full(len(blocks), np.nan)
        there = np.isfinite(times)
        lengths[there] = field.lengths_m(blocks[there])
        return times, profile.drive_energy_j(lengths, times)
