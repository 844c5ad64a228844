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
from numpy.typing import NDArray

from react_opt.instance import OrosInstance
from react_opt.models.program import FloatArray, IntArray, Program
from react_opt.route_problem import RobotClass, Route, RouteProblem
from react_opt.timegraph import reach, route_problem


@dataclass
class RobotColumns:
    """Column numbers of one robot's variables, -1 where there is none.

    ``y``, ``h``, ``s``, ``u``, ``z`` are ``(n_cells, T + 1)``; ``x`` is ``(n_arcs, T + 1)``; ``b`` is ``(T + 1,)``.
    """

    index: int
    robot_class: int
    group: RobotClass
    y: IntArray
    x: IntArray
    h: IntArray
    s: IntArray
    u: IntArray
    z: IntArray
    b: IntArray


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
    robots = [_robot_columns(problem, program, r, k) for k, group in enumerate(problem.classes) for r in group.robots]
    e = _explored_columns(instance, problem, program)
    model = OrosModel(problem, program, robots, e)
    for robot in robots:
        _motion(problem, program, robot)
        _sensing_where_it_stands(problem, program, robot)
        _battery(problem, program, robot)
        _charging_while_waiting(problem, program, robot)
    _explored_by_sensing(model)
    _charger_slots(model)
    if problem.robots_per_cell is not None:
        _robots_per_cell(model, problem.robots_per_cell)
    if problem.sensing_robots_per_step is not None:
        _sensing_robots_per_step(model, problem.sensing_robots_per_step)
    if problem.forbid_swaps:
        model.d = _no_swaps(model)
    return model


def column_count(problem: RouteProblem) -> int:
    """Return an upper bound on the number of columns, without building the model."""
    steps, chargers = problem.horizon + 1, int((problem.charger_j > 0).sum())
    per_robot = 3 * problem.n_cells + problem.n_arcs + 2 * chargers + 1
    pairs = problem.n_arcs if problem.forbid_swaps else 0
    return steps * (problem.n_robots * per_robot + problem.n_cells + pairs)


# --- columns ---


def _robot_columns(problem: RouteProblem, program: Program, r: int, k: int) -> RobotColumns:
    group = problem.classes[k]
    n, steps = problem.n_cells, problem.horizon + 1
    stand = reach(problem, group)
    y = _columns(program, f"y{r}", stand)
    wait = np.zeros((n, steps), dtype=bool)
    wait[:, :-1] = stand[:, :-1] & stand[:, 1:]
    h = _columns(program, f"h{r}", wait)
    move = np.zeros((problem.n_arcs, steps), dtype=bool)
    for d in np.unique(problem.arc_steps):
        arcs = np.flatnonzero(problem.arc_steps == d)
        if d < steps:
            move[arcs, : steps - d] = stand[problem.arc_from[arcs], : steps - d] & stand[problem.arc_to[arcs], d:]
    x = _columns(program, f"x{r}", move)
    earns = stand & (problem.reward > 0)
    earns[:, : max(1, group.start_step)] = False
    s = _columns(program, f"s{r}", earns)
    charge = np.zeros((n, steps), dtype=bool)
    charge[:, 1:] = wait[:, :-1] & (problem.charger_j > 0)[:, None]
    u = _columns(program, f"u{r}", charge, integer=False)
    scarce = (problem.charger_slots < problem.n_robots)[:, None]
    z = _columns(program, f"z{r}", charge & scarce)
    live = np.arange(group.start_step, steps)
    cost = np.where(live == problem.horizon, problem.sigma, 0.0)
    b = np.full(steps, -1, dtype=np.int64)
    b[live] = program.add_columns(f"b{r}", live, cost=cost, lower=group.reserve_j, upper=group.capacity_j)
    return RobotColumns(r, k, group, y, x, h, s, u, z, b)


def _columns(program: Program, name: str, where: NDArray[np.bool_], *, integer: bool = True) -> IntArray:
    """Add a column for every True entry and return their numbers, -1 elsewhere."""
    numbers = np.full(where.shape, -1, dtype=np.int64)
    upper = 1.0 if integer else np.inf
    numbers[where] = program.add_columns(name, np.argwhere(where), upper=upper, integer=integer)
    return numbers


