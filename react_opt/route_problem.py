"""The route problem as plain arrays: what the decomposition, its pricing and its primal search work on.

Nothing here knows files, plans or pydantic; times are whole steps, energies joules. A *route* is what one
robot does from its ``start_step`` to the horizon. Rewards are data (``reward[i, t]``), so deadlines, weights
and other reward profiles need no code.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class RobotClass:
    """Robots with equal data share one class: they are interchangeable in the master.

    Parameters
    ----------
    robots
        Indices of the robots of this class in the instance.
    start, start_step
        Cell and instant at which the route begins.
    battery_j, capacity_j, reserve_j
        Battery at ``start_step``, its ceiling and its floor, J.
    wait_j, sense_j
        Energy of one waiting step and of sensing at one instant, J.
    return_to
        Cell where the robot must stand at the horizon, -1 if it is free.
    """

    robots: tuple[int, ...]
    start: int
    start_step: int
    battery_j: float
    capacity_j: float
    reserve_j: float
    wait_j: float
    sense_j: float
    return_to: int = -1


@dataclass(frozen=True)
class RouteProblem:
    """An OROS instance as arrays.

    Parameters
    ----------
    horizon
        T, the last instant.
    n_cells
        Number of cells.
    reward
        ``(n_cells, horizon + 1)``: what first sensing cell i at instant t earns, coverage only; <= 0 where it
        earns nothing (already explored, past its deadline, t = 0).
    arc_from, arc_to, arc_steps, arc_energy_j
        ``(n_arcs,)`` travel arcs, sorted by ``arc_from``; of arcs that agree in from, to and steps only the
        cheapest is kept.
    arc_travel
        ``(n_arcs,)`` index of each arc in the instance's ``travel[]``.
    out_start
        ``(n_cells + 1,)``: arcs that leave cell i are ``out_start[i]:out_start[i + 1]``.
    sigma
        Weight of one joule left at the horizon.
    classes
        Robot classes.
    charger_j
        ``(n_cells,)`` most a robot may charge in one waiting step in this cell, J; 0 where there is none.
    charger_slots
        ``(n_cells,)`` robots that may charge at once.
    robots_per_cell, forbid_swaps, sensing_robots_per_step
        The coupling limits of the instance; None or False where absent.
    """

    horizon: int
    n_cells: int
    reward: FloatArray
    arc_from: IntArray
    arc_to: IntArray
    arc_steps: IntArray
    arc_energy_j: FloatArray
    arc_travel: IntArray
    out_start: IntArray
    sigma: float
    classes: tuple[RobotClass, ...]
    charger_j: FloatArray
    charger_slots: IntArray
    robots_per_cell: int | None = None
    forbid_swaps: bool = False
    sensing_robots_per_step: int | None = None

    @property
    def n_arcs(self) -> int:
        """Number of travel arcs."""
        return len(self.arc_from)

    @property
    def n_robots(self) -> int:
        """Number of robots over all classes."""
        return sum(len(group.robots) for group in self.classes)


@dataclass(frozen=True)
class Route:
    """What one robot does from ``start_step`` to the horizon, one entry per instant t = start_step..T.

    Parameters
    ----------
    robot_class
        Index into ``RouteProblem.classes``.
    cell
        Cell where the robot stands, -1 while on an arc of several steps.
    arc
        Arc (index into ``RouteProblem.arc_from``) started at this instant, -1 when it waits, is under way, or
        at the horizon.
    sense
        True where it senses.
    charge_j
        J credited at this instant (charged while waiting since the instant before).
    """

    robot_class: int
    cell: IntArray
    arc: IntArray
    sense: NDArray[np.bool_]
    charge_j: FloatArray
