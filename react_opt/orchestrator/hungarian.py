"""Frontiers assigned to the whole fleet at once by the Hungarian method."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from react_opt.orchestrator.frontier import Choice, Frontiers
from react_opt.orchestrator.nearest import share

GAIN_S_PER_M = 0.5
"""A metre of frontier is worth so many s of driving. Tuned on generated buildings (benchmarks/tune_baselines.py)."""
NEVER_S = 1e6


class Hungarian(Frontiers):
    """The assignment of least total cost ``time - gain * length``."""

    def choose(self, choice: Choice) -> list[int]:
        """Return for each robot the index of its frontier, -1 for none."""
        gain = self.options.extra.get("gain_s_per_m", GAIN_S_PER_M)
        length_m = np.array([cluster.length_m for cluster in choice.clusters])
        cost = choice.time_s + choice.beyond_s - gain * length_m
        rows, cols = linear_sum_assignment(np.where(np.isfinite(cost), cost, NEVER_S))
        picked = [-1] * len(choice.robots)
        for row, col in zip(rows.tolist(), cols.tolist(), strict=True):
            if np.isfinite(cost[row, col]):
                picked[row] = col
        return share(picked, cost)


class HungarianAreas(Hungarian):
    """The same, with the way on from a frontier to the nearest unexplored area as part of its cost."""

    knows_areas = True
