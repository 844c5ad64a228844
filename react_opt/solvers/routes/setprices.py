"""What sets of cells cost at given prices of cells and of rank-1 cuts."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.labels import lowest_bit
from react_opt.solvers.routes.labelstore import MaskArray
from react_opt.solvers.routes.setcuts import SetCut

FEW = 50_000  # sets that one thread looks at

_ZERO = np.uint64(0)
_ONE = np.uint64(1)
_BYTE = np.uint64(255)
DUE = np.uint64(0x8080808080808080)


class SetPrices(NamedTuple):
    """Prices in the form that kernels read: tables for eight cells at a time, the sums of eight cuts in a word's bytes.

    A cut whose coefficient can be 2 stands there twice, and so on.

    Parameters
    ----------
    cell
        ``(8 words, 256)`` what the cells of each byte of a set cost.
    times
        ``(8 words, 256, w)`` the numerators of these cells added up, one cut to a byte.
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
    paid.sort(key=lambda entry: -entry[2])  # the dearest first: sums that lead to nothing are given up early
    cells, room = 64 * -(-len(cell) // 64), 8 * -(-len(paid) // 8)
    times, short, worths = np.zeros((cells, room), np.uint8), np.zeros(room, np.uint8), np.zeros(room)
    for place, (cut, least, worth) in enumerate(paid):
        times[list(cut.cells), place] = cut.times
        short[place], worths[place] = 128 - least, worth
    each = np.concatenate((cell, np.zeros(cells - len(cell))))
    return SetPrices(*_tables(each, times.view(np.uint64)), short.view(np.uint64), worths)


@kernel(nogil=True)
def _tables(cell: FloatArray, times: MaskArray) -> tuple[FloatArray, MaskArray]:
    """Return the sums of prices and of words over each set of eight cells."""
    of_cell = np.zeros((len(cell) // 8, 256))
    of_times = np.zeros((len(cell) // 8, 256, times.shape[1]), np.uint64)
    for byte in range(len(of_cell)):
        for held in range(1, 256):
            i, others = 8 * byte + lowest_bit(np.uint64(held)), held & (held - 1)
            of_cell[byte, held] = of_cell[byte, others] + cell[i]
            of_times[byte, held] = of_times[byte, others] + times[i]
    return of_cell, of_times


@kernel(inline="always")
def add_up(sets: MaskArray, r: int, prices: SetPrices, sums: MaskArray) -> float:
    """Write the sums of the cuts' numerators in set ``r`` into ``sums``; return what its cells cost.

    A sum is written with what it lacks to 128 where the cut is due.
    """
    for c in range(len(sums)):
        sums[c] = prices.short[c]
    cost, times = 0.0, prices.times
    for w in range(sets.shape[1]):
        left = sets[r, w]
        for b in range(8):
            cost += prices.cell[8 * w + b, np.int64((left >> np.uint64(8 * b)) & _BYTE)]
        for b in range(8):
            held = np.int64((left >> np.uint64(8 * b)) & _BYTE)
            for c in range(len(sums)):  # a view of the row would cost more than the sums
                sums[c] += times[8 * w + b, held, c]
    return cost


@kernel(nogil=True)
def sums_of_sets(sets: MaskArray, prices: SetPrices) -> MaskArray:
    """Return ``(m, w)`` the sums of the cuts' numerators in each set, as of :func:`add_up`.

    Parameters
    ----------
    sets
        ``(m, words)`` cells, 64 to a word.
    prices
        The prices.
    """
    sums, row = np.empty((len(sets), len(prices.short)), np.uint64), np.empty(len(prices.short), np.uint64)
    for r in range(len(sets)):
        add_up(sets, r, prices, row)
        for c in range(len(row)):
            sums[r, c] = row[c]
    return sums


@kernel(nogil=True)
def _costs(sets: MaskArray, prices: SetPrices, cost: FloatArray) -> None:
    sums = np.empty(len(prices.short), np.uint64)
    for r in range(len(sets)):
        total = add_up(sets, r, prices, sums)
        for c in range(len(sums)):
            due = sums[c] & DUE
            while due != _ZERO:
                total += prices.price[8 * c + (lowest_bit(due) >> 3)]
                due &= due - _ONE
        cost[r] = total


def cost_of_sets(sets: MaskArray, prices: SetPrices, threads: int = 1) -> FloatArray:
    """Return ``(m,)`` the price of each set's cells and of the cuts' coefficients in it.

    Parameters
    ----------
    sets
        ``(m, words)`` cells, 64 to a word.
    prices
        The prices.
    threads
        Threads to use.
    """
    cost = np.empty(len(sets))
    if threads == 1 or len(sets) < FEW:
        _costs(sets, prices, cost)
        return cost
    ends = np.linspace(0, len(sets), threads + 1).astype(np.int64).tolist()
    with ThreadPoolExecutor(threads) as executor:
        jobs = [executor.submit(_costs, sets[a:b], prices, cost[a:b]) for a, b in pairwise(ends)]
        for job in jobs:
            job.result()
    return cost


def coefficients_of_sets(sets: MaskArray, cuts: Sequence[SetCut]) -> NDArray[np.uint8]:
    """Return ``(m, n_cuts)`` the coefficient of each cut in each set.

    Parameters
    ----------
    sets
        ``(m, words)`` cells, 64 to a word.
    cuts
        The cuts.
    """
    widest = max((len(cut.cells) for cut in cuts), default=1)
    cells, times = np.zeros((len(cuts), widest), np.int64), np.zeros((len(cuts), widest), np.int64)
    for c, cut in enumerate(cuts):
        cells[c, : len(cut.cells)], times[c, : len(cut.cells)] = cut.cells, cut.times
    return _coefficients(sets, cells, times, np.array([cut.over for cut in cuts], np.int64))


@kernel(nogil=True)
def _coefficients(sets: MaskArray, cells: IntArray, times: IntArray, over: IntArray) -> NDArray[np.uint8]:
    """Return ``(m, n_cuts)`` the numerators of the cells that each set holds, divided by ``over`` and rounded down."""
    found = np.empty((len(sets), len(over)), np.uint8)
    for r in range(len(sets)):
        for c in range(len(over)):
            total = 0
            for p in range(cells.shape[1]):
                i = cells[c, p]
                total += times[c, p] * np.int64((sets[r, i // 64] >> np.uint64(i % 64)) & _ONE)
            found[r, c] = total // over[c]
    return found
