"""What a set of routes is worth and whether it keeps every limit: the search's own sanity check.

This is the solver's view of a plan, on the arrays of `RouteProblem`; plans that leave the program are replayed
by the independent checker.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from react_opt.route_problem import FloatArray, IntArray, Route, RouteProblem

TOLERANCE = 1e-6
"""Relative slack granted to battery and charge limits."""


def first_sensed(problem: RouteProblem, routes: Sequence[Route]) -> IntArray:
    """Instant at which each cell is first sensed, ``horizon + 1`` where it never is.

    Parameters
    ----------
    problem
        The problem.
    routes
        Any number of routes.
    """
    first = np.full(problem.n_cells, problem.horizon + 1, dtype=np.int64)
    for route in routes:
        at = np.flatnonzero(route.sense)
        start_step = problem.classes[route.robot_class].start_step
        np.minimum.at(first, route.cell[at], at + start_step)
    return first


def coverage(problem: RouteProblem, first: IntArray) -> float:
    """Coverage that the instants of first sensing earn (`first_sensed`)."""
    cells = np.flatnonzero(first <= problem.horizon)
    return float(np.maximum(problem.reward[cells, first[cells]], 0.0).sum())


def battery(problem: RouteProblem, route: Route) -> FloatArray:
    """Battery ``b[t]`` of a route at each instant from its class's ``start_step`` to the horizon, J."""
    group = problem.classes[route.robot_class]
    change = np.array(route.charge_j, dtype=np.float64)
    change[0] += group.battery_j
    change[route.sense] -= group.sense_j
    waits = (route.cell[:-1] >= 0) & (route.arc[:-1] < 0)
    change[1:][waits] -= group.wait_j
    moves = np.flatnonzero(route.arc >= 0)
    moves = moves[moves + 1 < len(change)]
    change[moves + 1] -= problem.arc_energy_j[route.arc[moves]]
    return np.cumsum(change)


def value(problem: RouteProblem, routes: Sequence[Route]) -> float:
    """Objective of a set of routes by its definition: coverage and the weighted battery left.

    Parameters
    ----------
    problem
        The problem.
    routes
        One route per robot; fewer give the value of those robots alone.
    """
    left_j = sum(float(battery(problem, route)[-1]) for route in routes)
    return coverage(problem, first_sensed(problem, routes)) + problem.sigma * left_j


def feasible(problem: RouteProblem, routes: Sequence[Route]) -> list[str]:
    """Violations of a complete set of routes, one line each; empty when it keeps every limit.

    Parameters
    ----------
    problem
        The problem.
    routes
        One route per robot, classes in order.
    """
    faults: list[str] = []
    expected = [k for k, group in enumerate(problem.classes) for _ in group.robots]
    if [route.robot_class for route in routes] != expected:
        return [f"classes of the routes are {[r.robot_class for r in routes]}, expected {expected}"]
    for number, route in enumerate(routes):
        faults += [f"route {number}: {text}" for text in _route_faults(problem, route)]
    return faults or coupling_faults(problem, routes)


def _route_faults(problem: RouteProblem, route: Route) -> list[str]:
    """Violations of one route's own limits."""
    group = problem.classes[route.robot_class]
    length = problem.horizon - group.start_step + 1
    if {len(route.cell), len(route.arc), len(route.sense), len(route.charge_j)} != {length}:
        return [f"needs {length} instants"]
    faults = []
    if route.cell[0] != group.start:
        faults.append("does not begin at its start")
    k = 0
    while k < length - 1:
        here, arc = int(route.cell[k]), int(route.arc[k])
        if arc < 0:
            if route.cell[k + 1] != here:
                faults.append(f"leaves cell {here} without an arc at entry {k}")
                break
            k += 1
            continue
        steps = int(problem.arc_steps[arc])
        if problem.arc_from[arc] != here or k + steps >= length:
            faults.append(f"arc {arc} cannot start in cell {here} at entry {k}")
            break
        if route.cell[k + steps] != problem.arc_to[arc] or np.any(route.cell[k + 1 : k + steps] >= 0):
            faults.append(f"arc {arc} started at entry {k} is not driven")
            break
        if np.any(route.arc[k + 1 : k + steps] >= 0):
            faults.append(f"starts an arc while on arc {arc}")
            break
        k += steps
    if route.arc[-1] >= 0:
        faults.append("starts an arc at the horizon")
    if group.return_to >= 0 and route.cell[-1] != group.return_to:
        faults.append(f"ends in cell {route.cell[-1]}, not in {group.return_to}")
    if np.any(route.sense & (route.cell < 0)) or (group.start_step == 0 and route.sense[0]):
        faults.append("senses where it does not stand, or at instant 0")
    slack = TOLERANCE * max(1.0, group.capacity_j)
    waited = np.zeros(length, dtype=bool)
    waited[1:] = (route.arc[:-1] < 0) & (route.cell[:-1] >= 0)
    limit = np.where(waited & (route.cell >= 0), problem.charger_j[np.maximum(route.cell, 0)], 0.0)
    if np.any(route.charge_j < 0.0) or np.any(route.charge_j > limit + slack):
        faults.append("charges where or more than it may")
    level = battery(problem, route)
    if level.min() < group.reserve_j - slack or level.max() > group.capacity_j + slack:
        faults.append(f"battery runs from {level.min():g} to {level.max():g} J")
    return faults


