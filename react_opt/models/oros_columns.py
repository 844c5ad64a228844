"""Columns of the OROS model: which variables there are, and where (symbols in :mod:`react_opt.models.oros`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from react_opt.instance import OrosInstance
from react_opt.models.program import IntArray, Program
from react_opt.route_problem import RobotClass, RouteProblem
from react_opt.timegraph import reach


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


def robot_columns(problem: RouteProblem, program: Program, r: int, k: int) -> RobotColumns:
    """Add the columns of robot ``r`` of class ``k``: y, h, x, s, u, z and b, only where it can be."""
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


def explored_columns(instance: OrosInstance, problem: RouteProblem, program: Program) -> IntArray:
    """Add e[i,t] with cost w_i for 1 <= t <= deadline_i; fixed at 1 where the cell is explored from the start."""
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
