"""OROS alone: from the standing point of an area to the next one, nothing in between."""

from __future__ import annotations

import numpy as np

from react_opt.orchestrator.belief import AreaView, Belief, RobotView
from react_opt.orchestrator.highlevel import Place, area_at, distance_m, high_level
from react_opt.orchestrator.orders import able, drive, stand
from react_opt.orchestrator.strategy import Decision, Note, Order, StrategyOptions

ARRIVED_M = 1.0  # a robot that stands this near to where an area is to be seen from has seen it
REPLAN_M = 1.0  # a standing point that moves further calls for a new way


class Oros:
    """The high-level plan only (paper, section on OROS).

    An area counts as explored once a robot has stood at its standing point (the plan senses there), or where the
    belief proves it unreachable. Each time this happens the fleet is planned anew; busy robots keep the area they
    are on their way to. Sensors are off on the way to an area that is explored already.
    """

    def __init__(self, options: StrategyOptions) -> None:
        self.options = options
        self.explored: set[str] = set()
        self.routes: dict[str, tuple[str, ...]] = {}
        self.under_way: dict[str, tuple[str, tuple[float, float]]] = {}
        self.begun = False
        self.finished = False

    def decide(self, belief: Belief) -> Decision:
        """Return what changes now."""
        areas = {area.id: area for area in belief.areas}
        notes: list[Note] = []
        orders: list[Order] = []
        replan = not self.begun
        for robot in belief.robots:
            replan |= self._follow(robot, areas, notes)
        if replan and not self.finished:
            self.begun = True
            notes.append(self._plan(belief))
        for robot in able(belief):
            order = self._order(belief, robot, areas)
            if order is not None:
                orders.append(order)
        done = self.begun and not self.under_way and not any(self.routes.values())
        return Decision(orders, notes, done)

    def _follow(self, robot: RobotView, areas: dict[str, AreaView], notes: list[Note]) -> bool:
        """Take note of arrivals and losses; return whether the fleet must be planned anew."""
        if robot.state == "dead":
            self.under_way.pop(robot.id, None)
            return self.routes.pop(robot.id, None) is not None
        if robot.id not in self.under_way:
            return False
        name, _ = self.under_way[robot.id]
        area = areas[name]
        arrived = distance_m(robot, area.stand_m) <= ARRIVED_M
        if not (arrived or area.unreachable or robot.state in ("idle", "stuck")):
            return False
        if not arrived and not area.unreachable and robot.state == "idle" and robot.target != name:
            return False  # the order has not reached it yet
        del self.under_way[robot.id]
        new = name not in self.explored
        self.explored.add(name)
        if new:
            why = "stood at its centre" if arrived else ("unreachable" if area.unreachable else "got no nearer")
            notes.append(Note("area_explored", robot=robot.id, target=name, reason=why, x_m=area.x_m, y_m=area.y_m))
        return new

    def _plan(self, belief: Belief) -> Note:
        places = []
        areas = {area.id: area for area in belief.areas}
        for robot in able(belief):
            if robot.id in self.under_way:
                name, _ = self.under_way[robot.id]
                time_s, _ = belief.costs(robot, np.array([areas[name].stand_m]), optimistic=True)
                busy_s = 0.0 if np.isnan(time_s[0]) else float(time_s[0])
                places.append(Place(robot, name, busy_s))
            else:
                places.append(Place(robot, area_at(belief, (robot.x_m, robot.y_m)).id))
        plan = high_level(belief, self.options, places, frozenset(self.explored))
        self.routes = dict(plan.routes)
        first = {place.area for place in places if place.robot.id not in self.under_way}
        for place in places:  # the area a robot starts in is explored from its standing point like any other
            name, who = place.area, place.robot.id
            if who in self.under_way or name in self.explored or name not in first:
                continue
            if plan.explored_by.get(name) == who:
                self.routes[who] = (name, *self.routes.get(who, ()))
        return plan.note

    def _order(self, belief: Belief, robot: RobotView, areas: dict[str, AreaView]) -> Order | None:
        if robot.id in self.under_way:
            name, stand_m = self.under_way[robot.id]
            area = areas[name]
            if robot.state != "idle" and distance_m_between(stand_m, area.stand_m) <= REPLAN_M:
                return None
        else:
            route = self.routes.get(robot.id, ())
            while route and areas[route[0]].unreachable:
                route = route[1:]
            if not route:
                self.routes[robot.id] = ()
                return stand(robot) if robot.target is not None else None
            name, self.routes[robot.id] = route[0], route[1:]
            area = areas[name]
        order = drive(belief, robot, area.stand_m, name, sensing=name not in self.explored)
        if order is None:  # no way, not even through unknown space: the next decision plans without it
            self.explored.add(name)
            self.under_way.pop(robot.id, None)
            self.begun = False
            return stand(robot)
        self.under_way[robot.id] = (name, area.stand_m)
        return order


def distance_m_between(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the straight distance between two points, m."""
    return float(np.hypot(one[0] - other[0], one[1] - other[1]))
