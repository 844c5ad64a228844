"""OROS as a monolithic time-expanded MILP: the readable reference, solved by any backend.

Columns (r robot, i cell, a arc of the time graph, t instant; robots and cells count as in the instance):

====== ========= =========================================================================
y      {0, 1}    robot r stands in cell i at instant t
x      {0, 1}    robot r starts arc a at t and arrives at t + d_a
h      {0, 1}    robot r waits in cell i from t to t + 1
s      {0, 1}    robot r, standing in cell i at t, senses
e      {0, 1}    cell i is explored by instant t
b      J         battery of robot r at t
u      J         charged by robot r while waiting in cell i from t - 1 to t
z      {0, 1}    robot r charges in cell i from t - 1 to t (a slot is taken)
d      {0, 1}    direction allowed on the pair k of opposite arcs from t to t + 1
====== ========= =========================================================================

Only nodes that a robot can reach from its start (and leave in time for its ``return_to``) have columns.
Equations follow REACT (arXiv 2503.05904) as stated in the project's design, one function per family.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from react_opt.instance import OrosInstance
from react_opt.models.oros_columns import RobotColumns, explored_columns, robot_columns
from react_opt.models.oros_fleet_rows import (
    charger_slots,
    explored_by_sensing,
    no_swaps,
    opposite_pairs,
    robots_per_cell,
    sensing_robots_per_step,
)
from react_opt.models.oros_robot_rows import battery, charging_while_waiting, motion, sensing_where_it_stands
from react_opt.models.program import FloatArray, IntArray, Program
from react_opt.route_problem import Route, RouteProblem
from react_opt.timegraph import route_problem


@dataclass
class OrosModel:
    """The MILP of an instance, and the way back from a solution vector.

    Parameters
    ----------
    problem
        The instance as arrays.
    program
        The sparse program; callers may add blocks of their own.
    robots
        Columns by robot, class by class.
    e
        ``(n_cells, T + 1)`` columns of the explored variables, -1 where they would earn nothing.
    """

    problem: RouteProblem
    program: Program
    robots: list[RobotColumns]
    e: IntArray
    d: IntArray = field(default_factory=lambda: np.empty((0, 0), dtype=np.int64))

    def routes(self, x: FloatArray) -> list[Route]:
        """Read a solution vector back into routes, one per robot, class by class.

        Parameters
        ----------
        x
            ``(n_columns,)`` solution vector; integer columns are rounded.

        Raises
        ------
        ValueError
            Where the vector does not describe a route (two things at once, or nothing).
        """
        return [_route(self.problem, robot, x) for robot in self.robots]

    def vector(self, routes: list[Route]) -> FloatArray:
        """Return the solution vector of routes, one per robot, class by class."""
        x = np.zeros(self.program.n_columns)
        explored = self.problem.reward.copy() * 0.0
        for robot, route in zip(self.robots, routes, strict=True):
            _fill(self.problem, robot, route, x, explored)
        x[self.e[self.e >= 0]] = np.minimum(1.0, np.cumsum(explored, axis=1))[self.e >= 0]
        fixed = self.program.lower
        x = np.where(fixed == self.program.upper, fixed, x)
        for k in range(len(self.d)):
            _fill_direction(self, k, x)
        return x


def oros_model(instance: OrosInstance, problem: RouteProblem | None = None) -> OrosModel:
    """Build the MILP of an instance.

    Parameters
    ----------
    instance
        The instance.
    problem
        Its arrays where they are at hand, None to derive them.
    """
    problem = route_problem(instance) if problem is None else problem
    program = Program(instance.name, maximise=True)
    robots = [robot_columns(problem, program, r, k) for k, group in enumerate(problem.classes) for r in group.robots]
    e = explored_columns(instance, problem, program)
    model = OrosModel(problem, program, robots, e)
    for robot in robots:
        motion(problem, program, robot)
        sensing_where_it_stands(problem, program, robot)
        battery(problem, program, robot)
        charging_while_waiting(problem, program, robot)
    explored_by_sensing(program, robots, e)
    charger_slots(problem, program, robots)
    if problem.robots_per_cell is not None:
        robots_per_cell(problem, program, robots, problem.robots_per_cell)
    if problem.sensing_robots_per_step is not None:
        sensing_robots_per_step(problem, program, robots, problem.sensing_robots_per_step)
    if problem.forbid_swaps:
        model.d = no_swaps(problem, program, robots)
    return model


def column_count(problem: RouteProblem) -> int:
    """Return an upper bound on the number of columns, without building the model."""
    steps, chargers = problem.horizon + 1, int((problem.charger_j > 0).sum())
    per_robot = 3 * problem.n_cells + problem.n_arcs + 2 * chargers + 1
    pairs = problem.n_arcs if problem.forbid_swaps else 0
    return steps * (problem.n_robots * per_robot + problem.n_cells + pairs)


def _route(problem: RouteProblem, robot: RobotColumns, x: FloatArray) -> Route:
    first, steps = robot.group.start_step, problem.horizon + 1
    n = steps - first
    cell, arc = np.full(n, -1, dtype=np.int64), np.full(n, -1, dtype=np.int64)
    sense, charge = np.zeros(n, dtype=bool), np.zeros(n)
    i, t = robot.group.start, first
    while True:
        cell[t - first] = i
        sense[t - first] = robot.s[i, t] >= 0 and x[robot.s[i, t]] > 0.5
        if t == problem.horizon:
            return Route(robot.robot_class, cell, arc, sense, charge)
        out = np.arange(problem.out_start[i], problem.out_start[i + 1])
        out = out[robot.x[out, t] >= 0]
        taken = out[x[robot.x[out, t]] > 0.5]
        if len(taken) == 1:
            arc[t - first] = taken[0]
            i, t = int(problem.arc_to[taken[0]]), t + int(problem.arc_steps[taken[0]])
        elif len(taken) == 0 and robot.h[i, t] >= 0 and x[robot.h[i, t]] > 0.5:
            t += 1
            if robot.u[i, t] >= 0:
                charge[t - first] = max(0.0, x[robot.u[i, t]])
        else:
            raise ValueError(f"the solution vector is no route for robot {robot.index} at instant {t}")


def _fill(problem: RouteProblem, robot: RobotColumns, route: Route, x: FloatArray, explored: FloatArray) -> None:
    first = robot.group.start_step
    battery = robot.group.battery_j
    for k, i in enumerate(route.cell.tolist()):
        t = first + k
        if k > 0:
            if route.arc[k - 1] >= 0:
                battery -= problem.arc_energy_j[route.arc[k - 1]]
            elif route.cell[k - 1] >= 0:
                battery -= robot.group.wait_j
        battery += route.charge_j[k]
        if i >= 0:
            x[robot.y[i, t]] = 1.0
            if route.sense[k]:
                battery -= robot.group.sense_j
                x[robot.s[i, t]] = 1.0
                explored[i, t] = 1.0
            if route.arc[k] >= 0:
                x[robot.x[route.arc[k], t]] = 1.0
            elif t < problem.horizon:
                x[robot.h[i, t]] = 1.0
            if route.charge_j[k] > 0:
                x[robot.u[i, t]] = route.charge_j[k]
                if robot.z[i, t] >= 0:
                    x[robot.z[i, t]] = 1.0
        x[robot.b[t]] = battery


def _fill_direction(model: OrosModel, k: int, x: FloatArray) -> None:
    forth, _ = opposite_pairs(model.problem)[k]
    for robot in model.robots:
        for a in forth:
            for t in np.flatnonzero(robot.x[a] >= 0):
                if x[robot.x[a, t]] > 0.5:
                    x[model.d[k, t : t + model.problem.arc_steps[a]]] = 1.0
