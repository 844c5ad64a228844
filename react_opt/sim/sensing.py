"""LiDARs of the simulated robots, and the rules by which they are switched off where nothing is left to see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.geometry.occupancy import UNKNOWN
from react_opt.geometry.raycast import ray_table, scan_px, unknown_ahead_px
from react_opt.instance import Mission
from react_opt.kernels import kernel
from react_opt.orchestrator.fleet_belief import FleetBelief
from react_opt.sim.robot import SimRobot
from react_opt.sim.rules import sampled
from react_opt.sim.world import World

SMALL_GAIN_M2 = 0.1
"""Below this much new area per scan the rule ``small_gain`` switches off, m^2."""

BLIND_M = 1.0
"""No robot drives over ground that it has not seen with its sensors off: they are on so far before it, m."""

_SAMPLE_M = 0.1


class Lidars:
    """Scans of the world into what robots know, and whether a scan is worth it.

    Parameters
    ----------
    mission
        Its switching rule and ``always_on`` count.
    world
        The truth.
    """

    def __init__(self, mission: Mission, world: World) -> None:
        self._mission = mission
        self._world = world
        self._found = np.empty(world.blocked.size, dtype=np.int64)
        self._marks = np.zeros(world.blocked.shape, dtype=np.int32)
        self._mark = 0

    def wanted(self, robot: SimRobot, known: NDArray[np.uint8], belief: FleetBelief) -> bool:
        """Tell whether a robot's sensors are to be on, by the mission's rule, from what the robot knows alone.

        ``no_new_pixel`` and ``small_gain`` ask what a scan would reveal if unknown space were free;
        ``area_explored`` whether the robot's area is explored (share ``delta``), unless its way ends there at
        something smaller than an area: a local target, a frontier. Whatever the rule and the order, sensors are on
        where a robot is about to drive over ground that it does not know, and where it cannot move as it wants.
        """
        if self._mission.always_on or robot.wedged or self._is_blind(robot, known):
            return True
        if robot.order is not None and not robot.order.sensing:
            return False
        unit = self._world.map.resolution_m
        if self._mission.switching == "area_explored":
            x, y = self._world.map.pixel_to_world((robot.u_m / unit, robot.v_m / unit))
            area = belief.area_of((float(x), float(y)))
            if area is None or belief.explored_share(area) < self._mission.delta:
                return True
            return area == self._inspects(robot, belief)
        enough = 1 if self._mission.switching == "no_new_pixel" else max(1, round(SMALL_GAIN_M2 / unit**2))
        self._mark += 1
        x, y, c, s = robot.pose_px(unit)
        table, reach = ray_table(robot.profile.lidar_rays), robot.profile.lidar_range_m / unit
        return bool(unknown_ahead_px(known, x, y, c, s, table, reach, self._marks, self._mark, enough) >= enough)

    def _is_blind(self, robot: SimRobot, known: NDArray[np.uint8]) -> bool:
        """Tell whether a robot's disc is about to cover pixels that it does not know."""
        if not robot.path:
            return False
        unit = self._world.map.resolution_m
        ahead = sampled([(robot.u_m, robot.v_m), *robot.path], _SAMPLE_M, BLIND_M)
        return bool(_covers_unknown(known, ahead / unit, robot.profile.radius_m / unit))

    @staticmethod
    def _inspects(robot: SimRobot, belief: FleetBelief) -> str | None:
        """Return the area in which a robot's order leads it to look at something smaller than an area."""
        if robot.order is None or not robot.order.path_m or robot.target is None or belief.is_area(robot.target):
            return None
        return belief.area_of(robot.order.path_m[-1])

    def scan(self, robot: SimRobot, known: NDArray[np.uint8]) -> NDArray[np.int64]:
        """Scan once into a robot's map; return the pixels that became known, row by row."""
        unit = self._world.map.resolution_m
        x, y, c, s = robot.pose_px(unit)
        table, reach = ray_table(robot.profile.lidar_rays), robot.profile.lidar_range_m / unit
        count = scan_px(self._world.map.cells, known, x, y, c, s, table, reach, self._found)
        return self._found[:count].copy()


@kernel
def _covers_unknown(known: NDArray[np.uint8], points: NDArray[np.float64], radius: float) -> bool:
    """Tell whether a disc around any of some points (pixel coordinates) covers the centre of an unknown pixel."""
    rows, cols = known.shape
    for n in range(points.shape[0]):
        x, y = points[n, 0], points[n, 1]
        for r in range(max(0, int(y - radius)), min(rows, int(y + radius) + 1)):
            for c in range(max(0, int(x - radius)), min(cols, int(x + radius) + 1)):
                if known[r, c] == UNKNOWN and (c + 0.5 - x) ** 2 + (r + 0.5 - y) ** 2 < radius * radius:
                    return True
    return False
