"""Why a target is skipped, and what value it would cost to force it in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import dijkstra

from react_opt.models.inspection import ABSENT, FloatArray, InspectionArrays, Routes, forced
from react_opt.plan import SkipReason
from react_opt.solvers.inspection.control import Control
from react_opt.solvers.inspection.decompose import Decomposition


@dataclass(frozen=True)
class Reason:
    """Why a target is skipped; ``loss`` is None where forcing it in is infeasible or was not tested."""

    target: int
    reason: SkipReason
    loss: float | None = None


def reasons(arrays: InspectionArrays, routes: Routes) -> list[Reason]:
    """Return the reason of every target that the routes skip, from shortest chains of drives alone.

    ``unreachable``: no chain of drives leads a robot there and on to its end; ``time``: none does within the
    time left; ``battery``: some does in time, but none within its energy; ``outbid``: a robot could, but what
    is visited instead is worth more.
    """
    visited = {k for route in routes for k in route}
    n = len(arrays.value)
    level = np.zeros(n, dtype=np.int64)
    for r in range(len(arrays.time_s)):
        time_s, energy_j = _through(arrays.time_s[r]), _through(arrays.energy_j[r])
        reach = (time_s < ABSENT) & (energy_j < ABSENT)
        in_time = time_s <= arrays.time_limit_s
        in_energy = energy_j <= arrays.energy_limit_j[r]
        mine = np.where(reach, 1, 0) + np.where(reach & in_time, 1, 0) + np.where(reach & in_time & in_energy, 1, 0)
        level = np.maximum(level, mine)
    names: tuple[SkipReason, ...] = ("unreachable", "time", "battery", "outbid")
    return [Reason(k, names[level[k]]) for k in range(n) if k not in visited]


def _through(drive: FloatArray) -> FloatArray:
    """Return ``(N,)`` the least sum of a chain from the start over each target to the end."""
    n = len(drive) - 2
    graph = np.where(drive < ABSENT, drive, np.inf)
    least = dijkstra(_sparse(graph), indices=[n])[0]
    back = dijkstra(_sparse(graph.T), indices=[n + 1])[0]
    total = least[:n] + back[:n]
    return np.where(np.isfinite(total), total, 2 * ABSENT)


def _sparse(graph: FloatArray) -> object:
    """Return a graph in which a drive of no length is a drive (a dense 0 would mean none)."""
    from scipy.sparse import csr_array

    i, j = np.nonzero(np.isfinite(graph))
    return csr_array((np.maximum(graph[i, j], 1e-300), (i, j)), shape=graph.shape)


def with_losses(
    arrays: InspectionArrays, routes: Routes, value: float, control: Control, seed: int = 0
) -> list[Reason]:
    """Return the reasons, each tested by forcing the target into a plan whose value was proven.

    A target is forced by making it worth more than all others together. Where even then no plan visits it, it
    is the budgets together that forbid it, and its reason is the one that binds the chain that is shortest in
    time. What is not settled before the control stops keeps its reason without a loss.
    """
    tested = []
    for row in reasons(arrays, routes):
        if row.reason != "outbid" or control.stopped():
            tested.append(row)
            continue
        lifted, lift = forced(arrays, row.target)
        with control.part() as part:
            answer = Decomposition(lifted, part, seed=seed, routes=routes).run(second=False)
        proven = answer.routes is not None and answer.value_bound <= answer.value + 1e-6 * max(1.0, answer.value)
        if not proven or answer.routes is None:
            tested.append(row)
        elif any(row.target in route for route in answer.routes):
            tested.append(Reason(row.target, "outbid", max(0.0, value - (answer.value - lift))))
        else:
            tested.append(Reason(row.target, "battery"))
    return tested
