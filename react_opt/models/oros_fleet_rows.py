"""Rows of the OROS model that couple robots: exploration, charger slots and the limits of the fleet."""

from __future__ import annotations

import numpy as np

from react_opt.models.oros_columns import RobotColumns
from react_opt.models.program import IntArray, Program
from react_opt.route_problem import RouteProblem


def explored_by_sensing(program: Program, robots: list[RobotColumns], e: IntArray) -> None:
    """e[i,t] <= e[i,t-1] + sum_r s[r,i,t], with e[i,0] = 0 (cells explored from the start are fixed)."""
    fixed = program.lower
    free = (e >= 0) & ~np.where(e >= 0, fixed[e] > 0.5, False)
    nodes = np.argwhere(free)
    number = np.full(free.shape, -1, dtype=np.int64)
    number[free] = np.arange(len(nodes))
    i, t = nodes.T
    later = t > 1
    rows, columns = [np.arange(len(nodes)), np.flatnonzero(later)], [e[i, t], e[i[later], t[later] - 1]]
    values = [np.ones(len(nodes)), -np.ones(later.sum())]
    for robot in robots:
        si, st = np.nonzero((robot.s >= 0) & free)
        rows.append(number[si, st])
        columns.append(robot.s[si, st])
        values.append(-np.ones(len(si)))
    program.add_rows(
        "explored",
        nodes,
        row=np.concatenate(rows),
        column=np.concatenate(columns),
        value=np.concatenate(values),
        upper=0.0,
    )


def _at_most(
    program: Program, name: str, keys: IntArray, entries: list[tuple[IntArray, IntArray]], most: IntArray
) -> None:
    """Add rows ``sum of columns <= most``; entries are (row, column) pairs of arrays."""
    row = np.concatenate([entry[0] for entry in entries]) if entries else np.empty(0, dtype=np.int64)
    column = np.concatenate([entry[1] for entry in entries]) if entries else np.empty(0, dtype=np.int64)
    program.add_rows(name, keys, row=row, column=column, value=1.0, upper=most)


def charger_slots(problem: RouteProblem, program: Program, robots: list[RobotColumns]) -> None:
    """sum_r z[r,i,t] <= slots_i."""
    steps = problem.horizon + 1
    scarce = np.flatnonzero((problem.charger_j > 0) & (problem.charger_slots < problem.n_robots))
    if not len(scarce):
        return
    keys = np.array([(i, t) for i in scarce for t in range(1, steps)], dtype=np.int64).reshape(-1, 2)
    number = np.full((problem.n_cells, steps), -1, dtype=np.int64)
    number[keys[:, 0], keys[:, 1]] = np.arange(len(keys))
    entries = [(number[robot.z >= 0], robot.z[robot.z >= 0]) for robot in robots]
    _at_most(program, "slots", keys, entries, problem.charger_slots[keys[:, 0]])


def robots_per_cell(problem: RouteProblem, program: Program, robots: list[RobotColumns], most: int) -> None:
    """sum_r y[r,i,t] <= robots_per_cell, t >= 1."""
    steps = problem.horizon + 1
    keys = np.argwhere(np.ones((problem.n_cells, steps - 1), dtype=bool)) + np.array([0, 1])
    entries = []
    for robot in robots:
        i, t = np.nonzero(robot.y >= 0)
        late = t >= 1
        entries.append((i[late] * (steps - 1) + t[late] - 1, robot.y[i[late], t[late]]))
    _at_most(program, "robots_per_cell", keys, entries, np.full(len(keys), most))


def sensing_robots_per_step(problem: RouteProblem, program: Program, robots: list[RobotColumns], most: int) -> None:
    """sum_{r,i} s[r,i,t] <= sensing_robots_per_step."""
    keys = np.arange(1, problem.horizon + 1)
    entries = [(np.nonzero(robot.s >= 0)[1] - 1, robot.s[robot.s >= 0]) for robot in robots]
    _at_most(program, "sensing_robots_per_step", keys, entries, np.full(len(keys), most))


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


def no_swaps(problem: RouteProblem, program: Program, robots: list[RobotColumns]) -> IntArray:
    """Robots under way on i -> j from t to t + 1 need d = 1, those on j -> i need d = 0.

    Open time intervals with whole ends overlap exactly where they share one interval (t, t + 1).
    """
    pairs = opposite_pairs(problem)
    steps = problem.horizon
    keys = np.argwhere(np.ones((len(pairs), steps), dtype=bool))
    d = program.add_columns("d", keys, upper=1.0, integer=True).reshape(len(pairs), steps)
    for forward, sign in ((True, 1.0), (False, -1.0)):
        for robot in robots:
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
