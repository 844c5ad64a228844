"""What is known of an inspection while it is being solved, and the grid on which its values lie."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction

from react_opt.models.inspection import FloatArray, Routes


@dataclass
class Answer:
    """What is known of an instance.

    Parameters
    ----------
    routes
        Best routes by value, then second objective; None where none are known.
    value, cost
        Their value and second objective; meaningless without routes.
    value_bound
        Proven upper bound on the value.
    cost_bound
        Proven lower bound on the second objective of plans of the best value; None where unknown.
    infeasible
        Whether it is proven that some class of robots has no route.
    stuck
        Whether labels or columns outgrew their limits, so that the search ended without a proof.
    notes
        Counts: columns, pricings, routes enumerated.
    """

    routes: Routes | None = None
    value: float = -math.inf
    cost: float = math.inf
    value_bound: float = math.inf
    cost_bound: float | None = None
    infeasible: bool = False
    stuck: bool = False
    notes: dict[str, int] = field(default_factory=dict)


def grid_of(values: FloatArray) -> float:
    """Return the coarsest step of which all values are multiples, 0 where it is finer than 1e-5 of the largest."""
    numerator, denominator = 0, 1
    for value in values.tolist():
        exact = Fraction(repr(value))
        common = math.lcm(denominator, exact.denominator)
        if common > 10**7:
            return 0.0
        numerator = math.gcd(numerator * (common // denominator), exact.numerator * (common // exact.denominator))
        denominator = common
    step = numerator / denominator
    return step if len(values) and step > 1e-5 * float(values.max()) else 0.0


def rounded(bound: float, grid: float) -> float:
    """Return a bound on a value, rounded down to the grid of values (0: no grid)."""
    return math.floor(bound / grid + 1e-6) * grid if grid > 0 else bound
