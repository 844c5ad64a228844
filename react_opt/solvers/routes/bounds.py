"""What a bound is worth: when a plan counts as optimal, and rounding a bound down to a value a plan can have."""

from __future__ import annotations

import math

import numpy as np

from react_opt.route_problem import FloatArray, RouteProblem

SAFETY = 1e-10
MOST_LEVELS = 100_000


def tolerance(objective: float, sigma: float) -> float:
    """Return how far above a plan's objective a bound may lie for the plan to count as optimal.

    ``max(1e-9 |objective|, min(1e-6 |objective|, sigma * 1 J))``; without sigma ``1e-6 |objective|``.

    Parameters
    ----------
    objective
        Objective of the plan.
    sigma
        Weight of one joule left at the horizon.
    """
    size = abs(objective)
    return max(1e-9 * size, min(1e-6 * size, sigma) if sigma > 0 else 1e-6 * size)


class Lattice:
    """The values that plans can have, if all data are whole numbers.

    A plan is worth ``g a + sigma (B - q b)`` with whole a and b: g divides every reward, q every energy, B is
    the sum of the batteries (of the capacities, where there are chargers). A bound that lies between two such values
    is worth the lower one.

    Parameters
    ----------
    problem
        The route problem.
    """

    def __init__(self, problem: RouteProblem) -> None:
        self.sigma = problem.sigma
        positive = problem.reward[problem.reward > 0]
        self.reward_unit = _unit(positive) if len(positive) else 1.0
        energies = [problem.arc_energy_j]
        energies += [np.array([group.wait_j, group.sense_j]) for group in problem.classes]
        self.battery_j = sum(len(group.robots) * group.battery_j for group in problem.classes)
        self.least_j = sum(len(group.robots) * group.reserve_j for group in problem.classes)
        if problem.charger_j.any():  # it is best to charge what power and capacity allow
            self.battery_j = sum(len(group.robots) * group.capacity_j for group in problem.classes)
            energies.append(problem.charger_j)
            energies.append(np.array([group.capacity_j - group.battery_j for group in problem.classes]))
        self.energy_unit = _unit(np.concatenate(energies))

    def round_down(self, bound: float) -> float:
        """Return the largest value a plan can have that is not above ``bound``, or ``bound`` if unknown.

        A margin for rounding errors is added to the bound first, so that a value equal to the bound is kept.

        Parameters
        ----------
        bound
            A valid bound on the objective.
        """
        bound += SAFETY * abs(bound)
        if self.reward_unit == 0.0 or not math.isfinite(bound):
            return bound
        if self.sigma == 0.0:
            return self.reward_unit * math.floor(bound / self.reward_unit)
        level = math.floor((bound - self.sigma * self.least_j) / self.reward_unit)
        best = -math.inf
        for _ in range(MOST_LEVELS):
            coverage = self.reward_unit * level
            if level < 0 or coverage + self.sigma * self.battery_j <= best:
                break
            battery = min(self.battery_j, (bound - coverage) / self.sigma)
            if self.energy_unit > 0.0 and battery < self.battery_j:
                spent = math.ceil((self.battery_j - battery) / self.energy_unit - 1e-7)
                battery = self.battery_j - self.energy_unit * spent
            if battery >= self.least_j - 1e-7:
                best = max(best, coverage + self.sigma * battery)
            level -= 1
        return min(bound, best + SAFETY * abs(best)) if best > -math.inf else bound


def _unit(values: FloatArray) -> float:
    """Return the greatest common divisor of whole numbers, 0 if they are not whole or all zero."""
    if len(values) == 0 or np.any(values != np.floor(values)) or np.any(np.abs(values) > 2**52):
        return 0.0
    return float(np.gcd.reduce(values.astype(np.int64)))
