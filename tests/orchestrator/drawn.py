"""A belief over a hand-drawn map, and a small loop that moves points over it: for tests of strategies alone.

Nothing of the simulator is used: a robot jumps from way point to way point at its top speed, and sees what lies
in line of sight within its range.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import ndimage

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyMap
from react_opt.geometry.raycast import ray_table, scan_px
from react_opt.orchestrator.belief import AreaView, FloatArray, LocalTarget, RobotView
from react_opt.orchestrator.strategy import Decision, Strategy
from react_opt.orchestrator.survey import COARSE, Survey

PROFILE = RobotProfile(
    length_m=0.3, width_m=0.3, speed_max_m_s=1.0, speed_min_m_s=1.0, full_speed_clearance_m=0.3, accel_m_s2=1.0,
    turn_rad_s=10.0, idle_w=2.0, motion_w=7.0, turn_w=9.0, sensing_w=16.9, battery_j=8000.0, capacity_j=8000.0,
    reserve_j=0.0, lidar_range_m=4.0, lidar_rays=360,
)  # fmt: skip


def drawn(text: str, pixels_per_char: int = 5) -> np.ndarray[Any, Any]:
    """Return the pixels of a drawing: ``#`` is a wall, everything else free; the last line has the smallest y."""
    lines = text.strip("\n").split("\n")[::-1]
    width = max(map(len, lines))
    grid = np.array([[OCCUPIED if ch == "#" else FREE for ch in line.ljust(width, "#")] for line in lines], np.uint8)
    return np.kron(grid, np.ones((pixels_per_char, pixels_per_char), np.uint8))


