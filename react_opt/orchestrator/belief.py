"""What the fleet believes: the merged occupancy map, its robots, areas and local targets. All a strategy may see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import OccupancyMap

FloatArray = NDArray[np.float64]
RobotState = Literal["idle", "driving", "yielding", "stuck", "dead"]


@dataclass(frozen=True)
class RobotView:
    """A robot as last heard of.

    Parameters
    ----------
    id, profile
        Who and what it is.
    x_m, y_m, yaw_rad, battery_j
        Pose and battery.
    state
        ``idle``: no path left; ``stuck``: no progress for ``stuck_s``; ``dead``: failed or empty.
    target
        What its order in force serves.
    sensing
        Whether its sensors are on.
    heard_s
        When this was reported, s.
    """

    id: str
    profile: RobotProfile
    x_m: float
    y_m: float
    yaw_rad: float
    battery_j: float
    state: RobotState
    target: str | None
    sensing: bool
    heard_s: float


@dataclass(frozen=True)
class AreaView:
    """An area g[a,b] as believed.

    Parameters
    ----------
    id
        Its name, ``a,b`` with whole numbers (negative where the building turned out larger).
    x_m, y_m
        Its centre, m.
    stand_m
        Where a robot stands in it: the reachable known-free point nearest to the centre, else the centre, m.
    known_share
        c[a,b] = known / (known + unknown pixels that connect through unknown to known free space); 0 where
        nothing of it has been seen.
    unreachable
        Whether the belief proves that nothing more of it can be explored from where robots can drive.
    """

    id: str
    x_m: float
    y_m: float
    stand_m: tuple[float, float]
    known_share: float
    unreachable: bool


@dataclass(frozen=True)
class LocalTarget:
    """The centroid of an unknown region within an area, made accessible.

    Parameters
    ----------
    id
        Stable while its region lives on from update to update.
    area
        Id of the area it lies in.
    x_m, y_m
        The region's centroid, m.
    stand_m
        A known-free reachable point from which the region (or its frontier) can be seen, m; None: inaccessible.
    size_m2
        Area of the unknown region within the area, m^2.
    opening_m2
        Unexplored area around it that visiting may open, m^2.
    frontier_m
        Length of its border with known free space, m.
    """

    id: str
    area: str
    x_m: float
    y_m: float
    stand_m: tuple[float, float] | None
    size_m2: float
    opening_m2: float
    frontier_m: float


class Belief(Protocol):
    """The view a strategy gets. Numbers are as of the last map that arrived, at ``t_s``."""

    @property
    def t_s(self) -> float:
        """Simulated (or real) time of the belief, s."""
        ...

    @property
    def version(self) -> int:
        """Grows with every change of the map."""
        ...

    @property
    def map(self) -> OccupancyMap:
        """The merged map; beyond the areas, what has not been seen counts as occupied."""
        ...

    @property
    def robots(self) -> tuple[RobotView, ...]:
        """All robots, dead ones too, in the mission's order."""
        ...

    @property
    def areas(self) -> tuple[AreaView, ...]:
        """All areas, in the order they became known."""
        ...

    @property
    def targets(self) -> tuple[LocalTarget, ...]:
        """The local targets, in the order they appeared."""
        ...

    def costs(
        self, robot: RobotView, points_m: FloatArray, *, optimistic: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Return time (s) and energy (J, without sensing) for a robot to drive to ``(n, 2)`` points, NaN: no way.

        Known-free space only, unless ``optimistic``: then unknown space counts as free.
        """
        ...

    def soonest_s(self, robots: Sequence[RobotView], points_m: FloatArray) -> FloatArray:
        """Return time (s) until the first of some robots is at ``(n, 2)`` points over known-free space, NaN: no way."""
        ...

    def path(
        self, robot: RobotView, goal_m: tuple[float, float], *, optimistic: bool = False
    ) -> tuple[tuple[float, float], ...]:
        """Return way points to the goal, the robot's place first; empty where there is no way."""
        ...

    def table(self, profile: RobotProfile, points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return time (s) and energy (J) between ``(n, 2)`` points over known-free space as ``(n, n)``, NaN: no way."""
        ...

    def would_see(self, point_m: tuple[float, float], range_m: float) -> int:
        """Return how many unknown pixels a scan from a point would reveal if unknown space were free."""
        ...
