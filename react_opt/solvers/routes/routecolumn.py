"""From a route to its column: cells in order of collection, and its exact value."""

from __future__ import annotations

import numpy as np

from react_opt.route_problem import Route, RouteProblem
from react_opt.solvers.routes.columns import Column


def route_column(problem: RouteProblem, route: Route) -> Column:
    """Return the column of a route: its cells in order of collection and its exact value.

    Parameters
    ----------
    problem
        The route problem.
    route
        A route; sensing the same cell twice counts twice (a relaxation that only pricing produces).
    """
    data = problem.classes[route.robot_class]
    instants = np.arange(data.start_step, problem.horizon + 1)
    sensed = route.cell[route.sense]
    coverage = float(problem.reward[sensed, instants[route.sense]].sum())
    return Column(
        route.robot_class,
        coverage + problem.sigma * end_battery(problem, route),
        tuple(sensed.tolist()),
        route,
        tuple(instants[route.sense].tolist()),
    )


def end_battery(problem: RouteProblem, route: Route) -> float:
    """Return the battery at the horizon after a route, J."""
    data = problem.classes[route.robot_class]
    started = route.arc[route.arc >= 0]
    waits = len(route.cell) - 1 - int(problem.arc_steps[started].sum())
    spent = float(problem.arc_energy_j[started].sum()) + waits * data.wait_j
    return data.battery_j - spent - data.sense_j * int(route.sense.sum()) + float(route.charge_j.sum())
