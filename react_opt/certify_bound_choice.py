"""The best choice among enumerated routes, searched again: at the prices of the certificate, plainly.

With prices, multipliers and the bound L that they prove, a plan of routes that collect no cell twice is worth

    L - sum_r (best of its class - worth of r after prices) - sum_i pi_i (1 - collected_i) - slack of cuts

and all that is deducted is not negative. A plan worth more than B therefore holds only routes that lose less than
L - B, at whatever prices.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from react_opt.certify_bound_enumerate import Found
from react_opt.certify_bound_route import MARGIN, ONE, Floats, Words
from react_opt.errors import UsageError

MOST_TIMES = 10**9
SAMPLE = 400  # routes by which it is estimated how many collect a cell


def repriced(
    found: list[Found], counts: list[int], pool: Mapping[str, Any], lowest: Floats, floor: float
) -> tuple[list[Found], list[float], Floats, float]:
    """Return the routes that count at other prices, the most that one of each class is worth then, and the bound.

    The prices are of cells and of rank-1 cuts ``sum floor(sum_i times_i a_i / over) <= floor(sum_i times_i / over)``,
    which every plan keeps. Of the routes those are left that lose no more than the bound lies above ``floor``. The
    third result is the price of each cell.

    Parameters
    ----------
    found, counts
        Routes of each class and how many robots there are.
    pool
        ``cell_price`` and ``cuts`` (cells, times, over, price).
    lowest
        ``(n_cells,)`` least price that counts of each cell.
    floor
        Value of interest.
    """
    cell = np.array(pool["cell_price"], dtype=np.float64)
    if len(cell) != len(lowest) or not np.all(np.isfinite(cell)):
        raise UsageError(f"the certificate prices {len(cell)} cells, the instance has {len(lowest)}")
    cell = np.maximum(cell, lowest)
    total = float(cell.sum())
    inside = [np.unpackbits(routes.sets.view(np.uint8), axis=1, bitorder="little")[:, : len(cell)] for routes in found]
    worth = [routes.value - collected @ cell for routes, collected in zip(found, inside, strict=True)]
    for cut in pool["cuts"]:
        price, over = max(0.0, float(cut["price"])), int(cut["over"])
        if max(over, sum(abs(int(t)) for t in cut["times"])) > MOST_TIMES:
            raise UsageError("the certificate holds a cut with multipliers that are too large to be counted")
        cells, times = [int(c) for c in cut["cells"]], np.array([int(t) for t in cut["times"]], dtype=np.int64)
        if over < 1 or len(times) != len(cells) or len(set(cells)) != len(cells) or times.min(initial=0) < 0:
            raise UsageError("the certificate holds a cut whose cells and multipliers do not fit")
        total += price * (int(times.sum()) // over)
        for value, collected in zip(worth, inside, strict=True):
            value -= price * ((collected[:, cells].astype(np.int64) @ times) // over)
    best = [float(value.max(initial=-math.inf)) for value in worth]
    total += float(np.dot(counts, best))
    least = total - floor + MARGIN * max(1.0, abs(floor))
    left = [
        Found(routes.sets[keep], value[keep], routes.value[keep])
        for routes, value, keep in (
            (routes, value, value >= most - least) for routes, value, most in zip(found, worth, best, strict=True)
        )
    ]
    return left, best, cell, total


def best_of(
    found: list[Found], best: list[float], counts: list[int], price: Floats, losable: float, floor: float
) -> float:
    """Return the most that a choice of routes is worth, or ``floor`` if none is worth more.

    Parameters
    ----------
    found, best, counts
        Routes of each class, the most that one is worth after prices, and how many robots there are.
    price
        ``(n_cells,)`` what is lost where a cell is left; infinite where it has to be collected.
    losable
        What a plan may lose that is worth ``floor``.
    floor
        Value of interest.
    """
    sets = np.concatenate([routes.sets for routes in found])
    value = np.concatenate([routes.value for routes in found])
    loss = np.concatenate([most - routes.reduced for routes, most in zip(found, best, strict=True)])
    group = np.repeat(np.arange(len(found)), [len(routes.value) for routes in found])
    order = np.argsort(loss, kind="stable")
    sets, value, loss, group = sets[order], value[order], loss[order], group[order]
    losable += MARGIN * max(1.0, abs(floor))
    top = floor

    def search(
        open_to: NDArray[np.int64], covered: Words, needed: Words, left: list[int], lost: float, worth: float
    ) -> None:
        nonlocal top
        robots = sum(left)
        if robots == 0:
            top = max(top, worth)
            return
        if robots == 1:  # the last one has to collect all that is needed
            open_to = open_to[~np.any(needed & ~covered & ~sets[open_to], axis=1)]
        open_to = open_to[np.array(left)[group[open_to]] > 0]
        ahead, leading = 0.0, np.full(len(left), np.inf)  # the least that the routes left lose together, and each
        for k, number in enumerate(left):
            if number:
                mine = loss[open_to[group[open_to] == k]]
                if len(mine) == 0:
                    return
                leading[k] = mine[0]
                ahead += number * float(mine[0])
        within = np.bitwise_or.reduce(sets[open_to], axis=0) | covered
        out_of_reach = ~_inside(within, len(price))
        beyond = float(price[out_of_reach].sum())

        def spare() -> float:
            return losable - (top - floor) - lost - beyond - ahead

        open_to = open_to[loss[open_to] < leading[group[open_to]] + spare()]
        if len(open_to) == 0:
            return
        wanted = np.flatnonzero((price > spare()) & ~out_of_reach & ~_inside(covered, len(price)))
        needed = np.zeros_like(covered)
        np.bitwise_or.at(needed, wanted // 64, ONE << (wanted % 64).astype(np.uint64))
        turn = max(k for k, number in enumerate(left) if number)
        part = spare() / left[turn]
        tried = open_to[(group[open_to] == turn) & (loss[open_to] < leading[turn] + part)]
        ordered, sample = True, open_to[:: 1 + len(open_to) // SAMPLE]
        ways = len(tried) * len(sample) // len(open_to)
        for cell in wanted.tolist():
            mark = ONE << np.uint64(cell % 64)
            if (often := int(np.count_nonzero(sets[sample, cell // 64] & mark))) < ways:
                tried, ordered, ways = open_to[(sets[open_to, cell // 64] & mark) != 0], False, often
        for r in tried.tolist():
            if loss[r] >= leading[group[r]] + spare():
                continue
            rest = open_to[~np.any(sets[open_to] & sets[r], axis=1)]
            if ordered:  # the routes of a class are chosen by rising loss
                rest = rest[(group[rest] != turn) | (rest >= r)]
            fewer = [number - (k == group[r]) for k, number in enumerate(left)]
            search(rest, covered | sets[r], needed, fewer, lost + float(loss[r]), worth + float(value[r]))

    none = np.zeros(sets.shape[1], np.uint64)
    search(np.arange(len(value)), none, none, list(counts), 0.0, 0.0)
    return top


def _inside(held: Words, n_cells: int) -> NDArray[np.bool_]:
    """Return ``(n_cells,)`` which cells a set holds."""
    cells: NDArray[np.bool_] = np.unpackbits(held.view(np.uint8), bitorder="little")[:n_cells].astype(np.bool_)
    return cells
