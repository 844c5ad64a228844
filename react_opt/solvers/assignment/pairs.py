"""The tree's view of an assignment: pairs that gain something, and conflicts covered by cliques."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.models.assignment import AssignmentArrays


@dataclass
class Pairs:
    """The pairs that gain something, sorted by robot, and the conflicts as cliques and neighbour lists."""

    start: NDArray[np.int64]
    robot: NDArray[np.int64]
    target: NDArray[np.int64]
    value: NDArray[np.float64]
    energy: NDArray[np.float64]  # share of the robot's limit
    order: NDArray[np.int64]  # pairs by falling value
    units: NDArray[np.int64]
    clique_start: NDArray[np.int64]
    clique: NDArray[np.int64]
    near_start: NDArray[np.int64]
    near: NDArray[np.int64]


def pairs_of(arrays: AssignmentArrays) -> Pairs:
    """Return the kernel's view of an assignment."""
    robot, target = np.nonzero(arrays.value > 0)
    n_robots, n_targets = arrays.value.shape
    value = arrays.value[robot, target]
    limit = np.maximum(arrays.energy_limit_j(), 1e-300)
    energy = arrays.energy_j[robot, target] / limit[robot]
    start = np.searchsorted(robot, np.arange(n_robots + 1))
    clique_start, clique, near_start, near = _cliques(arrays.conflicts, n_targets)
    order = np.argsort(-value, kind="stable")
    return Pairs(start, robot, target, value, energy, order, arrays.capacity, clique_start, clique, near_start, near)


@kernel
def _cliques(conflicts: Any, n_targets: int) -> Any:
    """Cover the conflict graph with cliques, greedily; return cliques and neighbour lists, both as CSR."""
    near_start = np.zeros(n_targets + 1, np.int64)
    n = len(conflicts)
    for e in range(n):
        near_start[conflicts[e, 0] + 1] += 1
        near_start[conflicts[e, 1] + 1] += 1
    near_start = np.cumsum(near_start)
    near = np.empty(2 * n, np.int64)
    fill = near_start.copy()
    for e in range(n):
        a, b = conflicts[e, 0], conflicts[e, 1]
        near[fill[a]] = b
        fill[a] += 1
        near[fill[b]] = a
        fill[b] += 1
    covered = np.zeros(2 * n, np.bool_)
    starts = np.zeros(n + 1, np.int64)
    members = np.empty(2 * n, np.int64)
    n_cliques, size = 0, 0
    common = np.zeros(n_targets, np.int64)
    for e in range(n):
        a, b = conflicts[e, 0], conflicts[e, 1]
        known = False
        for q in range(near_start[a], near_start[a + 1]):
            known = known or (near[q] == b and covered[q])
        if known:
            continue
        first = size
        common[:] = 0
        for j in (a, b):
            members[size] = j
            size += 1
            for q in range(near_start[j], near_start[j + 1]):
                common[near[q]] += 1
        for q in range(near_start[a], near_start[a + 1]):
            c = near[q]
            if common[c] == size - first:
                members[size] = c
                size += 1
                for z in range(near_start[c], near_start[c + 1]):
                    common[near[z]] += 1
        for x in range(first, size):
            j = members[x]
            for q in range(near_start[j], near_start[j + 1]):
                for y in range(first, size):
                    if members[y] == near[q]:
                        covered[q] = True
        n_cliques += 1
        starts[n_cliques] = size
        if size + n_targets > len(members):
            longer = np.empty(2 * len(members) + n_targets, np.int64)
            longer[:size] = members[:size]
            members = longer
    return starts[: n_cliques + 1].copy(), members[:size].copy(), near_start, near
