"""Priority of a local target: what visiting it may bring, from the unknown it borders.

    gain_k = floor + size * s(area_k / area_ref) + opening * s(neighbourhood_k / neighbourhood_ref)
    s(x)   = 1 - exp(-x)

``area_k`` is the size of the unknown region whose centroid the target is, ``neighbourhood_k`` the unexplored
area around it that it may open (behind it, not part of the region that was seen). Both saturate: the second
square metre of a region is worth nearly as much as the first, the hundredth next to nothing, since one visit
sees no further than the sensor reaches. The paper names both terms (section on the real-time orchestrator)
and gives no formula; this one is the project's own, and its weights are data.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.errors import UsageError


@dataclass(frozen=True)
class PriorityWeights:
    """Weights of the priority, as data.

    Parameters
    ----------
    size, opening
        Largest gain from the region itself and from the neighbourhood it may open.
    area_ref_m2, neighbourhood_ref_m2
        Areas (m^2) at which either term reaches 63 % of its largest gain.
    floor
        Gain of a target of no size.

    Raises
    ------
    UsageError
        Where a weight is negative or not finite, or a reference area is not positive.
    """

    size: float = 1.0
    opening: float = 1.0
    area_ref_m2: float = 4.0
    neighbourhood_ref_m2: float = 40.0
    floor: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        for name in ("size", "opening", "floor", "area_ref_m2", "neighbourhood_ref_m2"):
            value = getattr(self, name)
            positive = name.endswith("_m2")
            if not np.isfinite(value) or value < 0 or (positive and value == 0):
                raise UsageError(
                    f"priority weights: {name}: expected a number {'>' if positive else '>='} 0, found {value}"
                )


def target_gains(
    area_m2: ArrayLike, neighbourhood_m2: ArrayLike, weights: PriorityWeights = PriorityWeights()
) -> NDArray[np.float64]:
    """Return the gain of each target; it grows with both areas and never exceeds the sum of the weights.

    Parameters
    ----------
    area_m2
        ``(K,)`` size of each target's unknown region, m^2.
    neighbourhood_m2
        ``(K,)`` unexplored area around each target that visiting it may open, m^2.
    weights
        The weights.

    Raises
    ------
    UsageError
        Where an area is negative or not a number.
    """
    area, around = np.asarray(area_m2, dtype=np.float64), np.asarray(neighbourhood_m2, dtype=np.float64)
    if not ((area >= 0).all() and (around >= 0).all()):
        raise UsageError("priorities: expected areas >= 0")
    size = -np.expm1(-area / weights.area_ref_m2)
    opening = -np.expm1(-around / weights.neighbourhood_ref_m2)
    gains: NDArray[np.float64] = weights.floor + weights.size * size + weights.opening * opening
    return gains


def is_postponed(gain: ArrayLike, postpone_below: float) -> NDArray[np.bool_]:
    """Return whether each target is put off to the inspection at the end: its priority is below the threshold."""
    return np.asarray(np.asarray(gain, dtype=np.float64) < postpone_below)
