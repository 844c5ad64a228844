"""Which local targets are taken now and which are postponed: REACT's priority, from size, access and neighbourhood."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.models.priorities import PriorityWeights, target_gains
from react_opt.orchestrator.belief import LocalTarget

ACCESS_REF_M = 1.0
"""Length of frontier at which access is 63 % of free access: about the width of a door."""
ACCESS_REF_S = 20.0
"""A way that takes so long leaves 37 % of the priority."""
WEIGHTS = PriorityWeights()


def priorities(
    targets: Sequence[LocalTarget], time_s: ArrayLike | None = None, weights: PriorityWeights = WEIGHTS
) -> NDArray[np.float64]:
    """Return the priority of each target: its gain times its access.

        priority_k = gain(size_k, opening_k) * (1 - exp(-frontier_k / ACCESS_REF_M)) * exp(-time_k / ACCESS_REF_S)

    The gain (:mod:`react_opt.models.priorities`) grows with the size of the unknown region and with the unexplored
    neighbourhood that it may open; a region seen through a slit is worth less now than one that lies open, and one at
    the end of a long way less than one beside the robot. A target that cannot be reached from known space has
    priority 0.

    Parameters
    ----------
    targets
        ``K`` of them.
    time_s
        ``(K,)`` s to drive there for the robot that is nearest, NaN or infinite where there is no way; None: not
        counted.
    weights
        Of the gain.
    """
    if not targets:
        return np.zeros(0)
    size = np.array([target.size_m2 for target in targets])
    opening = np.array([target.opening_m2 for target in targets])
    access = -np.expm1(-np.array([target.frontier_m for target in targets]) / ACCESS_REF_M)
    inaccessible = np.array([target.stand_m is None for target in targets])
    if time_s is not None:
        way_s = np.asarray(time_s, dtype=np.float64)
        inaccessible |= ~np.isfinite(way_s)
        access = access * np.exp(-np.where(np.isfinite(way_s), way_s, 0.0) / ACCESS_REF_S)
    return np.where(inaccessible, 0.0, target_gains(size, opening, weights) * access)
