"""Branch and bound for the assignment: a Lagrangian bound over a transportation problem, depth first.

The coupling limits (energy budgets, and conflicts gathered into cliques) are priced into the pairs' weights;
what is left is a transportation problem. Every relaxed solution is repaired into a feasible assignment, and a
pair whose reduced cost exceeds the gap leaves the subtree. A conflict that the relaxed solution breaks is
branched on as "this target is not taken" or "none that conflicts with it is taken"; a broken budget as "this
pair is in" or "out".
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.solvers.assignment.pairs import Pairs
from react_opt.solvers.assignment.transport import transport

FREE, IN, OUT = 0, 1, 2
ROOT_ROUNDS, NODE_ROUNDS = 60, 4
STACK_FULL, STOPPED, DONE = 0, 1, 2
ROUNDING = 1e-12  # of energies, as shares of a robot's limit


@kernel
def _ban(p: int, state: Any) -> bool:
    """Put a pair out; False where it was in."""
    if state[p] == IN:
        return False
    state[p] = OUT
    return True


@kernel
def _ban_target(k: int, pair_start: Any, pair_of: Any, state: Any) -> bool:
    good = True
    for q in range(pair_start[k], pair_start[k + 1]):
        good = _ban(pair_of[q], state) and good
    return good


@kernel
def _keep_target(k: int, near_start: Any, near: Any, pair_start: Any, pair_of: Any, state: Any) -> bool:
    good = True
    for q in range(near_start[k], near_start[k + 1]):
        good = _ban_target(near[q], pair_start, pair_of, state) and good
    return good


@kernel
def _force(
    p: int, start: Any, robot: Any, target: Any, energy: Any, units: Any, near_start: Any, near: Any,
    pair_start: Any, pair_of: Any, state: Any,
) -> bool:  # fmt: skip
    """Put a pair in, and out whatever it excludes; False where that cannot be."""
    if state[p] == OUT:
        return False
    k, r = target[p], robot[p]
    for q in range(pair_start[k], pair_start[k + 1]):
        if pair_of[q] != p and not _ban(pair_of[q], state):
            return False
    state[p] = IN
    used, count = 0.0, 0
    for q in range(start[r], start[r + 1]):
        if state[q] == IN:
            used += energy[q]
            count += 1
    if used > 1.0 + ROUNDING or count > units[r]:
        return False
    for q in range(start[r], start[r + 1]):
        if state[q] == FREE and (count == units[r] or used + energy[q] > 1.0 + ROUNDING):
            state[q] = OUT
    return bool(_keep_target(k, near_start, near, pair_start, pair_of, state))


@kernel
def _repair(
    owner: Any, order: Any, robot: Any, target: Any, value: Any, energy: Any, units: Any, near_start: Any,
    near: Any, state: Any, taken: Any,
) -> float:  # fmt: skip
    """Build a feasible assignment: pairs that are in, then those of the relaxed solution, then any, by value."""
    used, count = np.zeros(len(units)), np.zeros(len(units), np.int64)
    blocked = np.zeros(len(owner), np.bool_)
    taken[:] = -1
    total = 0.0
    for turn in range(3):
        for x in range(len(order)):
            p = order[x]
            k, r = target[p], robot[p]
            if taken[k] >= 0 or blocked[k] or count[r] == units[r] or state[p] == OUT:
                continue
            if used[r] + energy[p] > 1.0 + 2 * ROUNDING:  # twice: in another order than in _force
                continue
            if (turn == 0 and state[p] != IN) or (turn == 1 and owner[k] != p):
                continue
            taken[k] = p
            used[r] += energy[p]
            count[r] += 1
            total += value[p]
            for q in range(near_start[k], near_start[k + 1]):
                blocked[near[q]] = True
    return total


def greedy(pairs: Pairs, n_targets: int) -> tuple[NDArray[np.int64], float]:
    """Return the pair of each target (-1 none) when pairs are taken by falling value, and the total value."""
    taken, nobody = np.full(n_targets, -1, dtype=np.int64), np.full(n_targets, -1, dtype=np.int64)
    state = np.zeros(len(pairs.robot), dtype=np.int8)
    total = _repair(
        nobody, pairs.order, pairs.robot, pairs.target, pairs.value, pairs.energy, pairs.units, pairs.near_start,
        pairs.near, state, taken,
    )  # fmt: skip
    return taken, float(total)


@kernel
def search(
    start: Any, robot: Any, target: Any, value: Any, energy: Any, order: Any, units: Any, clique_start: Any,
    clique: Any, near_start: Any, near: Any, states: Any, prices: Any, bounds: Any, counters: Any, best: Any,
    best_value: float, max_solves: int, gap: float, tolerance: float,
) -> float:  # fmt: skip
    """Work on the stack of open nodes until it is empty, full, or ``max_solves`` transports are done.

    Parameters
    ----------
    start, robot, target, value, energy, order, units, clique_start, clique, near_start, near
        Fields of :class:`Pairs`.
    states, prices, bounds
        The stack: per node the state of each pair, the multipliers (robots, then cliques), and its bound.
    counters
        In and out: open nodes, transports done, why it returned, and whether the root is done.
    best, best_value
        In and out: pair of each target in the best assignment (-1 none), and its value.
    max_solves, gap, tolerance
        Work of this call; relative and absolute gap at which a node is closed. ``bounds[0]`` of an empty
        stack holds the largest bound of the nodes that the gap closed.

    Returns
    -------
    float
        The best value.
    """
    n_robots, n_targets, n_pairs = len(units), len(best), len(robot)
    n_cliques = len(clique_start) - 1
    owner, taken = np.empty(n_targets, np.int64), np.empty(n_targets, np.int64)
    u, v = np.empty(n_robots), np.empty(n_targets)
    weight, penalty = np.empty(n_pairs), np.empty(n_targets)
    open_pair = np.empty(n_pairs, np.bool_)
    room = np.empty(n_robots, np.int64)
    slack, price = np.empty(n_robots + n_cliques), np.empty(n_robots + n_cliques)
    kept_price = np.empty(n_robots + n_cliques)
    alive = np.empty(n_targets, np.bool_)
    state = np.empty(n_pairs, np.int8)
    pair_start = np.zeros(n_targets + 1, np.int64)
    for p in range(n_pairs):
        pair_start[target[p] + 1] += 1
    pair_start = np.cumsum(pair_start)
    pair_of = np.empty(n_pairs, np.int64)
    fill = pair_start.copy()
    for p in range(n_pairs):
        pair_of[fill[target[p]]] = p
        fill[target[p]] += 1
    solves = 0
    while counters[0] > 0:
        if counters[0] + 2 >= len(bounds) or solves >= max_solves:
            counters[1] += solves
            counters[2] = STACK_FULL if counters[0] + 2 >= len(bounds) else STOPPED
            return best_value
        counters[0] -= 1
        node = counters[0]
        bound = bounds[node]
        state[:] = states[node]
        price[:] = prices[node]
        closing = best_value + max(tolerance, gap * abs(best_value))
        if bound <= closing:
            bounds[-1] = max(bounds[-1], bound)
            continue
        rounds = NODE_ROUNDS if counters[3] else ROOT_ROUNDS
        counters[3] = 1
        node_bound, theta, idle_rounds, least = bound, 1.0, 0, np.inf
        closed = False
        kept_price[:] = price
        for turn in range(rounds + 1):
            if turn == rounds:
                price[:] = kept_price
            room[:] = units
            base = 0.0
            alive[:] = False
            for r in range(n_robots):
                total = 0.0
                for p in range(start[r], start[r + 1]):
                    if state[p] != OUT:
                        total += energy[p]
                        alive[target[p]] = True
                if total <= 1.0:
                    price[r] = 0.0
                base += price[r]
            penalty[:] = 0.0
            for q in range(n_cliques):
                count = 0
                for x in range(clique_start[q], clique_start[q + 1]):
                    count += alive[clique[x]]
                if count <= 1:
                    price[n_robots + q] = 0.0
                    continue
                base += price[n_robots + q]
                for x in range(clique_start[q], clique_start[q + 1]):
                    penalty[clique[x]] += price[n_robots + q]
            for p in range(n_pairs):
                open_pair[p] = state[p] == FREE
                if state[p] != OUT:
                    weight[p] = value[p] - price[robot[p]] * energy[p] - penalty[target[p]]
                    if state[p] == IN:
                        base += weight[p]
                        room[robot[p]] -= 1
            relaxed = base + transport(start, robot, target, weight, open_pair, room, owner, u, v)
            solves += 1
            for p in range(n_pairs):
                if state[p] == IN:
                    owner[target[p]] = p
            idle_rounds += 1
            if relaxed < least:
                if relaxed < least - 1e-4 * abs(relaxed):
                    idle_rounds = 0
                least = relaxed
                node_bound = min(node_bound, relaxed)
                kept_price[:] = price
            norm, broken = 0.0, False
            slack[:] = 1.0
            for k in range(n_targets):
                if owner[k] >= 0:
                    slack[robot[owner[k]]] -= energy[owner[k]]
            for q in range(n_cliques):
                for x in range(clique_start[q], clique_start[q + 1]):
                    if owner[clique[x]] >= 0:
                        slack[n_robots + q] -= 1.0
            for x in range(n_robots + n_cliques):
                broken = broken or slack[x] < -ROUNDING
                if slack[x] < 0 or price[x] > 0:
                    norm += slack[x] * slack[x]
            if not broken or turn % 4 == 0 or turn == rounds:
                got = _repair(owner, order, robot, target, value, energy, units, near_start, near, state, taken)
                if got > best_value + 1e-12 * abs(best_value):
                    best_value = got
                    best[:] = taken
            closing = best_value + max(tolerance, gap * abs(best_value))
            if node_bound <= closing:
                closed = True
                break
            for p in range(n_pairs):  # reduced costs: what cannot be in a better assignment is out
                if state[p] == FREE and owner[target[p]] != p and room[robot[p]] > 0:
                    state[p] = OUT if relaxed + weight[p] + u[robot[p]] + v[target[p]] <= closing else FREE
            if norm < 1e-18 or turn == rounds:
                break
            if idle_rounds >= 4:
                theta *= 0.5
                idle_rounds = 0
                if theta < 0.02:
                    rounds = turn + 1
                    price[:] = kept_price
                    continue
            step = theta * (relaxed - best_value) / norm
            for x in range(n_robots + n_cliques):
                price[x] = max(0.0, price[x] - step * slack[x])
        if closed:
            bounds[-1] = max(bounds[-1], node_bound)
            continue
        # branch: the fullest clique, else the most overdrawn robot, else the most valuable open pair
        worst, where = -ROUNDING, -1
        for x in range(n_robots + n_cliques):
            if slack[x] < worst:
                worst, where = slack[x], x
        side_a, side_b = counters[0], counters[0] + 1
        for side in (side_a, side_b):
            states[side] = state
            prices[side] = kept_price
            bounds[side] = node_bound
        good_a = good_b = True
        if where >= n_robots:
            chosen, most = -1, -np.inf
            q = where - n_robots
            for x in range(clique_start[q], clique_start[q + 1]):
                k = clique[x]
                if owner[k] >= 0 and value[owner[k]] > most:
                    chosen, most = k, value[owner[k]]
            good_a = _ban_target(chosen, pair_start, pair_of, states[side_a])
            good_b = _keep_target(chosen, near_start, near, pair_start, pair_of, states[side_b])
        else:
            chosen, most = -1, -np.inf
            if where >= 0:
                for p in range(start[where], start[where + 1]):
                    if owner[target[p]] == p and state[p] == FREE and energy[p] > most:
                        chosen, most = p, energy[p]
            else:
                for p in range(n_pairs):
                    if state[p] == FREE:
                        rank = weight[p] + (1e6 if owner[target[p]] == p else 0.0)
                        if rank > most:
                            chosen, most = p, rank
            if chosen < 0:  # every pair is decided and the limits hold: the repair found this assignment
                continue
            good_a = _ban(chosen, states[side_a])
            good_b = _force(
                chosen, start, robot, target, energy, units, near_start, near, pair_start, pair_of, states[side_b]
            )
        if good_a and good_b:
            counters[0] += 2
        elif good_a:
            counters[0] += 1
        elif good_b:
            states[side_a] = states[side_b]
            counters[0] += 1
    counters[1] += solves
    counters[2] = DONE
    return best_value
