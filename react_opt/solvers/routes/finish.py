"""Closing a gap by enumeration: all routes that a better plan can contain, and the best choice among them."""

from __future__ import annotations

import numpy as np

from react_opt.solvers.routes.budget import Standing
from react_opt.solvers.routes.choice import Pool, best_choice
from react_opt.solvers.routes.columns import Duals
from react_opt.solvers.routes.enumeration import Enumerated, enumerate_routes
from react_opt.solvers.routes.generation import Generation, Multipliers

EASIER = 0.7  # share of the last hopeless gap at which it is tried again
LEAST_LABELS, MOST_LABELS = 1_000_000, 8_000_000  # of the enumeration of one class
LABELS_PER_LABEL = 3  # in between: as many times the labels of all pricings so far, which are dearer
MOST_ROUTES = 200_000
MOST_WORK = 1_000_000_000  # looks at routes when choosing among them, about a second


class Finish:
    """Enumerates and chooses where few routes are left.

    Parameters
    ----------
    generation
        The column generation with its region.
    standing
        The best plan so far and the limits.
    """

    def __init__(self, generation: Generation, standing: Standing) -> None:
        self.generation, self.standing = generation, standing
        problem = generation.pricer.problem
        # with limits between robots a worse route with the same cells can be of use; chargers are not enumerated
        self._coupled = (
            problem.forbid_swaps or problem.robots_per_cell is not None or problem.sensing_robots_per_step is not None
        ) or bool(problem.charger_j.any())
        self.routes = 0  # enumerated in the attempts that succeeded
        self._hopeless_gap = np.inf

    def bound(self, best: Multipliers, *, anew: bool = False) -> float | None:
        """Return the bound of the region looked at after enumeration; None if there are too many routes.

        What is not enumerated cannot beat the incumbent, so the bound is that of the choice or the incumbent,
        whichever is larger. Better plans found are offered.

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
        most_labels = min(MOST_LABELS, max(LEAST_LABELS, LABELS_PER_LABEL * pricer.labels))
        duals = self.generation.extended(best)
        found: list[Enumerated] = []
        for group in range(len(master.counts)):
            routes = enumerate_routes(
                pricer,
                group,
                duals,
                float(duals.group[group]) - gap,
                self.generation.side,
                master.cuts,
                max_labels=most_labels,
            )
            standing.budget.spend()
            if routes is None or sum(len(one.label) for one in (*found, routes)) > MOST_ROUTES:
                if not anew:
                    self._hopeless_gap = EASIER * gap
                return None
            found.append(routes)
        worth, complete = self._choose(found, duals, gap)
        standing.budget.spend()
        if not complete:
            if not anew:
                self._hopeless_gap = EASIER * gap
            return None
        self.routes += sum(len(one.label) for one in found)
        return max(worth, floor)

    def _choose(self, found: list[Enumerated], duals: Duals, gap: float) -> tuple[float, bool]:
        """Offer the best choice of routes; return the most that a choice is worth and whether that is certain."""
        standing, pricer = self.standing, self.generation.pricer
        floor = -np.inf if standing.objective is None else standing.objective
        region = self.generation.side.region
        price = np.maximum(duals.cell, 0.0)
        if region is not None:
            price[region.must] = np.inf
        loss = np.concatenate([duals.group[k] - one.reduced for k, one in enumerate(found)])
        order = np.argsort(loss, kind="stable")
        group = np.concatenate([np.full(len(one.label), k, np.int64) for k, one in enumerate(found)])
        pool = Pool(
            np.concatenate([one.value for one in found])[order],
            loss[order],
            group[order],
            np.concatenate([one.sets for one in found])[order],
        )
        counts = np.array(self.generation.master.counts, dtype=np.int64)
        best, worth, complete = best_choice(pool, counts, price, gap, floor, MOST_WORK, pricer.stop)
        if best[0] >= 0:
            within = np.concatenate([np.arange(len(one.label)) for one in found])[order]
            columns = [
                pricer.column(k, found[k].labels, int(found[k].label[r]))
                for k, r in zip(group[order][best].tolist(), within[best].tolist(), strict=True)
            ]
            columns.sort(key=lambda column: column.group)
            standing.offer([column.path for column in columns])
            worth = max(worth, sum(column.value for column in columns))
        return worth, complete
