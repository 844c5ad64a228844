"""OROS alone: from the standing point of an area to the next one, nothing in between."""

from __future__ import annotations

import numpy as np

from react_opt.orchestrator.belief import AreaView, Belief, RobotView
from react_opt.orchestrator.highlevel import Place, area_at, goal_of, high_level
from react_opt.orchestrator.orders import Driver, able, distance_m
from react_opt.orchestrator.strategy import Decision, Note, Order, StrategyOptions
from react_opt.orchestrator.survey import Survey

ARRIVED_M = 0.7
"""A robot that is so near to where an area is seen from has seen it."""


class Oros:
    """The high-level plan only (paper, section on OROS).

    An area counts as explored once a robot has been at its standing point (the plan senses there), or where no
    robot gets any nearer. Each time this happens the fleet is planned anew; busy robots keep the area they are on
    their way to. Sensors are off on the way to an area that is explored already.
    """

    def __init__(self, options: StrategyOptions) -> None:
        self.options = options
        self.driver = Driver()
        self.survey: Survey | None = None
        self.explored: set[str] = set()
        self.routes: dict[str, tuple[str, ...]] = {}
        self.under_way: dict[str, str] = {}
        self.replan = True

    def decide(self, belief: Belief) -> Decision:
        """Return what changes now."""
        if self.survey is None:
            self.survey = Survey([robot.profile for robot in belief.robots])
        self.survey.update(belief.map, belief.version)
        areas = {area.id: area for area in belief.areas}
        notes: list[Note] = []
        for robot in belief.robots:
            self._follow(robot, areas, notes)
        if self.replan:
            self.replan = False
            notes.append(self._plan(belief))
        orders = [order for robot in able(belief) for order in self._orders(belief, robot, areas, notes)]
        done = not self.replan and not self.under_way and not any(self.routes.values())
        return Decision(orders, notes, done)

    def _follow(self, robot: RobotView, areas: dict[str, AreaView], notes: list[Note]) -> None:
        """Take note of arrivals and losses."""
        if robot.state == "dead":
            self.under_way.pop(robot.id, None)
            self.replan |= self.routes.pop(robot.id, None) is not None
            return
        name = self.under_way.get(robot.id)
        if name is None:
            return
        assert self.survey is not None
        area = areas[name]
        arrived = distance_m(robot, goal_of(self.survey.map, area)) <= ARRIVED_M
        ended = robot.state in ("idle", "stuck") and robot.target == name
        if arrived or area.unreachable or ended:
            del self.under_way[robot.id]
            why = "stood at its centre" if arrived else ("unreachable" if area.unreachable else "got no nearer")
            self._explore(name, why, notes, robot.id)

    def _explore(self, name: str, why: str, notes: list[Note], robot: str | None = None) -> None:
        if name not in self.explored:
            self.explored.add(name)
            self.replan = True
            notes.append(Note("area_explored", robot=robot, target=name, reason=why))

    def _plan(self, belief: Belief) -> Note:
        assert self.survey is not None
        areas = {area.id: area for area in belief.areas}
        places = []
        for robot in able(belief):
            name = self.under_way.get(robot.id)
            if name is None:
                places.append(Place(robot, area_at(belief, (robot.x_m, robot.y_m)).id))
                continue
            time_s, _ = belief.costs(robot, np.array([areas[name].stand_m]), optimistic=True)
            places.append(Place(robot, name, 0.0 if np.isnan(time_s[0]) else float(time_s[0])))
        plan = high_level(belief, self.survey, self.options, places, frozenset(self.explored))
        self.routes = dict(plan.routes)
        for place in places:  # the area a robot starts in is explored from its standing point like any other
            who = place.robot.id
            if who not in self.under_way and plan.explored_by.get(place.area) == who:
                self.routes[who] = (place.area, *self.routes.get(who, ()))
        return plan.note

    def _orders(self, belief: Belief, robot: RobotView, areas: dict[str, AreaView], notes: list[Note]) -> list[Order]:
        assert self.survey is not None
        if robot.id not in self.under_way:
            route = self.routes.get(robot.id, ())
            if not route:
                return self.driver.stop(robot)
            self.under_way[robot.id], self.routes[robot.id] = route[0], route[1:]
        name = self.under_way[robot.id]
        goal_m = goal_of(self.survey.map, areas[name])
        sensing = name not in self.explored
        orders = self.driver.go(belief, self.survey, robot, goal_m, name, sensing=sensing)
        if orders is None:  # not even through unknown space: the next decision plans without it
            del self.under_way[robot.id]
            self._explore(name, "no way", notes)
            self.replan = True
            return self.driver.stop(robot)
        return orders