def _explored_columns(instance: OrosInstance, problem: RouteProblem, program: Program) -> IntArray:
    """e[i,t] with cost w_i for 1 <= t <= deadline_i; fixed at 1 where the cell is explored from the start."""
    n, steps = problem.n_cells, problem.horizon + 1
    deadline = [problem.horizon if c.deadline_step is None else c.deadline_step for c in instance.cells]
    instant = np.arange(steps)[None, :]
    where = (instant >= 1) & (instant <= np.array(deadline).reshape(n, 1))
    weight = np.broadcast_to(np.array([cell.weight for cell in instance.cells]).reshape(n, 1), where.shape)
    known = np.broadcast_to(np.array([cell.explored for cell in instance.cells]).reshape(n, 1), where.shape)
    e = np.full((n, steps), -1, dtype=np.int64)
    e[where] = program.add_columns(
        "e", np.argwhere(where), cost=weight[where], lower=known[where].astype(float), upper=1.0, integer=True
    )
    return e


# --- rows of one robot ---


def _motion(problem: RouteProblem, program: Program, robot: RobotColumns) -> None:
    """Robot r stands where it arrives, and leaves from where it stands; before its start it is nowhere.

    y[i,t] = [start] + h[i,t-1] + sum_{a into i} x[a, t - d_a]   and   y[i,t] = h[i,t] + sum_{a out of i} x[a,t], t < T
    """
    nodes = np.argwhere(robot.y >= 0)
    number = np.full(robot.y.shape, -1, dtype=np.int64)
    number[nodes[:, 0], nodes[:, 1]] = np.arange(len(nodes))
    arcs, starts = np.nonzero(robot.x >= 0)
    cells, instants = np.nonzero(robot.h >= 0)
    ends = starts + problem.arc_steps[arcs]
    begins = (nodes[:, 0] == robot.group.start) & (nodes[:, 1] == robot.group.start_step)
    y, x, h = robot.y[nodes[:, 0], nodes[:, 1]], robot.x[arcs, starts], robot.h[cells, instants]
    program.add_rows(
        f"arrive{robot.index}",
        nodes,
        row=np.concatenate([np.arange(len(nodes)), number[problem.arc_to[arcs], ends], number[cells, instants + 1]]),
        column=np.concatenate([y, x, h]),
        value=np.concatenate([np.ones(len(y)), -np.ones(len(x) + len(h))]),
        lower=begins.astype(float),
        upper=begins.astype(float),
    )
    before = nodes[:, 1] < problem.horizon
    number[nodes[before, 0], nodes[before, 1]] = np.arange(before.sum())
    program.add_rows(
        f"leave{robot.index}",
        nodes[before],
        row=np.concatenate([np.arange(before.sum()), number[problem.arc_from[arcs], starts], number[cells, instants]]),
        column=np.concatenate([y[before], x, h]),
        value=np.concatenate([np.ones(before.sum()), -np.ones(len(x) + len(h))]),
        lower=0.0,
        upper=0.0,
    )


def _sensing_where_it_stands(problem: RouteProblem, program: Program, robot: RobotColumns) -> None:
    """s[i,t] <= y[i,t]."""
    nodes = np.argwhere(robot.s >= 0)
    m = np.arange(len(nodes))
    program.add_rows(
        f"sense_stands{robot.index}",
        nodes,
        row=np.concatenate([m, m]),
        column=np.concatenate([robot.s[nodes[:, 0], nodes[:, 1]], robot.y[nodes[:, 0], nodes[:, 1]]]),
        value=np.concatenate([np.ones(len(m)), -np.ones(len(m))]),
        upper=0.0,
    )


