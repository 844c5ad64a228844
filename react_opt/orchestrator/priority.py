"""Which local targets are taken now and which are postponed: REACT's priority, from size, access and neighbourhood."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from react_opt.models.priorities import PriorityWeights, target_gains
from react_opt.orchestrator.belief import LocalTarget

ACCESS_REF_M = 1.0
"""Length of frontier at which access is 63 % of free access: about the width of a door."""
WEIGHTS = PriorityWeights()


def priorities(targets: Sequence[LocalTarget], weights: PriorityWeights = WEIGHTS) -> NDArray[np.float64]:
    """Return the priority of each target: its gain times its access.

        priority_k = gain(size_k, opening_k) * (1 - exp(-frontier_k / ACCESS_REF_M))

    The gain (:mod:`react_opt.models.priorities`) grows with the size of the unknown region and with the unexplored
    neighbourhood that it may open; a region seen through a slit is worth less now than one that lies open. A target
    that cannot be reached from known space has priority 0.
    """
    if not targets:
        return np.zeros(0)
    size = np.array([target.size_m2 for target in targets])
    opening = np.array([target.opening_m2 for target in targets])
    access = -np.expm1(-np.array([target.frontier_m for target in targets]) / ACCESS_REF_M)
    inaccessible = np.array([target.stand_m is None for target in targets])
    return np.where(inaccessible, 0.0, target_gains(size, opening, weights) * access)
