"""Pricing of a class of robots that can reach a charger: what its labels need to know, and the call of the kernel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.route_problem import FloatArray, RouteProblem
from react_opt.solvers.routes.beam import needed_battery
from react_opt.solvers.routes.charging import Charge, charged, flat_rest, grow_charging, most_ahead
from react_opt.solvers.routes.labelstore import NEVER, Graph, Labels, Prices
from react_opt.solvers.routes.linesearch import lowest_point
from react_opt.solvers.routes.residual import leftover

SLACK = 1e-9  # of the capacity


class Recharging:
    """Labels of one class whose battery can rise.

    Parameters
    ----------
    problem
        The route problem.
    group
        Index of the class.
    """

    def __init__(self, problem: RouteProblem, group: int) -> None:
        self.problem, data = problem, problem.classes[group]
        self._graph = (problem.out_start, problem.arc_to, problem.arc_steps)
        self._begin, self._start = data.start_step, data.start
        self._finish = np.zeros(problem.n_cells)
        if data.return_to >= 0:
            self._finish[:] = NEVER
            self._finish[data.return_to] = 0.0
        amount = np.where(problem.charger_slots > 0, problem.charger_j, 0.0)
        idle = np.full(problem.n_cells, data.wait_j)
        none = np.zeros(problem.n_arcs)
        horizon = problem.horizon
        instant = np.arange(horizon + 1)[:, None]
        gross = most_ahead(*self._graph, self._finish, self._begin, horizon, problem.arc_energy_j, idle)
        slack = SLACK * max(1.0, data.capacity_j)
        budget = data.battery_j - data.reserve_j
        need = needed_battery(problem, data, leftover(problem, []))
        self.charge = Charge(
            budget + slack,
            data.battery_j - data.capacity_j,
            problem.arc_energy_j,
            data.wait_j,
            data.sense_j,
            problem.sigma,
            amount,
            data.battery_j - need + slack,
            budget - gross - data.sense_j * (horizon - instant),
            most_ahead(*self._graph, self._finish, self._begin, horizon, none, amount),
        )
        self.rate = 0.0  # price of a joule at the last call

    @property
    def possible(self) -> bool:
        """Whether a robot of the class can stand at a charger for a step."""
        return bool(self.charge.yet[self._begin, self._start] > 0.0)

    def grow(
        self,
        graph: Graph,
        prices: Prices,
        slot: FloatArray | None,
        origin: FloatArray,
        cutoff: float,
        width: int,
        max_labels: int,
        stop: NDArray[np.uint8],
    ) -> tuple[Labels, bool]:
        """Return labels and whether none was lost (`charging.grow_charging`).

        Parameters
        ----------
        graph, prices
            Arcs and prices forwards in time.
        slot
            ``(T + 1, n)`` prices of charging; None if there are none.
        origin
            ``(n_cells,)`` value of starting in each cell.
        cutoff, width, max_labels, stop
            See `labels.grow_labels`.
        """
        slots = np.zeros((1, 1)) if slot is None else slot
        charge = self.charge

        def rest(rate: float) -> FloatArray:
            return flat_rest(
                *self._graph, self._finish, self._begin, prices.gain, prices.stand, slots, charge, float(rate)
            )

        def worth(rate: float) -> float:
            return float(rest(rate)[self._begin, self._start]) + rate * charge.budget

        top = float(prices.gain.max(initial=0.0)) / max(charge.sense, 1.0)
        best = self.rate = lowest_point(worth, self.rate, top)
        rates = [0.0, -charge.sigma, *(share * best for share in (0.4, 0.75, 1.0, 1.3, 2.0) if best > 0.0)]
        completion = np.stack([rest(rate) for rate in rates])
        return grow_charging(
            graph, prices, slots, charge, origin, self._begin, completion, np.array(rates), cutoff, width, max_labels,
            stop,
        )  # fmt: skip

    def credits(self, labels: Labels, label: int) -> FloatArray:
        """Return what is charged at each instant by the route of a label at the horizon, J."""
        return charged(labels, self.charge, self.problem.arc_steps, label, self.problem.horizon)[self._begin :]


def recharging(problem: RouteProblem) -> dict[int, Recharging]:
    """Return the classes that can reach a charger."""
    if not problem.charger_j.any():
        return {}
    classes = {group: Recharging(problem, group) for group in range(len(problem.classes))}
    return {group: each for group, each in classes.items() if each.possible}