def _battery(problem: RouteProblem, program: Program, robot: RobotColumns) -> None:
    """Battery balance, with reserve_r and capacity_r as bounds of b.

    b[t] = b[t-1] - sum_a q_a x[a,t-1] - idle sum_i h[i,t-1] + sum_i u[i,t] - sensing sum_i s[i,t],
    b[start] = battery_r - sensing sum_i s[i,start]
    """
    first = robot.group.start_step
    live = np.arange(first, problem.horizon + 1)
    arcs, starts = np.nonzero(robot.x >= 0)
    cells, instants = np.nonzero(robot.h >= 0)
    sensed, sense_at = np.nonzero(robot.s >= 0)
    charged, charge_at = np.nonzero(robot.u >= 0)
    rows = [
        live - first,
        live[1:] - first,
        starts + 1 - first,
        instants + 1 - first,
        sense_at - first,
        charge_at - first,
    ]
    columns = [
        robot.b[live],
        robot.b[live[:-1]],
        robot.x[arcs, starts],
        robot.h[cells, instants],
        robot.s[sensed, sense_at],
        robot.u[charged, charge_at],
    ]
    values = [
        np.ones(len(live)),
        -np.ones(len(live) - 1),
        problem.arc_energy_j[arcs],
        np.full(len(cells), robot.group.wait_j),
        np.full(len(sensed), robot.group.sense_j),
        -np.ones(len(charged)),
    ]
    start = np.where(live == first, robot.group.battery_j, 0.0)
    program.add_rows(
        f"battery{robot.index}",
        live,
        row=np.concatenate(rows),
        column=np.concatenate(columns),
        value=np.concatenate(values),
        lower=start,
        upper=start,
    )


def _charging_while_waiting(problem: RouteProblem, program: Program, robot: RobotColumns) -> None:
    """u[i,t] <= charger_i h[i,t-1], and u[i,t] <= charger_i z[i,t] where slots are scarce."""
    for name, gate in (("charge_waits", np.roll(robot.h, 1, axis=1)), ("charge_slot", robot.z)):
        nodes = np.argwhere((robot.u >= 0) & (gate >= 0))
        if not len(nodes):
            continue
        m, (i, t) = np.arange(len(nodes)), nodes.T
        program.add_rows(
            f"{name}{robot.index}",
            nodes,
            row=np.concatenate([m, m]),
            column=np.concatenate([robot.u[i, t], gate[i, t]]),
            value=np.concatenate([np.ones(len(m)), -problem.charger_j[i]]),
            upper=0.0,
        )


# --- rows that couple robots ---


def _explored_by_sensing(model: OrosModel) -> None:
    """e[i,t] <= e[i,t-1] + sum_r s[r,i,t], with e[i,0] = 0 (cells explored from the start are fixed)."""
    fixed = model.program.lower
    free = (model.e >= 0) & ~np.where(model.e >= 0, fixed[model.e] > 0.5, False)
    nodes = np.argwhere(free)
    number = np.full(free.shape, -1, dtype=np.int64)
    number[free] = np.arange(len(nodes))
    i, t = nodes.T
    later = t > 1
    rows, columns = [np.arange(len(nodes)), np.flatnonzero(later)], [model.e[i, t], model.e[i[later], t[later] - 1]]
    values = [np.ones(len(nodes)), -np.ones(later.sum())]
    for robot in model.robots:
        si, st = np.nonzero((robot.s >= 0) & free)
        rows.append(number[si, st])
        columns.append(robot.s[si, st])
        values.append(-np.ones(len(si)))
    model.program.add_rows(
        "explored",
        nodes,
        row=np.concatenate(rows),
        column=np.concatenate(columns),
        value=np.concatenate(values),
        upper=0.0,
    )


def _at_most(
    model: OrosModel, name: str, keys: IntArray, entries: list[tuple[IntArray, IntArray]], most: IntArray
) -> None:
    """Add rows ``sum of columns <= most``; entries are (row, column) pairs of arrays."""
    row = np.concatenate([entry[0] for entry in entries]) if entries else np.empty(0, dtype=np.int64)
    column = np.concatenate([entry[1] for entry in entries]) if entries else np.empty(0, dtype=np.int64)
    model.program.add_rows(name, keys, row=row, column=column, value=1.0, upper=most)


