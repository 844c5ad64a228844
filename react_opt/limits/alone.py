"""The bound of :mod:`react_opt.limits.detours` for one robot, made fast enough to count more regions.

A single robot enters all of S itself, so only those S count that leave no more unseen than may be; they are taken by
the time of visiting them, and those that take longer than the best so far are done with. The least time through Q, a
place and R, over all splits Q + R = S, depends on Q by the region m that it ends in and on R by the region n that it
begins with: it is the least over m and n of ``cost(m, n) + time(m, place) + time(place, n)`` with ``cost(m, n)`` the
least time through any Q that ends in m and any R that begins with n. So a place takes |S|^2 steps instead of 2^|S|.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@kernel
def alone_s(
    start: FloatArray, between: FloatArray, start_block: FloatArray, to_block: FloatArray, begin: IntArray,
    lists: IntArray, hidden_in: IntArray, weight: IntArray, needed: IntArray,
) -> FloatArray:  # fmt: skip
    """Return the least times over all sets of regions entered, for several numbers of pixels wanted, s.

    Parameters
    ----------
    start, between
        ``(k,)`` and ``(k, k)`` least times from the start to the regions and from region to region.
    start_block, to_block
        ``(blocks,)`` and ``(k, blocks)`` least times from the start and from the regions to the blocks of places.
    begin, lists
        The blocks from which each group is visible.
    hidden_in
        ``(groups,)`` bits: the regions from which alone a group is visible.
    weight
        ``(groups,)`` pixels of each group.
    needed
        ``(n,)`` pixels wanted.
    """
    k, groups, sets = start.shape[0], weight.shape[0], 1 << start.shape[0]
    there, back, alone = _orders(start, between)
    inside = np.zeros(sets, dtype=np.int64)  # of what is hidden in some region, pixels that a set of them shows at most
    for g in range(groups):
        inside[hidden_in[g]] += weight[g]
    for m in range(k):
        for chosen in range(sets):
            if chosen >> m & 1:
                inside[chosen] += inside[chosen ^ 1 << m]
    best = np.full(needed.shape[0], np.inf)
    cost, least = np.empty((k + 1, k + 1)), np.empty(start_block.shape[0])
    times = np.empty(groups)
    for chosen in np.argsort(alone):
        useful = False
        for n in range(needed.shape[0]):
            useful = useful or (inside[chosen] >= needed[n] and alone[chosen] < best[n])
        if not useful:
            continue
        _costs(chosen, there, back, cost)
        least[:] = np.inf
        for m in range(k + 1):
            for n in range(k + 1):
                if np.isfinite(cost[m, n]):
                    for b in range(least.shape[0]):
                        into = start_block[b] if m == k else to_block[m, b]
                        out = 0.0 if n == k else to_block[n, b]
                        least[b] = min(least[b], cost[m, n] + into + out)
        for g in range(groups):
            times[g] = np.inf
            if hidden_in[g] & ~chosen == 0:
                for n in range(begin[g], begin[g + 1]):
                    times[g] = min(times[g], least[lists[n]])
        order = np.argsort(times)
        for n in range(needed.shape[0]):
            seen, last = 0, 0.0
            for g in order:
                if seen >= needed[n] or np.isinf(times[g]):
                    break
                seen += weight[g]
                last = times[g]
            if seen >= needed[n]:
                best[n] = min(best[n], max(alone[chosen], last))
    return best


@kernel
def _orders(start: FloatArray, between: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the least times through each set of regions: by the last one, from the start; by the first one; from it.

    The last is the least of the first over all regions: what a visit of the set takes.
    """
    k, sets = start.shape[0], 1 << start.shape[0]
    there, back = np.full((sets, max(1, k)), np.inf), np.full((sets, max(1, k)), np.inf)
    alone = np.zeros(sets)
    for chosen in range(1, sets):
        for m in range(k):
            rest = chosen ^ 1 << m
            if not chosen >> m & 1:
                continue
            if rest == 0:
                there[chosen, m], back[chosen, m] = start[m], 0.0
            for n in range(k):
                if rest >> n & 1:
                    there[chosen, m] = min(there[chosen, m], there[rest, n] + between[n, m])
                    back[chosen, m] = min(back[chosen, m], back[rest, n] + between[m, n])
        alone[chosen] = there[chosen].min()
    return there, back, alone


@kernel
def _costs(chosen: int, there: FloatArray, back: FloatArray, cost: FloatArray) -> None:
    """Write the least times of a split by the region before a place and the one after it; k stands for none."""
    k = cost.shape[0] - 1
    cost[:] = np.inf
    if chosen == 0:
        cost[k, k] = 0.0
    first = chosen
    while True:
        after = chosen ^ first
        for m in range(k):
            if first >> m & 1:
                if after == 0:
                    cost[m, k] = there[first, m]
                for n in range(k):
                    if after >> n & 1:
                        cost[m, n] = min(cost[m, n], there[first, m] + back[after, n])
        if first == 0:
            for n in range(k):
                if after >> n & 1:
                    cost[k, n] = back[after, n]
            return
        first = (first - 1) & chosen
