"""First prices: one price for all cells, and the volume algorithm where the linear programme is too large.

The Lagrangian bound is a convex function of the prices. Along one common price its minimum is found by
bisection and is a good start for everything else. With many cells the linear programme of column generation
converges too slowly, and the volume algorithm (Barahona and Anbil 2000) lowers the bound from there: it steps
against an average of the routes found so far instead of the last ones alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from react_opt.route_problem import FloatArray
from react_opt.solvers.routes.columns import Column, Duals
from react_opt.solvers.routes.generation import Generation, Multipliers
from react_opt.solvers.routes.master import Master
from react_opt.solvers.routes.pricing import NO_SIDE_PRICES

LEVELS = 8
BEAM = 2
FIRST_STEP = 0.05
LAST_STEP = 1e-4
PATIENCE = 12
AVERAGE = 0.1


class DualAscent:
    """Improves prices without a linear programme.

    Parameters
    ----------
    generation
        Column generation whose best multipliers are set; the columns found go to its master.
    """

    def __init__(self, generation: Generation) -> None:
        self.generation = generation
        self.master: Master = generation.master
        self.standing = generation.standing
        self.n = self.master.n_cells
        self.best: Multipliers | None = None

    def uniform(self, top: float) -> None:
        """Find the best common price of all cells between 0 and ``top``.

        Parameters
        ----------
        top
            Largest price worth trying: the most that a cell can earn.
        """
        low, high = 0.0, top
        for _ in range(LEVELS):
            left, right = low + 0.4 * (high - low), low + 0.6 * (high - low)
            at_left = self._evaluate(np.full(self.n, left))[0]
            if self.standing.done():
                return
            if at_left < self._evaluate(np.full(self.n, right))[0]:
                high = right
            else:
                low = left
            if self.standing.done():
                return

    def volume(self) -> None:
        """Lower the bound by the volume algorithm until its steps are tiny or a limit is reached."""
        if self.best is None:
            return
        centre = self.best.duals.cell
        bound, used = self._evaluate(centre)
        average, step, failures = used, FIRST_STEP, 0
        while step > LAST_STEP and not self.standing.done():
            target = self.standing.objective
            target = 0.95 * bound if target is None else target
            direction = 1.0 - average
            direction[(centre <= 0.0) & (direction > 0.0)] = 0.0
            size = float(direction @ direction)
            if size == 0.0:
                return
            price = np.maximum(0.0, centre - step * (bound - target) / size * direction)
            value, used = self._evaluate(price)
            change = used - average
            length = float(change @ change)
            share = float((1.0 - average) @ change) / length if length > 0.0 else 0.0
            average = average + min(AVERAGE, max(0.1 * AVERAGE, share)) * change
            if value < bound:
                if float((1.0 - used) @ direction) > 0.0:
                    step = min(1.0, 1.1 * step)
                bound, centre, failures = value, price, 0
            else:
                failures += 1
                if failures == PATIENCE:
                    step, failures = 0.7 * step, 0
        self.generation.best = self.best

    def _evaluate(self, cell: FloatArray) -> tuple[float, FloatArray]:
        """Return the bound at some prices and how often its routes collect each cell."""
        groups = len(self.master.counts)
        duals = Duals(cell, np.zeros(groups), np.zeros(0), np.zeros(0))
        pricer, used = self.generation.pricer, np.zeros(self.n)
        lowest = np.full(groups, -np.inf)
        beam = pricer.price(duals, NO_SIDE_PRICES, width=BEAM, columns=1, floor=lowest)
        floor, known = lowest.copy(), np.isfinite(beam.top)  # unknown where the pass was given up at the deadline
        floor[known] = beam.top[known] + 1e-9 * np.maximum(1.0, np.abs(beam.top[known]))
        exact = pricer.price(duals, NO_SIDE_PRICES, columns=1, floor=floor)
        self.standing.budget.spend(2)
        best: dict[int, Column] = {column.group: column for column in beam.columns}
        best.update({column.group: column for column in exact.columns})
        for group, column in best.items():
            np.add.at(used, list(column.cells), float(self.master.counts[group]))
        self.master.add(best.values())
        if exact.best is None:
            return np.inf, used
        bound = self.generation.bound(duals, exact.best)
        if self.best is None or bound < self.best.bound:
            self.best = Multipliers(bound, replace(duals, group=exact.best))
            self.generation.best = self.best
            self.standing.lower_bound_to(bound)
        return bound, used
