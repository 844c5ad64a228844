"""What every path planner here answers: costs and paths between points, for one robot on one map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Path:
    """A driven path.

    Parameters
    ----------
    points_m
        ``(k, 2)`` way points in the map's frame, m; the first is the start and the last the goal.
    length_m, time_s, energy_j
        Length, driving time and driving energy (base and motion, no sensing).
    min_clearance_m
        Smallest distance from the path to anything that blocks, m.
    """

    points_m: FloatArray
    length_m: float
    time_s: float
    energy_j: float
    min_clearance_m: float


@dataclass(frozen=True)
class CostTable:
    """Costs between all pairs of N points; an unreachable pair is absent (``reachable`` is False there).

    Parameters
    ----------
    points_m
        ``(n, 2)`` points in the map's frame, m.
    reachable
        ``(n, n)`` True where a path was found; the diagonal is True where the point itself is free.
    length_m, time_s, energy_j
        ``(n, n)``; NaN where ``reachable`` is False.
    method
        What found the paths, with its parameters.
    """

    points_m: FloatArray
    reachable: NDArray[np.bool_]
    length_m: FloatArray
    time_s: FloatArray
    energy_j: FloatArray
    method: str


@runtime_checkable
class PathCosts(Protocol):
    """Path costs for one robot on one map."""

    def cost_table(self, points_m: FloatArray) -> CostTable:
        """Return the costs between all pairs of ``(n, 2)`` points."""
        ...

    def path(self, start_m: FloatArray, goal_m: FloatArray) -> Path | None:
        """Return the path between two points, None where there is none."""
        ...
