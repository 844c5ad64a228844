"""What sets of cells cost at given prices of cells and of rank-1 cuts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray
from react_opt.solvers.routes.labels import lowest_bit
from react_opt.solvers.routes.labelstore import MaskArray
from react_opt.solvers.routes.setcuts import SetCut

_ZERO = np.uint64(0)
_ONE = np.uint64(1)
_DUE = np.uint64(0x8080808080808080)


class SetPrices(NamedTuple):
    """Prices in the form that kernels read: the sums of eight cuts in the eight bytes of a word.

    A cut whose coefficient can be 2 stands there twice, and so on.

    Parameters
    ----------
    cell
        ``(n_cells,)`` price of each cell.
    times
        ``(n_cells, w)`` numerator of each cell in each cut, one to a byte.
    short
        ``(w,)`` what a sum of numerators lacks to 128 where the cut has to be paid, one to a byte.
    price
        ``(8 w,)`` price of each cut.
    """

    cell: FloatArray
    times: MaskArray
    short: MaskArray
    price: FloatArray


def set_prices(cell: FloatArray, cuts: Sequence[SetCut], price: FloatArray) -> SetPrices:
    """Return prices of cells and cuts in the form that kernels read.

    Parameters
    ----------
    cell, cuts, price
        ``(n_cells,)`` price of each cell, and the cuts with theirs.
    """
    paid = [
        (cut, multiple * cut.over, worth)
        for cut, worth in zip(cuts, price.tolist(), strict=True)
        if worth > 0.0
        for multiple in range(1, int(cut.rhs) + 1)
    ]
    room = 8 * -(-len(paid) // 8)
    times, short, worths = np.zeros((len(cell), room), np.uint8), np.zeros(room, np.uint8), np.zeros(room)
    for place, (cut, least, worth) in enumerate(paid):
        times[list(cut.cells), place] = cut.times
        short[place], worths[place] = 128 - least, worth
    return SetPrices(np.ascontiguousarray(cell), times.view(np.uint64), short.view(np.uint64), worths)


@kernel(inline="always")
def cost_of_set(sets: MaskArray, r: int, prices: SetPrices, sums: MaskArray) -> float:
    """Return the price of the cells and cuts of set ``r``; ``sums`` is room for the words of the cuts."""
    words = len(prices.short)
    cost = 0.0
    for c in range(words):
        sums[c] = prices.short[c]
    for w in range(sets.shape[1]):
        left = sets[r, w]
        while left != _ZERO:
            i = 64 * w + lowest_bit(left)
            cost += prices.cell[i]
            for c in range(words):
                sums[c] += prices.times[i, c]
            left &= left - _ONE
    for c in range(words):
        due = sums[c] & _DUE
        while due != _ZERO:
            cost += prices.price[8 * c + (lowest_bit(due) >> 3)]
            due &= due - _ONE
    return cost


@kernel(nogil=True)
def cost_of_sets(sets: MaskArray, prices: SetPrices) -> FloatArray:
    """Return ``(m,)`` the price of each set's cells and of the cuts' coefficients in it.

    Parameters
    ----------
    sets
        ``(m, words)`` cells, 64 to a word.
    prices
        The prices.
    """
    cost = np.empty(len(sets))
    sums = np.empty(len(prices.short), np.uint64)
    for r in range(len(sets)):
        cost[r] = cost_of_set(sets, r, prices, sums)
    return cost
