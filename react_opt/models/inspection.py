"""Deferred-priority inspection: team orienteering with a time and an energy budget.

Nodes of robot r: targets 0..N-1, its start N, its end N+1. ``x[r,i,j]`` in {0,1}: robot r drives from i to j::

    max   sum_r,i,j value_j x[r,i,j]           then, among those,   min sum_r,i,j cost_rij x[r,i,j]
    s.t.  sum_j x[r,N,j] = 1,  sum_i x[r,i,N+1] = 1                    one route per robot
          sum_i x[r,i,k] = sum_j x[r,k,j]                              what is entered is left
          sum_r,i x[r,i,k] <= 1                                        one visit per target
          sum time_rij x[r,i,j] <= time_left,   sum energy_rij x[r,i,j] <= battery_r - reserve_r
          u_j >= u_i + 1 - N (1 - sum_r x[r,i,j])                      no cycles

``time_rij`` is the drive from i to j and the service at j. Nobody waits, so a route's time and energy are sums
over its drives. A robot without an end place finishes where it last leaves: its drives to N+1 are free.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from react_opt.instance import InspectionInstance
from react_opt.models.program import Program

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Routes = list[list[int]]  # per robot the targets in the order of visit

ABSENT = 1e12  # time (s) and energy (J) of a drive that is not listed: finite, so that sums stay numbers
TOLERANCE = 1e-9  # relative: sums of decimals may miss a budget that they meet on paper


@dataclass(frozen=True)
class InspectionArrays:
    """The plain mathematics.

    Parameters
    ----------
    value
        ``(N,)`` value of each target.
    time_s, energy_j
        ``(R, N + 2, N + 2)`` drive and service, ``ABSENT`` where there is no drive.
    time_limit_s
        Time left, with the tolerance that sums need.
    energy_limit_j
        ``(R,)`` battery minus reserve, with that tolerance.
    by_time
        Whether the second objective is time; else energy.
    """

    value: FloatArray
    time_s: FloatArray
    energy_j: FloatArray
    time_limit_s: float
    energy_limit_j: FloatArray
    by_time: bool

    @property
    def cost(self) -> FloatArray:
        """``(R, N + 2, N + 2)`` the second objective of each drive."""
        return self.time_s if self.by_time else self.energy_j

    @cached_property
    def classes(self) -> IntArray:
        """``(R,)`` for each robot the first robot that is interchangeable with it."""
        answer = np.arange(len(self.time_s))
        for r in range(len(answer)):
            for other in range(r):
                if (
                    answer[other] == other
                    and self.energy_limit_j[r] == self.energy_limit_j[other]
                    and np.array_equal(self.time_s[r], self.time_s[other])
                    and np.array_equal(self.energy_j[r], self.energy_j[other])
                ):
                    answer[r] = other
                    break
        return answer

    def totals(self, robot: int, route: Sequence[int]) -> tuple[float, float]:
        """Return time (s) and energy (J) of a route of a robot, from its start to its end."""
        n = len(self.value)
        nodes = [n, *route, n + 1]
        time_s = energy_j = 0.0
        for i, j in itertools.pairwise(nodes):
            time_s += self.time_s[robot, i, j]
            energy_j += self.energy_j[robot, i, j]
        return float(time_s), float(energy_j)

    def allows(self, robot: int, route: Sequence[int]) -> bool:
        """Whether a route keeps both budgets of a robot."""
        time_s, energy_j = self.totals(robot, route)
        return time_s <= self.time_limit_s and energy_j <= self.energy_limit_j[robot]

    def is_feasible(self, routes: Routes) -> bool:
        """Whether routes, one per robot, keep every limit."""
        visits = [k for route in routes for k in route]
        return len(set(visits)) == len(visits) and all(self.allows(r, route) for r, route in enumerate(routes))

    def worth(self, routes: Routes) -> tuple[float, float]:
        """Return the value visited, and the second objective (s or J) of routes."""
        value = sum(float(self.value[k]) for route in routes for k in route)
        which = 0 if self.by_time else 1
        return value, sum(self.totals(r, route)[which] for r, route in enumerate(routes))


@dataclass(frozen=True)
class InspectionModel:
    """An instance as arrays with its names."""

    robots: tuple[str, ...]
    targets: tuple[str, ...]
    arrays: InspectionArrays


def build(instance: InspectionInstance) -> InspectionModel:
    """Return an instance as arrays."""
    robots, n = instance.robots, len(instance.targets)
    place = {target.id: index for index, target in enumerate(instance.targets)}
    rows = instance.travel
    for row in rows:
        place.setdefault(row.from_, len(place))
        place.setdefault(row.to, len(place))
    for robot in robots:
        place.setdefault(robot.at, len(place))
        place.setdefault(robot.end or robot.at, len(place))
    number = {robot.id: index for index, robot in enumerate(robots)}
    at = np.array([(place[row.from_], place[row.to]) for row in rows], dtype=np.int64).reshape(-1, 2)
    cost = np.array([(row.time_s, row.energy_j) for row in rows], dtype=np.float64).reshape(-1, 2)
    whose = np.array([-1 if row.robot is None else number[row.robot] for row in rows], dtype=np.int64)
    shape = (len(place), len(place))
    general = np.full((2, *shape), ABSENT)
    shared = whose < 0
    general[:, at[shared, 0], at[shared, 1]] = np.minimum(cost[shared].T, ABSENT)
    service = np.array([(t.service_s, t.service_energy_j) for t in instance.targets], dtype=np.float64).reshape(-1, 2)
    drives = np.empty((2, len(robots), n + 2, n + 2))
    for r, robot in enumerate(robots):
        matrix, own = general, whose == r
        if own.any():
            matrix = general.copy()
            matrix[:, at[own, 0], at[own, 1]] = np.minimum(cost[own].T, ABSENT)
        nodes = np.array([*range(n), place[robot.at], place[robot.end or robot.at]])
        mine = matrix[:, nodes[:, None], nodes[None, :]]
        mine[:, nodes[:, None] == nodes[None, :]] = 0.0  # who stands at a place needs no drive to it
        if robot.end is None:
            mine[:, :, n + 1] = 0.0
        mine[:, :, :n] = np.minimum(mine[:, :, :n] + service.T[:, None, :], ABSENT)
        mine[:, range(n), range(n)] = ABSENT
        mine[:, :, n] = mine[:, n + 1, :] = ABSENT
        drives[:, r] = mine
    budget = np.array([robot.battery_j - robot.reserve_j for robot in robots], dtype=np.float64)
    arrays = InspectionArrays(
        value=np.array([target.value for target in instance.targets], dtype=np.float64),
        time_s=drives[0],
        energy_j=drives[1],
        time_limit_s=instance.time_left_s + TOLERANCE * max(1.0, instance.time_left_s),
        energy_limit_j=budget + TOLERANCE * np.maximum(1.0, budget),
        by_time=instance.minimise == "time",
    )
    return InspectionModel(tuple(r.id for r in robots), tuple(t.id for t in instance.targets), arrays)


def program(arrays: InspectionArrays, least_value: float | None = None) -> Program:
    """Return the inspection as an integer program.

    Parameters
    ----------
    arrays
        The mathematics.
    least_value
        None for the first objective (value, maximised); else the second is minimised over plans of at least
        this value.

    Notes
    -----
    Columns ``x`` (robot, i, j) and ``u`` (target); rows ``leave``, ``finish``, ``flow``, ``visit``, ``time``,
    ``energy``, ``order`` and, with ``least_value``, ``value``.
    """
    n, n_robots = len(arrays.value), len(arrays.time_s)
    model = Program("inspection", maximise=least_value is None)
    limit = arrays.energy_limit_j[:, None, None]
    usable = (arrays.time_s <= arrays.time_limit_s) & (arrays.energy_j <= limit)
    robot, i, j = np.nonzero(usable)
    worth = np.append(arrays.value, [0.0, 0.0])[j]
    cost = worth if least_value is None else arrays.cost[robot, i, j]
    x = model.add_columns("x", np.column_stack([robot, i, j]), cost=cost, upper=1.0, integer=True)
    # Whole positions cut nothing off, and solvers that compute in whole numbers can be given them.
    u = model.add_columns("u", np.arange(n), upper=float(max(1, n)), integer=True)
    each = np.arange(n_robots)
    out, arrive = i == n, j == n + 1
    model.add_rows("leave", each, row=robot[out], column=x[out], value=1.0, lower=1.0, upper=1.0)
    model.add_rows("finish", each, row=robot[arrive], column=x[arrive], value=1.0, lower=1.0, upper=1.0)
    into, off = j < n, i < n
    model.add_rows(
        "flow", np.array([(r, k) for r in range(n_robots) for k in range(n)]).reshape(-1, 2),
        row=np.concatenate([robot[into] * n + j[into], robot[off] * n + i[off]]),
        column=np.concatenate([x[into], x[off]]),
        value=np.concatenate([np.ones(into.sum()), -np.ones(off.sum())]), lower=0.0, upper=0.0,
    )  # fmt: skip
    model.add_rows("visit", np.arange(n), row=j[into], column=x[into], value=1.0, upper=1.0)
    time_s, energy_j = arrays.time_s[robot, i, j], arrays.energy_j[robot, i, j]
    model.add_rows("time", each, row=robot, column=x, value=time_s, upper=arrays.time_limit_s)
    model.add_rows("energy", each, row=robot, column=x, value=energy_j, upper=arrays.energy_limit_j)
    inner = into & off
    pairs = sorted({(a, b) for a, b in zip(i[inner].tolist(), j[inner].tolist(), strict=True)})
    row_of = {pair: index for index, pair in enumerate(pairs)}
    at = np.array([row_of[a, b] for a, b in zip(i[inner].tolist(), j[inner].tolist(), strict=True)], dtype=np.int64)
    first, second = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    model.add_rows(
        "order", np.array(pairs).reshape(-1, 2),
        row=np.concatenate([at, np.arange(len(pairs)), np.arange(len(pairs))]),
        column=np.concatenate([x[inner], u[first], u[second]]),
        value=np.concatenate([np.full(len(at), -float(n)), -np.ones(len(pairs)), np.ones(len(pairs))]),
        lower=1.0 - n,
    )  # fmt: skip
    if least_value is not None:
        model.add_rows("value", np.arange(1), row=np.zeros(len(x)), column=x, value=worth, lower=least_value)
    return model


def routes_of(model: Program, x: FloatArray, n_robots: int, n_targets: int) -> Routes:
    """Return the routes of a solution vector."""
    used = model.columns["x"].keys[model.values(x, "x") > 0.5]
    after = {(r, i): j for r, i, j in used.tolist()}
    routes: Routes = []
    for r in range(n_robots):
        route: list[int] = []
        at = after.get((r, n_targets), n_targets + 1)
        while at < n_targets and len(route) <= n_targets:
            route.append(at)
            at = after.get((r, at), n_targets + 1)
        routes.append(route)
    return routes


def vector_of(model: Program, routes: Routes, n_targets: int) -> FloatArray:
    """Return the solution vector of routes."""
    x = np.zeros(model.n_columns)
    key = {tuple(row): index for index, row in enumerate(model.columns["x"].keys.tolist())}
    first = model.columns["u"].first
    for r, route in enumerate(routes):
        nodes = [n_targets, *route, n_targets + 1]
        for position, (i, j) in enumerate(itertools.pairwise(nodes)):
            x[model.columns["x"].first + key[r, i, j]] = 1.0
            if j < n_targets:
                x[first + j] = float(position)
    return x


def forced(arrays: InspectionArrays, target: int) -> tuple[InspectionArrays, float]:
    """Return the problem with one target worth more than all others together, and by how much it was lifted."""
    lift = float(np.ceil(arrays.value.sum())) + 1.0
    value = arrays.value.copy()
    value[target] += lift
    return replace(arrays, value=value), lift
