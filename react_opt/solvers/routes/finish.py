"""Closing a gap by enumeration: all routes that a better plan can contain, and the best choice among them."""

from __future__ import annotations

import numpy as np

from react_opt.solvers.routes.budget import Standing
from react_opt.solvers.routes.columns import Column
from react_opt.solvers.routes.enumeration import enumerate_routes
from react_opt.solvers.routes.generation import Generation, Multipliers
from react_opt.solvers.routes.selection import select

EASIER = 0.7  # share of the last hopeless gap at which it is tried again


class Finish:
    """Enumerates and chooses where few routes are left.

    Parameters
    ----------
    generation
        The column generation with its region.
    standing
        The best plan so far and the limits.
    threads, seed
        Of HiGHS.
    """

    def __init__(self, generation: Generation, standing: Standing, threads: int, seed: int) -> None:
        self.generation, self.standing, self.threads, self.seed = generation, standing, threads, seed
        problem = generation.pricer.problem
        # with limits between robots a worse route with the same cells can be of use
        self._coupled = (
            problem.forbid_swaps or problem.robots_per_cell is not None or problem.sensing_robots_per_step is not None
        )
        self.routes = 0  # enumerated in the attempts that succeeded
        self._hopeless_gap = np.inf

    def bound(self, best: Multipliers, most: int, *, anew: bool = False) -> float | None:
        """Return the bound of the region looked at after enumeration; None if there are too many routes.

        What is not enumerated cannot beat the incumbent, so the bound is that of the choice or the incumbent,
        whichever is larger. Better plans found are offered.

        Parameters
        ----------
        best
            Multipliers of the region.
        most
            Most routes.
        anew
            Try even where the last attempt failed at a gap not much larger.
        """
        standing, master = self.standing, self.generation.master
        if standing.objective is None or self._coupled:
            return None
        gap = best.bound - standing.objective + 1e-7 * max(1.0, abs(best.bound))
        if gap > self._hopeless_gap and not anew:
            return None
        columns: list[Column] = []
        duals = self.generation.extended(best)
        for group in range(len(master.counts)):
            found = enumerate_routes(
                self.generation.pricer,
                group,
                duals,
                float(duals.group[group]) - gap,
                self.generation.side,
                master.cuts,
                max_routes=most,
            )
            standing.budget.spend()
            if found is None or len(columns) + len(found) > most:
                if not anew:
                    self._hopeless_gap = EASIER * gap
                return None
            columns += found
        chosen = select(
            columns,
            master.n_cells,
            master.counts,
            gap=0.5 * (standing.slack or 0.0),
            floor=None,
            time_limit_s=standing.budget.left_s(),
            node_limit=None,
            seed=self.seed,
            threads=self.threads,
        )
        standing.budget.spend()
        if chosen.columns is not None:
            standing.offer([column.path for column in chosen.columns])
        if chosen.bound is None or not chosen.solved:
            return None
        self.routes += len(columns)
        return max(chosen.bound, standing.objective)
