"""The linear programme over enumerated routes: priced by looking at them, tightened by cuts that need no memory.

Where a plan better than the incumbent can hold only routes of a known list, so can the columns of the master (Baldacci,
Christofides and Mingozzi 2008; Contardo and Martinelli 2014). New prices prove a smaller bound on the plans of these
routes, and routes that lose more than the bound lies above the incumbent leave the list.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.budget import Standing
from react_opt.solvers.routes.choice import Pool
from react_opt.solvers.routes.columns import Column
from react_opt.solvers.routes.labelstore import MaskArray
from react_opt.solvers.routes.master import Master, MasterPoint
from react_opt.solvers.routes.region import everything
from react_opt.solvers.routes.setcuts import Bits, SetCut, separate_sets

FIRST_COLUMNS, COLUMNS = 400, 60
SMOOTHING = 0.6
EARLY = 0.03  # part of what the programme lies above the incumbent
MOST_CUTS, CUTS_AT_ONCE = 200, 40
WORTH_IT, PATIENCE = 0.03, 3  # share of the gap that a round of cuts has to close, and how often it may fail to
TINY = 1e-6


@dataclass(frozen=True)
class PoolPrices:
    """Prices that prove a bound on the plans of enumerated routes.

    Parameters
    ----------
    bound
        The bound.
    cell, group
        Price of each cell, and the most that a route of each class is worth after prices.
    cuts, price
        Cuts and their prices.
    """

    bound: float
    cell: FloatArray
    group: FloatArray
    cuts: tuple[SetCut, ...]
    price: FloatArray


class PoolProgram:
    """The linear programme over a list of routes.

    Parameters
    ----------
    pool
        The routes.
    first
        Prices to begin with; ``bound`` and ``group`` are of no consequence.
    counts
        Robots of each class.
    must
        ``(n_cells,)`` cells that are collected in any case.
    standing
        The best plan so far and the limits.
    """

    def __init__(
        self,
        pool: Pool,
        first: PoolPrices,
        counts: Sequence[int],
        must: NDArray[np.bool_],
        standing: Standing,
    ) -> None:
        n = len(first.cell)
        self.pool, self.must, self._standing = pool, must, standing
        self._counts = np.array(counts, dtype=np.int64)
        self._inside = inside_of(pool.sets, n)
        self._rows = sp.csr_matrix(self._inside, dtype=np.float64)
        self._master = Master(n, counts, 2.0 * float(np.abs(pool.value).max()) * (1 + sum(counts)) + 1.0)
        self._master.restrict(replace(everything(len(counts), n, 0), must=must))
        self._route: dict[Column, int] = {}  # of each column of the master
        self._add(np.arange(min(FIRST_COLUMNS, len(pool.value))))
        self._add_cuts(first.cuts)
        self._stalled = 0
        self.prices = first
        self.stages: list[PoolPrices] = []  # prices at which routes were dropped
        self._look(first.cell, first.price, np.inf)

    @property
    def cuts(self) -> tuple[SetCut, ...]:
        """Cuts of the programme."""
        return tuple(cut for cut in self._master.cuts if isinstance(cut, SetCut))

    def tighten(self) -> bool:
        """Lower the bound by prices and cuts and drop routes; return whether it is worth while to go on."""
        before, floor = self.prices.bound, self._standing.objective
        point = self._converge()
        if floor is None:
            return False
        if point is None:
            self._drop(self.prices.bound - floor + 1e-7 * max(1.0, abs(floor)))
            return False
        used = np.flatnonzero(point.use > TINY)
        inside = np.zeros((len(used), self._inside.shape[1]), dtype=np.uint8)
        for row, k in enumerate(used.tolist()):
            inside[row, list(self._master.columns[k].cells)] = 1
        gap = self.prices.bound - floor
        self._stalled = 0 if before - self.prices.bound > WORTH_IT * gap else self._stalled + 1
        self._drop(gap + 1e-7 * max(1.0, abs(floor)))
        if gap <= 0.0 or self._stalled == PATIENCE:
            return False
        priced = dict(zip(self._master.cuts, point.duals.cut.tolist(), strict=True))
        cuts = separate_sets(inside, point.use[used], set(self.cuts), CUTS_AT_ONCE)
        if len(self._master.cuts) + len(cuts) > MOST_CUTS:
            # what routes lose is counted at the best prices, so the cuts that have one there stay
            best: dict[object, float] = dict(zip(self.cuts, self._extended()[1].tolist(), strict=True))
            idle = {cut for cut in self._master.cuts if priced[cut] <= TINY and best.get(cut, 0.0) <= 0.0}
            kept = np.flatnonzero([cut not in idle for cut in self._master.cuts])
            n = self._inside.shape[1]
            self._rows = self._rows[:, np.concatenate((np.arange(n), n + kept))]
            self._master.drop_cuts(lambda cut: cut in idle)
        self._add_cuts(cuts[: max(0, MOST_CUTS - len(self._master.cuts))])
        return bool(cuts)

    def _converge(self) -> MasterPoint | None:
        """Solve the linear programme over all routes; None at a limit."""
        floor = self._standing.objective
        centre_cell, centre_cut = self._extended()
        smoothing = SMOOTHING
        while not self._standing.budget.over():
            point = self._master.solve(self._standing.budget.left_s())
            self._standing.budget.spend()
            if point is None:
                return None
            cell = smoothing * centre_cell + (1.0 - smoothing) * point.duals.cell
            cut = smoothing * centre_cut + (1.0 - smoothing) * point.duals.cut
            before = self.prices.bound
            reduced = self._look(cell, cut, before)
            if self.prices.bound < before:
                centre_cell, centre_cut = cell, cut
            above = 0.0 if floor is None else point.value - floor
            if self.prices.bound - point.value <= max(1e-8 * max(1.0, abs(point.value)), EARLY * above):
                return point
            if floor is not None and self._standing.proven(self.prices.bound):
                return point
            true = reduced if smoothing == 0.0 else self._reduced(point.duals.cell, point.duals.cut)
            true = true - point.duals.group[self.pool.group]
            best = np.argpartition(-true, min(COLUMNS, len(true)) - 1)[:COLUMNS]
            if self._add(best[true[best] > 1e-9 * max(1.0, abs(point.value))]) == 0:
                if smoothing == 0.0:
                    return point
                smoothing = 0.0
            else:
                smoothing = SMOOTHING
        return None

    def _look(self, cell: FloatArray, cut: FloatArray, known: float) -> FloatArray:
        """Return value minus prices of all routes; keep the prices if their bound is less than the known one."""
        reduced = self._reduced(cell, cut)
        best = np.full(len(self._counts), -np.inf)
        np.maximum.at(best, self.pool.group, reduced)
        rhs = np.array([one.rhs for one in self._master.cuts])
        bound = float(cell.sum()) + float(cut @ rhs) + float(self._counts @ best)
        if bound < known:
            self.prices = PoolPrices(bound, cell, best, self.cuts, cut)
        return reduced

    def _reduced(self, cell: FloatArray, cut: FloatArray) -> FloatArray:
        reduced: FloatArray = self.pool.value - self._rows @ np.concatenate((cell, cut))
        return reduced

    def loss(self) -> FloatArray:
        """Return what each route loses at the best prices."""
        price = self._extended()[1]
        loss: FloatArray = self.prices.group[self.pool.group] - self._reduced(self.prices.cell, price)
        return loss

    def _extended(self) -> tuple[FloatArray, FloatArray]:
        """Return the best prices of cells and of the cuts that are there now."""
        price = dict(zip(self.prices.cuts, self.prices.price.tolist(), strict=True))
        return self.prices.cell, np.array([price.get(cut, 0.0) for cut in self.cuts])

    def _add(self, routes: IntArray) -> int:
        """Add routes to the master; return how many are new."""
        columns = []
        for r in routes.tolist():
            cells = tuple(np.flatnonzero(self._inside[r]).tolist())
            column = Column(int(self.pool.group[r]), float(self.pool.value[r]), cells, None, (0,) * len(cells))
            self._route[column] = r
            columns.append(column)
        return self._master.add(columns)

    def _add_cuts(self, cuts: Sequence[SetCut]) -> None:
        self._master.add_cuts(cuts)
        more = [sp.csr_matrix(cut.coefficients(self._inside)[:, None].astype(np.float64)) for cut in cuts]
        self._rows = sp.hstack([self._rows, *more], format="csr") if more else self._rows

    def _drop(self, most: float) -> None:
        """Leave out the routes that lose more than ``most`` at the best prices."""
        self.stages.append(self.prices)
        loss = self.loss()
        keep = np.flatnonzero(loss <= most)
        keep = keep[np.argsort(loss[keep], kind="stable")]
        self.pool = Pool(self.pool.value[keep], loss[keep], self.pool.group[keep], self.pool.sets[keep])
        self._inside, self._rows = self._inside[keep], self._rows[keep]
        now = np.full(len(loss), -1)
        now[keep] = np.arange(len(keep))
        self._route = {column: int(now[r]) for column, r in self._route.items() if now[r] >= 0}
        self._master.drop(lambda column: column not in self._route)


def inside_of(sets: MaskArray, n_cells: int) -> Bits:
    """Return ``(m, n_cells)`` 0 or 1: the cells of sets that hold 64 to a word."""
    return np.unpackbits(np.ascontiguousarray(sets).view(np.uint8), axis=1, bitorder="little")[:, :n_cells]
