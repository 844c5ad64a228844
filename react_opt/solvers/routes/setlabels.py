"""Kernel of the enumeration: one label per cell, instant and exact set of cells, in either direction of time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray
from react_opt.solvers.routes.labels import at_most, completed, lowest_bit
from react_opt.solvers.routes.labelstore import NEVER, ORIGIN, WAIT, Fuel, Graph, Labels, MaskArray, Prices

_ZERO = np.uint64(0)
_ONE = np.uint64(1)
_SPREAD = np.uint64(0x9E3779B97F4A7C15)
_HALF = np.uint64(32)


@kernel(nogil=True)
def grow_sets(
    graph: Graph,
    prices: Prices,
    fuel: Fuel,
    origin: FloatArray,
    collects_first: bool,
    idle_end: FloatArray,
    completion: FloatArray,
    other: Labels,
    until: int,
    cutoff: float,
    max_labels: int,
    stop: NDArray[np.uint8],
) -> tuple[Labels, MaskArray, FloatArray, bool]:
    """Return one label per cell, instant up to ``until`` and exact set of cells that may end at ``cutoff`` or more.

    A label that has just collected a cell (or the first of all) may be the last of its route that collects anything;
    ``idle_end`` is ``(H + 1, n)`` what it is worth to end from there on, ``NEVER`` backwards in time. All others have
    to collect something more, so ``completion`` and ``other`` speak of rests of routes that collect something.

    The value of a label leaves out the prices of cuts that it has paid; they are kept apart because labels with
    the same set compare by what they are worth in the plan. The second result is ``(n_labels, n_words)`` the
    exact sets, the third the prices paid, the last whether the enumeration is complete. Parameters as for
    ``grow_labels``.
    """
    n = len(graph.in_start) - 1
    last = len(prices.gain) - 1
    words = (n + 63) // 64
    limited = fuel.budget < np.inf
    joined = len(other.start) > 1
    size = 16384
    value = np.empty(size)
    paid_all = np.empty(size)
    memory = np.empty(size, np.uint64)
    cuts = np.empty(size, np.uint64)
    burnt = np.empty(size)
    parent = np.empty(size, np.int64)
    arc = np.empty(size, np.int64)
    sensed = np.empty(size, np.bool_)
    sets = np.empty((size, words), np.uint64)
    start = np.zeros((until + 1) * n + 1, np.int64)
    room = 1024
    c_value = np.empty(room)
    c_paid = np.empty(room)
    c_memory = np.empty(room, np.uint64)
    c_cuts = np.empty(room, np.uint64)
    c_burnt = np.empty(room)
    c_parent = np.empty(room, np.int64)
    c_arc = np.empty(room, np.int64)
    c_sensed = np.empty(room, np.bool_)
    table = np.full(1024, -1, np.int64)
    slot_of = np.empty(1024, np.int64)
    count = 0
    complete = True
    for tau in range(until + 1):
        for j in range(n):
            node = tau * n + j
            start[node] = count
            if stop[0] != 0:
                complete = False
            if not complete:
                continue
            mirrored = (last - tau) * n + j
            gain = prices.gain[tau, j]
            bit = graph.bit[j]
            word, inside = j // 64, _ONE << np.uint64(j % 64)
            cut_of, cut_keep = prices.cut_of[j], prices.cut_keep[j]
            rest = completion[0, tau, j]
            least = fuel.least[tau, j] if limited else 0.0
            found = 0
            for a in range(graph.in_start[j] - 2, graph.in_start[j + 1]):
                if a == graph.in_start[j] - 2:
                    if origin[tau, j] <= NEVER or (collects_first and gain <= NEVER):
                        continue
                    first, beyond = 0, 1
                    keep, cost, burn, taken = _ZERO, 0.0, 0.0, ORIGIN
                else:
                    if a < graph.in_start[j]:
                        if tau == 0:
                            continue
                        before = (tau - 1) * n + j
                        keep, cost, burn, taken = ~_ZERO, prices.wait_cost, fuel.wait, WAIT
                    else:
                        if tau < graph.in_steps[a]:
                            continue
                        before = (tau - graph.in_steps[a]) * n + graph.in_from[a]
                        taken = graph.in_arc[a]
                        keep, cost, burn = graph.in_keep[a], prices.arc_cost[taken], fuel.arc[taken]
                    first, beyond = start[before], start[before + 1]
                for k in range(first, beyond):
                    if taken == ORIGIN:
                        v, m, s, p = origin[tau, j], _ZERO, _ZERO, 0.0
                        f = fuel.spent[tau, j] if collects_first else 0.0
                        had = False
                    else:
                        v, m, s = value[k] - cost, memory[k] & keep, cuts[k] & cut_keep
                        f, p = burnt[k] + burn, paid_all[k]
                        had = sets[k, word] & inside != _ZERO
                    for collects in range(1 if collects_first and taken == ORIGIN else 0, 2):
                        if collects == 1:
                            if gain <= NEVER or had:
                                break
                            paid = s & cut_of
                            while paid != _ZERO:
                                p += prices.cut_price[lowest_bit(paid)]
                                paid &= paid - _ONE
                            v += gain
                            m |= bit
                            s ^= cut_of
                            f += fuel.sense
                        # before collecting a label is completed with collecting here, afterwards without
                        more = v - p + rest - (max(gain, 0.0) if collects else 0.0)
                        done = v - p + idle_end[tau, j] if collects or taken == ORIGIN else NEVER
                        if max(more, done) < cutoff or (limited and f + least > fuel.budget):
                            break
                        if collects == 0 and taken != ORIGIN:
                            if limited and at_most(v - p, f, fuel, completion, tau, j) < cutoff:
                                break
                            if joined and not completed(
                                v - p, m, s, f, mirrored, other, prices.cut_price, fuel.budget, cutoff
                            ):
                                break
                        if found == room:
                            room *= 2
                            c_value = np.concatenate((c_value, np.empty(found)))
                            c_paid = np.concatenate((c_paid, np.empty(found)))
                            c_burnt = np.concatenate((c_burnt, np.empty(found)))
                            c_memory = np.concatenate((c_memory, np.empty(found, np.uint64)))
                            c_cuts = np.concatenate((c_cuts, np.empty(found, np.uint64)))
                            c_parent = np.concatenate((c_parent, np.empty(found, np.int64)))
                            c_arc = np.concatenate((c_arc, np.empty(found, np.int64)))
                            c_sensed = np.concatenate((c_sensed, np.empty(found, np.bool_)))
                        c_value[found] = v
                        c_paid[found] = p
                        c_memory[found] = m
                        c_cuts[found] = s
                        c_burnt[found] = f
                        c_parent[found] = k
                        c_arc[found] = taken
                        c_sensed[found] = collects == 1
                        found += 1
            if found == 0:
                continue
            while count + found > size:
                size *= 2
            if size > len(value):
                more = size - len(value)
                value = np.concatenate((value, np.empty(more)))
                paid_all = np.concatenate((paid_all, np.empty(more)))
                burnt = np.concatenate((burnt, np.empty(more)))
                memory = np.concatenate((memory, np.empty(more, np.uint64)))
                cuts = np.concatenate((cuts, np.empty(more, np.uint64)))
                parent = np.concatenate((parent, np.empty(more, np.int64)))
                arc = np.concatenate((arc, np.empty(more, np.int64)))
                sensed = np.concatenate((sensed, np.empty(more, np.bool_)))
                sets = np.concatenate((sets, np.empty((more, words), np.uint64)))
            while 2 * found > len(table):
                table = np.full(2 * len(table), -1, np.int64)
                slot_of = np.empty(len(table), np.int64)
            slots = len(table) - 1
            begin = count
            order = np.argsort(-c_value[:found])
            for c in order:
                # write the label's set behind the last one kept, and look it up
                hashed = _ZERO
                for w in range(words):
                    held = _ZERO if c_arc[c] == ORIGIN else sets[c_parent[c], w]
                    if c_sensed[c] and w == word:
                        held |= inside
                    sets[count, w] = held
                    hashed = (hashed ^ held) * _SPREAD
                    hashed ^= hashed >> _HALF
                slot = np.int64(hashed & np.uint64(slots))
                dominated = False
                while table[slot] >= 0:
                    k = table[slot]
                    same = True
                    for w in range(words):
                        if sets[k, w] != sets[count, w]:
                            same = False
                            break
                    if same and (not limited or burnt[k] <= c_burnt[c]):
                        dominated = True
                        break
                    slot = (slot + 1) & slots
                if dominated:
                    continue
                table[slot] = count
                slot_of[count - begin] = slot
                value[count] = c_value[c]
                paid_all[count] = c_paid[c]
                memory[count] = c_memory[c]
                cuts[count] = c_cuts[c]
                burnt[count] = c_burnt[c]
                parent[count] = c_parent[c]
                arc[count] = c_arc[c]
                sensed[count] = c_sensed[c]
                count += 1
            for k in range(begin, count):
                table[slot_of[k - begin]] = -1
            if count > max_labels:
                complete = False
    start[(until + 1) * n] = count
    labels = Labels(
        start,
        value[:count],
        memory[:count],
        cuts[:count],
        burnt[:count],
        parent[:count],
        arc[:count],
        sensed[:count],
    )
    return labels, sets[:count], paid_all[:count], complete
