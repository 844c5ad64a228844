"""The inspection as one integer program, solved by a backend: first the value, then the second objective."""

from __future__ import annotations

from typing import Any

from react_opt.models.inspection import InspectionArrays, Routes, program, routes_of, vector_of
from react_opt.models.program import Program
from react_opt.options import SolveOptions
from react_opt.solvers.backend import Backend
from react_opt.solvers.inspection.answer import Answer
from react_opt.solvers.outcome import Limit, Outcome, Request
from react_opt.solvers.registry import DEFAULT, backend

VALUE_SLACK = 1e-7  # relative: what the second stage may lose of the value


def solve_whole(
    arrays: InspectionArrays, options: SolveOptions, routes: Routes | None
) -> tuple[Answer, Limit, str, str, dict[str, Any]]:
    """Solve both stages with a backend.

    Parameters
    ----------
    arrays, options
        The problem and the limits.
    routes
        Feasible routes to start from; None for the empty ones where they are feasible.

    Returns
    -------
    Answer
        What is known.
    limit, solver, version, settings
        What stopped the backend, and with what it solved.
    """
    chosen = backend(options.solver or DEFAULT)
    answer = Answer(value_bound=float(arrays.value.sum()))
    empty: Routes = [[] for _ in arrays.time_s]
    for start in (routes, empty):
        if start is not None and arrays.is_feasible(start):
            _offer(arrays, answer, start)
    if not arrays.time_s.size:
        answer.routes, answer.value, answer.cost, answer.value_bound, answer.cost_bound = [], 0.0, 0.0, 0.0, 0.0
        return answer, "none", chosen.name, chosen.version, {}
    model = program(arrays)
    outcome = _solve(chosen, model, arrays, options, answer)
    if outcome.bound is not None:
        answer.value_bound = min(answer.value_bound, outcome.bound)
    answer.infeasible = outcome.status == "infeasible" and answer.routes is None
    slack = VALUE_SLACK * max(1.0, abs(answer.value))
    limit = outcome.limit
    if answer.routes is not None and answer.value_bound <= answer.value + slack and limit == "none":
        answer.value_bound = answer.value
        second = program(arrays, answer.value - slack)
        outcome = _solve(chosen, second, arrays, options, answer)
        answer.cost_bound, limit = outcome.bound, outcome.limit
    return answer, limit, outcome.solver, outcome.version, dict(outcome.settings)


def _solve(chosen: Backend, model: Program, arrays: InspectionArrays, options: SolveOptions, answer: Answer) -> Outcome:
    n = len(arrays.value)
    request = Request(
        time_limit_s=options.left_s(),
        work_limit=options.work_limit,
        gap_rel=options.gap or 0.0,
        threads=options.threads,
        seed=options.seed,
        start=None if answer.routes is None else vector_of(model, answer.routes, n),
        on_progress=options.on_progress if model.maximise else None,
        should_stop=options.should_stop,
    )
    outcome = chosen.solve(model, request)
    if outcome.x is not None:
        routes = routes_of(model, outcome.x, len(arrays.time_s), n)
        if arrays.is_feasible(routes):
            _offer(arrays, answer, routes)
    return outcome


def _offer(arrays: InspectionArrays, answer: Answer, routes: Routes) -> None:
    value, cost = arrays.worth(routes)
    slack = VALUE_SLACK * max(1.0, abs(value))
    if answer.routes is None or value > answer.value + slack or (value > answer.value - slack and cost < answer.cost):
        answer.routes, answer.value, answer.cost = routes, value, cost
