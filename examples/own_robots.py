"""Drive your own robots: a loop of your own, a belief fed from outside, a strategy of this package. No simulator.

The robots here are a stand-in of forty lines: they move along the way points they are given and measure distances in
a map of their own. In their place put your own: what matters is the four calls in :func:`explore`, which are the same
in the callbacks of a ROS 2 node.

Run ``python examples/own_robots.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from react_opt import load
from react_opt.energy import RobotProfile
from react_opt.geometry import OccupancyMap, load_map
from react_opt.orchestrator.belief import RobotView
from react_opt.orchestrator.fleet_belief import FleetBelief
from react_opt.orchestrator.registry import make_strategy
from react_opt.orchestrator.strategy import StrategyOptions

FACTORY = Path(__file__).parent / "factory"
ANGLES = np.linspace(-math.pi, math.pi, 180, endpoint=False)


@dataclass
class MyRobot:
    """Stands in for a robot with a driver, a LiDAR and a battery."""

    id: str
    profile: RobotProfile
    x_m: float
    y_m: float
    battery_j: float
    building: OccupancyMap
    yaw_rad: float = 0.0
    path: list[tuple[float, float]] = field(default_factory=list)
    target: str | None = None
    sensing: bool = True

    def scan(self) -> np.ndarray:
        """Return measured distances along ``ANGLES``, m, infinite where nothing is in range."""
        reach = np.arange(0.0, self.profile.lidar_range_m, 0.05)
        x = self.x_m + reach[None, :] * np.cos(ANGLES + self.yaw_rad)[:, None]
        y = self.y_m + reach[None, :] * np.sin(ANGLES + self.yaw_rad)[:, None]
        hit = self.building.values_at(np.stack((x, y), axis=-1)) == 1
        return np.where(hit.any(axis=1), reach[hit.argmax(axis=1)], math.inf)

    def drive(self, seconds: float) -> None:
        """Move along the path at 0.8 m/s and spend energy."""
        left_m = 0.8 * seconds
        power_w = self.profile.idle_w + (self.profile.motion_w if self.path else 0.0)
        self.battery_j -= seconds * (power_w + (self.profile.sensing_w if self.sensing else 0.0))
        while self.path and left_m > 0:
            (x, y) = self.path[0]
            metres = math.hypot(x - self.x_m, y - self.y_m)
            if metres > 1e-6:
                self.yaw_rad = math.atan2(y - self.y_m, x - self.x_m)
            share = min(1.0, left_m / metres) if metres > 1e-6 else 1.0
            self.x_m, self.y_m = self.x_m + share * (x - self.x_m), self.y_m + share * (y - self.y_m)
            left_m -= metres
            if share == 1.0:
                self.path.pop(0)

    def view(self, now_s: float) -> RobotView:
        """Return what it reports."""
        state = "driving" if self.path else "idle"
        return RobotView(
            self.id,
            self.profile,
            self.x_m,
            self.y_m,
            self.yaw_rad,
            self.battery_j,
            state,
            self.target,
            self.sensing,
            now_s,
        )


def explore(robots: list[MyRobot], belief: FleetBelief, strategy_name: str, seconds: int) -> float:
    """Let robots explore for some of a mission's 240 seconds; return the share of the areas that is known then."""
    options = StrategyOptions(delta=0.95, step_s=10.0, horizon_s=240.0, window_steps=None, postpone_below=0.6, seed=0)
    strategy = make_strategy(strategy_name, options)
    by_id = {robot.id: robot for robot in robots}
    for now_s in range(seconds):
        for robot in robots:
            if robot.sensing:  # 1. what was measured
                angles = ANGLES + robot.yaw_rad
                belief.merge_scan(now_s, robot.x_m, robot.y_m, angles, robot.scan(), robot.profile.lidar_range_m)
            belief.report(robot.view(now_s))  # 2. where everybody is
        decision = strategy.decide(belief)  # 3. what to do
        for order in decision.orders:  # 4. pass it on
            robot = by_id[order.robot]
            robot.path, robot.target, robot.sensing = list(order.path_m[1:]), order.target, order.sensing
        for note in decision.notes:
            if note.type in ("target_taken", "replan"):
                print(f"{now_s:3d} s  {note.type:13} {note.robot or '':3} {note.target or '':5} {note.reason or ''}")
        if decision.done:
            break
        for robot in robots:
            robot.drive(1.0)
    return sum(area.known_share for area in belief.areas) / len(belief.areas)


def my_fleet(fleet_file: Path, building: OccupancyMap) -> list[MyRobot]:
    """Return the robots of a fleet file."""
    fleet = load(fleet_file, "fleet")
    profiles = {name: RobotProfile(**each.model_dump()) for name, each in fleet.profiles.items()}
    return [
        MyRobot(
            each.id,
            profiles[each.profile],
            each.x_m,
            each.y_m,
            profiles[each.profile].battery_j,
            building,
            each.yaw_rad,
        )
        for each in fleet.robots
    ]


if __name__ == "__main__":
    hidden = load_map(FACTORY / "factory.yaml")  # only the robots' LiDARs look at it
    mine = my_fleet(FACTORY / "fleet_2.json", hidden)
    blank = OccupancyMap(np.full_like(hidden.cells, 2), hidden.resolution_m, hidden.origin_x_m, hidden.origin_y_m)
    shared = FleetBelief(blank, (0.0, 0.0, 20.0, 50.0), 10.0, [robot.profile for robot in mine])
    print(f"{explore(mine, shared, 'react', 90):.1%} of the areas' floor known")