def coupling_faults(problem: RouteProblem, routes: Sequence[Route]) -> list[str]:
    """Violations of the limits that couple the robots, for any number of routes; one line each."""
    faults = []
    shape = (problem.horizon + 1, problem.n_cells)
    if problem.robots_per_cell is not None:
        standing = np.zeros(shape, dtype=np.int64)
        for route in routes:
            at = np.flatnonzero(route.cell >= 0)
            standing[at + problem.classes[route.robot_class].start_step, route.cell[at]] += 1
        for t, cell in np.argwhere(standing[1:] > problem.robots_per_cell):
            faults.append(f"{standing[t + 1, cell]} robots stand in cell {cell} at instant {t + 1}")
    if problem.sensing_robots_per_step is not None:
        sensing = np.zeros(problem.horizon + 1, dtype=np.int64)
        for route in routes:
            sensing[np.flatnonzero(route.sense) + problem.classes[route.robot_class].start_step] += 1
        for t in np.flatnonzero(sensing > problem.sensing_robots_per_step):
            faults.append(f"{sensing[t]} robots sense at instant {t}")
    if problem.charger_j.any():
        charging: dict[tuple[int, int], int] = {}
        for route in routes:
            for k in np.flatnonzero(route.charge_j > 0.0):
                place = (int(route.cell[k]), int(k) + problem.classes[route.robot_class].start_step)
                charging[place] = charging.get(place, 0) + 1
        faults += [
            f"{count} robots charge in cell {cell} at instant {t}"
            for (cell, t), count in charging.items()
            if count > problem.charger_slots[cell]
        ]
    if problem.forbid_swaps:
        faults += _swaps(problem, routes)
    return faults


def _swaps(problem: RouteProblem, routes: Sequence[Route]) -> list[str]:
    """Pairs of robots that meet head-on: i -> j and j -> i in overlapping open intervals."""
    faults = []
    driven: dict[tuple[int, int], list[tuple[int, int, int]]] = {}
    for number, route in enumerate(routes):
        start_step = problem.classes[route.robot_class].start_step
        for k in np.flatnonzero(route.arc >= 0):
            arc = route.arc[k]
            i, j = int(problem.arc_from[arc]), int(problem.arc_to[arc])
            begin = int(k) + start_step
            end = begin + int(problem.arc_steps[arc])
            for other, begin_other, end_other in driven.get((j, i), []):
                if other != number and begin < end_other and begin_other < end:
                    faults.append(f"routes {other} and {number} swap cells {j} and {i} at instant {begin}")
            driven.setdefault((i, j), []).append((number, begin, end))
    return faults


def tidy(problem: RouteProblem, routes: Sequence[Route]) -> list[Route]:
    """The same movements without sensing that earns nothing; chargers may then fill less.

    Where a robot never charges, sensing that earns less than its energy is worth is dropped too.

    Of several robots that sense a cell only the first does (the first in order on ties). A plan that kept every
    limit still does, and is worth at least as much.

    Parameters
    ----------
    problem
        The problem.
    routes
        Any number of routes.
    """
    first = first_sensed(problem, routes)
    taken = np.zeros(problem.n_cells, dtype=bool)
    result = []
    for route in routes:
        group = problem.classes[route.robot_class]
        at = np.flatnonzero(route.sense)
        cells, instants = route.cell[at], at + group.start_step
        earned = problem.reward[cells, instants]
        keep = (first[cells] == instants) & ~taken[cells] & (earned > 0.0)
        if not route.charge_j.any():  # else what it would save may not fit into the battery later
            keep &= earned >= problem.sigma * group.sense_j
        taken[cells[keep]] = True
        if keep.all():
            result.append(route)
            continue
        sense = np.zeros_like(route.sense)
        sense[at[keep]] = True
        result.append(_cut_charge(problem, replace(route, sense=sense)))
    return result


def _cut_charge(problem: RouteProblem, route: Route) -> Route:
    """The same route, charging no more than its capacity takes."""
    capacity_j = problem.classes[route.robot_class].capacity_j
    charge_j = route.charge_j.copy()
    for k in np.flatnonzero(charge_j > 0.0):
        over = float(battery(problem, replace(route, charge_j=charge_j))[k]) - capacity_j
        charge_j[k] -= min(charge_j[k], max(0.0, over))
    return replace(route, charge_j=charge_j)
