"""Orders that strategies share: driving somewhere and keeping at it, standing still, who can be told anything."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np

from react_opt.orchestrator.belief import Belief, RobotView
from react_opt.orchestrator.strategy import Order, Point
from react_opt.orchestrator.survey import Survey

MOVED_M = 1.0
"""A goal that moves further calls for a new way."""
DETOUR = 1.2
"""A way over known-free space is preferred to one through unknown space that is not shorter by this factor."""


def able(belief: Belief) -> list[RobotView]:
    """Return the robots that are not dead, in the mission's order."""
    return [robot for robot in belief.robots if robot.state != "dead"]


def stand(robot: RobotView) -> Order:
    """Return the order to stand still with the sensors off."""
    return Order(robot.id, (), None, sensing=False)


def distance_m(robot: RobotView, point: Point) -> float:
    """Return the straight distance from a robot to a point, m."""
    return hypot(robot.x_m - point[0], robot.y_m - point[1])


@dataclass(frozen=True)
class _Way:
    goal_m: Point
    order: Order


class Driver:
    """Gives an order to drive only where it changes something.

    An order stays in force while its target is the same, its goal stays where it was, the robot is under way, and
    nothing that has been seen since stands in the way.
    """

    def __init__(self) -> None:
        self._ways: dict[str, _Way] = {}

    def goal(self, robot: RobotView) -> Point | None:
        """Return where a robot was last sent, m."""
        way = self._ways.get(robot.id)
        return None if way is None else way.goal_m

    def forget(self, robot: RobotView) -> None:
        """Drop what a robot was told, so that the next order is given in any case."""
        self._ways.pop(robot.id, None)

    def go(
        self, belief: Belief, survey: Survey, robot: RobotView, goal_m: Point, target: str, *, sensing: bool = True
    ) -> list[Order] | None:
        """Return the order to drive to a point, nothing where the order in force does, None where there is no way."""
        way = self._ways.get(robot.id)
        if (
            way is not None
            and way.order.target == target
            and way.order.sensing == sensing
            and hypot(way.goal_m[0] - goal_m[0], way.goal_m[1] - goal_m[1]) <= MOVED_M
            and robot.state in ("driving", "yielding")
            and survey.is_free(ahead(robot, way.order.path_m))
        ):
            return []
        path = way_to(belief, robot, goal_m)
        if len(path) == 0:
            self._ways.pop(robot.id, None)
            return None
        order = Order(robot.id, path, target, sensing)
        self._ways[robot.id] = _Way(goal_m, order)
        return [order]

    def stop(self, robot: RobotView) -> list[Order]:
        """Return the order to stand still, nothing where the robot was told so already."""
        way = self._ways.pop(robot.id, None)
        return [stand(robot)] if way is not None or robot.target is not None else []


def way_to(belief: Belief, robot: RobotView, goal_m: Point) -> tuple[Point, ...]:
    """Return the way over known-free space where that is not much longer, else through unknown space taken as free."""
    path = belief.path(robot, goal_m)
    bold = belief.path(robot, goal_m, optimistic=True)
    if len(path) == 0 or (len(bold) > 0 and length_m(path) > DETOUR * length_m(bold) + MOVED_M):
        return bold
    return path


def length_m(path: tuple[Point, ...]) -> float:
    """Return the length of a way, m."""
    return float(np.hypot(*np.diff(np.array(path), axis=0).T).sum())


def ahead(robot: RobotView, path: tuple[Point, ...]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return what is left of a path: from its way point nearest to the robot's segment on."""
    points = np.array(path, dtype=np.float64)
    at = np.array((robot.x_m, robot.y_m))
    if len(points) < 2:
        return points
    start, along = points[:-1], np.diff(points, axis=0)
    square = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((at - start) * along).sum(axis=1) / square, 0.0, 1.0)
    gap = ((start + share[:, None] * along - at) ** 2).sum(axis=1)
    segment = int(np.argmin(gap))
    return np.vstack((start[segment] + share[segment] * along[segment], points[segment + 1 :]))
