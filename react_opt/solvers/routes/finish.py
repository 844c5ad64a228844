"""Closing a gap by enumeration: all routes that a better plan can contain, and the best choice among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.route_problem import FloatArray
from react_opt.solvers.routes.budget import Standing
from react_opt.solvers.routes.choice import Pool, best_choice
from react_opt.solvers.routes.columns import Duals, Rank1Cut
from react_opt.solvers.routes.cuts import SubsetRow
from react_opt.solvers.routes.enumeration import Enumeration, enumerate_routes
from react_opt.solvers.routes.generation import Generation, Multipliers
from react_opt.solvers.routes.pool import CUTS_AT_ONCE, TINY, WORTH_IT, PoolPrices, PoolProgram
from react_opt.solvers.routes.setcuts import SetCut, separate_sets
from react_opt.solvers.routes.setprices import set_prices

EASIER = 0.85  # share of the last hopeless gap at which it is tried again
LEAST, MOST = 400_000, 6_000_000  # labels of each direction; in between twice as many as labels priced so far
MOST_ROUTES = 300_000  # in the linear programme
PATIENCE = 5  # looks at all routes that may fail to lower the bound by so much of the gap
FIRST_WORK, MOST_WORK = 400_000_000, 2_000_000_000  # looks at routes when choosing among them: one second, or some
SHORTER = 0.7  # share of the list of the last choice that was given up at which it is tried again


class Finished(NamedTuple):
    """A bound on a region's plans, and the prices over enumerated routes that it rests on, one after the other."""

    bound: float
    stages: tuple[PoolPrices, ...] = ()


class _Listed(NamedTuple):
    """Routes that lose least at some prices, the bound that these prove, and whether no route is missing."""

    pool: Pool
    prices: PoolPrices
    whole: bool


