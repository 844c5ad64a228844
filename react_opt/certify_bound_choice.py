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
from react_opt.certify_bound_route import MARGIN, Floats
from react_opt.errors import UsageError

MOST_TIMES = 10**9


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
    inside = np.unpackbits(sets.view(np.uint8), axis=1, bitorder="little")[:, : len(price)].astype(bool)
    losable += MARGIN * max(1.0, abs(floor))
    top = floor

    def search(
        open_to: NDArray[np.int64], covered: NDArray[np.bool_], left: list[int], lost: float, worth: float
    ) -> None:
        nonlocal top
        if sum(left) == 0:
            top = max(top, worth)
            return
        room = losable - (top - floor) - lost
        open_to = open_to[(loss[open_to] < room) & (np.array(left)[group[open_to]] > 0)]
        out_of_reach = ~covered & ~inside[open_to].any(axis=0)
        beyond = float(price[out_of_reach].sum())
        room = losable - (top - floor) - lost - beyond
        if room <= 0.0 or len(open_to) == 0:
            return
        wanted = np.where(covered | out_of_reach, 0.0, price)
        cell = int(np.argmax(wanted))
        settles = wanted[cell] > room
        turn = next(k for k, robots in enumerate(left) if robots)
        tried = open_to[inside[open_to, cell]] if settles else open_to[group[open_to] == turn]
        for r in tried[np.argsort(loss[tried], kind="stable")].tolist():
            if loss[r] >= losable - (top - floor) - lost - beyond:
                return
            rest = open_to[~(inside[open_to] & inside[r]).any(axis=1)]
            if not settles:  # the routes of a class are chosen by rising loss
                earlier = (group[rest] == turn) & ((loss[rest] < loss[r]) | ((loss[rest] == loss[r]) & (rest < r)))
                rest = rest[~earlier]
            fewer = [robots - (k == group[r]) for k, robots in enumerate(left)]
            search(rest, covered | inside[r], fewer, lost + float(loss[r]), worth + float(value[r]))

    search(np.arange(len(value)), np.zeros(len(price), dtype=bool), list(counts), 0.0, 0.0)
    return top
