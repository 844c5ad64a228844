"""Columns of the master: one way to spend one robot, as (group, value, cells collected).

The master, its cuts and its branching know no more than this of a column, so that other problems (the deferred
inspection) can use them with a pricer of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Any, Protocol

import numpy as np

from react_opt.route_problem import FloatArray, IntArray


@dataclass(frozen=True)
class Column:
    """One way to spend one robot.

    Parameters
    ----------
    group
        Class of interchangeable robots that it belongs to.
    value
        What it is worth in the objective.
    cells
        Cells collected in order; a cell collected twice (non-elementary routes) stands there twice.
    path
        The whole route in the pricer's own terms.
    instants
        When each of ``cells`` is collected.
    """

    group: int
    value: float
    cells: tuple[int, ...]
    path: Any = field(compare=False, repr=False, default=None)
    instants: tuple[int, ...] = ()

    @property
    def elementary(self) -> bool:
        """Whether no cell is collected twice."""
        return len(set(self.cells)) == len(self.cells)


@dataclass(frozen=True)
class Priced:
    """What one call of the pricing found.

    Parameters
    ----------
    columns
        Columns, best reduced value first within a group.
    best
        ``(n_groups,)`` for each group a bound from above on value minus prices of every column, the group's own
        multiplier not deducted; None if the call was a heuristic one.
    top
        ``(n_groups,)`` value minus prices of the best column found, minus infinity where none was.
    """

    columns: list[Column]
    best: FloatArray | None
    top: FloatArray


class Rank1Cut(Protocol):
    """A cut whose coefficient in a column is read off the column."""

    @property
    def rhs(self) -> float:
        """Right-hand side of ``sum coefficient * use <= rhs``."""
        ...

    def coefficients(self, columns: Sequence[Column], counts: FloatArray) -> FloatArray:
        """Return the cut's coefficient in each column; ``counts`` is ``(m, n_cells)`` how often it collects a cell."""
        ...


@dataclass(frozen=True)
class Duals:
    """Multipliers of the master, not negative but for ``group`` and cells that have to be collected.

    Parameters
    ----------
    cell
        ``(n_cells,)`` price of collecting a cell.
    group
        ``(n_groups,)`` multiplier of using one robot of a group.
    cut
        ``(n_cuts,)`` price of each cut.
    row
        ``(n_rows,)`` price of each further row (coupling limits, branching).
    """

    cell: FloatArray
    group: FloatArray
    cut: FloatArray
    row: FloatArray


def counted(cells: tuple[int, ...]) -> tuple[IntArray, FloatArray]:
    """Return the distinct cells of a column and how often each is collected."""
    distinct, times = np.unique(np.array(cells, dtype=np.int64), return_counts=True)
    return distinct, times.astype(np.float64)


def coefficients(rows: Sequence[Rank1Cut], columns: Sequence[Column], n_cells: int) -> FloatArray:
    """Return ``(len(rows), len(columns))`` the coefficients of cuts and side rows.

    Parameters
    ----------
    rows, columns, n_cells
        The rows, the columns and the number of cells.
    """
    counts = np.zeros((len(columns), n_cells))
    owner = np.repeat(np.arange(len(columns)), [len(column.cells) for column in columns])
    np.add.at(counts, (owner, np.fromiter(chain.from_iterable(column.cells for column in columns), np.int64)), 1.0)
    found = np.zeros((len(rows), len(columns)))
    for k, row in enumerate(rows):
        found[k] = row.coefficients(columns, counts)
    return found
