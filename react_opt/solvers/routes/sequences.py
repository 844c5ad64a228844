"""Routes as sequences of cells to sense, joined by fastest paths: the model that the annealing works on.

A sequence is read leniently: a cell whose turn comes when it earns nothing, or when serving it would miss the
horizon, the return or the battery's floor, is left out. Every sequence therefore stands for a feasible route of a
robot alone; limits between robots, chargers and slower speed modes are left to the beam search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray, Route, RouteProblem
from react_opt.solvers.routes.greedy import route_classes

Steps = NDArray[np.int32]

FAR = 1 << 29
"""Steps between cells that do not reach each other."""


@dataclass(frozen=True)
class SequenceModel:
    """Fastest travel between all cells, and the robots' data as columns.

    Parameters
    ----------
    steps, energy_j
        ``(n_cells, n_cells)`` steps of the fastest way from row to column (`FAR` where there is none), and the
        least energy of such a way, J.
    near
        ``(n_cells, k)`` for each cell the k cells from which it is reached soonest, nearest first, -1 at the end.
    whole
        ``(n_robots, 3)`` start, start step, return cell of each robot.
    joules
        ``(n_robots, 3)`` battery above the reserve, energy of a waiting step and of sensing, J.
    """

    steps: Steps
    energy_j: FloatArray
    near: NDArray[np.int32]
    whole: IntArray
    joules: FloatArray


def sequence_model(problem: RouteProblem, neighbours: int = 40) -> SequenceModel:
    """Fastest ways between all cells of a problem; memory grows with the square of the cells.

    Parameters
    ----------
    problem
        The problem.
    neighbours
        Cells in ``near``.
    """
    steps, energy_j = _fastest(
        problem.out_start, problem.arc_to, problem.arc_steps, problem.arc_energy_j, problem.horizon
    )
    count = min(neighbours, problem.n_cells - 1)
    near = np.full((problem.n_cells, max(1, count)), -1, dtype=np.int32)
    wanted = problem.reward.max(axis=1) > 0.0
    for cell in range(problem.n_cells):
        to = np.where(wanted, steps[:, cell], FAR)
        to[cell] = FAR
        closest = np.argsort(to, kind="stable")[:count]
        closest = closest[to[closest] < FAR]
        near[cell, : len(closest)] = closest
    groups = [problem.classes[k] for k in route_classes(problem)]
    whole = np.array([[g.start, g.start_step, g.return_to] for g in groups], dtype=np.int64)
    joules = np.array([[g.battery_j - g.reserve_j, g.wait_j, g.sense_j] for g in groups])
    return SequenceModel(steps, energy_j, near, whole, joules)


def applies(problem: RouteProblem, model: SequenceModel) -> bool:
    """Whether each robot can at least idle (and return) in the model, so that every sequence has a meaning."""
    for (start, start_step, back), (spare_j, wait_j, _) in zip(model.whole, model.joules, strict=True):
        steps, energy_j = 0, 0.0
        if back >= 0:
            steps, energy_j = int(model.steps[start, back]), float(model.energy_j[start, back])
        left = problem.horizon - int(start_step) - steps
        if left < 0 or energy_j + left * wait_j > spare_j:
            return False
    return True


def encode(problem: RouteProblem, routes: Sequence[Route]) -> tuple[NDArray[np.int32], IntArray]:
    """Sequences ``(n_robots, n_cells)`` of the cells that each route is the first to sense, and their lengths."""
    order = np.full((len(routes), problem.n_cells), -1, dtype=np.int32)
    lengths = np.zeros(len(routes), dtype=np.int64)
    events = sorted(
        (int(k) + problem.classes[route.robot_class].start_step, number, int(route.cell[k]))
        for number, route in enumerate(routes)
        for k in np.flatnonzero(route.sense)
    )
    seen: set[int] = set()
    for _, number, cell in events:
        if cell not in seen:
            seen.add(cell)
            order[number, lengths[number]] = cell
            lengths[number] += 1
    return order, lengths


def decode(problem: RouteProblem, model: SequenceModel, order: NDArray[np.int32], lengths: IntArray) -> list[Route]:
    """Routes of sequences that leave nothing out (as the annealing returns them); robots idle at the end."""
    routes = []
    for number, robot_class in enumerate(route_classes(problem)):
        group = problem.classes[robot_class]
        length = problem.horizon - group.start_step + 1
        route = Route(
            robot_class,
            np.full(length, -1, dtype=np.int64),
            np.full(length, -1, dtype=np.int64),
            np.zeros(length, dtype=bool),
            np.zeros(length),
        )
        at, k = group.start, 0
        route.cell[0] = at
        for cell in order[number, : lengths[number]]:
            at, k = _drive(problem, model, route, at, k, int(cell))
            if k == 0 and group.start_step == 0:  # nothing is sensed at instant 0
                k = 1
                route.cell[1] = at
            route.sense[k] = True
        if group.return_to >= 0:
            at, k = _drive(problem, model, route, at, k, group.return_to)
        route.cell[k:] = at
        routes.append(route)
    return routes


def _drive(problem: RouteProblem, model: SequenceModel, route: Route, at: int, k: int, goal: int) -> tuple[int, int]:
    """Write the cheapest of the fastest ways to ``goal`` into a route; returns where and when it ends."""
    while at != goal:
        best, taken = np.inf, -1
        for arc in range(problem.out_start[at], problem.out_start[at + 1]):
            there = problem.arc_to[arc]
            if problem.arc_steps[arc] + model.steps[there, goal] == model.steps[at, goal]:
                cost = problem.arc_energy_j[arc] + model.energy_j[there, goal]
                if cost < best:
                    best, taken = float(cost), arc
        route.arc[k] = taken
        k += int(problem.arc_steps[taken])
        at = int(problem.arc_to[taken])
        route.cell[k] = at
    return at, k


@kernel(nogil=True)
def _fastest(
    out_start: IntArray, arc_to: IntArray, arc_steps: IntArray, arc_energy_j: FloatArray, horizon: int
) -> tuple[Steps, FloatArray]:
    """Steps and least energy of the fastest ways between all cells, up to the horizon (buckets by step)."""
    n_cells = len(out_start) - 1
    steps = np.full((n_cells, n_cells), FAR, dtype=np.int32)
    energy_j = np.full((n_cells, n_cells), np.inf)
    longest = 1
    for a in range(len(arc_steps)):
        longest = max(longest, arc_steps[a])
    room = len(arc_to) + 1
    head = np.empty(longest + 1, dtype=np.int64)
    entry_cell = np.empty(room, dtype=np.int64)
    entry_next = np.empty(room, dtype=np.int64)
    done = np.zeros(n_cells, dtype=np.bool_)
    for source in range(n_cells):
        head[:] = -1
        done[:] = False
        steps[source, source] = 0
        energy_j[source, source] = 0.0
        entry_cell[0], entry_next[0] = source, -1
        head[0] = 0
        used, waiting = 1, 1
        t = 0
        while waiting > 0 and t <= horizon:
            bucket = t % (longest + 1)
            e = head[bucket]
            head[bucket] = -1
            while e >= 0:
                waiting -= 1
                i = entry_cell[e]
                e = entry_next[e]
                if done[i] or steps[source, i] != t:
                    continue
                done[i] = True
                for a in range(out_start[i], out_start[i + 1]):
                    j = arc_to[a]
                    arrival = t + arc_steps[a]
                    cost = energy_j[source, i] + arc_energy_j[a]
                    if arrival > horizon or arrival > steps[source, j]:
                        continue
                    if arrival == steps[source, j]:
                        energy_j[source, j] = min(energy_j[source, j], cost)
                        continue
                    steps[source, j] = arrival
                    energy_j[source, j] = cost
                    entry_cell[used] = j
                    slot = arrival % (longest + 1)
                    entry_next[used] = head[slot]
                    head[slot] = used
                    used += 1
                    waiting += 1
            t += 1
    return steps, energy_j
