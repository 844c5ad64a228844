"""One robot, few cells, many steps: its best route is searched for at once, without a linear programme.

What grows with the horizon in column generation is the number of labels, one pricing after the other. Here one search
by events (`beam`) compares labels across instants and is bounded by a Lagrangian potential.
"""

from __future__ import annotations

from typing import Any

from react_opt.route_problem import RouteProblem
from react_opt.solvers.routes.beam import affordable_width, best_response
from react_opt.solvers.routes.budget import Standing

STEPS_PER_CELL = 20  # from which on it is tried
MOST_CELLS = 64  # that a certificate remembers
MOST_WORK, WORK_PER_S, SHARE = 20_000_000, 2_000_000, 0.2  # looks at arcs, and the part of the time for them
LEAST_WIDTH, PRICE_STEPS = 16, 60


def fits(problem: RouteProblem) -> bool:
    """Return whether the search is worth a try: one robot on its own, without chargers."""
    free = problem.robots_per_cell is None and problem.sensing_robots_per_step is None and not problem.charger_j.any()
    many = problem.horizon >= STEPS_PER_CELL * problem.n_cells
    return problem.n_robots == 1 and free and many and problem.n_cells <= MOST_CELLS


def proven_alone(problem: RouteProblem, standing: Standing) -> dict[str, Any] | None:
    """Offer the best route, lower the bound to it and return the certificate; None if the search was cut short.

    Parameters
    ----------
    problem
        A problem that :func:`fits`.
    standing
        Best plan so far and the limits.
    """
    left_s = standing.budget.left_s()
    work = MOST_WORK if left_s is None else int(min(MOST_WORK, SHARE * WORK_PER_S * left_s))
    width = affordable_width(problem, work, work)
    if width < LEAST_WIDTH:
        return None
    steps = max(5, min(PRICE_STEPS, work // max(1, 4 * problem.horizon * problem.n_arcs)))
    standing.budget.spend()
    found = best_response(problem, 0, [], width=width, price_steps=steps)
    if found.route is not None:
        standing.offer([found.route])
    if not found.exact or standing.objective is None:
        return None
    value = max(found.value, standing.objective)  # they may differ by rounding
    standing.lower_bound_to(value + 1e-10 * abs(value))
    return {
        "kind": "lagrangian",
        "bound": value,
        "cell_price": [0.0] * problem.n_cells,
        "classes": [{"robots": list(problem.classes[0].robots), "best": value}],
        "memory": "all",
        "cuts": [],
        "rows": [],
        "potential": [max(0.0, float(price)) for price in found.prices],
    }
