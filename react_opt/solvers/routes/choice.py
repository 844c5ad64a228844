"""The best choice of whole routes from an enumeration, by depth-first search over what a better plan may lose.

With prices pi, cuts and multipliers mu_k that prove a bound, a plan of elementary routes is worth

    bound - sum_r (mu_k - reduced value of r) - sum_i pi_i (1 - collected_i) - sum_c price_c (slack of c)

and every term is a loss that is not negative. A plan better than ``floor`` loses less than ``bound - floor`` in all:
a cell whose price is more than what may still be lost has to be collected by one of the robots that are left, so the
search branches on who does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.labelstore import MaskArray

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
    n, robots = len(price), int(counts.sum())
    size = max(1024, 2 * m)
    candidates = np.empty(size, np.int64)
    candidates[:m] = np.arange(m)
    begin, end = np.zeros(robots + 1, np.int64), np.zeros(robots + 1, np.int64)
    at, chosen = np.zeros(robots + 1, np.int64), np.full(robots, -1, np.int64)
    must, turn = np.full(robots + 1, -1, np.int64), np.full(robots + 1, -1, np.int64)
    lost, worth = np.zeros(robots + 1), np.zeros(robots + 1)  # lost by the routes chosen
    beyond = np.zeros(robots + 1)  # lost besides, by cells that nobody left can collect
    covered = np.zeros((robots + 1, words), np.uint64)
    within = np.empty(words, np.uint64)
    left = counts.copy()
    best, best_value = np.full(robots, -1, np.int64), floor
    work, depth, enter = 0, 0, True
    end[0] = m
    while depth >= 0:
        if work > most_work or stop[0] != 0:
            return best, best_value, False
        if enter:
            # what nobody left can collect is lost; of what has to be collected branch on the dearest
            enter = False
            work += end[depth] - begin[depth]
            within[:] = _ZERO
            for p in range(begin[depth], end[depth]):
                for w in range(words):
                    within[w] |= pool.sets[candidates[p], w]
            must[depth] = -1
            beyond[depth] = 0.0
            for i in range(n):
                word, bit = i // 64, _ONE << np.uint64(i % 64)
                if covered[depth, word] & bit == _ZERO and within[word] & bit == _ZERO:
                    beyond[depth] += price[i]
            room = losable - (best_value - floor) - lost[depth] - beyond[depth]
            if room <= 0.0:
                depth -= 1
                if depth >= 0:
                    left[pool.group[chosen[depth]]] += 1
                continue
            dearest = room
            for i in range(n):
                word, bit = i // 64, _ONE << np.uint64(i % 64)
                if price[i] > dearest and covered[depth, word] & bit == _ZERO and within[word] & bit != _ZERO:
                    must[depth] = i
                    dearest = price[i]
            turn[depth] = -1
            if must[depth] < 0:
                for k in range(len(left)):
                    if left[k] > 0:
                        turn[depth] = k
                        break
            at[depth] = begin[depth]
        # the next route to try
        room = losable - (best_value - floor) - lost[depth] - beyond[depth]
        c = -1
        while at[depth] < end[depth]:
            r = candidates[at[depth]]
            at[depth] += 1
            work += 1
            if pool.loss[r] >= room:
                at[depth] = end[depth]
                break
            k = pool.group[r]
            if left[k] == 0:
                continue
            i = must[depth]
            if i >= 0 and pool.sets[r, i // 64] & (_ONE << np.uint64(i % 64)) == _ZERO:
                continue
            if i < 0 and (k != turn[depth] or left[k] * pool.loss[r] >= room):
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
        room -= pool.loss[c]
        first = end[depth]
        if first + end[depth] - begin[depth] > len(candidates):
            candidates = np.concatenate((candidates, np.empty(len(candidates), np.int64)))
        count = first
        # without a cell to settle, the routes of a class are chosen in the order of the list
        past = at[depth] - 1 if must[depth] < 0 else begin[depth]
        work += end[depth] - begin[depth]
        for p in range(begin[depth], end[depth]):
            r = candidates[p]
            if pool.loss[r] >= room:
                break
            if left[pool.group[r]] == 0 or (pool.group[r] == k and p < past):
                continue
            apart = True
            for w in range(words):
                if pool.sets[r, w] & covered[depth + 1, w] != _ZERO:
                    apart = False
                    break
            if apart:
                candidates[count] = r
                count += 1
        depth += 1
        begin[depth], end[depth] = first, count
        enter = True
    return best, best_value, True
