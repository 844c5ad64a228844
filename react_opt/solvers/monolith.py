"""The monolithic MILP of an OROS instance, solved by a backend from the best routes known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter

from react_opt.instance import OrosInstance
from react_opt.models.oros import OrosModel, oros_model
from react_opt.models.program import FloatArray, Program
from react_opt.models.replay import tidy
from react_opt.route_problem import Route, RouteProblem
from react_opt.solvers.outcome import Outcome, Request
from react_opt.solvers.registry import backend


def solve_monolith(
    instance: OrosInstance,
    problem: RouteProblem,
    solver: str,
    request: Request,
    routes: Sequence[Route] | None,
    keep_until: int | None = None,
) -> tuple[Outcome, list[Route] | None]:
    """Build the MILP, solve it, and read the routes back.

    Parameters
    ----------
    instance, problem
        The instance and its arrays.
    solver
        Name of the backend.
    request
        Limits; its ``start`` is filled in from ``routes``.
    routes
        Routes to start from, one per robot, class by class; None for none.
    keep_until
        Instant up to which the routes are fixed; None for nothing fixed.

    Returns
    -------
    outcome
        The backend's claim; objective and bound count what explored cells earn.
    routes
        Tidy routes, None where the backend found nothing usable.
    """
    begun = perf_counter()
    chosen = backend(solver)
    model = oros_model(instance, problem)
    start = None if routes is None else model.vector(list(routes))
    program = model.program if keep_until is None or start is None else _frozen(model, start, keep_until)
    limit_s = request.time_limit_s  # building the model took some of it
    left_s = None if limit_s is None else max(0.0, limit_s - (perf_counter() - begun))
    outcome = chosen.solve(program, replace(request, start=start, time_limit_s=left_s))
    if outcome.x is None:
        return outcome, None
    return outcome, tidy(problem, model.routes(outcome.x))


def _frozen(model: OrosModel, start: FloatArray, until: int) -> Program:
    """Fix what happens up to instant ``until``, but for what starts there."""
    columns: list[int] = []
    for robot in model.robots:
        for block, last in ((robot.x, until), (robot.h, until), (robot.s, until + 1), (robot.u, until + 1)):
            part = block[:, :last]
            columns += part[part >= 0].tolist()
    return model.program.fixed({column: float(start[column]) for column in columns})
