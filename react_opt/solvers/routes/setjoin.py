"""Kernel over exact sets of cells: beginnings and rests of routes put together, the best of them at given prices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.halves import Half, Seam
from react_opt.solvers.routes.labels import lowest_bit
from react_opt.solvers.routes.labelstore import WAIT, MaskArray
from react_opt.solvers.routes.ranking import inner
from react_opt.solvers.routes.setprices import DUE, SetPrices, add_up

_ZERO = np.uint64(0)
_ONE = np.uint64(1)
_SPREAD = np.uint64(0x9E3779B97F4A7C15)
_HALF = np.uint64(32)


@inner
def _hash(sets: MaskArray, r: int) -> np.uint64:
    """Return a number that depends on a set alone and looks like chance."""
    hashed = _ZERO
    for w in range(sets.shape[1]):
        hashed = (hashed ^ sets[r, w]) * _SPREAD
        hashed ^= hashed >> _HALF
    return hashed


@inner
def _place(sets: MaskArray, count: int, table: IntArray) -> int:
    """Return the slot of a set: the one that holds it, or the free one where it belongs."""
    words, slots = sets.shape[1], np.uint64(len(table) - 1)
    slot = np.int64(_hash(sets, count) & slots)
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


@inner
def _apart(sets: MaskArray, k: int, holds: MaskArray, wide: int, many: int, meets: MaskArray, apart: IntArray) -> int:
    """Write which of the first ``many`` rests of a node share no cell with set ``k``; return how many."""
    size = (many + 63) // 64
    for b in range(size):
        meets[b] = _ZERO
    for w in range(sets.shape[1]):
        left = sets[k, w]
        while left != _ZERO:
            row = wide * (64 * w + lowest_bit(left))
            for b in range(size):
                meets[b] |= holds[row + b]
            left &= left - _ONE
    count = 0
    for b in range(size):
        left = ~meets[b]
        while left != _ZERO:
            rest = 64 * b + lowest_bit(left)
            if rest >= many:
                break
            apart[count] = rest
            count += 1
            left &= left - _ONE
    return count


@kernel(nogil=True)
def join_sets(
    ahead: Half,
    behind: Half,
    rests: tuple[IntArray, MaskArray],
    sums: MaskArray,
    seam: Seam,
    prices: SetPrices,
    base_cutoff: float,
    cutoff: float,
    most: int,
    drawn: float,
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
    rests
        See :func:`rests_of_cells`.
    sums
        ``(m, w)`` the sums of the cuts' numerators in the set of each rest, see :func:`sums_of_sets`.
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
    drawn
        Share of the beginnings that is looked at, always the same ones; all by default.
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
    most_rests = 64
    for node in range(len(behind.start) - 1):
        most_rests = max(most_rests, behind.start[node + 1] - behind.start[node])
    meets, apart = np.empty((most_rests + 63) // 64, np.uint64), np.empty(most_rests, np.int64)
    mine, due = np.empty(len(prices.short), np.uint64), np.empty(len(prices.short), np.uint64)
    count = 0
    for t in range(until + 1):
        for i in range(share[0], n, share[1]):
            if stop[0] != 0:
                return sets[:count], gross[:count], value[:count], parts[:count], np.inf
            node = t * n + i
            for k in range(ahead.start[node], ahead.start[node + 1]):
                if drawn < 1.0 and float((_hash(ahead.sets, k) * _SPREAD) >> _HALF) >= drawn * 2.0**32:
                    continue
                add_up(ahead.sets, k, prices, mine)
                for c in range(len(mine)):
                    due[c] = mine[c] & DUE
                    mine[c] -= prices.short[c]
                # place -2: the route ends here; -1: it waits; then the arcs
                for place in range(-2, seam.out_start[i + 1] - seam.out_start[i]):
                    taken, burn, there, arrival, worth = WAIT, seam.wait_burn, i, t + 1, 0.0
                    if place == -2:
                        if not ahead.last[k]:
                            continue
                        worth, apart[0], count_apart, first = seam.idle_end[t, i], -1, 1, 0
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
                        first, many = behind.start[other], behind.start[other + 1] - behind.start[other]
                        wide = (many + 63) // 64
                        # together they cost at least what both cost
                        low, high = 0, many
                        while low < high:
                            middle = (low + high) // 2
                            if ahead.value[k] + worth + behind.value[first + middle] < cutoff:
                                high = middle
                            else:
                                low = middle + 1
                        if low == 0:
                            continue
                        words_of = rests[1][rests[0][other] : rests[0][other + 1]]
                        count_apart = _apart(ahead.sets, k, words_of, wide, low, meets, apart)
                    v, base = ahead.value[k] + worth, ahead.base[k] + worth
                    for a in range(count_apart):
                        at = first + apart[a] if place > -2 else -1
                        v_both, base_both = v, base
                        if at >= 0:
                            v_both += behind.value[at]
                            base_both += behind.base[at]
                        if v_both < cutoff or base_both < base_cutoff:
                            continue
                        if at >= 0:
                            if limited and ahead.fuel[k] + burn + behind.fuel[at] > seam.budget:
                                continue
                            both = ahead.cuts[k] & behind.cuts[at]
                            while both != _ZERO:
                                base_both -= seam.cut_price[lowest_bit(both)]
                                both &= both - _ONE
                            if base_both < base_cutoff:
                                continue
                            # cuts that both have paid for more than once, or that are due for both together only
                            for c in range(len(mine)):
                                other_due = sums[at, c] & DUE
                                changed = ((mine[c] + sums[at, c]) & DUE) ^ (due[c] | other_due)
                                while changed != _ZERO:
                                    v_both -= prices.price[8 * c + (lowest_bit(changed) >> 3)]
                                    changed &= changed - _ONE
                                twice = due[c] & other_due
                                while twice != _ZERO:
                                    v_both += prices.price[8 * c + (lowest_bit(twice) >> 3)]
                                    twice &= twice - _ONE
                                if v_both < cutoff:
                                    break
                            if v_both < cutoff:
                                continue
                        whole = ahead.gross[k] + worth
                        for w in range(words):
                            sets[count, w] = ahead.sets[k, w]
                        if at >= 0:
                            whole += behind.gross[at]
                            for w in range(words):
                                sets[count, w] |= behind.sets[at, w]
                        slot = _place(sets, count, table)
                        known = table[slot]
                        if known >= 0 and gross[known] >= whole:
                            continue
                        if known < 0:
                            known = count
                            table[slot] = count
                            count += 1
                        gross[known], value[known] = whole, v_both
                        parts[known, 0], parts[known, 1], parts[known, 2] = k, taken, at
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
