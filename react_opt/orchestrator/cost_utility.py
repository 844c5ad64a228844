"""Cost against utility of frontiers, as explore_lite weighs them: length of the frontier against the way to it."""

from __future__ import annotations

import numpy as np

from react_opt.orchestrator.frontier import Choice, Frontiers
from react_opt.orchestrator.nearest import share

GAIN_S_PER_M = 1.0
"""A metre of frontier is worth so many s of driving. Tuned on generated buildings (benchmarks/tune_baselines.py)."""


class CostUtility(Frontiers):
    """Each robot in turn takes the frontier of least cost ``time - gain * length`` that no other has taken."""

    def choose(self, choice: Choice) -> list[int]:
        """Return for each robot the index of its frontier, -1 for none."""
        gain = self.options.extra.get("gain_s_per_m", GAIN_S_PER_M)
        length_m = np.array([cluster.length_m for cluster in choice.clusters])
        cost = choice.time_s + choice.beyond_s - gain * length_m
        taken = np.zeros(len(length_m), dtype=bool)
        picked = []
        for row in cost:
            free = np.where(taken, np.inf, row)
            best = int(np.argmin(free))
            picked.append(best if np.isfinite(free[best]) else -1)
            taken[best] = True
        return share(picked, cost)


class CostUtilityAreas(CostUtility):
    """The same, with the way on from a frontier to the nearest unexplored area as part of its cost."""

    knows_areas = True
