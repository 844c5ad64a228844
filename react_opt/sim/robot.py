"""A simulated robot: differential drive along way points with limits of acceleration and turning, and its battery.

The robot drives where it looks. It turns towards the next way point at ``turn_rad_s`` at most, and drives no faster
than the speed law allows at its clearance, than it can brake before a bend or its goal, and than keeps it within
:data:`BEND_M` of the bend while it turns; where the bend is sharp it turns on the spot. Everything is counted in
*grid metres*: metres along the map's own axes from its corner.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan2, cos, hypot, inf, pi, sin, sqrt

import numpy as np

from react_opt.energy import RobotProfile
from react_opt.instance import Noise
from react_opt.orchestrator.belief import RobotState
from react_opt.orchestrator.strategy import Order

BEND_M = 0.05
"""How far a robot may leave its path in a bend, m."""

ARRIVED_M = 0.1
"""A way point is reached within this, m."""

CREEP_M_S = 0.05
"""Below this speed a robot turns on the spot."""

SHARP_RAD = 0.8
"""Beyond this heading error a robot does not drive at all, rad."""

Point = tuple[float, float]


@dataclass(eq=False)
class SimRobot:
    """A robot as it is.

    Parameters
    ----------
    id, profile
        Who and what it is.
    u_m, v_m, heading_rad
        Pose, grid metres and rad on the grid.
    battery_j
        What is left, J.
    rng
        Its source of noise.
    """

    id: str
    profile: RobotProfile
    u_m: float
    v_m: float
    heading_rad: float
    battery_j: float
    rng: np.random.Generator
    speed_m_s: float = 0.0
    turning_rad_s: float = 0.0
    sensing: bool = False
    state: RobotState = "idle"
    order: Order | None = None
    path: list[Point] = field(default_factory=list)
    """Way points still ahead."""
    limits_m_s: list[float] = field(default_factory=list)
    """Largest speed at each of them."""
    wait_s: float = 0.0
    speed_factor: float = 1.0
    power_factor: float = 1.0
    yields_to: str | None = None
    """The robot it makes way for, None while it follows its order."""
    wedged: bool = False
    """Whether it stands where it cannot turn as it wants, and works itself free."""
    cap_m_s: float = inf
    """Largest speed that traffic leaves it."""
    anchor: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where and when it last made progress: u, v and t."""

    @property
    def target(self) -> str | None:
        """What its order serves."""
        return None if self.order is None else self.order.target

    @property
    def alive(self) -> bool:
        """Whether it can still do anything."""
        return self.state != "dead"

    def follow(self, path: list[Point]) -> None:
        """Take way points ahead; the first ones are dropped where the robot is there already."""
        while path and hypot(path[0][0] - self.u_m, path[0][1] - self.v_m) < ARRIVED_M:
            path = path[1:]
        self.path = path
        self.limits_m_s = [0.0] * len(path)
        limit = 0.0
        for n in range(len(path) - 2, -1, -1):
            before = path[n - 1] if n else (self.u_m, self.v_m)
            leg = hypot(path[n + 1][0] - path[n][0], path[n + 1][1] - path[n][1])
            limit = min(
                sqrt(limit * limit + 2 * self.profile.accel_m_s2 * leg), self._bend_m_s(before, path[n], path[n + 1])
            )
            self.limits_m_s[n] = limit

    def _bend_m_s(self, a: Point, b: Point, c: Point) -> float:
        turn = wrapped(atan2(c[1] - b[1], c[0] - b[0]) - atan2(b[1] - a[1], b[0] - a[0]))
        return self._turning_m_s(turn)

    def _turning_m_s(self, angle: float) -> float:
        """Largest speed at which turning by an angle leads no further than ``BEND_M`` off the path."""
        return inf if angle == 0 else 2 * BEND_M * self.profile.turn_rad_s / (angle * angle)

    def halt(self) -> None:
        """Forget the way points; the robot brakes."""
        self.path, self.limits_m_s = [], []

    def plan_motion(self, dt: float, cap_m_s: float) -> tuple[float, float, float, float]:
        """Return speed, turning rate and the pose's new heading and step length of the next tick, obstacles aside.

        Parameters
        ----------
        dt
            The tick, s.
        cap_m_s
            Largest speed here, from clearance and traffic.
        """
        accel = self.profile.accel_m_s2 * dt
        while self.path and self._reached():
            self.path.pop(0)
            self.limits_m_s.pop(0)
        if not self.path or self.wait_s > 0:
            speed = max(0.0, self.speed_m_s - accel)
            return speed, 0.0, self.heading_rad, speed * dt
        goal = self.path[0]
        away = hypot(goal[0] - self.u_m, goal[1] - self.v_m)
        error = wrapped(atan2(goal[1] - self.v_m, goal[0] - self.u_m) - self.heading_rad)
        turn = min(max(error, -self.profile.turn_rad_s * dt), self.profile.turn_rad_s * dt)
        if abs(error) > SHARP_RAD:
            wanted = 0.0
        else:
            brake = sqrt(self.limits_m_s[0] ** 2 + 2 * 0.8 * self.profile.accel_m_s2 * away)
            wanted = min(cap_m_s, brake, self._turning_m_s(error))
        speed = min(max(wanted, self.speed_m_s - accel, 0.0), self.speed_m_s + accel)
        return speed, turn / dt, wrapped(self.heading_rad + turn), speed * dt

    def _reached(self) -> bool:
        goal = self.path[0]
        away = hypot(goal[0] - self.u_m, goal[1] - self.v_m)
        if away < ARRIVED_M:
            return True
        if len(self.path) < 2 or away > 0.3:
            return False
        after = self.path[1]  # beside the way point and nearer to the next one than it is
        dx, dy = after[0] - goal[0], after[1] - goal[1]
        return (self.u_m - goal[0]) * dx + (self.v_m - goal[1]) * dy > 0

    def spend(self, dt: float) -> None:
        """Draw a tick's energy from the battery, by the law of :mod:`react_opt.energy`."""
        profile = self.profile
        power = profile.idle_w + profile.motion_w * self.speed_m_s / profile.speed_max_m_s
        if self.speed_m_s < CREEP_M_S:
            power += profile.turn_w * abs(self.turning_rad_s) / profile.turn_rad_s
        if self.sensing:
            power += profile.sensing_w
        self.battery_j -= power * self.power_factor * dt

    def draw_noise(self, noise: Noise) -> None:
        """Draw the factors of speed and power for the next second."""
        if noise.speed:
            self.speed_factor = _factor(self.rng, noise.speed)
        if noise.power:
            self.power_factor = _factor(self.rng, noise.power)

    def pose_px(self, resolution_m: float) -> tuple[float, float, float, float]:
        """Return pixel coordinates, cosine and sine of the heading."""
        return self.u_m / resolution_m, self.v_m / resolution_m, cos(self.heading_rad), sin(self.heading_rad)


def _factor(rng: np.random.Generator, deviation: float) -> float:
    """Return a factor around 1, cut off at three deviations and at a fifth."""
    return max(0.2, 1.0 + deviation * min(max(float(rng.standard_normal()), -3.0), 3.0))


def wrapped(angle: float) -> float:
    """Return an angle in (-pi, pi]."""
    while angle > pi:
        angle -= 2 * pi
    while angle <= -pi:
        angle += 2 * pi
    return angle
