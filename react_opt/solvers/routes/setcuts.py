"""Rank-1 cuts over whole sets of cells, for routes that have been enumerated.

The rows "each cell once", multiplied by p_i and added up, are rounded down: ``sum_r floor(sum_i p_i a_ir) x_r <=
floor(sum_i p_i)`` (Chvatal-Gomory). Of three to five rows the multipliers below give all cuts that no others of their
size dominate (Pecin, Pessoa, Poggi, Uchoa and Santos 2017). What a route has collected is known, so the cuts need no
memory and cost a look at the routes only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.columns import Column

Bits = NDArray[np.uint8]

MULTIPLIERS = (
    ((1, 1, 1), 2),
    ((2, 1, 1, 1), 3),
    ((1, 1, 1, 1, 1), 3),
    ((2, 2, 1, 1, 1), 4),
    ((3, 1, 1, 1, 1), 4),
    ((3, 2, 2, 1, 1), 5),
    ((1, 1, 1, 1, 1), 2),
    ((2, 2, 1, 1, 1), 3),
    ((3, 3, 2, 2, 1), 4),
)
LEAST_VIOLATION = 0.02
MOST_PER_CELL = 12
SEEDS = 300  # sets of cells to which one more is added


@dataclass(frozen=True)
class SetCut:
    """One cut with multipliers ``times / over``.

    Parameters
    ----------
    cells
        Its cells.
    times, over
        Numerator for each of the cells, and the denominator of all.
    """

    cells: tuple[int, ...]
    times: tuple[int, ...]
    over: int

    @property
    def rhs(self) -> float:
        """Right-hand side."""
        return float(sum(self.times) // self.over)

    def coefficients(self, columns: Sequence[Column], counts: FloatArray) -> FloatArray:
        """Return its coefficient in each column that collects no cell twice, see `Rank1Cut`."""
        total: FloatArray = counts[:, list(self.cells)] @ np.array(self.times, dtype=np.float64)
        return total // self.over


@dataclass(frozen=True)
class _Family:
    """Cuts of one size: multipliers in every order, and the coefficient of each subset of the cells as a bit mask."""

    times: list[tuple[tuple[int, ...], int]]
    coefficient: FloatArray
    rhs: FloatArray


def _family(size: int) -> _Family:
    times = sorted(
        {(order, over) for times, over in MULTIPLIERS if len(times) == size for order in permutations(times)}
    )
    inside = (np.arange(2**size)[:, None] >> np.arange(size)) & 1
    coefficient = np.array([(inside @ np.array(order)) // over for order, over in times], dtype=np.float64)
    return _Family(times, coefficient, np.array([sum(order) // over for order, over in times], dtype=np.float64))


_FAMILIES = {size: _family(size) for size in (3, 4, 5)}


@kernel(nogil=True)
def _violations(
    inside: Bits, share: FloatArray, seeds: IntArray, coefficient: FloatArray, rhs: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Return for each seed and each further cell the largest violation, and the multipliers that have it."""
    n_seeds, size = seeds.shape
    n = inside.shape[1]
    worst = np.full((n_seeds, n), -np.inf)
    which = np.zeros((n_seeds, n), np.int64)
    mask = np.empty(len(share), np.int64)
    weight = np.empty(2 ** (size + 1))
    for s in range(n_seeds):
        for r in range(len(share)):
            mask[r] = 0
            for p in range(size):
                mask[r] |= np.int64(inside[r, seeds[s, p]]) << p
        for cell in range(n):
            known = False
            for p in range(size):
                known |= seeds[s, p] == cell
            if known:
                continue
            weight[:] = 0.0
            for r in range(len(share)):
                weight[mask[r] | (np.int64(inside[r, cell]) << size)] += share[r]
            for p in range(len(rhs)):
                total = -rhs[p]
                for m in range(len(weight)):
                    total += coefficient[p, m] * weight[m]
                if total > worst[s, cell]:
                    worst[s, cell] = total
                    which[s, cell] = p
    return worst, which


def separate_sets(inside: Bits, share: FloatArray, known: set[SetCut], most: int) -> list[SetCut]:
    """Return violated cuts over three to five cells, the most violated first; those of more cells by greedy growth.

    Parameters
    ----------
    inside
        ``(m, n_cells)`` 0 or 1, what each route in use collects.
    share
        ``(m,)`` how much each is used.
    known
        Cuts that are there already.
    most
        Most cuts returned.
    """
    n = inside.shape[1]
    i, j = np.triu_indices(n, 1)
    weighted = inside * share[:, None]
    seeds = np.stack([i, j], axis=1)[(weighted.T @ inside)[i, j] > LEAST_VIOLATION].astype(np.int64)
    found: list[tuple[float, SetCut]] = []
    for family in _FAMILIES.values():
        if len(seeds) == 0:
            break
        worst, which = _violations(inside, share, seeds, family.coefficient, family.rhs)
        order = np.argsort(-worst, axis=None, kind="stable")[: 8 * SEEDS]
        grown: dict[frozenset[int], list[int]] = {}
        for at in order.tolist():
            s, cell = divmod(at, n)
            cells = [*seeds[s].tolist(), cell]
            if worst[s, cell] == -np.inf or frozenset(cells) in grown:
                continue
            grown[frozenset(cells)] = cells
            if worst[s, cell] > LEAST_VIOLATION:
                times, over = family.times[which[s, cell]]
                pairs = sorted(zip(cells, times, strict=True))
                cut = SetCut(tuple(cell for cell, _ in pairs), tuple(time for _, time in pairs), over)
                found.append((float(worst[s, cell]), cut))
        seeds = np.array(list(grown.values())[:SEEDS], dtype=np.int64).reshape(-1, seeds.shape[1] + 1)
    found.sort(key=lambda entry: (-entry[0], entry[1].cells))
    cuts: list[SetCut] = []
    per_cell = np.zeros(n, dtype=np.int64)
    for _, cut in found:
        if len(cuts) == most:
            break
        if cut not in known and per_cell[list(cut.cells)].max() < MOST_PER_CELL:
            per_cell[list(cut.cells)] += 1
            cuts.append(cut)
    return cuts
