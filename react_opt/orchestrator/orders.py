"""Orders that strategies share: driving somewhere, standing still, and who can be told anything at all."""

from __future__ import annotations

from react_opt.orchestrator.belief import Belief, RobotView
from react_opt.orchestrator.strategy import Order, Point


def able(belief: Belief) -> list[RobotView]:
    """Return the robots that are not dead, in the mission's order."""
    return [robot for robot in belief.robots if robot.state != "dead"]


def drive(
    belief: Belief, robot: RobotView, goal_m: Point, target: str, *, sensing: bool = True, optimistic: bool = True
) -> Order | None:
    """Return the order to drive to a point; None where there is no way.

    Known-free space first; with ``optimistic`` else through unknown space taken as free.
    """
    path = belief.path(robot, goal_m)
    if len(path) == 0 and optimistic:
        path = belief.path(robot, goal_m, optimistic=True)
    return Order(robot.id, path, target, sensing) if len(path) > 0 else None


def stand(robot: RobotView) -> Order:
    """Return the order to stand still with the sensors off."""
    return Order(robot.id, (), None, sensing=False)
