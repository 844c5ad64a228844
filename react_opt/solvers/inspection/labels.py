"""Best routes of one robot for given prizes: labels by number of stops, with time, energy and memory.

A label is a partial route: node, time, energy, profit so far (prizes less ``rate`` times the second objective)
and the targets it must not visit again. Three ways to compare labels at a node:

``HEURISTIC``  time, energy and profit only: fast, finds good routes, proves nothing;
``EXACT``      a better label may also go wherever the worse one may: the best route of the (ng-)relaxation;
``ENUMERATE``  only labels that have visited the same targets compare: every route that is worth a threshold.

With full memories routes are elementary; with smaller ones (ng-routes, Baldacci et al. 2011) a target may come
back after a detour outside its neighbourhood, which bounds from above. Partial routes that cannot reach the
threshold are dropped by :func:`completion`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from react_opt.kernels import kernel

HEURISTIC, EXACT, ENUMERATE = 0, 1, 2
MOST_BUCKETS = 1500


@kernel
def completion(prize: Any, gain: Any, resource: Any, limit: float, n_buckets: int) -> Any:
    """Bound the profit still to be had from each node, by how much of a resource is used.

    Walks may repeat targets, but not go there and straight back; the resource is rounded down to buckets.

    Parameters
    ----------
    prize
        ``(N,)`` prize of each target; those of ``-inf`` are left out.
    gain
        ``(N + 2, N + 2)`` profit of each drive (prize of where it leads less its cost).
    resource
        ``(N + 2, N + 2)`` what a drive uses.
    limit
        What there is.
    n_buckets
        Buckets; every drive between targets must use more than ``limit / n_buckets``.

    Returns
    -------
    best, first, other
        ``(N + 1, n_buckets + 1)`` best profit, the target it goes to first (-1: the end), and the best profit
        of those that go elsewhere first.
    """
    n = len(prize)
    width = limit / n_buckets
    best = np.full((n + 1, n_buckets + 1), -np.inf)
    other = np.full((n + 1, n_buckets + 1), -np.inf)
    first = np.full((n + 1, n_buckets + 1), -1, np.int64)
    for b in range(n_buckets, -1, -1):
        used = b * width
        for i in range(n + 1):
            if i < n and prize[i] == -np.inf:
                continue
            top, second, to = -np.inf, -np.inf, -1
            if used + resource[i, n + 1] <= limit:
                top = gain[i, n + 1]
            for j in range(n):
                if j == i or prize[j] == -np.inf:
                    continue
                after = used + resource[i, j]
                if after > limit:
                    continue
                c = int(after / width)
                c = min(max(c, b + 1 if i < n else b), n_buckets)
                rest = best[j, c] if first[j, c] != i else other[j, c]
                worth = gain[i, j] + rest
                if worth > top:
                    top, second, to = worth, top, j
                elif worth > second:
                    second = worth
            best[i, b], other[i, b], first[i, b] = top, second, to
    return best, first, other


@kernel
def still_ahead(table: Any, first: Any, other: Any, i: int, used: float, width: float, mask: Any, label: int) -> float:
    """Bound from a completion table, knowing which targets are excluded."""
    b = min(int(used / width), table.shape[1] - 1)
    to = first[i, b]
    if to >= 0 and (mask[label, to >> 6] >> np.uint64(to & 63)) & np.uint64(1):
        return float(other[i, b])
    return float(table[i, b])


@kernel
def _charge(cuts: Any, penalty: Any) -> float:
    """Return what a set of cuts charges."""
    total, q = 0.0, 0
    while cuts != np.uint64(0):
        if cuts & np.uint64(1):
            total += penalty[q]
        cuts >>= np.uint64(1)
        q += 1
    return total


@kernel(nogil=True)
def best_routes(
    prize: Any, rate: float, cost: Any, time_s: Any, energy_j: Any, time_limit: float, energy_limit: float,
    memory: Any, metric: bool, threshold: float, mode: int, n_time: int, n_energy: int, in_cuts: Any, penalty: Any,
    beam: int, bound: Any, stop: Any, node: Any, parent: Any, profit: Any, mask: Any, final: Any, used_t: Any,
    used_e: Any, after: Any, dead: Any, parity: Any,
) -> int:  # fmt: skip
    """Extend labels until none is left; fill ``node, parent, profit, mask, final`` and return their number.

    Parameters
    ----------
    prize
        ``(N,)`` prize of each target, ``-inf`` for those to leave out.
    rate
        Weight of the second objective in the profit.
    cost, time_s, energy_j
        ``(N + 2, N + 2)`` drives of the robot, start N, end N + 1.
    time_limit, energy_limit
        Budgets.
    memory
        ``(N, W)`` bit sets of what is remembered at each target.
    metric
        Whether no detour over another target is ever shorter: then a target out of reach stays out of reach.
    threshold
        Only routes of more profit than this matter.
    mode
        ``HEURISTIC``, ``EXACT`` or ``ENUMERATE``.
    n_time, n_energy
        Buckets of the completion bounds in time and in energy, 0 to do without.
    in_cuts, penalty
        ``(N,)`` bits of the subset-row cuts that a target is in, and ``(64,)`` what each cut charges for every
        second stop in it.
    stop
        ``(1,)`` set to nonzero by another thread to end early; the number returned is then negative.
    node, parent, profit, mask, final
        Out: per label its target (N: the start), its predecessor, its profit, its excluded targets, and its
        profit when it goes to the end from here (``-inf`` where it cannot). Their length is the number of
        labels at most; the number returned is negative where it does not suffice.
    used_t, used_e, after, dead, parity
        Room for as many labels: time, energy, the next label at the node, whether another beats it, and the
        cuts in which an odd number of targets is visited.
    beam
        Labels kept per number of stops in ``HEURISTIC`` mode: those that promise most.
    bound
        Out: ``(1,)`` a bound on the profit of any route, from the completion table of time.
    """
    n, most = len(prize), len(node)
    words = mask.shape[1]
    gain = np.full((n + 2, n + 2), -np.inf)
    for i in range(n + 2):
        for j in range(n):
            gain[i, j] = prize[j] - rate * cost[i, j]
        gain[i, n + 1] = -rate * cost[i, n + 1]
    t_best = t_other = e_best = e_other = np.empty((0, 0))
    t_first = e_first = np.empty((0, 0), np.int64)
    if n_time > 0:
        t_best, t_first, t_other = completion(prize, gain, time_s, time_limit, n_time)
    if n_energy > 0:
        e_best, e_first, e_other = completion(prize, gain, energy_j, energy_limit, n_energy)
    bound[0] = np.inf
    if n_time > 0:
        bound[0] = t_best[n, 0]
    if n_energy > 0:
        bound[0] = min(bound[0], e_best[n, 0])
    promise = np.empty(most if mode == HEURISTIC else 0)
    t_width, e_width = time_limit / max(1, n_time), energy_limit / max(1, n_energy)
    head = np.full(n + 1, -1, np.int64)
    one = np.uint64(1)
    node[0], parent[0], profit[0] = n, -1, 0.0
    used_t[0] = used_e[0] = 0.0
    dead[0] = False
    parity[0] = np.uint64(0)
    for w in range(words):
        mask[0, w] = np.uint64(0)
    for j in range(n):
        if prize[j] == -np.inf:
            mask[0, j >> 6] |= one << np.uint64(j & 63)
    fits = time_s[n, n + 1] <= time_limit and energy_j[n, n + 1] <= energy_limit
    final[0] = gain[n, n + 1] if fits else -np.inf
    count = 1
    begin = 0
    while begin < count:
        end = count
        for label in range(begin, end):
            if stop[0] != 0:
                return -count
            if dead[label]:
                continue
            i = node[label]
            for j in range(n):
                if (mask[label, j >> 6] >> np.uint64(j & 63)) & one:
                    continue
                t, e = used_t[label] + time_s[i, j], used_e[label] + energy_j[i, j]
                if t > time_limit or e > energy_limit:
                    continue
                if metric and (t + time_s[j, n + 1] > time_limit or e + energy_j[j, n + 1] > energy_limit):
                    continue
                charged = parity[label] & in_cuts[j]
                p = profit[label] + gain[i, j] - _charge(charged, penalty)
                odd = parity[label] ^ in_cuts[j]
                for w in range(words):
                    mask[count, w] = (mask[label, w] & memory[j, w]) | mask[0, w]
                mask[count, j >> 6] |= one << np.uint64(j & 63)
                if n_time > 0 and p + still_ahead(t_best, t_first, t_other, j, t, t_width, mask, count) <= threshold:
                    continue
                if n_energy > 0 and p + still_ahead(e_best, e_first, e_other, j, e, e_width, mask, count) <= threshold:
                    continue
                if mode != ENUMERATE:
                    rest = p
                    for k in range(n):
                        if (mask[count, k >> 6] >> np.uint64(k & 63)) & one:
                            continue
                        far = t + time_s[j, k] + time_s[k, n + 1] > time_limit
                        if metric and (far or e + energy_j[j, k] + energy_j[k, n + 1] > energy_limit):
                            mask[count, k >> 6] |= one << np.uint64(k & 63)
                        elif prize[k] > 0:
                            rest += prize[k]
                    if rest <= threshold:
                        continue
                beaten = False
                previous = -1
                other = head[j]
                while other >= 0:
                    if dead[other]:
                        if previous >= 0:
                            after[previous] = after[other]
                        else:
                            head[j] = after[other]
                        other = after[other]
                        continue
                    if used_t[other] <= t and used_e[other] <= e and profit[other] >= p - 1e-12:
                        beaten = True
                        for w in range(words):
                            if mode == EXACT and (mask[other, w] & ~mask[count, w]) != np.uint64(0):
                                beaten = False
                            if mode == ENUMERATE and mask[other, w] != mask[count, w]:
                                beaten = False
                        if beaten and mode == EXACT and parity[other] & ~odd:
                            beaten = profit[other] - _charge(parity[other] & ~odd, penalty) >= p - 1e-12
                        if beaten:
                            break
                    if used_t[other] >= t and used_e[other] >= e and profit[other] <= p:
                        worse = True
                        for w in range(words):
                            if mode == EXACT and (mask[count, w] & ~mask[other, w]) != np.uint64(0):
                                worse = False
                            if mode == ENUMERATE and mask[other, w] != mask[count, w]:
                                worse = False
                        if worse and mode == EXACT and odd & ~parity[other]:
                            worse = p - _charge(odd & ~parity[other], penalty) >= profit[other]
                        if worse:
                            dead[other] = True
                            final[other] = -np.inf
                    previous = other
                    other = after[other]
                if beaten:
                    continue
                node[count], parent[count], profit[count] = j, label, p
                used_t[count], used_e[count] = t, e
                fits = t + time_s[j, n + 1] <= time_limit and e + energy_j[j, n + 1] <= energy_limit
                final[count] = p + gain[j, n + 1] if fits else -np.inf
                if mode == HEURISTIC:
                    promise[count] = p
                    if n_time > 0:
                        promise[count] += still_ahead(t_best, t_first, t_other, j, t, t_width, mask, count)
                    elif n_energy > 0:
                        promise[count] += still_ahead(e_best, e_first, e_other, j, e, e_width, mask, count)
                dead[count] = False
                parity[count] = odd
                after[count] = head[j]
                head[j] = count
                count += 1
                if count >= most:
                    return -count
        begin = end
        if mode == HEURISTIC and count - begin > beam:
            least = np.sort(promise[begin:count])[-beam]
            for label in range(begin, count):
                if promise[label] < least:
                    dead[label] = True
    return count
