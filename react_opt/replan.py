"""Replanning from an instant on: what a plan has done up to then is frozen, the rest is a problem of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from react_opt.models.replay import battery
from react_opt.route_problem import FloatArray, IntArray, RobotClass, Route, RouteProblem


@dataclass(frozen=True)
class Frozen:
    """A problem whose first steps are fixed by a plan.

    Parameters
    ----------
    problem
        The rest: robots start where and when the plan first lets them decide again.
    head
        By robot of the whole problem, class by class, the part of its route that is fixed.
    order
        For each robot of the rest, class by class, its place in the whole problem.
    earned
        Coverage that the fixed part has earned.
    under_way
        True where a robot is on an arc at the instant of replanning; opposite arcs are then not free to use.
    """

    problem: RouteProblem
    head: list[Route]
    order: list[int]
    earned: float
    under_way: bool

    def whole(self, rest: Sequence[Route]) -> list[Route]:
        """Return routes of the whole problem from routes of the rest."""
        result = list(self.head)
        for place, route in zip(self.order, rest, strict=True):
            result[place] = _joined(self.head[place], route)
        return result

    def rest(self, routes: Sequence[Route]) -> list[Route]:
        """Return the part of whole routes that is not fixed, class by class of the rest."""
        result = []
        classes = [k for k, group in enumerate(self.problem.classes) for _ in group.robots]
        for k, place in zip(classes, self.order, strict=True):
            keep = len(routes[place].cell) - (self.problem.horizon + 1 - self.problem.classes[k].start_step)
            route = routes[place]
            first_sense = route.sense[keep:].copy()
            # What was sensed and charged by the instant from which it is free is fixed already.
            if len(self.head[place].cell):
                first_sense[0] &= not self.head[place].sense[-1]
            charge = route.charge_j[keep:].copy()
            charge[0] = 0.0
            result.append(Route(k, route.cell[keep:], route.arc[keep:], first_sense, charge))
        return result


def freeze(problem: RouteProblem, routes: Sequence[Route], at_step: int) -> Frozen:
    """Fix everything that routes do up to and including instant ``at_step``, but for what they start there.

    A robot that is on an arc at that instant decides again when it arrives; one that has not started yet is
    free. No cell is sensed anew at or before ``at_step``.

    Parameters
    ----------
    problem
        The whole problem.
    routes
        One route per robot, class by class.
    at_step
        The instant, 0..T.
    """
    first = np.full(problem.n_cells, problem.horizon + 1, dtype=np.int64)
    heads: list[Route] = []
    starts: list[tuple[RobotClass, int]] = []
    under_way = False
    place = 0
    for group in problem.classes:
        for robot in group.robots:
            route = routes[place]
            head, start = _head(problem, group, robot, route, at_step)
            under_way |= bool(start.start_step > at_step >= group.start_step)
            sensed = np.flatnonzero(head.sense)
            np.minimum.at(first, head.cell[sensed], sensed + group.start_step)
            heads.append(head)
            starts.append((start, place))
            place += 1
    done = first <= problem.horizon
    cells = np.flatnonzero(done)
    earned = float(problem.reward[cells, first[cells]].sum())
    reward = problem.reward.copy()
    reward[done] = 0.0
    reward[:, : at_step + 1] = 0.0
    groups: dict[tuple[float, ...], list[tuple[RobotClass, int]]] = {}
    for start, place in starts:
        key = (start.start, start.start_step, start.battery_j, start.capacity_j, start.reserve_j, start.wait_j)
        groups.setdefault((*key, start.sense_j, start.return_to), []).append((start, place))
    classes = tuple(
        replace(members[0][0], robots=tuple(start.robots[0] for start, _ in members)) for members in groups.values()
    )
    order = [place for members in groups.values() for _, place in members]
    return Frozen(replace(problem, reward=reward, classes=classes), heads, order, earned, under_way)


def _head(problem: RouteProblem, group: RobotClass, robot: int, route: Route, at_step: int) -> tuple[Route, RobotClass]:
    """Return the fixed part of a route, up to its first free instant, and the robot as it is then."""
    k = at_step - group.start_step
    if k < 0:
        empty: IntArray = np.empty(0, dtype=np.int64)
        nothing: FloatArray = np.empty(0)
        return Route(route.robot_class, empty, empty, empty.astype(bool), nothing), replace(group, robots=(robot,))
    while route.cell[k] < 0:
        k += 1
    late = group.start_step + k > at_step  # it arrives later: whether it senses there is free
    level = battery(problem, route)
    left_j = float(level[k]) + (group.sense_j if late and route.sense[k] else 0.0)
    sense = route.sense[: k + 1].copy()
    if late:
        sense[k] = False
    head = Route(route.robot_class, route.cell[: k + 1], route.arc[: k + 1], sense, route.charge_j[: k + 1])
    start = replace(group, robots=(robot,), start=int(route.cell[k]), start_step=group.start_step + k, battery_j=left_j)
    return head, start


def _joined(head: Route, rest: Route) -> Route:
    """Return the whole route; both hold the instant at which they meet, where the rest decides."""
    if not len(head.cell):
        return Route(head.robot_class, rest.cell, rest.arc, rest.sense, rest.charge_j)
    sense = np.concatenate([head.sense, rest.sense[1:]])
    sense[len(head.sense) - 1] |= rest.sense[0]
    return Route(
        head.robot_class,
        np.concatenate([head.cell[:-1], rest.cell]),
        np.concatenate([head.arc[:-1], rest.arc]),
        sense,
        np.concatenate([head.charge_j, rest.charge_j[1:]]),
    )
