"""Beginnings and rests of routes: what they are, which of them can be part of a route that is worth enough."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.labels import lowest_bit
from react_opt.solvers.routes.labelstore import MaskArray

_ZERO = np.uint64(0)
_ONE = np.uint64(1)


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


@kernel(nogil=True)
def promising(ahead: Half, behind: Half, seam: Seam, least: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which labels may be part of a route that is worth enough: with the best partner, whatever it collects.

    Parameters
    ----------
    ahead, behind, seam
        As for :func:`join_sets`, in any order within a cell and instant.
    least
        Least value minus prices of a route.
    """
    n, last = len(seam.out_start) - 1, len(seam.idle_end) - 1
    until = (len(ahead.start) - 1) // n - 1
    top = np.full(len(ahead.start) - 1, -np.inf)
    for node in range(len(top)):
        for k in range(ahead.start[node], ahead.start[node + 1]):
            top[node] = max(top[node], ahead.value[k])
    other_top = np.full(len(behind.start) - 1, -np.inf)
    for node in range(len(other_top)):
        for k in range(behind.start[node], behind.start[node + 1]):
            other_top[node] = max(other_top[node], behind.value[k])
    other_best = np.full(len(other_top), -np.inf)
    here, there = np.zeros(len(ahead.value), np.bool_), np.zeros(len(behind.value), np.bool_)
    for t in range(until + 1):
        for i in range(n):
            node = t * n + i
            best = -np.inf
            for place in range(-1, seam.out_start[i + 1] - seam.out_start[i]):
                to, arrival, worth = i, t + 1, -seam.wait_cost
                if place >= 0:
                    arc = seam.out_start[i] + place
                    to, arrival, worth = seam.arc_to[arc], t + seam.arc_steps[arc], -seam.arc_cost[arc]
                if arrival <= until or arrival > last:
                    continue
                other = (last - arrival) * n + to
                best = max(best, worth + other_top[other])
                other_best[other] = max(other_best[other], worth + top[node])
            for k in range(ahead.start[node], ahead.start[node + 1]):
                here[k] = ahead.value[k] + (max(best, seam.idle_end[t, i]) if ahead.last[k] else best) >= least
    for node in range(len(other_best)):
        for k in range(behind.start[node], behind.start[node + 1]):
            there[k] = behind.value[k] + other_best[node] >= least
    return here, there


@kernel(nogil=True)
def rests_of_cells(start: IntArray, sets: MaskArray) -> tuple[IntArray, MaskArray]:
    """Return which rests of each cell and instant hold each cell, 64 rests to a word, and where a node's words begin.

    Parameters
    ----------
    start, sets
        Of the rests, see `Half`.
    """
    words = sets.shape[1]
    first = np.zeros(len(start), np.int64)
    for node in range(len(start) - 1):
        first[node + 1] = first[node] + 64 * words * ((start[node + 1] - start[node] + 63) // 64)
    holds = np.zeros(first[-1], np.uint64)
    for node in range(len(start) - 1):
        wide = (start[node + 1] - start[node] + 63) // 64
        for k in range(start[node], start[node + 1]):
            at, bit = first[node] + (k - start[node]) // 64, _ONE << np.uint64((k - start[node]) % 64)
            for w in range(words):
                left = sets[k, w]
                while left != _ZERO:
                    holds[at + wide * (64 * w + lowest_bit(left))] |= bit
                    left &= left - _ONE
    return first, holds
