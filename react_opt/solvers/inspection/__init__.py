"""Deferred-priority inspection: from an instance to a checked plan."""

from __future__ import annotations

import time
from typing import Any

from react_opt.certify_inspection import OPTIMAL_GAP, check_inspection
from react_opt.claims import instance_ref, versions
from react_opt.instance import InspectionInstance
from react_opt.models.inspection import InspectionArrays, InspectionModel, Routes, build
from react_opt.options import SolveOptions
from react_opt.plan import (
    InspectionClaim,
    InspectionPlan,
    InspectionRoute,
    Plan,
    Secondary,
    Skipped,
    Stop,
    gap_of,
)
from react_opt.solvers.highs_model import fresh_scheduler
from react_opt.solvers.inspection.answer import Answer
from react_opt.solvers.inspection.baseline import Gate, gate, simple_rule
from react_opt.solvers.inspection.control import Control
from react_opt.solvers.inspection.decompose import Decomposition
from react_opt.solvers.inspection.explain import Reason, reasons, with_losses
from react_opt.solvers.inspection.whole import solve_whole
from react_opt.solvers.stated import Statement, require_start

__all__ = ["Gate", "gate", "inspect", "simple_rule", "solve_inspection"]

CHECK_S, CHECK_ROW_S = 0.01, 3e-5  # kept for reading the plan back and checking it, and more per travel row


def inspect(
    arrays: InspectionArrays, options: SolveOptions, routes: Routes | None = None, reserve_s: float = 0.0
) -> tuple[Answer, Control]:
    """Solve an inspection on arrays by route decomposition: the entry for a control loop.

    Parameters
    ----------
    arrays
        The problem (:func:`react_opt.models.inspection.build`).
    options
        Limits, threads, seed and gap. The unit of ``work_limit`` is one pricing (a large one is several) or one
        portion of local search.
    routes
        Feasible routes to start from; None for none.
    reserve_s
        Seconds of the time limit to leave to the caller.

    Returns
    -------
    Answer
        Routes, value and second objective with their bounds.
    Control
        What stopped it, and the work done.
    """
    deadline = None if options.deadline is None else options.deadline - reserve_s

    def report(value: float | None, bound: float) -> None:
        if options.on_progress is not None:
            options.on_progress(time.perf_counter() - options.begun, value, bound)

    fresh_scheduler()
    with Control(deadline, options.work_limit, options.should_stop) as control:
        search = Decomposition(
            arrays, control, threads=options.threads, seed=options.seed, gap=options.gap or 0.0, routes=routes,
            on_bound=report,
        )  # fmt: skip
        return search.run(), control


