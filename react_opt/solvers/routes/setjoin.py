"""Kernel over exact sets of cells: beginnings and rests of routes put together, the best of them at given prices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.labels import lowest_bit
from react_opt.solvers.routes.labelstore import WAIT, MaskArray
from react_opt.solvers.routes.ranking import inner
from react_opt.solvers.routes.setprices import SetPrices, cost_of_set

_ZERO = np.uint64(0)
_ONE = np.uint64(1)
_SPREAD = np.uint64(0x9E3779B97F4A7C15)
_HALF = np.uint64(32)


class Half(NamedTuple):
    """Labels of one direction and their exact sets.

    Parameters
    ----------
    start
        Labels of each cell and instant, in kernel time; see `Labels`.
    sets
        ``(m, words)`` the sets.
    gross
        ``(m,)`` what each label is worth in the objective, to a constant.
    base
        ``(m,)`` its value minus the prices of cells and cuts with which it was enumerated.
    value
        ``(m,)`` its value minus the prices of interest.
    cuts, fuel
        ``(m,)`` state of the cuts with which it was enumerated, and energy.
    last
        ``(m,)`` whether a route may end with it.
    """

    start: IntArray
    sets: MaskArray
    gross: FloatArray
    base: FloatArray
    value: FloatArray
    cuts: MaskArray
    fuel: FloatArray
    last: NDArray[np.bool_]


class Seam(NamedTuple):
    """What leads from a beginning to a rest.

    Parameters
    ----------
    out_start, arc_to, arc_steps
        See `RouteProblem`.
    arc_cost, wait_cost, arc_burn, wait_burn, budget
        Cost and energy of arcs and of waiting a step, and the energy that there is.
    cut_price
        Price of each cut with which labels were enumerated.
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
    ahead: Half,
    behind: Half,
    rest_of: IntArray,
    seam: Seam,
    prices: SetPrices,
    base_cutoff: float,
    cutoff: float,
    most: int,
    share: tuple[int, int],
    stop: NDArray[np.uint8],
) -> tuple[MaskArray, FloatArray, FloatArray, IntArray, float]:
    """Return the routes that are worth most at given prices, the best one for each exact set.

    ``(m, words)`` sets, ``(m,)`` value in the objective (to a constant) and value minus prices, ``(m, 3)`` label of
    the beginning, arc taken from there and label of the rest (-1 where the route ends with its beginning), and the
    value minus prices from which on none is missing: infinite where it was given up.

    Parameters
    ----------
    ahead
        Beginnings, up to some instant.
    behind
        Rests that begin after it, in their own kernel time; those of each cell and instant by falling value.
    rest_of
        Label of each rest.
    seam
        How they are put together.
    prices
        Prices of interest.
    base_cutoff
        Least value minus the prices with which they were enumerated.
    cutoff
        Least value minus the prices of interest.
    most
        Sets returned at most; those of least value are left out.
    share
        Looks at beginnings in every ``share[1]``-th cell only, from ``share[0]`` on.
    stop
        ``(1,)`` flag that gives it up at once.
    """
    n = len(seam.out_start) - 1
    last = len(seam.idle_end) - 1
    until = (len(ahead.start) - 1) // n - 1
    words = ahead.sets.shape[1]
    limited = seam.budget < np.inf
    size = max(8, min(4096, 2 * most))
    sets = np.empty((size, words), np.uint64)
    gross, value, parts = np.empty(size), np.empty(size), np.empty((size, 3), np.int64)
    table = np.full(4 * size, -1, np.int64)
    sums = np.empty(len(prices.short), np.uint64)
    count = 0
    for t in range(until + 1):
        for i in range(share[0], n, share[1]):
            if stop[0] != 0:
                return sets[:count], gross[:count], value[:count], parts[:count], np.inf
            node = t * n + i
            for k in range(ahead.start[node], ahead.start[node + 1]):
                # place -2: the route ends here; -1: it waits; then the arcs
                for place in range(-2, seam.out_start[i + 1] - seam.out_start[i]):
                    taken, burn, there, arrival, worth = WAIT, seam.wait_burn, i, t + 1, 0.0
                    if place == -2:
                        if not ahead.last[k]:
                            continue
                        worth = seam.idle_end[t, i]
                        first, beyond = 0, 1
                    else:
                        if place == -1:
                            worth = -seam.wait_cost
                        else:
                            taken = seam.out_start[i] + place
                            burn, there, arrival = seam.arc_burn[taken], seam.arc_to[taken], t + seam.arc_steps[taken]
                            worth = -seam.arc_cost[taken]
                        if arrival <= until or arrival > last:
                            continue
                        other = (last - arrival) * n + there
                        first, beyond = behind.start[other], behind.start[other + 1]
                    v, base = ahead.value[k] + worth, ahead.base[k] + worth
                    for rest in range(first, beyond):
                        at = rest if place > -2 else -1
                        v_both, base_both = v, base
                        if at >= 0:
                            v_both += behind.value[at]
                            base_both += behind.base[at]
                        if v_both < cutoff:  # together they cost at least what both cost
                            break
                        if base_both < base_cutoff:
                            continue
                        if at >= 0:
                            apart = True
                            for w in range(words):
                                if ahead.sets[k, w] & behind.sets[at, w] != _ZERO:
                                    apart = False
                                    break
                            if not apart:
                                continue
                            if limited and ahead.fuel[k] + burn + behind.fuel[at] > seam.budget:
                                continue
                            both = ahead.cuts[k] & behind.cuts[at]
                            while both != _ZERO:
                                base_both -= seam.cut_price[lowest_bit(both)]
                                both &= both - _ONE
                            if base_both < base_cutoff:
                                continue
                        whole = ahead.gross[k] + worth
                        for w in range(words):
                            sets[count, w] = ahead.sets[k, w]
                            if at >= 0:
                                sets[count, w] |= behind.sets[at, w]
                        if at >= 0:
                            whole += behind.gross[at]
                            v_both = whole - cost_of_set(sets, count, prices, sums)
                            if v_both < cutoff:
                                continue
                        slot = _place(sets, count, table)
                        known = table[slot]
                        if known >= 0 and gross[known] >= whole:
                            continue
                        if known < 0:
                            known = count
                            table[slot] = count
                            count += 1
                        gross[known], value[known] = whole, v_both
                        parts[known, 0], parts[known, 1], parts[known, 2] = k, taken, rest_of[at] if at >= 0 else -1
                        if count < size:
                            continue
                        if size < 2 * most:
                            size *= 2
                            sets = np.concatenate((sets, np.empty((count, words), np.uint64)))
                            gross = np.concatenate((gross, np.empty(count)))
                            value = np.concatenate((value, np.empty(count)))
                            parts = np.concatenate((parts, np.empty((count, 3), np.int64)))
                            table = np.full(4 * size, -1, np.int64)
                        else:  # only the better ones go on, and what is worse than these is not looked at any more
                            cutoff = np.partition(value, count - most)[count - most]
                            kept = 0
                            for r in range(count):
                                if value[r] > cutoff:
                                    sets[kept] = sets[r]
                                    gross[kept], value[kept], parts[kept] = gross[r], value[r], parts[r]
                                    kept += 1
                            count = kept
                            table[:] = -1
                        for r in range(count):
                            table[_place(sets, r, table)] = r
    return sets[:count], gross[:count], value[:count], parts[:count], cutoff


@kernel(nogil=True)
def best_of_each(sets: MaskArray, gross: FloatArray) -> IntArray:
    """Return the place of each different set, where it is worth most.

    Parameters
    ----------
    sets, gross
        ``(m, words)`` sets and ``(m,)`` what they are worth.
    """
    m, words = sets.shape
    seen, place = np.empty((m + 1, words), np.uint64), np.empty(m, np.int64)
    size = 4096
    while size < 4 * m:
        size *= 2
    table = np.full(size, -1, np.int64)
    count = 0
    for r in range(m):
        seen[count] = sets[r]
        slot = _place(seen, count, table)
        known = table[slot]
        if known < 0:
            table[slot] = count
            place[count] = r
            count += 1
        elif gross[r] > gross[place[known]]:
            place[known] = r
    return place[:count]
