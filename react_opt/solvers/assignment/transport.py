"""Transportation problem by successive shortest paths: the relaxation that bounds the assignment's tree.

Robots offer units, each target takes at most one, and a unit may stay idle at value 0. Pairs come sorted by
robot (``start[r]:start[r+1]``), so a search over a thinned-out set costs only what is left.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from react_opt.kernels import kernel


@kernel
def transport(
    start: Any,
    robot: Any,
    target: Any,
    weight: Any,
    open_pair: Any,
    units: Any,
    owner: Any,
    u: Any,
    v: Any,
) -> float:
    """Maximise the weight of the pairs chosen; duals of the minimisation of ``-weight`` are left behind.

    Parameters
    ----------
    start, robot, target, weight
        Pairs sorted by robot: ``(R + 1,)`` offsets, and per pair its robot, target and weight.
    open_pair
        Whether a pair may be chosen.
    units
        ``(R,)`` how many targets each robot may take.
    owner
        Out: ``(K,)`` the pair chosen for each target, -1 for none.
    u, v
        Out: duals with ``-weight - u[r] - v[k] >= 0`` on every open pair, 0 on the chosen ones, ``u, v <= 0``.

    Returns
    -------
    float
        The total weight, equal to ``-(sum units u + sum v)``.
    """
    n_robots, n_targets = len(units), len(owner)
    distance = np.empty(n_targets)
    before = np.empty(n_targets, np.int64)
    scanned = np.zeros(n_targets, np.bool_)
    touched = np.empty(n_targets, np.int64)
    robot_distance = np.empty(n_robots)
    entry = np.empty(n_robots, np.int64)
    in_tree = np.zeros(n_robots, np.bool_)
    tree = np.empty(n_robots, np.int64)
    owner[:] = -1
    u[:] = 0.0
    v[:] = 0.0
    distance[:] = np.inf
    for r in range(n_robots):
        least = 0.0
        for p in range(start[r], start[r + 1]):
            if open_pair[p]:
                least = min(least, -weight[p] - v[target[p]])
        u[r] = least if units[r] > 0 else 0.0
        for _ in range(units[r]):
            n_touched, n_tree = 0, 0
            best, final, idle = np.inf, -1, -1
            i, di = r, 0.0
            entry[r] = -1
            while True:
                in_tree[i] = True
                tree[n_tree] = i
                n_tree += 1
                robot_distance[i] = di
                if di - u[i] < best:
                    best, final, idle = di - u[i], -1, i
                for p in range(start[i], start[i + 1]):
                    if open_pair[p]:
                        k = target[p]
                        if owner[k] != p and not scanned[k]:
                            d = di - weight[p] - u[i] - v[k]
                            if d < distance[k]:
                                if distance[k] == np.inf:
                                    touched[n_touched] = k
                                    n_touched += 1
                                distance[k] = d
                                before[k] = p
                again = False
                while True:
                    nearest, least = -1, best
                    for t in range(n_touched):
                        k = touched[t]
                        if not scanned[k] and distance[k] < least:
                            nearest, least = k, distance[k]
                    if nearest < 0:
                        break
                    if owner[nearest] < 0:
                        best, final = least, nearest
                        break
                    scanned[nearest] = True
                    i, di = robot[owner[nearest]], least
                    if not in_tree[i]:
                        entry[i] = nearest
                        again = True
                        break
                if not again:
                    break
            for t in range(n_tree):
                u[tree[t]] += best - robot_distance[tree[t]]
            k = final if final >= 0 else entry[idle]
            while k >= 0:
                owner[k] = before[k]
                k = entry[robot[before[k]]]
            for t in range(n_tree):
                i = tree[t]
                in_tree[i] = False
                for p in range(start[i], start[i + 1]):
                    if owner[target[p]] == p:
                        v[target[p]] = -weight[p] - u[i]
            for t in range(n_touched):
                distance[touched[t]] = np.inf
                scanned[touched[t]] = False
            if final < 0 and idle == r:
                break
    total = 0.0
    for k in range(n_targets):
        if owner[k] >= 0:
            total += weight[owner[k]]
    return total
