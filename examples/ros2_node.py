"""A ROS 2 node that explores a building with a fleet: scans and odometry in, paths for Nav2 out.

It listens, per robot of a fleet file, to ``/ROBOT/scan`` (LaserScan, taken at the robot's centre), ``/ROBOT/odom``
(Odometry, in the map's frame) and ``/ROBOT/battery`` (BatteryState, the charge in Ah), and publishes ``/ROBOT/plan``
(Path) and ``/ROBOT/sensing`` (Bool) whenever the strategy decides. Start it where ROS 2 is sourced:

    python examples/ros2_node.py FLEET.json --size-m 20 50 --strategy react

"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np

from react_opt import load
from react_opt.energy import RobotProfile
from react_opt.geometry import OccupancyMap
from react_opt.orchestrator.belief import RobotView
from react_opt.orchestrator.fleet_belief import FleetBelief
from react_opt.orchestrator.registry import make_strategy
from react_opt.orchestrator.strategy import StrategyOptions

RESOLUTION_M, CELL_M = 0.1, 10.0


class Explorer:
    """Everything but ROS: what to do with each message, and what follows from it."""

    def __init__(self, fleet_file: str, size_m: tuple[float, float], strategy: str) -> None:
        fleet = load(fleet_file, "fleet")
        profiles = {name: RobotProfile(**each.model_dump()) for name, each in fleet.profiles.items()}
        self.robots = {robot.id: profiles[robot.profile] for robot in fleet.robots}
        self.pose: dict[str, tuple[float, float, float]] = {}
        self.battery_j = {name: profile.battery_j for name, profile in self.robots.items()}
        self.ahead: dict[str, list[tuple[float, float]]] = {name: [] for name in self.robots}
        self.target: dict[str, str | None] = dict.fromkeys(self.robots)
        self.sensing = dict.fromkeys(self.robots, True)
        cols, rows = (round(side / RESOLUTION_M) for side in size_m)
        blank = OccupancyMap(np.full((rows, cols), 2, np.uint8), RESOLUTION_M)
        self.belief = FleetBelief(blank, (0.0, 0.0, *size_m), CELL_M, list(self.robots.values()))
        options = StrategyOptions(
            delta=0.95, step_s=10.0, horizon_s=240.0, window_steps=None, postpone_below=0.6, seed=0
        )
        self.strategy = make_strategy(strategy, options)

    def scanned(self, name: str, message: Any, now_s: float) -> None:
        """Take a sensor_msgs/LaserScan."""
        if name in self.pose and self.sensing[name]:
            x, y, yaw = self.pose[name]
            angles = message.angle_min + message.angle_increment * np.arange(len(message.ranges)) + yaw
            self.belief.merge_scan(now_s, x, y, angles, message.ranges, message.range_max)

    def moved(self, name: str, message: Any) -> None:
        """Take a nav_msgs/Odometry; way points that are reached are done with."""
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        self.pose[name] = at.x, at.y, 2.0 * math.atan2(turn.z, turn.w)
        while self.ahead[name] and math.dist(self.ahead[name][0], (at.x, at.y)) < 0.3:
            self.ahead[name].pop(0)

    def drained(self, name: str, message: Any) -> None:
        """Take a sensor_msgs/BatteryState."""
        self.battery_j[name] = message.charge * 3600.0 * message.voltage

    def decide(self, now_s: float) -> list[tuple[str, list[tuple[float, float]], bool]]:
        """Return who drives which way from now on, and whether it senses on it."""
        for name, (x, y, yaw) in self.pose.items():
            state = "driving" if self.ahead[name] else "idle"
            self.belief.report(
                RobotView(name, self.robots[name], x, y, yaw, self.battery_j[name], state, self.target[name],
                          self.sensing[name], now_s)
            )  # fmt: skip
        if len(self.pose) < len(self.robots) or self.belief.version == 0:
            return []  # not everybody has been heard of
        told = []
        for order in self.strategy.decide(self.belief).orders:
            self.ahead[order.robot], self.target[order.robot] = list(order.path_m[1:]), order.target
            self.sensing[order.robot] = order.sensing
            told.append((order.robot, list(order.path_m), order.sensing))
        return told


def main() -> None:
    """Run the node."""
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from nav_msgs.msg import Odometry, Path
    from rclpy.node import Node
    from sensor_msgs.msg import BatteryState, LaserScan
    from std_msgs.msg import Bool

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("fleet", help="fleet file: ids are the robots' namespaces")
    parser.add_argument("--size-m", nargs=2, type=float, default=(20.0, 50.0), help="extent of the building, m")
    parser.add_argument("--strategy", default="react")
    options = parser.parse_args()
    explorer = Explorer(options.fleet, tuple(options.size_m), options.strategy)

    rclpy.init()
    node = Node("react_opt")

    def now_s() -> float:
        return node.get_clock().now().nanoseconds * 1e-9

    paths, switches = {}, {}
    for name in explorer.robots:
        node.create_subscription(LaserScan, f"/{name}/scan", lambda m, n=name: explorer.scanned(n, m, now_s()), 10)
        node.create_subscription(Odometry, f"/{name}/odom", lambda m, n=name: explorer.moved(n, m), 10)
        node.create_subscription(BatteryState, f"/{name}/battery", lambda m, n=name: explorer.drained(n, m), 10)
        paths[name] = node.create_publisher(Path, f"/{name}/plan", 10)
        switches[name] = node.create_publisher(Bool, f"/{name}/sensing", 10)

    def tick() -> None:
        for name, way, sensing in explorer.decide(now_s()):
            path = Path()
            path.header.frame_id = "map"
            for x, y in way:
                pose = PoseStamped()
                pose.header.frame_id = "map"
                pose.pose.position.x, pose.pose.position.y = x, y
                path.poses.append(pose)
            paths[name].publish(path)
            switches[name].publish(Bool(data=sensing))

    node.create_timer(1.0, tick)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