def _charger_slots(model: OrosModel) -> None:
    """sum_r z[r,i,t] <= slots_i."""
    steps = model.problem.horizon + 1
    scarce = np.flatnonzero((model.problem.charger_j > 0) & (model.problem.charger_slots < model.problem.n_robots))
    if not len(scarce):
        return
    keys = np.array([(i, t) for i in scarce for t in range(1, steps)], dtype=np.int64).reshape(-1, 2)
    number = np.full((model.problem.n_cells, steps), -1, dtype=np.int64)
    number[keys[:, 0], keys[:, 1]] = np.arange(len(keys))
    entries = [(number[robot.z >= 0], robot.z[robot.z >= 0]) for robot in model.robots]
    _at_most(model, "slots", keys, entries, model.problem.charger_slots[keys[:, 0]])


def _robots_per_cell(model: OrosModel, most: int) -> None:
    """sum_r y[r,i,t] <= robots_per_cell, t >= 1."""
    steps = model.problem.horizon + 1
    keys = np.argwhere(np.ones((model.problem.n_cells, steps - 1), dtype=bool)) + np.array([0, 1])
    entries = []
    for robot in model.robots:
        i, t = np.nonzero(robot.y >= 0)
        late = t >= 1
        entries.append((i[late] * (steps - 1) + t[late] - 1, robot.y[i[late], t[late]]))
    _at_most(model, "robots_per_cell", keys, entries, np.full(len(keys), most))


def _sensing_robots_per_step(model: OrosModel, most: int) -> None:
    """sum_{r,i} s[r,i,t] <= sensing_robots_per_step."""
    keys = np.arange(1, model.problem.horizon + 1)
    entries = [(np.nonzero(robot.s >= 0)[1] - 1, robot.s[robot.s >= 0]) for robot in model.robots]
    _at_most(model, "sensing_robots_per_step", keys, entries, np.full(len(keys), most))


def opposite_pairs(problem: RouteProblem) -> list[tuple[IntArray, IntArray]]:
    """Return the pairs (arcs i -> j, arcs j -> i) for which both directions exist, i < j."""
    by_ends: dict[tuple[int, int], list[int]] = {}
    for a, (i, j) in enumerate(zip(problem.arc_from.tolist(), problem.arc_to.tolist(), strict=True)):
        by_ends.setdefault((i, j), []).append(a)
    return [
        (np.array(arcs), np.array(by_ends[j, i]))
        for (i, j), arcs in sorted(by_ends.items())
        if i < j and (j, i) in by_ends
    ]


def _no_swaps(model: OrosModel) -> IntArray:
    """Robots under way on i -> j from t to t + 1 need d = 1, those on j -> i need d = 0.

    Open time intervals with whole ends overlap exactly where they share one interval (t, t + 1).
    """
    problem, program = model.problem, model.program
    pairs = opposite_pairs(problem)
    steps = problem.horizon
    keys = np.argwhere(np.ones((len(pairs), steps), dtype=bool))
    d = program.add_columns("d", keys, upper=1.0, integer=True).reshape(len(pairs), steps)
    for forward, sign in ((True, 1.0), (False, -1.0)):
        for robot in model.robots:
            rows, columns = [], []
            for k, pair in enumerate(pairs):
                for a in pair[0] if forward else pair[1]:
                    starts = np.flatnonzero(robot.x[a] >= 0)
                    for offset in range(int(problem.arc_steps[a])):
                        rows.append(k * steps + starts + offset)
                        columns.append(robot.x[a, starts])
            m = np.arange(len(keys))
            under_way = np.concatenate(rows) if rows else np.empty(0, dtype=np.int64)
            started = np.concatenate(columns) if columns else np.empty(0, dtype=np.int64)
            program.add_rows(
                f"{'forth' if forward else 'back'}{robot.index}",
                keys,
                row=np.concatenate([under_way, m]),
                column=np.concatenate([started, d.ravel()]),
                value=np.concatenate([np.ones(len(started)), np.full(len(m), -sign)]),
                upper=0.0 if forward else 1.0,
            )
    return d


# --- the way back, and forth ---


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
