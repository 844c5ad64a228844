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
from react_opt.solvers.routes.enumeration import Enumeration, Look, enumerate_routes
from react_opt.solvers.routes.generation import Generation, Multipliers
from react_opt.solvers.routes.pool import CUTS_AT_ONCE, TINY, WORTH_IT, PoolPrices, PoolProgram
from react_opt.solvers.routes.setcuts import SetCut, separate_sets
from react_opt.solvers.routes.setjoin import best_of_each
from react_opt.solvers.routes.setprices import cost_of_sets, set_prices

EASIER = 0.85  # share of the last hopeless gap at which it is tried again
LEAST, MOST = 400_000, 12_000_000  # labels of each direction; in between four times as many as labels priced so far
MOST_ROUTES = 1_500_000  # that are listed if these are all; otherwise the best ones, and as many others
SOME_ROUTES = 250_000
AHEAD = 0.6  # of the way from the best prices to those of the list
PATIENCE = 8  # looks at all routes that may fail to lower the bound by so much of the gap
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
        most = min(MOST, max(LEAST, 4 * pricer.labels)) // max(1, words // 2)  # sets of many cells are large
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
                return Finished(best.bound, tuple(program.stages)), False
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

        The list grows by what is worth most at prices on the way from the best ones to those of the list, and by
        others drawn at random: few routes that are not drawn can lie above prices that suit those drawn (Clarkson
        1995). Where the bound did not fall there, the next prices are nearer to the best ones (Ben-Ameur, Neto 2007).
        Return the prices of the smallest bound over all routes, and whether it came to that.
        """
        best, ahead, failed = program.prices, AHEAD, 0
        program.stages.append(best)
        while failed < PATIENCE and not self.standing.budget.over():
            program.tighten()
            here = _between(best, program.prices, ahead)
            listed = self._look(found, here, here.group - self._gap(best), best)
            if listed is None:
                break
            pool, prices, whole = listed
            if whole:
                program.renew(pool, prices, whole=True)
                self.routes += len(pool.value)
                return prices, True
            failed = 0 if best.bound - prices.bound > WORTH_IT * self._gap(best) else failed + 1
            if prices.bound < best.bound:
                best, ahead = prices, AHEAD
                program.stages.append(best)
                form, gap = set_prices(best.cell, best.cuts, best.price), self._gap(best)
                for one, worth in zip(found, best.group.tolist(), strict=True):
                    one.narrow(form, worth - gap)
            else:
                ahead /= 2.0
            program.renew(_united(program.pool, pool), best, whole=False)
        return best, False

    def _gap(self, prices: PoolPrices) -> float:
        """Return what a route can lose at some prices in a plan better than the incumbent."""
        floor = -np.inf if self.standing.objective is None else self.standing.objective
        return prices.bound - floor + 1e-7 * max(1.0, abs(prices.bound))

    def _look(
        self, found: list[Enumeration], prices: PoolPrices, least: FloatArray, known: PoolPrices | None = None
    ) -> _Listed | None:
        """Return the routes that lose least at some prices; None if it was interrupted.

        Parameters
        ----------
        found
            The routes of each class.
        prices
            The prices; ``bound`` and ``group`` are of no consequence.
        least
            ``(n_classes,)`` value minus prices from which on routes are of interest.
        known
            Prices with a proven bound: routes that lose more at these than a better plan can are left out.
        """
        form = set_prices(prices.cell, prices.cuts, prices.price)
        with self.standing.budget.alone():
            most, some = MOST_ROUTES // len(found), SOME_ROUTES // len(found)
            looks = [one.look(form, float(worth), most, some) for one, worth in zip(found, least, strict=True)]
        if any(look.whole_above == np.inf for look in looks):
            return None
        if known is not None:
            looks = [self._within(look, known, k) for k, look in enumerate(looks)]
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

    def _within(self, look: Look, known: PoolPrices, group: int) -> Look:
        """Return a look without the routes of a class that lose more at some prices than those of a better plan."""
        reduced = look.value - cost_of_sets(look.sets, set_prices(known.cell, known.cuts, known.price), self.threads)
        kept = known.group[group] - reduced <= self._gap(known)
        return look._replace(sets=look.sets[kept], value=look.value[kept], reduced=look.reduced[kept])

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


def _united(one: Pool, other: Pool) -> Pool:
    """Return the routes of both lists, the best one for each class and set; what they lose is left open."""
    value, group = np.concatenate((one.value, other.value)), np.concatenate((one.group, other.group))
    sets = np.concatenate((one.sets, other.sets))
    kept = best_of_each(np.column_stack((sets, group.astype(np.uint64))), value)
    return Pool(value[kept], np.zeros(len(kept)), group[kept], sets[kept])


def _between(one: PoolPrices, other: PoolPrices, share: float) -> PoolPrices:
    """Return the prices at some share of the way from ``one`` to ``other``; the bound is not known."""
    price: dict[SetCut, float] = {}
    for prices, weight in ((one, 1.0 - share), (other, share)):
        for cut, worth in zip(prices.cuts, prices.price.tolist(), strict=True):
            price[cut] = price.get(cut, 0.0) + weight * worth
    cell, group = ((1.0 - share) * old + share * new for old, new in ((one.cell, other.cell), (one.group, other.group)))
    return PoolPrices(np.inf, cell, group, tuple(price), np.array(list(price.values())))
