"""Ways of robots through the next regions of their tours: quick to drive, and no stop where the tour goes on.

A robot that is sent to one place at a time brakes at its end and waits for its next order. Here an order leads on
through the regions that come next, so that a robot which has seen the first of them goes on without being told. Ways
are smoothed (:mod:`react_opt.orchestrator.smooth`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot

import numpy as np

from react_opt.orchestrator.belief import Belief, RobotView
from react_opt.orchestrator.orders import MOVED_M, ahead, length_m, stand, way_to
from react_opt.orchestrator.smooth import Ground, law_of, smoothed
from react_opt.orchestrator.strategy import Order, Point
from react_opt.orchestrator.survey import Block, Survey

ENOUGH_M = 6.0
"""A way need not lead on where its first stop is further away: the plan will be another one by then."""


@dataclass(frozen=True)
class _Way:
    stops_m: tuple[Point, ...]
    goal: str
    order: Order


class Guide:
    """Gives robots orders to drive through places, where that changes something.

    Orders are named after tours: an order that goes on with what the last one led to, or with the same goal, keeps its
    name, since it is no other task.
    """

    def __init__(self) -> None:
        self._ways: dict[str, _Way] = {}
        self._tours = 0

    def go(
        self,
        belief: Belief,
        survey: Survey,
        robot: RobotView,
        goal: str,
        stops: Sequence[Block],
    ) -> list[Order] | None:
        """Return the order to drive through places, nothing where the order in force does, None where there is no way.

        Parameters
        ----------
        belief, survey, robot
            What is known, and who is to drive.
        goal
            Name of the region that the first place shows.
        stops
            Coarse blocks to drive through.
        """
        stops_m = tuple(survey.point_of(block) for block in stops)
        way = self._ways.get(robot.id)
        on = way is not None and robot.state in ("driving", "yielding") and robot.target == way.order.target
        if way is not None and on and _same(way.stops_m, stops_m) and survey.is_free(ahead(robot, way.order.path_m)):
            return []
        path = way_to(belief, robot, stops_m[0])
        if len(path) == 0:
            self._ways.pop(robot.id, None)
            return None
        ends = [len(path) - 1]
        for stop in stops_m[1:]:
            if length_m(path) > ENOUGH_M:
                break
            leg = belief.path(replace(robot, x_m=path[-1][0], y_m=path[-1][1]), stop, optimistic=True)
            if len(leg) == 0:
                break
            path += leg[1:]
            ends.append(len(path) - 1)
        led = way is not None and (way.goal == goal or (on and any(_near(stop, stops_m[0]) for stop in way.stops_m)))
        if way is not None and led and way.order.target is not None:
            name = way.order.target
        else:
            self._tours += 1
            name = f"tour {self._tours}"
        order = Order(robot.id, _smooth(belief, survey, robot, path, ends), name, sensing=True)
        self._ways[robot.id] = _Way(stops_m, goal, order)
        return [order]

    def stop(self, robot: RobotView) -> list[Order]:
        """Return the order to stand still, nothing where the robot was told so already."""
        way = self._ways.pop(robot.id, None)
        return [stand(robot)] if way is not None or robot.target is not None else []


def _near(one: Point, other: Point) -> bool:
    return hypot(one[0] - other[0], one[1] - other[1]) <= MOVED_M


def _same(before: tuple[Point, ...], now: tuple[Point, ...]) -> bool:
    """Tell whether a way through places still leads through the first two that are wanted."""
    return all(n < len(before) and _near(before[n], stop) for n, stop in enumerate(now[:2]))


def _smooth(
    belief: Belief, survey: Survey, robot: RobotView, path: tuple[Point, ...], ends: list[int]
) -> tuple[Point, ...]:
    """Return a way that is quicker to drive and leads through the same places; ``ends`` are their way points."""
    fixed = np.zeros(len(path), dtype=np.bool_)
    fixed[ends] = True
    way = smoothed(
        survey.to_blocks(path) * survey.block_m,
        robot.yaw_rad - survey.map.origin_yaw_rad,
        _ground(belief, survey, robot),
        law_of(robot.profile, moving=robot.state == "driving"),
        fixed,
    )
    points = survey.map.pixel_to_world(way / survey.map.resolution_m)
    return tuple((float(x), float(y)) for x, y in points)


def _ground(belief: Belief, survey: Survey, robot: RobotView) -> Ground:
    """Return the clearances of blocks, robots that have died counted as solid."""
    clear = survey.clearance_m()
    for other in belief.robots:
        if other.state == "dead" and other.id != robot.id:
            rows, cols = np.indices(clear.shape)
            x, y = survey.to_blocks((other.x_m, other.y_m))
            gap = np.hypot(cols + 0.5 - x, rows + 0.5 - y) * survey.block_m - other.profile.radius_m
            clear = np.minimum(clear, gap)
    return clear, survey.block_m
