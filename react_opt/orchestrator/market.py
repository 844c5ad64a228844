"""A market for frontiers: the best bid wins, and what lies near a sold frontier loses value (Burgard et al. 2005)."""

from __future__ import annotations

import numpy as np

from react_opt.orchestrator.frontier import Choice, Frontiers

SECONDS_WORTH = 0.02
"""What a second of driving costs, where an untouched frontier is worth 1. Tuned on generated buildings
(benchmarks/tune_baselines.py)."""


class Market(Frontiers):
    """Robots bid ``value - price * time``; a sale lowers the value of frontiers within the sensors' reach of it."""

    def choose(self, choice: Choice) -> list[int]:
        """Return for each robot the index of its frontier, -1 for none."""
        price = self.options.extra.get("seconds_worth", SECONDS_WORTH)
        at = np.array([(cluster.x_m, cluster.y_m) for cluster in choice.clusters])
        value = np.ones(len(at))
        picked = [-1] * len(choice.robots)
        cost = price * (choice.time_s + choice.beyond_s)
        waiting = set(range(len(picked)))
        while waiting:
            rows = sorted(waiting)
            bids = value[None] - cost[rows]
            row, col = np.unravel_index(int(np.argmax(bids)), bids.shape)
            if not np.isfinite(bids[row, col]):
                break
            robot = rows[int(row)]
            picked[robot] = int(col)
            waiting.discard(robot)
            reach_m = choice.robots[robot].profile.lidar_range_m
            gap_m = np.hypot(*(at - at[int(col)]).T)
            value -= np.clip(1.0 - gap_m / reach_m, 0.0, 1.0)
        return picked


class MarketAreas(Market):
    """The same, with the way on from a frontier to the nearest unexplored area as part of its cost."""

    knows_areas = True
