"""What the labelling kernels read and write: the graph, prices, energy, and the labels themselves, as flat arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.route_problem import FloatArray, IntArray

MaskArray = NDArray[np.uint64]
SmallInts = NDArray[np.int32]

NEVER = -1e300
WAIT = -1
ORIGIN = -2


class Graph(NamedTuple):
    """Arcs in one direction of time, grouped by the cell they enter, and what each cell remembers.

    Parameters
    ----------
    in_start, in_from, in_steps, in_arc
        Arcs that enter cell j are ``in_start[j]:in_start[j + 1]``; ``in_arc`` is their index in the problem.
    in_keep
        Mask of the colours that survive each of these arcs.
    bit
        Colour of each cell, as a mask of one bit.
    cell_of, steps_to
        ``(n_cells, 64)``: the cell that a colour means when remembered in cell j (-1: none), and the fewest
        steps from j to it.
    """

    in_start: IntArray
    in_from: IntArray
    in_steps: IntArray
    in_arc: IntArray
    in_keep: MaskArray
    bit: MaskArray
    cell_of: SmallInts
    steps_to: SmallInts


class Prices(NamedTuple):
    """What everything is worth in one direction of time, indexed by kernel time.

    Parameters
    ----------
    gain
        ``(H + 1, n)`` value of collecting cell i at tau, prices deducted.
    best_gain
        ``(H + 2, n)`` most that collecting cell i at tau or later can be worth, at least 0.
    stand
        ``(H + 1, n)`` price of standing in cell i at tau, or ``(1, 1)`` zeros where there is none.
    arc_cost
        ``(n_arcs,)`` cost of an arc; ``wait_cost`` the cost of one waiting step.
    cut_of, cut_keep, cut_price
        Cuts that each cell belongs to, cuts whose state survives in each cell, price of each cut.
    """

    gain: FloatArray
    best_gain: FloatArray
    stand: FloatArray
    arc_cost: FloatArray
    wait_cost: float
    cut_of: MaskArray
    cut_keep: MaskArray
    cut_price: FloatArray


class Fuel(NamedTuple):
    """The battery as a resource of the labels, J; ``budget`` infinite where it cannot bind.

    ``least`` is ``(H + 1, n)``: the least energy with which a route is completed from here, J, and ``spent`` that with
    which it is brought here where it collects nothing on the way. ``rate`` are the prices of a joule, first 0, at which
    the rest of a route has been bounded.
    """

    budget: float
    arc: FloatArray
    wait: float
    sense: float
    least: FloatArray
    spent: FloatArray
    rate: FloatArray


class Labels(NamedTuple):
    """Labels of one pass: those of cell i at tau are ``start[tau * n + i] : start[tau * n + i + 1]``.

    Within a cell and instant they are sorted by falling value. ``parent`` is the label it came from, ``arc``
    the arc taken (``WAIT``, ``ORIGIN``), ``sensed`` whether the cell was collected on arrival.
    """

    start: IntArray
    value: FloatArray
    memory: MaskArray
    cuts: MaskArray
    fuel: FloatArray
    parent: IntArray
    arc: IntArray
    sensed: NDArray[np.bool_]


def no_labels() -> Labels:
    """Return labels of length 0."""
    none = np.zeros(0, dtype=np.int64)
    bits: NDArray[np.uint64] = np.zeros(0, dtype=np.uint64)
    return Labels(np.zeros(1, dtype=np.int64), np.zeros(0), bits, bits, np.zeros(0), none, none, np.zeros(0, np.bool_))
