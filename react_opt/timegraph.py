"""From an OROS instance to the plain arrays of the time-expanded graph.

The graph is never unrolled: cells, arcs and the horizon describe it, so memory grows with cells x steps (the
reward profile), not with robots or arcs.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from react_opt.instance import OrosInstance
from react_opt.route_problem import FloatArray, IntArray, RobotClass, RouteProblem


def route_problem(instance: OrosInstance) -> RouteProblem:
    """Return the time-expanded problem of an instance as arrays.

    Of travel arcs that agree in from, to and steps only the cheapest is kept (the first on ties), deadlines
    beyond the horizon mean the horizon, robots with equal data form one class (classes in order of their
    first robot), and sigma takes its default where it is not given.

    Parameters
    ----------
    instance
        A valid instance; cells keep their order.
    """
    cell_index = {cell.id: index for index, cell in enumerate(instance.cells)}
    n_cells = len(instance.cells)
    arc_from, arc_to, arc_steps, arc_energy_j, arc_travel = _arcs(instance, cell_index)
    charger_j = np.zeros(n_cells)
    charger_slots = np.zeros(n_cells, dtype=np.int64)
    for charger in instance.chargers:
        charger_j[cell_index[charger.cell]] = charger.power_w * instance.step_s
        charger_slots[cell_index[charger.cell]] = charger.slots
    return RouteProblem(
        horizon=instance.horizon_steps,
        n_cells=n_cells,
        reward=reward_profile(instance),
        arc_from=arc_from,
        arc_to=arc_to,
        arc_steps=arc_steps,
        arc_energy_j=arc_energy_j,
        arc_travel=arc_travel,
        out_start=np.searchsorted(arc_from, np.arange(n_cells + 1)).astype(np.int64),
        sigma=instance.sigma,
        classes=_classes(instance, cell_index),
        charger_j=charger_j,
        charger_slots=charger_slots,
        robots_per_cell=instance.limits.robots_per_cell,
        forbid_swaps=instance.limits.forbid_swaps,
        sensing_robots_per_step=instance.limits.sensing_robots_per_step,
    )


def reward_profile(instance: OrosInstance) -> FloatArray:
    """Return ``reward[i, t]``: what first sensing cell i at instant t earns.

    It is ``w_i (deadline_i - t + 1)`` for 1 <= t <= deadline_i, and 0 at t = 0, past the deadline and for cells
    that are explored already.

    Parameters
    ----------
    instance
        A valid instance.
    """
    horizon = instance.horizon_steps
    instant = np.arange(horizon + 1)
    deadline = np.array([horizon if c.deadline_step is None else min(c.deadline_step, horizon) for c in instance.cells])
    weight = np.array([0.0 if cell.explored else cell.weight for cell in instance.cells])
    profile = weight[:, None] * np.maximum(deadline[:, None] - instant[None, :] + 1, 0)
    profile[:, 0] = 0.0
    return np.ascontiguousarray(profile)


def _arcs(
    instance: OrosInstance, cell_index: dict[str, int]
) -> tuple[IntArray, IntArray, IntArray, FloatArray, IntArray]:
    """Return the undominated arcs as arrays, sorted by (from, to, steps)."""
    cheapest: dict[tuple[int, int, int], tuple[float, int]] = {}
    for index, arc in enumerate(instance.travel):
        key = (cell_index[arc.from_], cell_index[arc.to], arc.steps)
        if key not in cheapest or arc.energy_j < cheapest[key][0]:
            cheapest[key] = (arc.energy_j, index)
    keys = sorted(key for key in cheapest if key[2] <= instance.horizon_steps)
    ends = np.array(keys, dtype=np.int64).reshape(-1, 3)
    return (
        np.ascontiguousarray(ends[:, 0]),
        np.ascontiguousarray(ends[:, 1]),
        np.ascontiguousarray(ends[:, 2]),
        np.array([cheapest[key][0] for key in keys], dtype=np.float64),
        np.array([cheapest[key][1] for key in keys], dtype=np.int64),
    )


def _classes(instance: OrosInstance, cell_index: dict[str, int]) -> tuple[RobotClass, ...]:
    """Return robots grouped by equal data."""
    groups: dict[tuple[int, int, float, float, float, float, float, int], list[int]] = {}
    for index, robot in enumerate(instance.robots):
        key = (
            cell_index[robot.start],
            robot.start_step,
            robot.battery_j,
            robot.capacity_j,
            robot.reserve_j,
            robot.idle_w * instance.step_s,
            robot.sensing_w * instance.step_s,
            -1 if robot.return_to is None else cell_index[robot.return_to],
        )
        groups.setdefault(key, []).append(index)
    return tuple(RobotClass(tuple(robots), *key) for key, robots in groups.items())


def steps_between(problem: RouteProblem, origin: int, *, backward: bool = False) -> IntArray:
    """Return the fewest steps from a cell to every cell (``backward``: from every cell to it).

    Cells that cannot be reached have ``horizon + 1``.

    Parameters
    ----------
    problem
        The problem.
    origin
        Index of the cell.
    """
    n = problem.n_cells
    tail, head = (problem.arc_to, problem.arc_from) if backward else (problem.arc_from, problem.arc_to)
    order = np.lexsort((problem.arc_steps, head, tail))  # of parallel arcs the fastest comes first
    first = np.unique(tail[order] * n + head[order], return_index=True)[1]
    fastest = order[first]
    graph = sp.csr_array((problem.arc_steps[fastest].astype(np.float64), (tail[fastest], head[fastest])), shape=(n, n))
    distance = dijkstra(graph, indices=origin)
    return np.where(distance <= problem.horizon, distance, problem.horizon + 1).astype(np.int64)


def reach(problem: RouteProblem, group: RobotClass) -> NDArray[np.bool_]:
    """Return ``(n_cells, T + 1)``: where and when a robot can stand, by its motion alone.

    It must have had the steps to come from its start, and keep those to its ``return_to``. The node of its
    start is always True.

    Parameters
    ----------
    problem
        The problem.
    group
        The robot's class.
    """
    instant = np.arange(problem.horizon + 1)[None, :]
    stand = instant >= group.start_step + steps_between(problem, group.start)[:, None]
    if group.return_to >= 0:
        stand &= instant + steps_between(problem, group.return_to, backward=True)[:, None] <= problem.horizon
    stand[group.start, group.start_step] = True
    return np.asarray(stand)
