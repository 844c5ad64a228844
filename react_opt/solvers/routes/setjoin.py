"""Kernels over exact sets of cells: beginnings and rests of routes put together, and what sets cost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.labels import lowest_bit
from react_opt.solvers.routes.labelstore import ORIGIN, WAIT, Labels, MaskArray
from react_opt.solvers.routes.ranking import inner

_ZERO = np.uint64(0)
_ONE = np.uint64(1)
_SPREAD = np.uint64(0x9E3779B97F4A7C15)
_HALF = np.uint64(32)


class Half(NamedTuple):
    """Labels of one direction, their exact sets, and the prices of cuts that they have paid."""

    labels: Labels
    sets: MaskArray
    paid: FloatArray


class Seam(NamedTuple):
    """What leads from a beginning to a rest.

    Parameters
    ----------
    out_start, arc_to, arc_steps
        See `RouteProblem`.
    arc_cost, wait_cost, arc_burn, wait_burn, budget
        Cost and energy of arcs and of waiting a step, and the energy that there is.
    cut_price
        Price of each cut.
    idle_end
        ``(H + 1, n)`` what it is worth to end from there on.
    """

    out_start: IntArray
    arc_to: IntArray
    arc_steps: IntArray
    arc_cost: FloatArray
    wait_cost: float
    arc_burn: FloatArray
    wait_burn: float
    budget: float
    cut_price: FloatArray
    idle_end: FloatArray


@inner
def _place(sets: MaskArray, count: int, table: IntArray) -> int:
    """Return the slot of a set: the one that holds it, or the free one where it belongs."""
    words, slots = sets.shape[1], np.uint64(len(table) - 1)
    hashed = _ZERO
    for w in range(words):
        hashed = (hashed ^ sets[count, w]) * _SPREAD
        hashed ^= hashed >> _HALF
    slot = np.int64(hashed & slots)
    while table[slot] >= 0:
        same = True
        for w in range(words):
            if sets[table[slot], w] != sets[count, w]:
                same = False
                break
        if same:
            break
        slot = np.int64((np.uint64(slot) + _ONE) & slots)
    return int(slot)


@kernel(nogil=True)
def join_sets(
    ahead: Half, behind: Half, order: IntArray, seam: Seam, cutoff: float, most: int, stop: NDArray[np.uint8]
) -> tuple[MaskArray, FloatArray, FloatArray, IntArray, bool]:
    """Return the best route for each exact set that is worth ``cutoff`` after prices.

    ``(m, words)`` sets, ``(m,)`` value and prices of cuts paid, ``(m, 3)`` label of the beginning, arc taken from
    there and label of the rest (-1 where the route ends with its beginning), and whether none is missing.

    Parameters
    ----------
    ahead
        Beginnings, up to some instant.
    behind
        Rests that begin after it, in their own kernel time.
    order
        Rests of each cell and instant by falling value after prices, as places in ``behind``; those that come before
        all others in ``behind`` may be left out.
    seam
        How they are put together.
    cutoff
        Least value after prices.
    most
        Sets beyond which it is given up.
    stop
        ``(1,)`` flag that gives it up at once.
    """
    n = len(seam.out_start) - 1
    last = len(seam.idle_end) - 1
    until = (len(ahead.labels.start) - 1) // n - 1
    words = ahead.sets.shape[1]
    limited = seam.budget < np.inf
    left_out = len(behind.sets) - len(order)
    size = 4096
    sets = np.empty((size, words), np.uint64)
    value, paid, parts = np.empty(size), np.empty(size), np.empty((size, 3), np.int64)
    table = np.full(4 * size, -1, np.int64)
    count = 0
    for t in range(until + 1):
        for i in range(n):
            if stop[0] != 0:
                return sets[:count], value[:count], paid[:count], parts[:count], False
            node = t * n + i
            for k in range(ahead.labels.start[node], ahead.labels.start[node + 1]):
                # place -2: the route ends here; -1: it waits; then the arcs
                for place in range(-2, seam.out_start[i + 1] - seam.out_start[i]):
                    v, p = ahead.labels.value[k], ahead.paid[k]
                    taken, burn, there, arrival = WAIT, seam.wait_burn, i, t + 1
                    if place == -2:
                        if not ahead.labels.sensed[k] and ahead.labels.arc[k] != ORIGIN:
                            continue
                        v += seam.idle_end[t, i]
                        first, beyond = 0, 1
                    else:
                        if place == -1:
                            v -= seam.wait_cost
                        else:
                            taken = seam.out_start[i] + place
                            burn, there, arrival = seam.arc_burn[taken], seam.arc_to[taken], t + seam.arc_steps[taken]
                            v -= seam.arc_cost[taken]
                        if arrival <= until or arrival > last:
                            continue
                        other = (last - arrival) * n + there
                        first, beyond = behind.labels.start[other], behind.labels.start[other + 1]
                    for at in range(first, beyond):
                        rest, v_both, p_both = -1, v, p
                        if place > -2:
                            rest = order[at - left_out]
                            v_both += behind.labels.value[rest]
                            p_both += behind.paid[rest]
                        if v_both - p_both < cutoff:
                            break
                        if place > -2:
                            apart = True
                            for w in range(words):
                                if ahead.sets[k, w] & behind.sets[rest, w] != _ZERO:
                                    apart = False
                                    break
                            if not apart:
                                continue
                            if limited and ahead.labels.fuel[k] + burn + behind.labels.fuel[rest] > seam.budget:
                                continue
                            both = ahead.labels.cuts[k] & behind.labels.cuts[rest]
                            while both != _ZERO:
                                p_both += seam.cut_price[lowest_bit(both)]
                                both &= both - _ONE
                            if v_both - p_both < cutoff:
                                continue
                        for w in range(words):
                            sets[count, w] = ahead.sets[k, w]
                            if place > -2:
                                sets[count, w] |= behind.sets[rest, w]
                        slot = _place(sets, count, table)
                        known = table[slot]
                        if known >= 0 and value[known] >= v_both:
                            continue
                        if known < 0:
                            known = count
                            table[slot] = count
                            count += 1
                        value[known], paid[known] = v_both, p_both
                        parts[known, 0], parts[known, 1], parts[known, 2] = k, taken, rest
                        if count > most:
                            return sets[:count], value[:count], paid[:count], parts[:count], False
                        if count == size:
                            size *= 2
                            sets = np.concatenate((sets, np.empty((count, words), np.uint64)))
                            value = np.concatenate((value, np.empty(count)))
                            paid = np.concatenate((paid, np.empty(count)))
                            parts = np.concatenate((parts, np.empty((count, 3), np.int64)))
                            table = np.full(4 * size, -1, np.int64)
                            for k2 in range(count):
                                table[_place(sets, k2, table)] = k2
    return sets[:count], value[:count], paid[:count], parts[:count], True
