"""First prices, before any linear programme: from a relaxation without routes, then by a smooth ascent.

The Lagrangian bound is a convex function of the prices. `slots` gives a start whose bound already counts how far the
robots can have got. With many cells the linear programme of column generation converges too slowly, and the smoothed
dual (`smoothing.SmoothedDual`) is minimised first, at falling temperatures and with a memory that grows along the
cycles of routes drawn from it.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from react_opt.route_problem import FloatArray, Route
from react_opt.solvers.routes.columns import Column, Duals
from react_opt.solvers.routes.generation import Generation, Multipliers
from react_opt.solvers.routes.memory import Memory
from react_opt.solvers.routes.pricing import NO_SIDE_PRICES
from react_opt.solvers.routes.routecolumn import route_column
from react_opt.solvers.routes.slots import slot_prices
from react_opt.solvers.routes.smoothing import MOST_WEIGHTS, SmoothedDual

BEAM = 2
FIRST_BITS = 4  # cells remembered in one place by the smoothed dual at first
PRECISION = 1e-7  # relative change of the smoothed bound at which it ends
SAMPLE = 300  # routes drawn to look for cycles
BETWEEN = 20  # iterations between two exact pricings
WORTH_IT = 1e-4  # relative change of the bound below which the memory is not grown once more


class Effort(NamedTuple):
    """How far the smoothed dual is minimised.

    Parameters
    ----------
    hot, cold
        First and last temperature as shares of what a cell earns at best, on average.
    iterations
        Of the quasi-Newton method at one temperature.
    rounds
        Of growing memory.
    """

    hot: float
    cold: float
    iterations: int
    rounds: int


WHOLE = Effort(0.02, 0.001, 60, 8)
BRIEF = Effort(0.01, 0.005, 15, 1)  # where the linear programme converges well, once it has prices to begin with


class _Stopped(Exception):
    """A limit was reached within a descent."""


class DualAscent:
    """Improves prices without a linear programme.

    Parameters
    ----------
    generation
        Column generation whose best multipliers are set; the columns found go to its master.
    memory
        The ng-sets of its pricer, grown along with those of the smoothed dual.
    seed
        Seed of the routes drawn.
    threads
        Robot classes that are priced at once.
    effort
        How far `smooth` goes.
    """

    def __init__(
        self, generation: Generation, memory: Memory, seed: int, threads: int = 1, effort: Effort = WHOLE
    ) -> None:
        self.generation, self.memory, self.effort = generation, memory, effort
        self.threads = max(1, min(threads, len(generation.master.counts)))
        self.master, self.standing = generation.master, generation.standing
        self.problem = generation.pricer.problem
        self.rng = np.random.default_rng(seed)
        self.best: Multipliers | None = None
        self._pricing_s = 0.0

    def slots(self) -> None:
        """Begin with the prices of the relaxation in which a robot collects one cell per instant anywhere."""
        price = slot_prices(self.problem, self.standing.budget.left_s())
        self.standing.budget.spend()
        self._evaluate(np.zeros(self.problem.n_cells) if price is None else price)

    def smooth(self) -> None:
        """Lower the bound by minimising the smoothed dual until growing its memory does not pay any more."""
        if self.best is None:
            return
        places = self.problem.reward.size
        bits = next((b for b in range(FIRST_BITS, 0, -1) if places << b <= MOST_WEIGHTS), 0)
        if bits == 0:
            return
        smooth = SmoothedDual(
            self.problem, Memory(self.memory.steps, bits).near, self.threads, self.generation.pricer.stop
        )
        reward = self.problem.reward.max(axis=1, initial=0.0)
        scale = float(np.mean(reward[reward > 0.0])) if reward.any() else 1.0
        cell, temperature = self.best.duals.cell, self.effort.hot * scale
        while not self.standing.done():
            cell = self._descend(smooth, cell, temperature)
            self._evaluate(cell)
            if temperature <= self.effort.cold * scale:
                break
            temperature = max(0.5 * temperature, self.effort.cold * scale)
        for _ in range(self.effort.rounds):
            if self.standing.done():
                return
            before = self.best.bound
            smooth.value(cell, temperature)
            if self.standing.done():  # the sums may have been given up
                return
            routes = [smooth.draw(k, SAMPLE, self.rng) for k in range(len(self.problem.classes))]
            pairs = smooth.grow(_cycles([route for part in routes for route in part]))
            self.memory.grow(pairs)
            self.generation.pricer.remember()
            if not pairs:
                break
            cell = self._descend(smooth, cell, temperature)
            self._evaluate(cell)
            if before - self.best.bound < WORTH_IT * abs(before):
                break
        smooth.value(cell, temperature)
        if self.standing.done():
            return
        drawn = [route for k in range(len(self.problem.classes)) for route in smooth.draw(k, SAMPLE, self.rng)]
        self.master.add([route_column(self.problem, route) for route in drawn if self._possible(route)])
        self.generation.best = self.best

    def _possible(self, route: Route) -> bool:
        """Whether the pricing may return a route: the smoothed dual knows no battery, and less memory."""
        return self.memory.allows(route) and not self.generation.pricer.binds(route.robot_class)

    def _descend(self, smooth: SmoothedDual, cell: FloatArray, temperature: float) -> FloatArray:
        """Return better prices at one temperature."""
        reached, count = cell, 0

        def value(prices: FloatArray) -> tuple[float, FloatArray]:
            self.standing.budget.spend()
            found = smooth.value(prices, temperature)
            if self.standing.done():
                raise _Stopped
            return found

        def watch(prices: FloatArray) -> None:
            nonlocal reached, count
            reached, count = prices.copy(), count + 1
            if count % BETWEEN == 0 and count < self.effort.iterations:
                self._evaluate(np.maximum(0.0, reached))
            left_s = self.standing.budget.left_s()
            if left_s is not None and left_s < 3.0 * self._pricing_s:  # what is reached has to be priced yet
                raise StopIteration

        with suppress(_Stopped):
            minimize(
                value, cell, jac=True, method="L-BFGS-B", bounds=[(0.0, None)] * len(cell), callback=watch,
                options={"maxiter": self.effort.iterations, "maxcor": 50, "ftol": PRECISION},
            )  # fmt: skip
        return np.maximum(0.0, reached)

    def _evaluate(self, cell: FloatArray) -> None:
        """Take the bound that some prices prove, and the routes found on the way, if there is time."""
        if self.best is not None and self.standing.done():
            return
        begun = time.perf_counter()
        groups = len(self.master.counts)
        duals = Duals(cell, np.zeros(groups), np.zeros(0), np.zeros(0))
        pricer = self.generation.pricer

        def price(group: int) -> tuple[Column | None, float]:
            floor = np.full(groups, -np.inf)
            beam = pricer.price(duals, NO_SIDE_PRICES, width=BEAM, columns=1, groups=[group], floor=floor)
            if np.isfinite(beam.top[group]):  # unknown where the pass was given up at the deadline
                floor[group] = beam.top[group] + 1e-9 * max(1.0, abs(float(beam.top[group])))
            exact = pricer.price(duals, NO_SIDE_PRICES, columns=1, groups=[group], floor=floor)
            columns = exact.columns or beam.columns
            return columns[0] if columns else None, np.nan if exact.best is None else float(exact.best[group])

        with ThreadPoolExecutor(self.threads) as pool:
            found = list(pool.map(price, range(groups)))
        self.standing.budget.spend(2)
        self.master.add([column for column, _ in found if column is not None])
        best = np.array([top for _, top in found])
        if np.isnan(best).any():
            return
        self._pricing_s = time.perf_counter() - begun
        bound = self.generation.bound(duals, best)
        if self.best is None or bound < self.best.bound:
            self.best = Multipliers(bound, replace(duals, group=best))
            self.generation.best = self.best
            self.standing.lower_bound_to(bound)


def _cycles(routes: Sequence[Route]) -> list[tuple[int, frozenset[int]]]:
    """Return the cycles on which routes collect a cell again, those that are frequent and short first."""
    found: Counter[tuple[int, frozenset[int]]] = Counter()
    for route in routes:
        last: dict[int, int] = {}
        for position in np.flatnonzero(route.sense):
            cell = int(route.cell[position])
            if cell in last:
                places = route.cell[last[cell] : position]
                found[cell, frozenset(int(place) for place in places if place >= 0)] += 1
            last[cell] = int(position)
    return sorted(found, key=lambda cycle: (-found[cycle] / len(cycle[1]), cycle[0], sorted(cycle[1])))
