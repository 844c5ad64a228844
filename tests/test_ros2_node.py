"""The example's ROS 2 node on stand-ins of ROS's modules: messages in, paths out that lead through what was scanned."""

from __future__ import annotations

import importlib.util
import math
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent


class Message(SimpleNamespace):
    """Any message: fields appear when they are asked for."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        value: Any = [] if name == "poses" else Message()
        setattr(self, name, value)
        return value


class Node:
    """What the example uses of rclpy.node.Node."""

    def __init__(self, name: str) -> None:
        self.name, self.now_s = name, 0.0
        self.heard: dict[str, Any] = {}
        self.told: dict[str, list[Any]] = {}
        self.ticks: list[Any] = []

    def create_subscription(self, kind: Any, topic: str, call: Any, depth: int) -> None:
        self.heard[topic] = call

    def create_publisher(self, kind: Any, topic: str, depth: int) -> Any:
        return SimpleNamespace(publish=self.told.setdefault(topic, []).append)

    def create_timer(self, period_s: float, call: Any) -> None:
        self.ticks.append(call)

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=self.now_s * 1e9))


def pose(x: float, y: float, yaw: float) -> Message:
    message = Message()
    message.pose.pose.position = SimpleNamespace(x=x, y=y)
    message.pose.pose.orientation = SimpleNamespace(z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    return message


def drive(node: Node) -> None:
    """Two robots in an empty hall of 20 m x 50 m, the lower left corner of which they stand in."""
    angles = -math.pi + 2 * math.pi / 360 * np.arange(360)
    for name, x, y in (("r1", 2.0, 2.0), ("r2", 2.0, 4.0)):
        assert node.ticks[0]() is None
        assert not node.told[f"/{name}/plan"], "nobody drives before all have been heard of"
        node.heard[f"/{name}/odom"](pose(x, y, 0.0))
        node.heard[f"/{name}/battery"](SimpleNamespace(charge=0.1, voltage=20.0))
        with np.errstate(divide="ignore"):
            to_left = np.where(np.cos(angles) < 0, -(x - 0.1) / np.cos(angles), np.inf)
            to_bottom = np.where(np.sin(angles) < 0, -(y - 0.1) / np.sin(angles), np.inf)
        ranges = np.minimum(to_left, to_bottom)
        node.heard[f"/{name}/scan"](
            SimpleNamespace(angle_min=-math.pi, angle_increment=2 * math.pi / 360, range_max=8.0, ranges=ranges)
        )
    node.now_s = 1.0
    node.ticks[0]()


def test_messages_lead_to_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    nodes: list[Node] = []
    modules: dict[str, Any] = {name: ModuleType(name) for name in ("rclpy", "rclpy.node")}
    modules["rclpy"].init = lambda: None
    modules["rclpy"].spin = lambda node: (nodes.append(node), drive(node))
    modules["rclpy.node"].Node = Node
    for package, kinds in (
        ("geometry_msgs", ("PoseStamped",)), ("nav_msgs", ("Odometry", "Path")),
        ("sensor_msgs", ("BatteryState", "LaserScan")), ("std_msgs", ("Bool",)),
    ):  # fmt: skip
        modules[package], modules[f"{package}.msg"] = ModuleType(package), ModuleType(f"{package}.msg")
        for kind in kinds:
            setattr(modules[f"{package}.msg"], kind, type(kind, (Message,), {}))
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    fleet = ROOT / "examples" / "factory" / "fleet_2.json"
    monkeypatch.setattr(sys, "argv", ["ros2_node.py", str(fleet), "--size-m", "20", "50", "--strategy", "nearest"])
    spec = importlib.util.spec_from_file_location("ros2_node", ROOT / "examples" / "ros2_node.py")
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    example.main()
    (node,) = nodes
    for name, start in (("r1", (2.0, 2.0)), ("r2", (2.0, 4.0))):
        (path,) = node.told[f"/{name}/plan"]
        way = [(pose.pose.position.x, pose.pose.position.y) for pose in path.poses]
        assert way[0] == pytest.approx(start)
        assert math.dist(way[0], way[-1]) > 1.0
        assert path.header.frame_id == "map"
        assert node.told[f"/{name}/sensing"][0].data is True
