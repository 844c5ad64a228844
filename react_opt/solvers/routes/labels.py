"""Kernels of the pricing: labels over the time-expanded graph, forwards and backwards in time.

A label stands at one cell at one instant of *kernel time* tau and says what the best known way there is worth
(its value, prices included), which cells it remembers having collected (a mask of colours, see ``memory.py``),
the state of the subset-row cuts (one bit each: an odd number of the cut's cells has been collected) and the
energy used so far. Both directions run through the same kernel: backwards, kernel time is ``T - t`` and the
arcs are reversed. Masks live in one machine word because colours, not cells, are the bits.

A label dominates another of the same cell and instant if its value is at least as large after every cell that
it alone remembers has been bought back at the most it could still earn, and likewise for cut states: whatever
the second does next, the first does too, leaving out what it has collected before (the compensated dominance
of resource-constrained shortest paths with set resources).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.labelstore import NEVER, ORIGIN, WAIT, Fuel, Graph, Labels, Prices
from react_opt.solvers.routes.ranking import sort_falling

_DEBRUIJN = np.zeros(64, dtype=np.int64)
for _position in range(64):
    _DEBRUIJN[((0x03F79D71B4CB0A89 << _position) & 0xFFFFFFFFFFFFFFFF) >> 58] = _position

_ZERO = np.uint64(0)
_ONE = np.uint64(1)
_FACTOR = np.uint64(0x03F79D71B4CB0A89)
_SHIFT = np.uint64(58)


@kernel(inline="always")
def lowest_bit(word: np.uint64) -> int:
    """Return the position of the lowest bit of a word that is not zero."""
    low = word & (~word + _ONE)
    return int(_DEBRUIJN[(low * _FACTOR) >> _SHIFT])


@kernel(nogil=True)
def flat_values(graph: Graph, prices: Prices, origin: FloatArray, collect: bool, collects_first: bool) -> FloatArray:
    """Return the value of the best way to each cell and instant when nothing is remembered.

    ``(H + 1, n)``, collecting at tau included; ``NEVER`` where the cell cannot be reached. It bounds every
    label from above.

    Parameters
    ----------
    graph, prices
        Arcs and prices in kernel time; cuts are ignored.
    origin
        ``(H + 1, n)`` value of starting in each cell at each instant, ``NEVER`` where no route starts.
    collect
        False leaves out the gains.
    collects_first
        Every route collects the cell in which it starts at once.
    """
    n = len(graph.in_start) - 1
    last = len(prices.gain) - 1
    priced = len(prices.stand) > 1
    best = np.full((last + 1, n), NEVER)
    for tau in range(last + 1):
        for j in range(n):
            value = NEVER if collects_first else origin[tau, j]
            if tau > 0 and best[tau - 1, j] > NEVER:
                value = max(value, best[tau - 1, j] - prices.wait_cost)
            for a in range(graph.in_start[j], graph.in_start[j + 1]):
                before = tau - graph.in_steps[a]
                if before >= 0 and best[before, graph.in_from[a]] > NEVER:
                    value = max(value, best[before, graph.in_from[a]] - prices.arc_cost[graph.in_arc[a]])
            gain = prices.gain[tau, j]
            if value > NEVER and collect and gain > 0.0:
                value += gain
            if collects_first and origin[tau, j] > NEVER and gain > NEVER:
                value = max(value, origin[tau, j] + gain)
            if value > NEVER and priced:
                if prices.stand[tau, j] == np.inf:
                    continue
                value -= prices.stand[tau, j]
            best[tau, j] = value
    return best


@kernel(inline="always")
def completed(
    value: float,
    memory: np.uint64,
    cuts: np.uint64,
    fuel: float,
    node: int,
    other: Labels,
    cut_price: FloatArray,
    budget: float,
    cutoff: float,
) -> bool:
    """Return whether some label of the other direction completes this one to at least ``cutoff``."""
    for k in range(other.start[node], other.start[node + 1]):
        total = value + other.value[k]
        if total < cutoff:
            return False
        if memory & other.memory[k] != _ZERO or fuel + other.fuel[k] > budget:
            continue
        both = cuts & other.cuts[k]
        while both != _ZERO:
            total -= cut_price[lowest_bit(both)]
            both &= both - _ONE
        if total >= cutoff:
            return True
    return False


@kernel(inline="always")
def at_most(value: float, burnt: float, fuel: Fuel, completion: FloatArray, tau: int, cell: int) -> float:
    """Return what a label can end at, by Lagrangian relaxation of the battery."""
    best = np.inf
    for k in range(len(fuel.rate)):
        best = min(best, value + completion[k, tau, cell] + fuel.rate[k] * (fuel.budget - burnt))
    return best


@kernel(nogil=True)
def grow_labels(
    graph: Graph,
    prices: Prices,
    fuel: Fuel,
    origin: FloatArray,
    collects_first: bool,
    completion: FloatArray,
    other: Labels,
    cutoff: float,
    width: int,
    max_labels: int,
    buys_back: bool,
    stop: NDArray[np.uint8],
) -> tuple[Labels, bool]:
    """Return all undominated labels that may still end at ``cutoff`` or more, and whether none was lost.

    Parameters
    ----------
    graph, prices, fuel
        Arcs, prices and battery in kernel time.
    origin
        ``(H + 1, n)`` value of starting in each cell at each instant, ``NEVER`` where no route starts.
    collects_first
        Every route collects the cell in which it starts at once.
    completion
        ``(n_rates, H + 1, n)`` bound on what the rest of the route earns from here, collecting here included,
        when each joule of it costs ``fuel.rate``.
    other
        Labels of the other direction, in its own kernel time (``H - tau``), for a sharper bound; of length 0
        if there are none. They have to stem from the same or weaker memory and at least the same gains.
    cutoff
        Labels that cannot end at this value or more are dropped.
    width
        Most labels kept per cell and instant; the pass is exact if this never bites.
    max_labels
        The pass is given up (second return value False) when it holds more labels than this.
    buys_back
        False compares memories by inclusion alone: needed where the labels bound each single label of the other
        direction rather than the best route.
    stop
        ``(1,)`` flag that another thread sets at the deadline: the pass is then given up as with ``max_labels``.
    """
    n = len(graph.in_start) - 1
    last = len(prices.gain) - 1
    priced = len(prices.stand) > 1
    limited = fuel.budget < np.inf
    joined = len(other.start) > 1
    complete = True
    size = 4096
    value = np.empty(size)
    memory = np.empty(size, np.uint64)
    cuts = np.empty(size, np.uint64)
    burnt = np.empty(size)
    parent = np.empty(size, np.int64)
    arc = np.empty(size, np.int64)
    sensed = np.empty(size, np.bool_)
    start = np.zeros((last + 1) * n + 1, np.int64)
    room = 256
    c_value = np.empty(room)
    c_memory = np.empty(room, np.uint64)
    c_cuts = np.empty(room, np.uint64)
    c_burnt = np.empty(room)
    c_parent = np.empty(room, np.int64)
    c_arc = np.empty(room, np.int64)
    c_sensed = np.empty(room, np.bool_)
    buy_back = np.empty(64)
    order = np.empty(room, np.int64)
    count = 0
    for tau in range(last + 1):
        for j in range(n):
            node = tau * n + j
            start[node] = count
            if stop[0] != 0:
                complete = False
                continue
            if completion[0, tau, j] <= NEVER:
                continue
            mirrored = (last - tau) * n + j
            stand = prices.stand[tau, j] if priced else 0.0
            gain = prices.gain[tau, j]
            bit = graph.bit[j]
            cut_of = prices.cut_of[j]
            cut_keep = prices.cut_keep[j]
            least = fuel.least[tau, j] if limited else 0.0
            found = 0
            # the arc index in_start[j] - 1 stands for waiting, the one before for starting
            for a in range(graph.in_start[j] - 2, graph.in_start[j + 1]):
                if a == graph.in_start[j] - 2:
                    if origin[tau, j] <= NEVER or (collects_first and gain <= NEVER):
                        continue
                    first, beyond = 0, 1
                    before, keep, cost, burn, taken = 0, _ZERO, 0.0, 0.0, ORIGIN
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
                    forced = collects_first and taken == ORIGIN
                    if taken == ORIGIN:
                        v, m, s, f = origin[tau, j] - stand, _ZERO, _ZERO, fuel.spent[tau, j] if forced else 0.0
                    else:
                        v, m, s = value[k] - cost - stand, memory[k] & keep, cuts[k] & cut_keep
                        f = burnt[k] + burn
                    if v + completion[0, tau, j] < cutoff:
                        if taken == ORIGIN:
                            continue
                        break  # labels are sorted by value
                    if limited and (f + least > fuel.budget or at_most(v, f, fuel, completion, tau, j) < cutoff):
                        continue
                    if joined and not completed(
                        v + stand, m, s, f, mirrored, other, prices.cut_price, fuel.budget, cutoff
                    ):
                        continue
                    if found + 2 > room:
                        room *= 2
                        c_value = np.concatenate((c_value, np.empty(room - len(c_value))))
                        c_burnt = np.concatenate((c_burnt, np.empty(room - len(c_burnt))))
                        c_memory = np.concatenate((c_memory, np.empty(room - len(c_memory), np.uint64)))
                        c_cuts = np.concatenate((c_cuts, np.empty(room - len(c_cuts), np.uint64)))
                        c_parent = np.concatenate((c_parent, np.empty(room - len(c_parent), np.int64)))
                        c_arc = np.concatenate((c_arc, np.empty(room - len(c_arc), np.int64)))
                        c_sensed = np.concatenate((c_sensed, np.empty(room - len(c_sensed), np.bool_)))
                    idle = not forced
                    if (gain > 0.0 or forced) and m & bit == _ZERO:
                        paid = s & cut_of
                        v_sensed = v + gain
                        while paid != _ZERO:
                            v_sensed -= prices.cut_price[lowest_bit(paid)]
                            paid &= paid - _ONE
                        f_sensed = f + fuel.sense
                        if not limited or f_sensed + least <= fuel.budget:
                            c_value[found] = v_sensed
                            c_memory[found] = m | bit
                            c_cuts[found] = s ^ cut_of
                            c_burnt[found] = f_sensed
                            c_parent[found] = k
                            c_arc[found] = taken
                            c_sensed[found] = True
                            found += 1
                            # collecting now is never worse than later: the idle twin is dominated
                            better = buys_back and not limited and cut_of == _ZERO
                            idle = idle and not (better and gain >= prices.best_gain[tau + 1, j])
                    if idle:
                        c_value[found] = v
                        c_memory[found] = m
                        c_cuts[found] = s
                        c_burnt[found] = f
                        c_parent[found] = k
                        c_arc[found] = taken
                        c_sensed[found] = False
                        found += 1
            if found == 0:
                continue
            if found > len(order):
                order = np.empty(2 * found, np.int64)
            sort_falling(c_value, found, order)
            known = _ZERO
            while count + found > size:
                size *= 2
            if size > len(value):
                value = np.concatenate((value, np.empty(size - len(value))))
                burnt = np.concatenate((burnt, np.empty(size - len(burnt))))
                memory = np.concatenate((memory, np.empty(size - len(memory), np.uint64)))
                cuts = np.concatenate((cuts, np.empty(size - len(cuts), np.uint64)))
                parent = np.concatenate((parent, np.empty(size - len(parent), np.int64)))
                arc = np.concatenate((arc, np.empty(size - len(arc), np.int64)))
                sensed = np.concatenate((sensed, np.empty(size - len(sensed), np.bool_)))
            begin = count
            for rank in range(found):
                c = order[rank]
                v, m, s, f = c_value[c], c_memory[c], c_cuts[c], c_burnt[c]
                dominated = False
                for k in range(begin, count):
                    if limited and burnt[k] > f:
                        continue
                    slack = value[k] - v
                    extra = memory[k] & ~m
                    if extra != _ZERO and not buys_back:
                        continue
                    while extra != _ZERO:
                        colour = lowest_bit(extra)
                        colour_bit = extra & (~extra + _ONE)
                        if known & colour_bit == _ZERO:
                            known |= colour_bit
                            later = min(tau + max(1, graph.steps_to[j, colour]), last + 1)
                            buy_back[colour] = prices.best_gain[later, graph.cell_of[j, colour]]
                        slack -= buy_back[colour]
                        extra &= extra - _ONE
                        if slack < 0.0:
                            break
                    if slack < 0.0:
                        continue
                    odd = cuts[k] & ~s
                    while odd != _ZERO:
                        slack -= prices.cut_price[lowest_bit(odd)]
                        odd &= odd - _ONE
                    if slack >= 0.0:
                        dominated = True
                        break
                if dominated:
                    continue
                if count - begin >= width:
                    complete = False
                    break
                value[count] = v
                memory[count] = m
                cuts[count] = s
                burnt[count] = f
                parent[count] = c_parent[c]
                arc[count] = c_arc[c]
                sensed[count] = c_sensed[c]
                count += 1
            if count > max_labels:
                for rest in range(node + 1, (last + 1) * n + 1):
                    start[rest] = count
                return Labels(start, value, memory, cuts, burnt, parent, arc, sensed), False
    start[(last + 1) * n] = count
    return (
        Labels(
            start,
            value[:count],
            memory[:count],
            cuts[:count],
            burnt[:count],
            parent[:count],
            arc[:count],
            sensed[:count],
        ),
        complete,
    )


@kernel(nogil=True)
def trace(
    labels: Labels, arc_from: IntArray, arc_steps: IntArray, label: int, cell: int, tau: int
) -> tuple[IntArray, IntArray, NDArray[np.bool_]]:
    """Return cell, arc started and sensing at each instant of kernel time up to ``tau`` for one label.

    Entries before the label's origin, and cells while on an arc of several steps, are -1. ``arc_from`` and
    ``arc_steps`` are those of the direction in which the labels were grown.
    """
    cells = np.full(tau + 1, -1, np.int64)
    arcs = np.full(tau + 1, -1, np.int64)
    senses = np.zeros(tau + 1, np.bool_)
    while True:
        cells[tau] = cell
        senses[tau] = labels.sensed[label]
        taken = labels.arc[label]
        if taken == ORIGIN:
            return cells, arcs, senses
        label = labels.parent[label]
        if taken == WAIT:
            tau -= 1
        else:
            tau -= arc_steps[taken]
            cell = arc_from[taken]
            arcs[tau] = taken
