"""From bare answers to plans: what a solver needs to hand in routes or an assignment and its claim."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from react_opt.certify_inspection import OPTIMAL_GAP
from react_opt.claims import instance_ref, optimality_tolerance
from react_opt.instance import AssignmentInstance, InspectionInstance, OrosInstance
from react_opt.models.assignment import AssignmentModel, IntArray, objective_of
from react_opt.models.inspection import InspectionModel, Routes
from react_opt.models.readback import fill_plan
from react_opt.models.replay import tidy
from react_opt.plan import (
    Assigned,
    AssignmentPlan,
    Claim,
    Deferred,
    InspectionClaim,
    InspectionPlan,
    InspectionRoute,
    OrosPlan,
    Secondary,
    Skipped,
    Stop,
    gap_of,
)
from react_opt.route_problem import Route, RouteProblem
from react_opt.solvers.assignment.explain import reasons as assignment_reasons
from react_opt.solvers.inspection.explain import reasons as inspection_reasons

Limit = Literal["time", "memory", "work", "interrupt", "none"]
KINDS: dict[str, type[OrosPlan] | type[AssignmentPlan] | type[InspectionPlan]] = {
    "oros": OrosPlan,
    "assignment": AssignmentPlan,
    "inspection": InspectionPlan,
}


def claimed(objective: float, bound: float | None, tolerance: float, limit: Limit, solver: str) -> dict[str, Any]:
    """Return the fields of a claim: optimal where the bound is within the tolerance of the objective.

    A bound below the objective by no more than that is rounding, and lifted; one further below is left as it is,
    for the checker to find.
    """
    if bound is not None and objective - tolerance <= bound < objective:
        bound = objective
    optimal = bound is not None and abs(bound - objective) <= tolerance
    return {
        "status": "optimal" if optimal else "feasible",
        "objective": objective,
        "bound": bound,
        "gap": gap_of(objective, bound),
        "limit": "none" if optimal else limit,
        "solver": solver,
    }


def without_plan(
    instance: Any, solver: str, *, infeasible: str = "", limit: Limit = "none", bound: float | None = None,
    reason: str | None = None,
) -> Any:  # fmt: skip
    """Return a plan that holds a claim alone: nothing found, or proven infeasible for the reason given."""
    status = "infeasible" if infeasible else "no_plan"
    claim = {
        "status": status, "limit": "none" if infeasible else limit, "bound": None if infeasible else bound,
        "solver": solver, "reason": infeasible or reason,
    }  # fmt: skip
    kind = KINDS[instance.kind]
    return kind.model_validate({"instance": instance_ref(instance).model_dump(), "claim": claim})


def oros_plan(
    instance: OrosInstance, problem: RouteProblem, routes: Sequence[Route], bound: float | None, limit: Limit,
    solver: str,
) -> OrosPlan:  # fmt: skip
    """Return the plan of routes, one per robot, class by class (:mod:`react_opt.route_problem`)."""
    shell = OrosPlan(instance=instance_ref(instance), claim=Claim(status="feasible"))
    plan = fill_plan(instance, problem, tidy(problem, list(routes)), shell)
    assert plan.objective is not None
    total = plan.objective.total
    fields = claimed(total, bound, optimality_tolerance(total, problem.sigma), limit, solver)
    return plan.model_copy(update={"claim": Claim(**fields)})


def assignment_plan(
    instance: AssignmentInstance, model: AssignmentModel, robot_of: IntArray, bound: float | None, limit: Limit,
    solver: str,
) -> AssignmentPlan:  # fmt: skip
    """Return the plan of an assignment: ``(K,)`` the robot of each target, -1 for none."""
    objective = objective_of(model.arrays, robot_of)
    fields = claimed(objective, bound, OPTIMAL_GAP * abs(objective), limit, solver)
    return AssignmentPlan(
        instance=instance_ref(instance),
        claim=Claim(**fields),
        assigned=tuple(
            Assigned(robot=model.robots[robot_of[k]], target=model.targets[k])
            for k in np.flatnonzero(robot_of >= 0).tolist()
        ),
        deferred=tuple(
            Deferred(target=model.targets[why.target], reason=why.reason) for why in assignment_reasons(model, robot_of)
        ),
    )


def inspection_plan(
    instance: InspectionInstance, model: InspectionModel, routes: Routes, bound: float | None, limit: Limit,
    solver: str,
) -> InspectionPlan:  # fmt: skip
    """Return the plan of routes, per robot the targets in the order of visit."""
    arrays, n = model.arrays, len(model.targets)
    value, cost = arrays.worth(routes)
    rows = []
    for r, robot in enumerate(instance.robots):
        at, now_s, spent_j, stops = n, 0.0, 0.0, []
        for k in routes[r]:
            now_s += float(arrays.time_s[r, at, k])
            spent_j += float(arrays.energy_j[r, at, k])
            arrive_s = now_s - instance.targets[k].service_s
            left_j = robot.battery_j - spent_j
            stops.append(Stop(target=model.targets[k], arrive_s=arrive_s, leave_s=now_s, battery_j=left_j))
            at = k
        now_s += float(arrays.time_s[r, at, n + 1])
        spent_j += float(arrays.energy_j[r, at, n + 1])
        rows.append(
            InspectionRoute(
                robot=robot.id, stops=tuple(stops), end=robot.end, finish_s=now_s,
                finish_battery_j=robot.battery_j - spent_j,
            )
        )  # fmt: skip
    fields = claimed(value, bound, OPTIMAL_GAP * abs(value), limit, solver)
    return InspectionPlan(
        instance=instance_ref(instance),
        claim=InspectionClaim(**fields, secondary=Secondary(objective=cost, status="feasible")),
        routes=tuple(rows),
        t_dpi_s=max((row.finish_s for row in rows), default=0.0),
        skipped=tuple(
            Skipped(target=model.targets[why.target], reason=why.reason)
            for why in inspection_reasons(arrays, routes)
        ),
    )  # fmt: skip


def whole(value: float, scale: int) -> int:
    """Return a scaled number rounded up: drives in whole units never look shorter than they are."""
    return math.ceil(value * scale - 1e-6)
