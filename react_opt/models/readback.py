"""From routes on arrays back to a plan of the instance, with batteries replayed and useless sensing dropped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from react_opt.instance import OrosInstance
from react_opt.models.replay import battery, coverage, first_sensed
from react_opt.plan import Explored, OrosPlan, OrosPlanObjective, OrosRobotPlan, OrosStep
from react_opt.route_problem import FloatArray, Route, RouteProblem


def explored_value(instance: OrosInstance) -> float:
    """Return what cells explored from the start earn: ``w_i min(deadline_i, T)``, the same for every plan."""
    horizon = instance.horizon_steps
    return sum(
        cell.weight * (horizon if cell.deadline_step is None else min(cell.deadline_step, horizon))
        for cell in instance.cells
        if cell.explored
    )


def fill_plan(instance: OrosInstance, problem: RouteProblem, routes: Sequence[Route], plan: OrosPlan) -> OrosPlan:
    """Return a copy of ``plan`` that holds the routes: robots in the order of the instance, explored cells, objective.

    Parameters
    ----------
    instance
        The instance.
    problem
        Its arrays.
    routes
        One route per robot, class by class, as :func:`tidy` leaves them.
    plan
        A plan with its claim.
    """
    order = [robot for group in problem.classes for robot in group.robots]
    by_robot = dict(zip(order, routes, strict=True))
    robots, explored = [], []
    left_j = 0.0
    for index, robot in enumerate(instance.robots):
        route = by_robot[index]
        level = battery(problem, route)
        left_j += float(level[-1])
        robots.append(OrosRobotPlan(id=robot.id, steps=_steps(instance, problem, route, level)))
        explored += [(int(route.cell[k]), robot.start_step + int(k), robot.id) for k in np.flatnonzero(route.sense)]
    covered = coverage(problem, first_sensed(problem, routes)) + explored_value(instance)
    weighted = problem.sigma * left_j
    return plan.model_copy(
        update={
            "robots": tuple(robots),
            "explored": tuple(
                Explored(cell=instance.cells[i].id, step=t, robot=r)
                for i, t, r in sorted(explored, key=lambda x: (x[1], x[0]))
            ),
            "objective": OrosPlanObjective(
                coverage=covered, battery=weighted, battery_j=left_j, total=covered + weighted
            ),
        }
    )


def routes_of(instance: OrosInstance, problem: RouteProblem, plan: OrosPlan) -> list[Route]:
    """Return the routes of a plan, one per robot, class by class.

    Parameters
    ----------
    instance
        The instance the plan belongs to.
    problem
        Its arrays.
    plan
        A plan that passed the checker.
    """
    cell_index = {cell.id: i for i, cell in enumerate(instance.cells)}
    arc_index = _arc_index(instance, problem)
    robots = {robot.id: robot for robot in plan.robots}
    routes = []
    for k, group in enumerate(problem.classes):
        for index in group.robots:
            steps = robots[instance.robots[index].id].steps
            routes.append(
                Route(
                    k,
                    np.array([-1 if step.cell is None else cell_index[step.cell] for step in steps], dtype=np.int64),
                    np.array([-1 if step.arc is None else arc_index[step.arc] for step in steps], dtype=np.int64),
                    np.array([step.sensing for step in steps], dtype=bool),
                    np.array([step.charging_j for step in steps], dtype=np.float64),
                )
            )
    return routes


def _arc_index(instance: OrosInstance, problem: RouteProblem) -> dict[int, int]:
    """Return for every travel row the arc that counts for it: the cheapest with its ends and steps."""
    counts = {
        (int(i), int(j), int(d)): a
        for a, (i, j, d) in enumerate(zip(problem.arc_from, problem.arc_to, problem.arc_steps, strict=True))
    }
    cell_index = {cell.id: i for i, cell in enumerate(instance.cells)}
    result = {}
    for index, arc in enumerate(instance.travel):
        a = counts.get((cell_index[arc.from_], cell_index[arc.to], arc.steps))
        if a is not None:
            result[index] = a
    return result


def _steps(instance: OrosInstance, problem: RouteProblem, route: Route, level: FloatArray) -> tuple[OrosStep, ...]:
    start = problem.classes[route.robot_class].start_step
    steps = []
    for k in range(len(route.cell)):
        arc = None if route.arc[k] < 0 else int(problem.arc_travel[route.arc[k]])
        steps.append(
            OrosStep(
                t=start + k,
                cell=None if route.cell[k] < 0 else instance.cells[route.cell[k]].id,
                arc=arc,
                speed_m_s=None if arc is None else instance.travel[arc].speed_m_s,
                sensing=bool(route.sense[k]),
                charging_j=float(route.charge_j[k]),
                battery_j=float(level[k]),
            )
        )
    return tuple(steps)
