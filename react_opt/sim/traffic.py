"""How robots move among walls and each other: none enters a wall or another robot, and none brakes too late."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import numpy as np
from numpy.typing import NDArray

from react_opt.energy import speed_at
from react_opt.geometry.inflation import clearance_px
from react_opt.kernels import kernel
from react_opt.sim.robot import SimRobot, wrapped
from react_opt.sim.world import World, footprint_free

BACK_M_S = 0.1
"""How fast a robot that cannot turn creeps away from a wall."""
LOOK_M = 0.05
"""How far around it such a robot looks for more clearance."""


class Traffic:
    """Moves robots tick by tick.

    Parameters
    ----------
    world
        The truth.
    robots
        All of them, in the mission's order.
    blocking
        Whether robots block each other; else they pass through each other.
    """

    def __init__(self, world: World, robots: list[SimRobot], blocking: bool) -> None:
        self._world = world
        self._robots = robots
        self._blocking = blocking
        self._unit = world.map.resolution_m

    def move(self, dt: float) -> None:
        """Move every robot by one tick."""
        for robot in self._robots:
            if robot.alive:
                self._step(robot, dt)

    def _step(self, robot: SimRobot, dt: float) -> None:
        profile = robot.profile
        clear_m = _clearance(self._world.space.clearance_m, robot.u_m / self._unit, robot.v_m / self._unit)
        cap = robot.speed_factor * speed_at(
            clear_m, profile.radius_m, profile.full_speed_clearance_m, profile.speed_min_m_s, profile.speed_max_m_s
        )
        if robot.wedged:
            room_m = self._room_m(robot, robot.u_m, robot.v_m)
            robot.wedged = bool(robot.path) and room_m < profile.radius_m and self._work_free(robot, dt, room_m)
            if robot.wedged:
                return
        before = robot.heading_rad
        speed, turning, heading, length = robot.plan_motion(dt, min(cap, robot.cap_m_s))
        u, v = robot.u_m + length * cos(heading), robot.v_m + length * sin(heading)
        if length > 0 and self._free(robot, u, v, heading):
            robot.u_m, robot.v_m, robot.heading_rad = u, v, heading
            robot.speed_m_s, robot.turning_rad_s = speed, turning
            return
        robot.speed_m_s = 0.0
        if turning != 0 and self._free(robot, robot.u_m, robot.v_m, heading):
            robot.heading_rad, robot.turning_rad_s = heading, turning
            return
        robot.heading_rad, robot.turning_rad_s = before, 0.0
        wanted = length > 0 or turning != 0  # a robot that waits is not wedged
        room_m = self._room_m(robot, robot.u_m, robot.v_m) if wanted and robot.path else np.inf
        if room_m < profile.radius_m + 0.05:
            robot.wedged = self._work_free(robot, dt, room_m)

    def _work_free(self, robot: SimRobot, dt: float, room_m: float) -> bool:
        """Move a robot that cannot turn towards more clearance; False where it can do nothing.

        It creeps along its heading, back or forth, where that leads away from what is near; else it turns, as far as it
        can, towards the line on which it does. A turn once begun goes on until something is in its way: turning to and
        fro between two headings of which neither helps would never end.
        """
        begun = robot.turning_rad_s if robot.wedged else 0.0
        robot.speed_m_s, robot.turning_rad_s = 0.0, 0.0
        step = BACK_M_S * dt
        for way in (-step, step):
            u, v = robot.u_m + way * cos(robot.heading_rad), robot.v_m + way * sin(robot.heading_rad)
            if not self._free(robot, u, v, robot.heading_rad):
                continue
            if self._room_m(robot, u, v) > room_m:
                robot.u_m, robot.v_m, robot.speed_m_s = u, v, BACK_M_S
                return True
        around = [robot.heading_rad + n * pi / 8 for n in range(16)]
        best_m, away = max(
            (self._room_m(robot, robot.u_m + LOOK_M * cos(angle), robot.v_m + LOOK_M * sin(angle)), angle)
            for angle in around
        )
        if best_m <= room_m:
            return False
        errors = sorted(
            (wrapped(away + back - robot.heading_rad) for back in (0.0, pi)),
            key=lambda error: (error * begun < 0, abs(error)),
        )
        for error in errors:
            turn = min(max(error, -robot.profile.turn_rad_s * dt), robot.profile.turn_rad_s * dt)
            heading = wrapped(robot.heading_rad + turn)
            if turn != 0 and self._free(robot, robot.u_m, robot.v_m, heading):
                robot.heading_rad, robot.turning_rad_s = heading, turn / dt
                return True
        return False

    def _room_m(self, robot: SimRobot, u: float, v: float) -> float:
        """Return the exact distance to what blocks, m, where it is less than turning takes and a little more."""
        reach = (robot.profile.radius_m + 2 * LOOK_M) / self._unit
        return room_px(self._world.blocked, u / self._unit, v / self._unit, reach) * self._unit

    def _free(self, robot: SimRobot, u: float, v: float, heading: float) -> bool:
        half_l, half_w = robot.profile.length_m / 2 / self._unit, robot.profile.width_m / 2 / self._unit
        x, y = u / self._unit, v / self._unit
        if not footprint_free(self._world.blocked, x, y, cos(heading), sin(heading), half_l, half_w):
            return False
        return not self._blocking or not any(
            _too_near(robot, other, u, v) for other in self._robots if other is not robot
        )


def _too_near(robot: SimRobot, other: SimRobot, u: float, v: float) -> bool:
    least = robot.profile.radius_m + other.profile.radius_m
    gap = hypot(u - other.u_m, v - other.v_m)
    return gap < least and gap < hypot(robot.u_m - other.u_m, robot.v_m - other.v_m)


@kernel
def _clearance(clearance_m: NDArray[np.float32], x: float, y: float) -> float:
    return clearance_px(clearance_m, x, y)


@kernel
def room_px(blocked: NDArray[np.uint8], x: float, y: float, reach: float) -> float:
    """Return the distance from a point to the nearest blocked pixel, or ``reach`` where that is less, pixels."""
    rows, cols = blocked.shape
    best = reach
    for r in range(max(0, int(y - reach)), min(rows, int(y + reach) + 1)):
        for c in range(max(0, int(x - reach)), min(cols, int(x + reach) + 1)):
            if blocked[r, c] != 0:
                dx = max(0.0, c - x, x - c - 1.0)
                dy = max(0.0, r - y, y - r - 1.0)
                best = min(best, np.hypot(dx, dy))
    return best