class Finish:
    """Enumerates and chooses where few routes are left.

    Parameters
    ----------
    generation
        The column generation with its region.
    standing
        The best plan so far and the limits.
    threads
        Threads to use.
    """

    def __init__(self, generation: Generation, standing: Standing, threads: int = 1) -> None:
        self.generation, self.standing, self.threads = generation, standing, threads
        problem = generation.pricer.problem
        # with limits between robots a worse route with the same cells can be of use; chargers are not enumerated
        self._coupled = (
            problem.forbid_swaps or problem.robots_per_cell is not None or problem.sensing_robots_per_step is not None
        ) or bool(problem.charger_j.any())
        self.routes = 0  # enumerated in the attempts that succeeded
        self._hopeless_gap = np.inf

    def bound(self, best: Multipliers, *, anew: bool = False) -> Finished | None:
        """Return the bound of the region looked at after enumeration; None if there are too many routes.

        What is not enumerated cannot beat the incumbent, so the bound is that of the routes enumerated or the
        incumbent, whichever is larger. Better plans found are offered.

        Parameters
        ----------
        best
            Multipliers of the region.
        anew
            Try even where the last attempt failed at a gap not much larger.
        """
        standing, master = self.standing, self.generation.master
        if standing.objective is None or self._coupled:
            return None
        gap = best.bound - standing.objective + 1e-7 * max(1.0, abs(best.bound))
        if gap > self._hopeless_gap and not anew:
            return None
        pricer, floor = self.generation.pricer, standing.objective
        words = -(-pricer.problem.n_cells // 64)
        most = min(MOST, max(LEAST, 2 * pricer.labels)) // max(1, words // 2)  # sets of many cells are large
        duals = self.generation.extended(best)
        found: list[Enumeration] = []
        for group in range(len(master.counts)):
            with standing.budget.alone():
                routes = enumerate_routes(
                    pricer,
                    group,
                    duals,
                    float(duals.group[group]) - gap,
                    self.generation.side,
                    master.cuts,
                    max_labels=most,
                    threads=self.threads,
                )
            standing.budget.spend()
            if routes is None:
                self._hopeless_gap = self._hopeless_gap if anew else EASIER * gap
                return None
            found.append(routes)
        finished, complete = self._choose(found, duals, gap)
        if not complete:
            self._hopeless_gap = self._hopeless_gap if anew else EASIER * gap
        return finished._replace(bound=max(finished.bound, floor))

    def _choose(self, found: list[Enumeration], duals: Duals, gap: float) -> tuple[Finished, bool]:
        """Offer the best choice of routes; return the most that a choice is worth and whether that is certain.

        Between attempts to choose, a linear programme over the routes enumerated leaves fewer of them.
        """
        standing, counts = self.standing, np.array(self.generation.master.counts, dtype=np.int64)
        region = self.generation.side.region
        must = np.zeros(len(duals.cell), np.bool_) if region is None else region.must
        listed = self._look(found, _set_prices(duals, self.generation.master.cuts), duals.group - gap)
        if listed is None:
            return Finished(np.inf), False
        pool, prices, whole = listed
        if len(np.unique(pool.group)) < len(counts):
            return Finished(standing.objective or 0.0), True
        if whole:
            self.routes += len(pool.value)
            worth, going = self._best_of(pool, prices, must, FIRST_WORK, found)
            if not going:
                return Finished(worth), True
        more_cuts = self._violated(set(prices.cuts))
        cuts, price = (*prices.cuts, *more_cuts), np.concatenate((prices.price, np.zeros(len(more_cuts))))
        first = replace(prices, cuts=cuts, price=price)
        program = PoolProgram(pool, first, counts.tolist(), must, standing, self.threads, whole=whole)
        if not whole:
            best, whole = self._complete(program, found)
            if not whole:
                return Finished(best.bound, (best,)), False
            worth, going = self._best_of(program.pool, best, must, FIRST_WORK, found)
            if not going:
                return Finished(worth, tuple(program.stages)), True
        given_up = len(program.pool.value)
        while True:
            more = program.tighten()
            prices = program.prices
            if standing.proven(prices.bound):
                return Finished(prices.bound, tuple(program.stages)), True
            if more and len(program.pool.value) > SHORTER * given_up:
                continue
            given_up = len(program.pool.value)
            worth, going = self._best_of(program.pool, prices, must, FIRST_WORK if more else MOST_WORK, found)
            if not going:
                return Finished(worth, tuple(program.stages)), True
            if not more:
                return Finished(prices.bound, tuple(program.stages)), False

    def _complete(self, program: PoolProgram, found: list[Enumeration]) -> tuple[PoolPrices, bool]:
        """Go on with prices over a part of the routes until no route is missing at these.

        Return the prices of the smallest bound over all routes, and whether it came to that.
        """
        best, rounds, failed = program.prices, 1, 0
        while failed < PATIENCE and not self.standing.budget.over():
            for _ in range(rounds):
                if not program.tighten():
                    break
            expected = program.prices.bound
            listed = self._look(found, program.prices, program.prices.group - self._gap(best))
            if listed is None:
                break
            pool, prices, whole = listed
            # where the part stood for all routes it may do so a little longer
            rounds = 2 if prices.bound <= expected + TINY else 1
            failed = 0 if best.bound - prices.bound > WORTH_IT * self._gap(best) else failed + 1
            best = min(best, prices, key=lambda one: one.bound)
            program.renew(pool, prices, whole=whole)
            if whole:
                self.routes += len(pool.value)
                return prices, True
        return best, False

    def _gap(self, prices: PoolPrices) -> float:
        """Return what a route can lose at some prices in a plan better than the incumbent."""
        floor = -np.inf if self.standing.objective is None else self.standing.objective
        return prices.bound - floor + 1e-7 * max(1.0, abs(prices.bound))

    def _look(self, found: list[Enumeration], prices: PoolPrices, least: FloatArray) -> _Listed | None:
        """Return the routes that lose least at some prices; None if it was interrupted.

        Parameters
        ----------
        found
            The routes of each class.
        prices
            The prices; ``bound`` and ``group`` are of no consequence.
        least
            ``(n_classes,)`` value minus prices from which on routes are of interest.
        """
        form = set_prices(prices.cell, prices.cuts, prices.price)
        with self.standing.budget.alone():
            looks = [
                one.look(form, float(worth), MOST_ROUTES // len(found)) for one, worth in zip(found, least, strict=True)
            ]
        if any(look.whole_above == np.inf for look in looks):
            return None
        best = np.array([look.reduced.max(initial=worth) for look, worth in zip(looks, least.tolist(), strict=True)])
        counts = np.array(self.generation.master.counts, dtype=np.float64)
        rhs = np.array([cut.rhs for cut in prices.cuts])
        bound = float(prices.cell.sum()) + float(prices.price @ rhs) + float(counts @ best)
        prices = replace(prices, bound=bound, group=best)
        gap = self._gap(prices)
        rounding = 1e-8 * max(1.0, abs(bound))  # a tenth of the margin that the gap holds
        whole = all(look.whole_above <= top - gap + rounding for look, top in zip(looks, best.tolist(), strict=True))
        loss = np.concatenate([top - look.reduced for look, top in zip(looks, best.tolist(), strict=True)])
        group = np.concatenate([np.full(len(look.value), k, np.int64) for k, look in enumerate(looks)])
        value, sets = np.concatenate([look.value for look in looks]), np.concatenate([look.sets for look in looks])
        order = np.argsort(loss, kind="stable")
        order = order[loss[order] <= gap]
        return _Listed(Pool(value[order], loss[order], group[order], sets[order]), prices, whole)

    def _violated(self, known: set[SetCut]) -> list[SetCut]:
        """Return cuts over sets that the last point of column generation violates: the first of the programme."""
        point, columns = self.generation.point, self.generation.master.columns
        if point is None or len(point.use) != len(columns):
            return []
        used = np.flatnonzero(point.use > TINY)
        inside = np.zeros((len(used), self.generation.master.n_cells), dtype=np.uint8)
        for row, k in enumerate(used.tolist()):
            inside[row, list(columns[k].cells)] = 1
        return separate_sets(inside, point.use[used], known, CUTS_AT_ONCE)

    def _best_of(
        self, pool: Pool, prices: PoolPrices, must: NDArray[np.bool_], most_work: int, found: list[Enumeration]
    ) -> tuple[float, bool]:
        """Offer the best choice from a pool; return its value and whether there may be a better one.

        Parameters
        ----------
        pool, prices
            The routes, and the prices that say what they lose.
        must
            ``(n_cells,)`` cells that have to be collected.
        most_work
            Looks at routes after which it is given up.
        found
            The routes of each class.
        """
        standing, pricer = self.standing, self.generation.pricer
        floor = -np.inf if standing.objective is None else standing.objective
        counts = np.array(self.generation.master.counts, dtype=np.int64)
        price = np.where(must, np.inf, np.maximum(prices.cell, 0.0))
        best, worth, complete = best_choice(pool, counts, price, self._gap(prices), floor, most_work, pricer.stop)
        standing.budget.spend()
        if best[0] >= 0:
            columns = [
                found[k].column(sets) for k, sets in zip(pool.group[best].tolist(), pool.sets[best], strict=True)
            ]
            columns.sort(key=lambda column: column.group)
            standing.offer([column.path for column in columns])
            worth = max(worth, sum(column.value for column in columns))
        return worth, not complete


def _set_prices(duals: Duals, cuts: Sequence[Rank1Cut]) -> PoolPrices:
    """Return prices of the same cells and, for cuts, of those over the same cells without limits to the memory."""
    price: dict[SetCut, float] = {}
    for cut, worth in zip(cuts, duals.cut.tolist(), strict=True):
        if isinstance(cut, SubsetRow) and worth > 0.0:
            whole = SetCut(tuple(sorted(cut.cells)), (1, 1, 1), 2)
            price[whole] = price.get(whole, 0.0) + worth
    return PoolPrices(np.inf, duals.cell, duals.group, tuple(price), np.array(list(price.values())))
