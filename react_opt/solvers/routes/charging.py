"""Kernels of the pricing where a class of robots can reach a charger: the battery of a label may rise.

A label holds the energy used so far less what was charged, ``used``, between ``floor`` (the battery is full) and
what the rest of the route leaves of the budget. Waiting at a charger gives as much as power and capacity allow: more
battery is never worse. Where a slot has a price (it is scarce), not charging is tried too.

*Dominance.* Let label k of the same cell and instant do what label c does, but for sensing what k remembers and c
does not. That is possible if k has at least as much battery, or so much that it cannot run short. What k is ahead of
c in battery, at the beginning and by sensing less, is worth sigma for each joule, but chargers may make up for it: at
most the lead, and at most what can be charged from here on. So k beats c if

    v_k - v_c >= sum of what the cells that only k remembers can still earn
                 + prices of the cuts whose state is odd in k only
                 + sigma min(lead + what it saves in sensing, what can be charged yet).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.labels import lowest_bit
from react_opt.solvers.routes.labelstore import NEVER, ORIGIN, WAIT, Graph, Labels, Prices
from react_opt.solvers.routes.ranking import sort_falling

_ZERO = np.uint64(0)
_ONE = np.uint64(1)


class Charge(NamedTuple):
    """The battery of one class of robots and what chargers give, J; times are instants of the problem.

    Parameters
    ----------
    budget, floor
        Most energy that may be used at any instant, and least (minus what there is room for at the start).
    arc, wait, sense
        Energy of each arc, of a waiting step, of sensing.
    sigma
        Weight of a joule left at the horizon.
    amount
        ``(n_cells,)`` most that is charged in a waiting step.
    limit
        ``(T + 1, n)`` most that may have been used (after sensing and charging) for the horizon to be reached.
    rich
        ``(T + 1, n)`` whoever has used no more cannot run short, whatever it does.
    yet
        ``(T + 1, n)`` most that can be charged from here on.
    """

    budget: float
    floor: float
    arc: FloatArray
    wait: float
    sense: float
    sigma: float
    amount: FloatArray
    limit: FloatArray
    rich: FloatArray
    yet: FloatArray


@kernel(nogil=True)
def most_ahead(
    out_start: IntArray,
    arc_to: IntArray,
    arc_steps: IntArray,
    finish: FloatArray,
    begin: int,
    horizon: int,
    arc_worth: FloatArray,
    wait_worth: FloatArray,
) -> FloatArray:
    """Return ``(T + 1, n)``: the largest sum over the moves from each instant and cell to the horizon.

    Parameters
    ----------
    out_start, arc_to, arc_steps
        Arcs of the problem.
    finish
        ``(n_cells,)`` 0 where a route may end, ``NEVER`` elsewhere.
    begin, horizon
        First and last instant.
    arc_worth, wait_worth
        ``(n_arcs,)`` and ``(n_cells,)`` what each move counts.
    """
    n = len(out_start) - 1
    most = np.full((horizon + 1, n), NEVER)
    most[horizon] = finish
    for t in range(horizon - 1, begin - 1, -1):
        for i in range(n):
            if most[t + 1, i] > NEVER:
                most[t, i] = most[t + 1, i] + wait_worth[i]
            for a in range(out_start[i], out_start[i + 1]):
                arrival = t + arc_steps[a]
                if arrival <= horizon and most[arrival, arc_to[a]] > NEVER:
                    most[t, i] = max(most[t, i], most[arrival, arc_to[a]] + arc_worth[a])
    return most


@kernel(nogil=True)
def flat_rest(
    out_start: IntArray,
    arc_to: IntArray,
    arc_steps: IntArray,
    finish: FloatArray,
    begin: int,
    gain: FloatArray,
    stand: FloatArray,
    slot: FloatArray,
    charge: Charge,
    rate: float,
) -> FloatArray:
    """Return ``(T + 1, n)``: most that the rest of a route earns, collecting here included, nothing remembered.

    Each joule costs ``sigma + rate``, and each joule charged earns as much, whether there is room for it or not.

    Parameters
    ----------
    out_start, arc_to, arc_steps, finish, begin
        See `most_ahead`.
    gain, stand, slot
        ``(T + 1, n)`` gains after prices, prices of standing and of charging; the latter two ``(1, 1)`` if none.
    charge
        The battery.
    rate
        Price of a joule on top of sigma.
    """
    n, horizon = gain.shape[1], gain.shape[0] - 1
    joule = charge.sigma + rate
    rest = np.full((horizon + 1, n), NEVER)
    entered = np.full((horizon + 1, n), NEVER)  # less the price of standing there
    for t in range(horizon, begin - 1, -1):
        for i in range(n):
            best = NEVER
            if t == horizon:
                best = finish[i]
            elif entered[t + 1, i] > NEVER:
                credit = joule * charge.amount[i]
                if len(slot) > 1:
                    credit = max(0.0, credit - slot[t + 1, i])
                best = entered[t + 1, i] - joule * charge.wait + credit
            for a in range(out_start[i], out_start[i + 1]):
                arrival = t + arc_steps[a]
                if arrival <= horizon and entered[arrival, arc_to[a]] > NEVER:
                    best = max(best, entered[arrival, arc_to[a]] - joule * charge.arc[a])
            if best <= NEVER:
                continue
            if gain[t, i] > NEVER:
                best += max(0.0, gain[t, i] - rate * charge.sense)
            rest[t, i] = best
            entered[t, i] = best - stand[t, i] if len(stand) > 1 else best
    return rest


@kernel(nogil=True)
def grow_charging(
    graph: Graph,
    prices: Prices,
    slot: FloatArray,
    charge: Charge,
    origin: FloatArray,
    origin_time: int,
    completion: FloatArray,
    rate: FloatArray,
    cutoff: float,
    width: int,
    max_labels: int,
    stop: NDArray[np.uint8],
) -> tuple[Labels, bool]:
    """Return all undominated labels that may still end at ``cutoff`` or more, and whether none was lost.

    Parameters
    ----------
    graph, prices
        Arcs and prices forwards in time.
    slot
        ``(T + 1, n)`` price of charging, or ``(1, 1)`` if there is none.
    charge
        The battery.
    origin, origin_time
        Value of starting in each cell (``NEVER`` where no route starts), at this instant.
    completion, rate
        ``(n_rates, T + 1, n)`` bounds on the rest (`flat_rest`) at these prices of a joule, the first of them 0; at
        the negative ones the battery is taken to be full at the end.
    cutoff, width, max_labels, stop
        See `labels.grow_labels`.
    """
    n = len(graph.in_start) - 1
    last = len(prices.gain) - 1
    priced, scarce = len(prices.stand) > 1, len(slot) > 1
    complete = True
    size = 4096
    value = np.empty(size)
    memory = np.empty(size, np.uint64)
    cuts = np.empty(size, np.uint64)
    used = np.empty(size)
    parent = np.empty(size, np.int64)
    arc = np.empty(size, np.int64)
    sensed = np.empty(size, np.bool_)
    start = np.zeros((last + 1) * n + 1, np.int64)
    room = 256
    c_value = np.empty(room)
    c_memory = np.empty(room, np.uint64)
    c_cuts = np.empty(room, np.uint64)
    c_used = np.empty(room)
    c_parent = np.empty(room, np.int64)
    c_arc = np.empty(room, np.int64)
    c_sensed = np.empty(room, np.bool_)
    order = np.empty(room, np.int64)
    count = 0
    for tau in range(last + 1):
        for j in range(n):
            node = tau * n + j
            start[node] = count
            if stop[0] != 0:
                complete = False
                continue
            if tau < origin_time or completion[0, tau, j] <= NEVER:
                continue
            stand = prices.stand[tau, j] if priced else 0.0
            toll = slot[tau, j] if scarce else 0.0
            gain, bit, limit = prices.gain[tau, j], graph.bit[j], charge.limit[tau, j]
            cut_of, cut_keep = prices.cut_of[j], prices.cut_keep[j]
            worth_it = gain + charge.sigma * charge.sense > 0.0
            found = 0
            # the arc index in_start[j] - 1 stands for waiting
            for a in range(graph.in_start[j] - 1, graph.in_start[j + 1]):
                waits = a < graph.in_start[j]
                first, beyond, keep, cost, burn, taken, amount = 0, 1, _ZERO, 0.0, 0.0, ORIGIN, 0.0
                if tau == origin_time:
                    if not waits or origin[j] <= NEVER:
                        continue
                else:
                    if waits:
                        before = (tau - 1) * n + j
                        keep, cost, burn, taken = ~_ZERO, prices.wait_cost, charge.wait, WAIT
                        amount = charge.amount[j]
                    else:
                        if tau - graph.in_steps[a] < origin_time:
                            continue
                        before = (tau - graph.in_steps[a]) * n + graph.in_from[a]
                        taken = graph.in_arc[a]
                        keep, cost, burn = graph.in_keep[a], prices.arc_cost[taken], charge.arc[taken]
                    first, beyond = start[before], start[before + 1]
                hoped = max(0.0, charge.sigma * amount - toll)
                for k in range(first, beyond):
                    if taken == ORIGIN:
                        v, m, s, f = origin[j] - stand, _ZERO, _ZERO, 0.0
                    else:
                        v, m, s = value[k] - cost - stand, memory[k] & keep, cuts[k] & cut_keep
                        f = used[k] + burn
                    if v + hoped + completion[0, tau, j] < cutoff:
                        if taken == ORIGIN:
                            continue
                        break  # labels are sorted by value
                    if f - amount > limit:
                        continue
                    best = np.inf
                    for r in range(len(rate)):
                        room_j = (charge.budget if rate[r] >= 0.0 else charge.floor) - f
                        now = max(0.0, (charge.sigma + rate[r]) * amount - toll)
                        best = min(best, v + now + completion[r, tau, j] + rate[r] * room_j)
                    if best < cutoff:
                        continue
                    if found + 4 > room:
                        room *= 2
                        c_value = np.concatenate((c_value, np.empty(room - len(c_value))))
                        c_used = np.concatenate((c_used, np.empty(room - len(c_used))))
                        c_memory = np.concatenate((c_memory, np.empty(room - len(c_memory), np.uint64)))
                        c_cuts = np.concatenate((c_cuts, np.empty(room - len(c_cuts), np.uint64)))
                        c_parent = np.concatenate((c_parent, np.empty(room - len(c_parent), np.int64)))
                        c_arc = np.concatenate((c_arc, np.empty(room - len(c_arc), np.int64)))
                        c_sensed = np.concatenate((c_sensed, np.empty(room - len(c_sensed), np.bool_)))
                    for senses in range(1, -1, -1):
                        if senses and not (worth_it and m & bit == _ZERO):
                            continue
                        earned = 0.0
                        if senses:
                            earned, paid = gain, s & cut_of
                            while paid != _ZERO:
                                earned -= prices.cut_price[lowest_bit(paid)]
                                paid &= paid - _ONE
                        drained = f + senses * charge.sense
                        credit = max(0.0, min(amount, drained - charge.floor))
                        for charges in range(1, -1, -1):
                            if charges != 0 and credit == 0.0:
                                continue
                            if charges == 0 and credit > 0.0 and toll == 0.0:
                                continue
                            left = drained - charges * credit
                            if left > limit:
                                continue
                            c_value[found] = v + earned + charges * (charge.sigma * credit - toll)
                            c_memory[found] = m | bit if senses else m
                            c_cuts[found] = s ^ cut_of if senses else s
                            c_used[found] = left
                            c_parent[found] = k
                            c_arc[found] = taken
                            c_sensed[found] = senses == 1
                            found += 1
            if found == 0:
                continue
            if found > len(order):
                order = np.empty(2 * found, np.int64)
            sort_falling(c_value, found, order)
            while count + found > size:
                size *= 2
            if size > len(value):
                value = np.concatenate((value, np.empty(size - len(value))))
                used = np.concatenate((used, np.empty(size - len(used))))
                memory = np.concatenate((memory, np.empty(size - len(memory), np.uint64)))
                cuts = np.concatenate((cuts, np.empty(size - len(cuts), np.uint64)))
                parent = np.concatenate((parent, np.empty(size - len(parent), np.int64)))
                arc = np.concatenate((arc, np.empty(size - len(arc), np.int64)))
                sensed = np.concatenate((sensed, np.empty(size - len(sensed), np.bool_)))
            begin = count
            rich, yet = charge.rich[tau, j], charge.yet[tau, j]
            for rank in range(found):
                c = order[rank]
                v, m, s, f = c_value[c], c_memory[c], c_cuts[c], c_used[c]
                dominated = False
                for k in range(begin, count):
                    if used[k] > f and used[k] > rich:
                        continue
                    slack, lead = value[k] - v, max(0.0, f - used[k])
                    extra = memory[k] & ~m
                    while extra != _ZERO and slack >= 0.0:
                        colour = lowest_bit(extra)
                        later = min(tau + max(1, graph.steps_to[j, colour]), last + 1)
                        slack -= prices.best_gain[later, graph.cell_of[j, colour]]
                        lead += charge.sense
                        extra &= extra - _ONE
                    odd = cuts[k] & ~s
                    while odd != _ZERO and slack >= 0.0:
                        slack -= prices.cut_price[lowest_bit(odd)]
                        odd &= odd - _ONE
                    if slack >= charge.sigma * min(lead, yet):
                        dominated = True
                        break
                if dominated:
                    continue
                if count - begin >= width:
                    complete = False
                    break
                value[count], memory[count], cuts[count], used[count] = v, m, s, f
                parent[count], arc[count], sensed[count] = c_parent[c], c_arc[c], c_sensed[c]
                count += 1
            if count > max_labels:
                for rest in range(node + 1, (last + 1) * n + 1):
                    start[rest] = count
                return Labels(start, value, memory, cuts, used, parent, arc, sensed), False
    start[(last + 1) * n] = count
    return (
        Labels(
            start,
            value[:count],
            memory[:count],
            cuts[:count],
            used[:count],
            parent[:count],
            arc[:count],
            sensed[:count],
        ),
        complete,
    )


@kernel(nogil=True)
def charged(labels: Labels, charge: Charge, arc_steps: IntArray, label: int, tau: int) -> FloatArray:
    """Return ``(tau + 1,)`` what is credited at each instant along the way of a label at instant ``tau``, J."""
    credit = np.zeros(tau + 1)
    while labels.arc[label] != ORIGIN:
        before = labels.parent[label]
        if labels.arc[label] == WAIT:
            drained = labels.fuel[before] + charge.wait + (charge.sense if labels.sensed[label] else 0.0)
            credit[tau] = max(0.0, drained - labels.fuel[label])
            tau -= 1
        else:
            tau -= arc_steps[labels.arc[label]]
        label = before
    return credit
