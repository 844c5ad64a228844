"""What sets of cells cost at given prices of cells and of rank-1 cuts."""

from __future__ import annotations

import numpy as np

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.labels import lowest_bit
from react_opt.solvers.routes.labelstore import MaskArray

_ZERO = np.uint64(0)
_ONE = np.uint64(1)


@kernel(nogil=True)
def cost_of_sets(
    sets: MaskArray, cell: FloatArray, cut_cells: IntArray, cut_times: IntArray, over: IntArray, price: FloatArray
) -> FloatArray:
    """Return ``(m,)`` the price of each set's cells and of the cuts' coefficients in it.

    Parameters
    ----------
    sets
        ``(m, words)`` cells, 64 to a word.
    cell
        ``(n_cells,)`` price of each cell.
    cut_cells, cut_times, over
        ``(n_cuts, size)`` cells of each cut and their multipliers times ``over``; 0 times where a cut has fewer.
    price
        ``(n_cuts,)`` price of each cut.
    """
    m, words = sets.shape
    cost = np.empty(m)
    inside = np.zeros(64 * words, np.int64)
    for r in range(m):
        total = 0.0
        for w in range(words):
            held = sets[r, w]
            while held != _ZERO:
                i = 64 * w + lowest_bit(held)
                inside[i] = 1
                total += cell[i]
                held &= held - _ONE
        for c in range(len(price)):
            times = 0
            for p in range(cut_cells.shape[1]):
                times += cut_times[c, p] * inside[cut_cells[c, p]]
            if times >= over[c]:
                total += price[c] * (times // over[c])
        for w in range(words):
            held = sets[r, w]
            while held != _ZERO:
                inside[64 * w + lowest_bit(held)] = 0
                held &= held - _ONE
        cost[r] = total
    return cost


def price_of_sets(sets: MaskArray, cell: FloatArray) -> FloatArray:
    """Return ``(m,)`` the price of each set's cells.

    Parameters
    ----------
    sets, cell
        See `cost_of_sets`.
    """
    none = np.zeros((0, 1), np.int64)
    return cost_of_sets(sets, cell, none, none, np.zeros(0, np.int64), np.zeros(0))
