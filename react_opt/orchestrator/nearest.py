"""Nearest frontier (Yamauchi 1997), with no two robots sent to the same one."""

from __future__ import annotations

import numpy as np

from react_opt.orchestrator.frontier import Choice, Frontiers


class Nearest(Frontiers):
    """Again and again the nearest pair of a robot and a frontier is taken; robots left over share."""

    def choose(self, choice: Choice) -> list[int]:
        """Return for each robot the index of its frontier, -1 for none."""
        cost = choice.time_s + choice.beyond_s
        picked = [-1] * len(choice.robots)
        free = cost.copy()
        for _ in picked:
            row, col = np.unravel_index(int(np.argmin(free)), free.shape)
            if not np.isfinite(free[row, col]):
                break
            picked[row] = int(col)
            free[row, :], free[:, col] = np.inf, np.inf
        return share(picked, cost)


def share(picked: list[int], cost: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[int]:
    """Give each robot without a frontier its cheapest one, whoever else drives there."""
    return [
        int(np.argmin(cost[row])) if at < 0 and np.isfinite(cost[row]).any() else at for row, at in enumerate(picked)
    ]


class NearestAreas(Nearest):
    """The same, with the way on from a frontier to the nearest unexplored area as part of its cost."""

    knows_areas = True
