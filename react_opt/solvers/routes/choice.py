"""The best choice of whole routes from an enumeration, by depth-first search over what a better plan may lose.

With prices pi, cuts and multipliers mu_k that prove a bound, a plan of elementary routes is worth

    bound - sum_r (mu_k - reduced value of r) - sum_i pi_i (1 - collected_i) - sum_c price_c (slack of c)

and every term is a loss that is not negative. A plan better than ``floor`` loses less than ``bound - floor`` in all.
So a cell whose price is more than what may still be lost has to be collected by one of the robots that are left, and
of l routes of a class that are left one loses no more than the l-th part. The search branches on which route collects
such a cell, or on which route loses least, whichever leaves fewer ways; the last robot has to collect all such cells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.labels import lowest_bit
from react_opt.solvers.routes.labelstore import MaskArray
from react_opt.solvers.routes.ranking import inner

SAMPLE = 400  # routes by which it is estimated how many collect a cell

_ZERO = np.uint64(0)
_ONE = np.uint64(1)


class Pool(NamedTuple):
    """Routes to choose from, by rising loss.

    Parameters
    ----------
    value
        ``(m,)`` what each route is worth in the objective.
    loss
        ``(m,)`` its class's multiplier minus its reduced value.
    group
        ``(m,)`` its class.
    sets
        ``(m, words)`` the cells it collects, 64 to a word.
    """

    value: FloatArray
    loss: FloatArray
    group: IntArray
    sets: MaskArray


@inner
def _routes_of_cells(sets: MaskArray, n_cells: int) -> MaskArray:
    """Return ``(n_cells, b)``: the routes that collect each cell, 64 to a word."""
    routes = np.zeros((n_cells, (len(sets) + 63) // 64), np.uint64)
    for r in range(len(sets)):
        for w in range(sets.shape[1]):
            left = sets[r, w]
            while left != _ZERO:
                routes[64 * w + lowest_bit(left), r // 64] |= _ONE << np.uint64(r % 64)
                left &= left - _ONE
    return routes


@inner
def _apart(sets: MaskArray, r: int, routes: MaskArray, many: int, apart: IntArray) -> int:
    """Write which of the first ``many`` routes share no cell with route ``r``; return how many."""
    words, count = (many + 63) // 64, 0
    meets = np.empty(256, np.uint64)
    for begin in range(0, words, len(meets)):
        size = min(len(meets), words - begin)
        meets[:size] = _ZERO
        for w in range(sets.shape[1]):
            left = sets[r, w]
            while left != _ZERO:
                row = routes[64 * w + lowest_bit(left), begin : begin + size]
                for b in range(size):
                    meets[b] |= row[b]
                left &= left - _ONE
        for b in range(size):
            left = ~meets[b]
            while left != _ZERO:
                other = 64 * (begin + b) + lowest_bit(left)
                if other < many:
                    apart[count] = other
                    count += 1
                left &= left - _ONE
    return count


@inner
def _rarest(pool: Pool, candidates: IntArray, needed: MaskArray, useful: FloatArray, fewest: int, step: int) -> int:
    """Return the cell of ``needed`` that the fewest of every ``step``-th candidate collect; -1 if not under ``fewest``.

    Candidates of class k that lose ``useful[k]`` or more are of no use.
    """
    often = np.zeros(64 * len(needed), np.int64)
    for p in range(0, len(candidates), step):
        r = candidates[p]
        if pool.loss[r] >= useful[pool.group[r]]:
            continue
        for w in range(len(needed)):
            left = pool.sets[r, w] & needed[w]
            while left != _ZERO:
                often[64 * w + lowest_bit(left)] += 1
                left &= left - _ONE
    rarest = -1
    for i in range(len(often)):
        if needed[i // 64] & (_ONE << np.uint64(i % 64)) != _ZERO and often[i] < fewest:
            rarest, fewest = i, often[i]
    return rarest


@kernel(nogil=True)
def best_choice(
    pool: Pool,
    counts: IntArray,
    price: FloatArray,
    losable: float,
    floor: float,
    most_work: int,
    stop: NDArray[np.uint8],
) -> tuple[IntArray, float, bool]:
    """Return the most valuable choice worth more than ``floor``, its value, and whether the search was complete.

    Parameters
    ----------
    pool
        The routes.
    counts
        Robots of each class.
    price
        ``(n_cells,)`` what is lost where a cell is left, infinite where it has to be collected.
    losable
        What a plan may lose that is worth ``floor``.
    floor
        Value to beat; the choice is empty and the value ``floor`` if none does.
    most_work
        Looks at routes after which the search is given up.
    stop
        ``(1,)`` flag that gives it up at once.
    """
    m, words = pool.sets.shape
    n, robots, classes = len(price), int(counts.sum()), len(counts)
    size = max(1024, 2 * m)
    candidates = np.empty(size, np.int64)
    candidates[:m] = np.arange(m)
    routes = _routes_of_cells(pool.sets, n)
    apart = np.empty(m, np.int64)
    begin, end = np.zeros(robots + 1, np.int64), np.zeros(robots + 1, np.int64)
    at, chosen = np.zeros(robots + 1, np.int64), np.full(robots, -1, np.int64)
    must, turn = np.full(robots + 1, -1, np.int64), np.full(robots + 1, -1, np.int64)
    lost, worth = np.zeros(robots + 1), np.zeros(robots + 1)  # lost by the routes chosen
    beyond = np.zeros(robots + 1)  # lost besides, by cells that nobody left can collect
    least = np.zeros((robots + 1, classes))  # that a route of a class loses
    ahead = np.zeros(robots + 1)  # that the routes left lose together
    covered, needed = np.zeros((robots + 1, words), np.uint64), np.zeros((robots + 1, words), np.uint64)
    within, useful = np.empty(words, np.uint64), np.empty(classes)
    left = counts.copy()
    best, best_value = np.full(robots, -1, np.int64), floor
    work, depth, enter = 0, 0, True
    end[0] = m
    while depth >= 0:
        if work > most_work or stop[0] != 0:
            return best, best_value, False
        if enter:
            # what nobody left can collect is lost, and no less than the best routes that are left lose
            enter = False
            work += end[depth] - begin[depth]
            within[:] = _ZERO
            least[depth] = np.inf
            for p in range(begin[depth], end[depth]):
                r = candidates[p]
                for w in range(words):
                    within[w] |= pool.sets[r, w]
                least[depth, pool.group[r]] = min(least[depth, pool.group[r]], pool.loss[r])
            ahead[depth] = beyond[depth] = 0.0
            for k in range(classes):
                if left[k] > 0:
                    ahead[depth] += left[k] * least[depth, k]
                    turn[depth] = k
            for i in range(n):
                word, bit = i // 64, _ONE << np.uint64(i % 64)
                if covered[depth, word] & bit == _ZERO and within[word] & bit == _ZERO:
                    beyond[depth] += price[i]
            spare = losable - (best_value - floor) - lost[depth] - beyond[depth] - ahead[depth]
            if not spare > 0.0:
                depth -= 1
                if depth >= 0:
                    left[pool.group[chosen[depth]]] += 1
                continue
            needed[depth] = _ZERO
            for i in range(n):
                word, bit = i // 64, _ONE << np.uint64(i % 64)
                if price[i] > spare and covered[depth, word] & bit == _ZERO and within[word] & bit != _ZERO:
                    needed[depth, word] |= bit
            useful[:] = -np.inf
            for k in range(classes):
                if left[k] > 0:
                    useful[k] = least[depth, k] + spare
            step = 1 + (end[depth] - begin[depth]) // SAMPLE
            k, ways = turn[depth], 0
            for p in range(begin[depth], end[depth], step):
                r = candidates[p]
                ways += pool.group[r] == k and pool.loss[r] < least[depth, k] + spare / left[k]
            here = candidates[begin[depth] : end[depth]]
            must[depth] = _rarest(pool, here, needed[depth], useful, ways, step)
            at[depth] = begin[depth]
        # the next route to try
        spare = losable - (best_value - floor) - lost[depth] - beyond[depth] - ahead[depth]
        c = -1
        while at[depth] < end[depth]:
            r = candidates[at[depth]]
            at[depth] += 1
            work += 1
            k = pool.group[r]
            if left[k] == 0 or pool.loss[r] >= least[depth, k] + spare:
                continue
            i = must[depth]
            if i >= 0 and pool.sets[r, i // 64] & (_ONE << np.uint64(i % 64)) == _ZERO:
                continue
            if i < 0 and (k != turn[depth] or pool.loss[r] >= least[depth, k] + spare / left[k]):
                continue
            c = r
            break
        if c < 0:
            depth -= 1
            if depth >= 0:
                left[pool.group[chosen[depth]]] += 1
            continue
        chosen[depth] = c
        total = worth[depth] + pool.value[c]
        if depth == robots - 1:
            if total > best_value:
                best_value = total
                best[:] = chosen
            continue
        k = pool.group[c]
        left[k] -= 1
        for w in range(words):
            covered[depth + 1, w] = covered[depth, w] | pool.sets[c, w]
        lost[depth + 1], worth[depth + 1] = lost[depth] + pool.loss[c], total
        spare -= pool.loss[c] - least[depth, k]
        first = end[depth]
        if first + end[depth] - begin[depth] > len(candidates):
            candidates = np.concatenate((candidates, np.empty(len(candidates), np.int64)))
        # without a cell to settle, the routes of a class are chosen in the order of the list
        past = at[depth] - 1 if must[depth] < 0 else begin[depth]
        bar = -np.inf  # no route that loses so much is of use
        for g in range(classes):
            if left[g] > 0:
                bar = max(bar, least[depth, g] + spare)
        if depth == 0:
            many = int(np.searchsorted(pool.loss, bar))
            open_to = _apart(pool.sets, c, routes, many, apart)
            work += many // 16
        else:
            open_to = 0
            for p in range(begin[depth], end[depth]):
                work += 1
                if pool.loss[candidates[p]] >= bar:
                    break
                clear = True
                for w in range(words):
                    clear &= pool.sets[candidates[p], w] & pool.sets[c, w] == _ZERO
                if clear:
                    apart[open_to] = p
                    open_to += 1
        count = first
        for q in range(open_to):
            p = apart[q]
            r = candidates[p]
            g = pool.group[r]
            if left[g] == 0 or (g == k and p < past) or pool.loss[r] >= least[depth, g] + spare:
                continue
            if depth == robots - 2:
                lacks = False
                for w in range(words):
                    lacks |= needed[depth, w] & ~covered[depth + 1, w] & ~pool.sets[r, w] != _ZERO
                if lacks:
                    continue
            candidates[count] = r
            count += 1
        work += open_to
        if count == first:
            left[k] += 1
            continue
        depth += 1
        begin[depth], end[depth] = first, count
        enter = True
    return best, best_value, True
