"""The linear programme over enumerated routes: priced by looking at them, tightened by cuts that need no memory.

Where a plan better than the incumbent can hold only routes of a known list, so can the columns of the master (Baldacci,
Christofides and Mingozzi 2008; Contardo and Martinelli 2014). New prices prove a smaller bound on the plans of these
routes, and routes that lose more than the bound lies above the incumbent leave the list.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.budget import Standing
from react_opt.solvers.routes.choice import Pool
from react_opt.solvers.routes.columns import Column
from react_opt.solvers.routes.labelstore import MaskArray
from react_opt.solvers.routes.master import Master, MasterPoint
from react_opt.solvers.routes.region import everything
from react_opt.solvers.routes.setcuts import Bits, SetCut, separate_sets
from react_opt.solvers.routes.setprices import coefficients_of_sets, cost_of_sets, set_prices

FIRST_COLUMNS, COLUMNS = 400, 320
MOST_COLUMNS = 6000  # then half of them are dropped
ACTIVE = 20_000  # routes that are priced each time; all others only when these do not help any more
OTHERS = 10_000  # routes that are priced besides, from all over the list: without them prices go astray
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
        Prices to begin with, at which all routes that a better plan can contain have been listed if ``whole``;
        ``bound`` and ``group`` are of no consequence.
    counts
        Robots of each class.
    must
        ``(n_cells,)`` cells that are collected in any case.
    standing
        The best plan so far and the limits.
    threads
        Threads for HiGHS, as many as in the master of the column generation: its scheduler serves one number only.
    whole
        Whether no route is missing. If some are, the bound holds for plans of these routes only.
    """

    def __init__(
        self,
        pool: Pool,
        first: PoolPrices,
        counts: Sequence[int],
        must: NDArray[np.bool_],
        standing: Standing,
        threads: int = 1,
        *,
        whole: bool = True,
    ) -> None:
        n = len(first.cell)
        self.pool, self.must, self._standing, self._whole = pool, must, standing, whole
        self._counts, self._threads = np.array(counts, dtype=np.int64), threads
        self._master = Master(n, counts, 2.0 * float(np.abs(pool.value).max()) * (1 + sum(counts)) + 1.0, threads)
        self._master.restrict(replace(everything(len(counts), n, 0), must=must))
        self._add(np.arange(min(FIRST_COLUMNS, len(pool.value))))
        self._master.add_cuts(first.cuts)
        self._active = self._first()
        self._stalled = 0
        self._rows: tuple[IntArray, tuple[SetCut, ...], csr_array] | None = None
        self.prices = first
        self.stages = [first] if whole else []  # prices at which routes were dropped, or were not listed
        self._look(first.cell, first.price, np.inf)

    def renew(self, pool: Pool, prices: PoolPrices, *, whole: bool) -> None:
        """Go on with another list.

        Parameters
        ----------
        pool
            The routes, with what they lose at these prices if ``whole``.
        prices
            Prices with a bound that holds whatever routes are missing, and the most that a route of each class is worth
            among all. They are what new prices are pulled towards.
        whole
            Whether no route is missing that a plan better than the incumbent can contain.
        """
        self.pool, self.prices, self._whole, self._stalled = pool, prices, whole, 0
        if whole:
            self.stages.append(prices)
            self._active = self._first()
            self._forget(self._most_lost())
        else:
            # other routes lose too much to be part of a better plan
            loss = prices.group[pool.group] - self._look(*self._extended(), np.inf)
            order = np.argsort(loss, kind="stable")
            order = order[loss[order] <= self._most_lost()]
            self.pool = Pool(pool.value[order], loss[order], pool.group[order], pool.sets[order])
            self._active = self._first()

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
            self._drop()
            return False
        used = np.flatnonzero(point.use > TINY)
        inside = np.zeros((len(used), len(self.must)), dtype=np.uint8)
        for row, k in enumerate(used.tolist()):
            inside[row, list(self._master.columns[k].cells)] = 1
        gap = self.prices.bound - floor
        self._stalled = 0 if before - self.prices.bound > WORTH_IT * gap else self._stalled + 1
        self._drop()
        if gap <= 0.0 or self._stalled == PATIENCE:
            return False
        priced = dict(zip(self._master.cuts, point.duals.cut.tolist(), strict=True))
        cuts = separate_sets(inside, point.use[used], set(self.cuts), CUTS_AT_ONCE)
        if len(self._master.cuts) + len(cuts) > MOST_CUTS:
            # what routes lose is counted at the best prices, so the cuts that have one there stay
            best: dict[object, float] = dict(zip(self.cuts, self._extended()[1].tolist(), strict=True))
            idle = {cut for cut in self._master.cuts if priced[cut] <= TINY and best.get(cut, 0.0) <= 0.0}
            self._master.drop_cuts(lambda cut: cut in idle)
        self._master.add_cuts(cuts[: max(0, MOST_CUTS - len(self._master.cuts))])
        return bool(cuts)

    def _converge(self) -> MasterPoint | None:
        """Solve the linear programme over all routes, those of least loss first; None at a limit."""
        while True:
            found = self._converge_over(self._active)
            if found is None:
                return None
            point, cell, cut, closed = found
            if len(self._active) == len(self.pool.value):
                return point
            reduced = self._look(cell, cut, self.prices.bound)
            if closed or self.prices.bound - point.value <= self._precision(point):
                return point
            top = np.full(len(self._counts), -np.inf)
            np.maximum.at(top, self.pool.group[self._active], reduced[self._active])
            better = reduced - top[self.pool.group]
            more = np.argpartition(-better, min(ACTIVE, len(better)) - 1)[:ACTIVE]
            more = np.setdiff1d(more[better[more] > 0.0], self._active)
            if len(more) == 0:
                return point
            self._active = np.concatenate((self._active, more))

    def _precision(self, point: MasterPoint) -> float:
        """How far a bound may lie above the linear programme."""
        floor = self._standing.objective
        return max(1e-8 * max(1.0, abs(point.value)), EARLY * (0.0 if floor is None else point.value - floor))

    def _converge_over(self, active: IntArray) -> tuple[MasterPoint, FloatArray, FloatArray, bool] | None:
        """Solve the linear programme over some routes; its point, the best prices, and whether they prove the plan."""
        whole, best = len(active) == len(self.pool.value), np.inf
        best_cell, best_cut = self._extended()
        centre_cell, centre_cut, smoothing = best_cell, best_cut, SMOOTHING
        group = self.pool.group[active]
        while not self._standing.budget.over():
            point = self._master.solve(self._standing.budget.left_s())
            self._standing.budget.spend()
            if point is None:
                return None
            cell = smoothing * centre_cell + (1.0 - smoothing) * point.duals.cell
            cut = smoothing * centre_cut + (1.0 - smoothing) * point.duals.cut
            if whole:
                best = self.prices.bound
                reduced = self._look(cell, cut, best)
                bound = self.prices.bound
            else:
                reduced = self._reduced(cell, cut, active)
                bound = min(best, self._bound(cell, cut, reduced, group)[0])
            if bound < best:
                best, best_cell, best_cut = bound, cell, cut
                centre_cell, centre_cut = cell, cut
            if whole and self._standing.proven(self.prices.bound):
                return point, best_cell, best_cut, True
            if bound - point.value <= self._precision(point):
                return point, best_cell, best_cut, False
            true = reduced if smoothing == 0.0 else self._reduced(point.duals.cell, point.duals.cut, active)
            true = true - point.duals.group[group]
            first = np.argpartition(-true, min(COLUMNS, len(true)) - 1)[:COLUMNS]
            if self._add(active[first[true[first] > 1e-9 * max(1.0, abs(point.value))]]) == 0:
                if smoothing == 0.0:
                    return point, best_cell, best_cut, False
                smoothing = 0.0
            else:
                smoothing = SMOOTHING
            if len(self._master.columns) > MOST_COLUMNS:  # the point is of no use afterwards
                self._master.keep_best(point, MOST_COLUMNS // 2)
        return None

    def _look(self, cell: FloatArray, cut: FloatArray, known: float) -> FloatArray:
        """Return value minus prices of all routes; keep the prices if their bound is less than the known one."""
        reduced = self._reduced(cell, cut)
        bound, best = self._bound(cell, cut, reduced, self.pool.group)
        if bound < known:
            self.prices = PoolPrices(bound, cell, best, self.cuts, cut)
        return reduced

    def _bound(
        self, cell: FloatArray, cut: FloatArray, reduced: FloatArray, group: IntArray
    ) -> tuple[float, FloatArray]:
        """Return the bound on the plans of some routes, and the most that one of each class is worth after prices."""
        best = np.full(len(self._counts), -np.inf)
        np.maximum.at(best, group, reduced)
        rhs = np.array([one.rhs for one in self._master.cuts])
        return float(cell.sum()) + float(cut @ rhs) + float(self._counts @ best), best

    def _reduced(self, cell: FloatArray, cut: FloatArray, active: IntArray | None = None) -> FloatArray:
        """Return value minus prices of some routes, all by default."""
        if active is None or len(active) == len(self.pool.value):
            form = set_prices(cell, self.cuts, cut)
            reduced: FloatArray = self.pool.value - cost_of_sets(self.pool.sets, form, self._threads)
            return reduced
        if self._rows is None or self._rows[0] is not active or self._rows[1] != self.cuts:
            sets = self.pool.sets[active]
            rows = np.hstack((inside_of(sets, len(cell)), coefficients_of_sets(sets, self.cuts)))
            self._rows = active, self.cuts, csr_array(rows, dtype=np.float64)
        some: FloatArray = self.pool.value[active] - self._rows[2] @ np.concatenate((cell, cut))
        return some

    def loss(self) -> FloatArray:
        """Return what each route loses at the best prices."""
        price = self._extended()[1]
        loss: FloatArray = self.prices.group[self.pool.group] - self._reduced(self.prices.cell, price)
        return loss

    def _extended(self) -> tuple[FloatArray, FloatArray]:
        """Return the best prices of cells and of the cuts that are there now."""
        price = dict(zip(self.prices.cuts, self.prices.price.tolist(), strict=True))
        return self.prices.cell, np.array([price.get(cut, 0.0) for cut in self.cuts])

    def _first(self) -> IntArray:
        """Return the routes that lose least, at least one of each class, and some of all the others."""
        size = len(self.pool.group)
        best = np.unique(self.pool.group, return_index=True)[1]
        others = np.linspace(0, max(0, size - 1), min(size, OTHERS)).astype(np.int64)
        return np.unique(np.concatenate((np.arange(min(ACTIVE, size)), best, others)))

    def _add(self, routes: IntArray) -> int:
        """Add routes to the master; return how many are new."""
        columns = []
        for r, inside in zip(routes.tolist(), inside_of(self.pool.sets[routes], len(self.must)), strict=True):
            cells = tuple(np.flatnonzero(inside).tolist())
            columns.append(Column(int(self.pool.group[r]), float(self.pool.value[r]), cells, None, (0,) * len(cells)))
        return self._master.add(columns)

    def _most_lost(self) -> float:
        """What a route of a plan better than the incumbent can lose at the best prices."""
        floor = self._standing.objective
        return np.inf if floor is None else self.prices.bound - floor + 1e-7 * max(1.0, abs(floor))

    def _drop(self) -> None:
        """Leave out the routes that lose more than those of a better plan at the best prices."""
        if not self._whole:
            return
        self.stages.append(self.prices)
        loss = self.loss()
        keep = np.flatnonzero(loss <= self._most_lost())
        keep = keep[np.argsort(loss[keep], kind="stable")]
        self.pool = Pool(self.pool.value[keep], loss[keep], self.pool.group[keep], self.pool.sets[keep])
        self._active = self._first()
        self._forget(self._most_lost())

    def _forget(self, most: float) -> None:
        """Drop columns of the master that lose more than ``most`` at the best prices."""
        columns, (cell, price) = self._master.columns, self._extended()
        value = np.array([column.value for column in columns], dtype=np.float64)
        group = np.array([column.group for column in columns], dtype=np.int64)
        sets = sets_of([column.cells for column in columns], len(cell))
        reduced = value - cost_of_sets(sets, set_prices(cell, self.cuts, price))
        gone = {id(columns[k]) for k in np.flatnonzero(self.prices.group[group] - reduced > most).tolist()}
        self._master.drop(lambda column: id(column) in gone)


def sets_of(cells: Sequence[tuple[int, ...]], n_cells: int) -> MaskArray:
    """Return ``(m, words)``: sets of cells, 64 to a word."""
    inside = np.zeros((len(cells), 64 * (-(-n_cells // 64))), dtype=np.uint8)
    for row, held in enumerate(cells):
        inside[row, list(held)] = 1
    return np.packbits(inside, axis=1, bitorder="little").view(np.uint64)


def inside_of(sets: MaskArray, n_cells: int) -> Bits:
    """Return ``(m, n_cells)`` 0 or 1: the cells of sets that hold 64 to a word."""
    words = np.ascontiguousarray(sets).view(np.uint8).reshape(len(sets), 8 * sets.shape[1])
    return np.unpackbits(words, axis=1, bitorder="little")[:, :n_cells]
