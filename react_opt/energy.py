"""The battery law: what driving, turning, waiting and sensing cost. Its only home but for the checker.

Powers of a robot that does several things at once add up:

=========== ================================================= =====================================
load        power                                             energy
=========== ================================================= =====================================
base        ``idle_w``, always, also while driving            ``idle_w * time``
motion      ``motion_w * v / speed_max_m_s`` at speed ``v``   ``motion_w / speed_max_m_s * length``
turning     ``turn_w`` while turning on the spot              ``turn_w * angle / turn_rad_s``
sensing     ``sensing_w`` (perception, processing, radio)     ``sensing_w * time``
=========== ================================================= =====================================

Motion power is rolling friction, ``friction * m * g * v``, so ``motion_w`` is the motion power at full speed
and a metre costs the same at every speed; what acceleration takes, braking does not give back, but it is small
at these speeds and is left to the friction term. Slower driving costs more, by the base load.

Speed near obstacles: at a clearance (distance from the robot's centre to what blocks) of at least
``full_speed_clearance_m`` the robot drives ``speed_max_m_s``; below that its speed falls linearly to
``speed_min_m_s`` at contact, where the clearance equals the footprint's radius.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.errors import UsageError
from react_opt.kernels import kernel

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class RobotProfile:
    """A robot model, with the fields of a fleet file's profile.

    Parameters
    ----------
    length_m, width_m
        Its outline, m.
    speed_max_m_s, speed_min_m_s, full_speed_clearance_m
        The speed law (see this module), m/s and m.
    accel_m_s2
        Acceleration, m/s²; path costs assume that speed changes at once, the simulator does not.
    turn_rad_s
        Speed of turning on the spot, rad/s.
    idle_w, motion_w, turn_w, sensing_w
        Powers, W (see this module).
    battery_j, capacity_j, reserve_j
        Battery at the start, when full, and the charge never to go below, J.
    lidar_range_m, lidar_rays
        Reach of its LiDAR, m, and rays per turn.

    Raises
    ------
    UsageError
        Where a robot could not move or turn at all.
    """

    length_m: float
    width_m: float
    speed_max_m_s: float
    speed_min_m_s: float
    full_speed_clearance_m: float
    accel_m_s2: float
    turn_rad_s: float
    idle_w: float
    motion_w: float
    turn_w: float
    sensing_w: float
    battery_j: float
    capacity_j: float
    reserve_j: float
    lidar_range_m: float
    lidar_rays: int

    def __post_init__(self) -> None:
        if not 0 < self.speed_min_m_s <= self.speed_max_m_s:
            raise UsageError(
                f"speeds are 0 < speed_min_m_s <= speed_max_m_s, not {self.speed_min_m_s} and {self.speed_max_m_s}"
            )
        if not self.turn_rad_s > 0:
            raise UsageError(f"turn_rad_s is positive, not {self.turn_rad_s}")

    @property
    def radius_m(self) -> float:
        """Radius of the disc that holds the outline at every heading, m."""
        return hypot(self.length_m, self.width_m) / 2

    def speed_m_s(self, clearance_m: ArrayLike, radius_m: float | None = None) -> FloatArray:
        """Return the speed at clearances, m/s (the speed law of this module).

        Parameters
        ----------
        clearance_m
            Distances from the robot's centre to what blocks, m.
        radius_m
            Clearance at contact, m; by default :attr:`radius_m`.
        """
        contact = self.radius_m if radius_m is None else radius_m
        span = self.full_speed_clearance_m - contact
        clearance = np.asarray(clearance_m, dtype=np.float64)
        if span <= 0:
            return np.full(clearance.shape, float(self.speed_max_m_s))
        share = np.clip((clearance - contact) / span, 0.0, 1.0)
        return np.asarray(self.speed_min_m_s + share * (self.speed_max_m_s - self.speed_min_m_s))

    def drive_energy_j(self, length_m: ArrayLike, time_s: ArrayLike) -> FloatArray:
        """Return the energy of driving a length in a time, J: base and motion, no sensing."""
        per_metre = self.motion_w / self.speed_max_m_s
        return self.idle_w * np.asarray(time_s, np.float64) + per_metre * np.asarray(length_m, np.float64)

    def turn_time_s(self, angle_rad: ArrayLike) -> FloatArray:
        """Return the time of turning on the spot by an angle of either sign, s."""
        return np.abs(np.asarray(angle_rad, np.float64)) / self.turn_rad_s

    def turn_energy_j(self, angle_rad: ArrayLike) -> FloatArray:
        """Return the energy of turning on the spot by an angle, J: base and turning, no sensing."""
        return (self.idle_w + self.turn_w) * self.turn_time_s(angle_rad)

    def idle_energy_j(self, time_s: float) -> float:
        """Return the energy of standing for a time, J."""
        return self.idle_w * time_s

    def sensing_energy_j(self, time_s: float) -> float:
        """Return what sensing adds over a time, J."""
        return self.sensing_w * time_s


@kernel
def speed_at(clearance_m: float, contact_m: float, full_m: float, slowest: float, fastest: float) -> float:
    """Return the speed at one clearance, m/s: :meth:`RobotProfile.speed_m_s` for compiled callers.

    Parameters
    ----------
    clearance_m, contact_m, full_m
        The clearance, and those at contact and of full speed, m.
    slowest, fastest
        The speeds there, m/s.
    """
    if clearance_m >= full_m or full_m <= contact_m:
        return fastest
    if clearance_m <= contact_m:
        return slowest
    return slowest + (fastest - slowest) * (clearance_m - contact_m) / (full_m - contact_m)