@dataclass
class DrawnBelief:
    """A belief in which everything can be set by hand; one pixel is 0.1 m."""

    cells: np.ndarray[Any, Any]
    robots: tuple[RobotView, ...]
    area_m: float = 5.0
    t_s: float = 0.0
    version: int = 0
    given_targets: tuple[LocalTarget, ...] | None = None
    resolution_m: float = 0.1

    @property
    def map(self) -> OccupancyMap:
        return OccupancyMap(self.cells.copy(), self.resolution_m)

    def survey(self) -> Survey:
        survey = Survey([robot.profile for robot in self.robots])
        survey.update(self.map, self.version)
        return survey

    @property
    def areas(self) -> tuple[AreaView, ...]:
        survey = self.survey()
        reach = survey.times_from(self.robots[0].x_m, self.robots[0].y_m, optimistic=False)
        may = survey.times_from(self.robots[0].x_m, self.robots[0].y_m, optimistic=True)
        side = round(self.area_m / self.resolution_m)
        result = []
        for a in range(-(-self.cells.shape[1] // side)):
            for b in range(-(-self.cells.shape[0] // side)):
                part = np.s_[b * side : (b + 1) * side, a * side : (a + 1) * side]
                cells = self.cells[part]
                known, unknown = int((cells == FREE).sum()), int((cells == UNKNOWN).sum())
                x, y = (a + 0.5) * self.area_m, (b + 0.5) * self.area_m
                wide = side // COARSE
                coarse = np.s_[b * wide : (b + 1) * wide, a * wide : (a + 1) * wide]
                at = np.argwhere(np.isfinite(reach[coarse]))
                stand = (x, y)
                if len(at):
                    best = at[np.argmin(((at - wide / 2 + 0.5) ** 2).sum(axis=1))]
                    stand = survey.point_of((int(best[0]) + b * wide, int(best[1]) + a * wide))
                share = known / (known + unknown) if known else 0.0
                result.append(AreaView(f"{a},{b}", x, y, stand, share, not bool(np.isfinite(may[coarse]).any())))
        return tuple(result)

    @property
    def targets(self) -> tuple[LocalTarget, ...]:
        if self.given_targets is not None:
            return self.given_targets
        survey = self.survey()
        reach = survey.times_from(self.robots[0].x_m, self.robots[0].y_m, optimistic=False)
        border = (self.cells == UNKNOWN) & ndimage.binary_dilation(self.cells == FREE)
        side = round(self.area_m / self.resolution_m)
        labels, _ = ndimage.label(self.cells == UNKNOWN)
        result = []
        for name in np.unique(labels[border]):
            for a in range(-(-self.cells.shape[1] // side)):
                for b in range(-(-self.cells.shape[0] // side)):
                    at = np.argwhere(labels[b * side : (b + 1) * side, a * side : (a + 1) * side] == name)
                    if not len(at):
                        continue
                    at += (b * side, a * side)
                    edge = at[border[at[:, 0], at[:, 1]]]
                    if not len(edge):
                        continue
                    y, x = (at.mean(axis=0) + 0.5) * self.resolution_m
                    near = np.argwhere(np.isfinite(reach))
                    gap = ((near - edge[len(edge) // 2] / COARSE) ** 2).sum(axis=1)
                    stand = survey.point_of(tuple(near[int(np.argmin(gap))])) if len(near) else None
                    size = len(at) * self.resolution_m**2
                    result.append(
                        LocalTarget(f"k{a},{b},{len(result)}", f"{a},{b}", float(x), float(y), stand, size, size,
                                    len(edge) * self.resolution_m)
                    )  # fmt: skip
        return tuple(result)

    def costs(
        self, robot: RobotView, points_m: FloatArray, *, optimistic: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        survey = self.survey()
        times = survey.times_from(robot.x_m, robot.y_m, optimistic=optimistic)
        time_s = np.array([times[survey.block_of(*point)] for point in points_m])
        time_s[~np.isfinite(time_s)] = np.nan
        return time_s, time_s * (robot.profile.idle_w + robot.profile.motion_w)

    def soonest_s(self, robots: Sequence[RobotView], points_m: FloatArray) -> FloatArray:
        return np.asarray(np.fmin.reduce([self.costs(robot, points_m)[0] for robot in robots]))

    def path(
        self, robot: RobotView, goal_m: tuple[float, float], *, optimistic: bool = False
    ) -> tuple[tuple[float, float], ...]:
        survey = self.survey()
        times = survey.times_from(*goal_m, optimistic=optimistic)
        start = survey.nearest_block(survey.block_of(robot.x_m, robot.y_m), np.isfinite(times), 4)
        if start is None:
            return ()
        row, col = start
        way = [(robot.x_m, robot.y_m)]
        while times[row, col] > 0:
            around = [
                (times[y, x], y, x)
                for y in range(max(0, row - 1), min(times.shape[0], row + 2))
                for x in range(max(0, col - 1), min(times.shape[1], col + 2))
                if y == row or x == col
            ]
            _, row, col = min(around)
            way.append(survey.point_of((row, col)))
        return tuple(way)

    def table(self, profile: RobotProfile, points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        rows = [
            self.costs(replace(self.robots[0], x_m=float(x), y_m=float(y), profile=profile), points_m)
            for x, y in points_m
        ]
        return np.array([row[0] for row in rows]), np.array([row[1] for row in rows])

    def would_see(self, point_m: tuple[float, float], range_m: float) -> int:
        return round(self.survey().gain_m2(*point_m, range_m, 1e9) / self.resolution_m**2)


def robot_at(name: str, x_m: float, y_m: float, **changes: Any) -> RobotView:
    """Return an idle robot at a point."""
    base = RobotView(name, PROFILE, x_m, y_m, 0.0, PROFILE.battery_j, "idle", None, True, 0.0)
    return replace(base, **changes)


class Loop:
    """Moves points over a drawing by the orders of a strategy, one step of ``step_s`` at a time."""

    def __init__(self, truth: np.ndarray[Any, Any], strategy: Strategy, robots: list[RobotView], **belief: Any) -> None:
        self.truth, self.strategy = truth, strategy
        self.belief = DrawnBelief(np.full_like(truth, UNKNOWN), tuple(robots), **belief)
        self.ways: dict[str, list[tuple[float, float]]] = {robot.id: [] for robot in robots}
        self.log: list[tuple[float, Decision]] = []
        self.done = False
        self._see()

    def _see(self) -> None:
        res = self.belief.resolution_m
        found = np.empty(self.truth.size, dtype=np.int64)
        for robot in self.belief.robots:
            x, y, reach = robot.x_m / res, robot.y_m / res, robot.profile.lidar_range_m / res
            scan_px(self.truth, self.belief.cells, x, y, 1.0, 0.0, ray_table(360), reach, found)
        self.belief.version += 1

    def run(self, limit_s: float, step_s: float = 1.0) -> float:
        """Run until the strategy is done or time is up; return the time, s."""
        while self.belief.t_s < limit_s and not self.done:
            decision = self.strategy.decide(self.belief)
            self.log.append((self.belief.t_s, decision))
            orders = {order.robot: order for order in decision.orders}
            robots = []
            for robot in self.belief.robots:
                target = robot.target
                if robot.id in orders:
                    self.ways[robot.id] = list(orders[robot.id].path_m[1:])
                    target = orders[robot.id].target
                robots.append(replace(self._moved(robot, step_s), target=target))
            self.done = decision.done and not any(self.ways.values())
            self.belief.robots = tuple(robots)
            self.belief.t_s += step_s
            self._see()
        return self.belief.t_s

    def _moved(self, robot: RobotView, step_s: float) -> RobotView:
        if robot.state == "dead":
            self.ways[robot.id] = []
            return robot
        way, left = self.ways[robot.id], robot.profile.speed_max_m_s * step_s
        x, y, yaw = robot.x_m, robot.y_m, robot.yaw_rad
        while way and left > 0:
            gap = float(np.hypot(way[0][0] - x, way[0][1] - y))
            yaw = float(np.arctan2(way[0][1] - y, way[0][0] - x)) if gap > 0 else yaw
            if gap <= left:
                (x, y), left = way.pop(0), left - gap
            else:
                x, y = x + (way[0][0] - x) * left / gap, y + (way[0][1] - y) * left / gap
                left = 0.0
        return replace(robot, x_m=x, y_m=y, yaw_rad=yaw, state="driving" if way else "idle")

    def known_share(self) -> float:
        """Return the share of the free pixels that are known."""
        free = self.truth == FREE
        return float((self.belief.cells[free] == FREE).mean())
