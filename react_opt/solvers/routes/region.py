"""Parts of the set of plans that branching looks at: when each class may collect each cell, and what must be collected.

A split at (cell, instant) divides the plans into those that collect the cell by that instant and the others. Both
sides only change the instants at which collecting earns something, so the pricing stays the same dynamic programme.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.route_problem import IntArray
from react_opt.solvers.routes.columns import Column


@dataclass(frozen=True)
class Split:
    """A question with two answers about a cell: collected by an instant, or collected by a class?

    Parameters
    ----------
    cell
        The cell.
    by
        Instant: yes means collected then or before. None if the question is about a class.
    group
        Class of robots: yes means collected by one of them. Used where ``by`` is None.
    """

    cell: int
    by: int | None = None
    group: int = -1


@dataclass(frozen=True)
class Region:
    """Plans that collect cells in given windows of time only, and certain cells in any case.

    Parameters
    ----------
    first, last
        ``(n_classes, n_cells)`` instants between which a class may collect a cell.
    must
        ``(n_cells,)`` whether the cell is collected.
    """

    first: IntArray
    last: IntArray
    must: NDArray[np.bool_]

    def side(self, split: Split, yes: bool) -> Region:
        """Return the plans of this region that answer a question with yes (or no)."""
        first, last, must = self.first.copy(), self.last.copy(), self.must
        i = split.cell
        if yes:
            must = must.copy()
            must[i] = True
        if split.by is None:
            others = np.arange(len(first)) != split.group
            last[others if yes else ~others, i] = -1
        elif yes:
            last[:, i] = np.minimum(last[:, i], split.by)
        else:
            first[:, i] = np.maximum(first[:, i], split.by + 1)
        return replace(self, first=first, last=last, must=must)

    def allowed(self, columns: Sequence[Column]) -> NDArray[np.bool_]:
        """Return for each column whether it collects within the windows."""
        return self.allowed_of(collections_of(columns))

    def allowed_of(self, what: Collections) -> NDArray[np.bool_]:
        """Return the same from the columns' collections."""
        within = self.first[what.group, what.cell] <= what.instant
        within &= what.instant <= self.last[what.group, what.cell]
        allowed = np.ones(what.columns, np.bool_)
        allowed[what.owner[~within]] = False
        return allowed


class Collections(NamedTuple):
    """Everything that so many ``columns`` collect: the column, its class, the cell and the instant."""

    columns: int
    owner: IntArray
    group: IntArray
    cell: IntArray
    instant: IntArray


def collections_of(columns: Sequence[Column]) -> Collections:
    """Return what columns collect."""
    sizes = np.array([len(column.cells) for column in columns], dtype=np.int64)
    owner = np.repeat(np.arange(len(columns)), sizes)
    group = np.array([column.group for column in columns], dtype=np.int64)
    cell = np.fromiter(chain.from_iterable(column.cells for column in columns), np.int64, int(sizes.sum()))
    instant = np.fromiter(chain.from_iterable(column.instants for column in columns), np.int64, int(sizes.sum()))
    return Collections(len(columns), owner, group[owner], cell, instant)


def everything(n_classes: int, n_cells: int, horizon: int) -> Region:
    """Return the region of all plans.

    Parameters
    ----------
    n_classes, n_cells, horizon
        Sizes of the problem.
    """
    shape = (n_classes, n_cells)
    return Region(np.zeros(shape, np.int64), np.full(shape, horizon, np.int64), np.zeros(n_cells, np.bool_))
