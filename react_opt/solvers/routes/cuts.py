"""Subset-row cuts: of three cells, routes that collect two or more of them may be used once in all.

With x the routes' use and a the number of a subset's cells that a route collects,
``sum floor(a / 2) x <= 1`` holds for every three cells (Jepsen, Petersen, Spoorendonk and Pisinger 2008). In the
limited-memory form (Pecin, Pessoa, Poggi and Uchoa 2017) the count is forgotten outside the cut's memory, which
weakens the coefficient but keeps the pricing fast.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from react_opt.route_problem import FloatArray
from react_opt.solvers.routes.columns import Column, Rank1Cut

LEAST_VIOLATION = 0.02
MOST_PER_CELL = 8


@dataclass(frozen=True)
class SubsetRow:
    """One cut over three cells with multiplier 1/2.

    Parameters
    ----------
    cells
        The three cells.
    memory
        Cells in which a route still remembers that it has collected an odd number of them.
    """

    cells: frozenset[int]
    memory: frozenset[int]

    rhs: float = 1.0

    def coefficients(self, columns: Sequence[Column], counts: FloatArray) -> FloatArray:
        """Return how often each column's route collects two of the cells without forgetting in between."""
        found = np.zeros(len(columns))
        for k in np.flatnonzero(counts[:, list(self.cells)].sum(axis=1) >= 2.0).tolist():
            found[k] = self.coefficient(columns[k])
        return found

    def coefficient(self, column: Column) -> float:
        """Return the same for one column."""
        route = column.path
        odd, times = False, 0
        for cell, senses in zip(route.cell.tolist(), route.sense.tolist(), strict=True):
            if cell < 0:
                continue
            if cell not in self.memory:
                odd = False
            if senses and cell in self.cells:
                times += odd
                odd = not odd
        return float(times)


def separate(
    columns: Sequence[Column], use: FloatArray, n_cells: int, known: Sequence[Rank1Cut], most: int = 20
) -> list[SubsetRow]:
    """Return violated cuts, the most violated first, with the memory that the routes in use need.

    Parameters
    ----------
    columns, use
        Columns of the master and how much each is used.
    n_cells
        Number of cells.
    known
        Cuts that are there already; one over the same cells is returned again only with a larger memory.
    most
        Most cuts returned.
    """
    used = np.flatnonzero(use > 1e-6)
    share = use[used]
    collects = np.zeros((len(used), n_cells))
    for row, k in enumerate(used.tolist()):
        collects[row, list(columns[k].cells)] = 1.0
    fractional = (share < 1.0 - 1e-6) if len(share) else share > 0
    share, collects, used = share[fractional], collects[fractional], used[fractional]
    together = collects.T @ (share[:, None] * collects)
    found: list[tuple[float, tuple[int, int, int]]] = []
    for i in range(n_cells):
        for j in np.flatnonzero(together[i, i + 1 :] > 1e-6) + i + 1:
            all_three = (share * collects[:, i] * collects[:, j]) @ collects
            twice = together[i, j] + together[i] + together[j] - 2.0 * all_three
            for k in np.flatnonzero(twice[j + 1 :] > 1.0 + LEAST_VIOLATION) + j + 1:
                found.append((float(twice[k]), (i, int(j), int(k))))
    # a triple whose third cell pairs with neither of the first two in order is found from another pair
    found.sort(key=lambda entry: (-entry[0], entry[1]))
    held: dict[frozenset[int], frozenset[int]] = {}
    for cut in known:
        if isinstance(cut, SubsetRow):
            held[cut.cells] = held.get(cut.cells, frozenset()) | cut.memory
    cuts: list[SubsetRow] = []
    per_cell = np.zeros(n_cells, dtype=np.int64)
    for _, triple in found:
        cells = frozenset(triple)
        if len(cuts) >= most:
            break
        if per_cell[list(triple)].max() >= MOST_PER_CELL:
            continue
        memory = set(cells) | held.get(cells, frozenset())
        for k in used.tolist():
            memory |= _between(columns[k], cells)
        if cells in held and memory <= held[cells]:
            continue
        per_cell[list(triple)] += 1
        cuts.append(SubsetRow(cells, frozenset(memory)))
    return cuts


def _between(column: Column, cells: frozenset[int]) -> set[int]:
    """Return the cells a route stands in between collecting the first and the last of some cells."""
    route = column.path
    at = [int(p) for p in np.flatnonzero(route.sense) if int(route.cell[p]) in cells]
    if len(at) < 2:
        return set()
    return {int(c) for c in route.cell[at[0] : at[-1] + 1] if c >= 0}