def solve_inspection(instance: InspectionInstance, options: SolveOptions, start: Plan | None = None) -> InspectionPlan:
    """Solve an ``inspection`` instance; see :func:`react_opt.solve`.

    Raises
    ------
    InputError
        Where ``start`` is no valid plan of the instance.
    """
    model = build(instance)
    reserve_s = CHECK_S + CHECK_ROW_S * len(instance.travel)
    known = None if start is None else _started(model, require_start(instance, start, InspectionPlan, check_inspection))
    statement = Statement(instance, options, check_inspection)
    settings: dict[str, Any]
    if options.method == "monolith" or (options.solver is not None and options.method == "auto"):
        answer, limit, solver, version, settings = solve_whole(model.arrays, options, known)
        method = "monolith: asked for" if options.method == "monolith" else f"monolith: solver {solver} was asked for"
        found_with = {**versions("numpy", "scipy"), solver: version}
    else:
        answer, control = inspect(model.arrays, options, known, reserve_s)
        limit = control.limit
        if answer.stuck and limit == "none":
            limit = "memory"
        method, solver = "routes", "react_opt with highs"
        found_with = versions("numpy", "scipy", "numba", "highspy")
        settings = dict(answer.notes)
    statement.phase_done("solve")
    if answer.routes is None:
        facts = statement.facts(method, solver, found_with, settings)
        return statement.checked(_without_plan(instance, model, answer, limit, facts))
    optimal = answer.value_bound - answer.value <= OPTIMAL_GAP * abs(answer.value)
    if options.explain and optimal:
        deadline = None if options.deadline is None else options.deadline - reserve_s
        with Control(deadline, None, options.should_stop) as left:
            why = with_losses(model.arrays, answer.routes, answer.value, left, options.seed)
    else:
        why = reasons(model.arrays, answer.routes)
    statement.phase_done("explain")
    best = (
        optimal
        and answer.cost_bound is not None
        and answer.cost - answer.cost_bound <= OPTIMAL_GAP * max(1.0, answer.cost)
    )
    claim = InspectionClaim(
        status="optimal" if optimal else "feasible",
        objective=answer.value,
        bound=max(answer.value_bound, answer.value),
        gap=gap_of(answer.value, max(answer.value_bound, answer.value)),
        limit="none" if optimal and best else limit,
        secondary=Secondary(
            objective=answer.cost,
            bound=None if answer.cost_bound is None or not optimal else min(answer.cost_bound, answer.cost),
            status="optimal" if best else "feasible",
        ),
        **statement.facts(method, solver, found_with, settings),
    )
    return statement.checked(_filled(instance, model, answer.routes, claim, why))


def _started(model: InspectionModel, start: InspectionPlan) -> Routes:
    """Return the routes of a plan."""
    number = {name: index for index, name in enumerate(model.targets)}
    stops = {route.robot: [number[stop.target] for stop in route.stops] for route in start.routes}
    return [stops.get(name, []) for name in model.robots]


def _filled(
    instance: InspectionInstance,
    model: InspectionModel,
    routes: Routes,
    claim: InspectionClaim,
    why: list[Reason],
) -> InspectionPlan:
    """Return the plan of routes, with its times and batteries."""
    arrays, n, rows = model.arrays, len(model.targets), []
    for r, robot in enumerate(instance.robots):
        at, now_s, spent_j, stops = n, 0.0, 0.0, []
        for k in routes[r]:
            now_s += float(arrays.time_s[r, at, k])
            spent_j += float(arrays.energy_j[r, at, k])
            stops.append(
                Stop(
                    target=model.targets[k],
                    arrive_s=now_s - instance.targets[k].service_s,
                    leave_s=now_s,
                    battery_j=robot.battery_j - spent_j,
                )
            )
            at = k
        now_s += float(arrays.time_s[r, at, n + 1])
        spent_j += float(arrays.energy_j[r, at, n + 1])
        rows.append(
            InspectionRoute(
                robot=robot.id,
                stops=tuple(stops),
                end=robot.end,
                finish_s=now_s,
                finish_battery_j=robot.battery_j - spent_j,
            )
        )
    return InspectionPlan(
        instance=instance_ref(instance),
        claim=claim,
        routes=tuple(rows),
        t_dpi_s=max((row.finish_s for row in rows), default=0.0),
        skipped=tuple(Skipped(target=model.targets[row.target], reason=row.reason, loss=row.loss) for row in why),
    )


def _without_plan(
    instance: InspectionInstance, model: InspectionModel, answer: Answer, limit: str, facts: dict[str, Any]
) -> InspectionPlan:
    reason = None
    if answer.infeasible:
        reason = "fleet: end: no plan brings every robot to its end"
        for r, robot in enumerate(instance.robots):
            if not model.arrays.allows(r, []):
                reason = f"robot {robot.id}: end: {robot.end!r} cannot be reached within the time left and the energy"
                break
    claim = InspectionClaim(
        status="infeasible" if answer.infeasible else "no_plan",
        bound=None if answer.infeasible else answer.value_bound,
        limit="none" if answer.infeasible else limit,  # type: ignore[arg-type]
        reason=reason,
        **facts,
    )
    return InspectionPlan(instance=instance_ref(instance), claim=claim)
