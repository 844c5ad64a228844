"""``solve``: from an instance to a checked plan. The recipe; its parts stand alone elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from react_opt.errors import InputError, UsageError
from react_opt.instance import AssignmentInstance, InspectionInstance, Mission, OrosInstance
from react_opt.options import SolveOptions
from react_opt.plan import Plan
from react_opt.solvers.registry import backend
from react_opt.solvers.warm import warm_up

WARM_S = 0.05  # below this the kernels were ready, and the claim says nothing of it


def solve(
    instance: OrosInstance | AssignmentInstance | InspectionInstance,
    *,
    time_limit_s: float | None = 60.0,
    work_limit: int | None = None,
    gap: float | None = None,
    solver: str | None = None,
    method: str = "auto",
    threads: int | None = None,
    seed: int = 0,
    start: Plan | None = None,
    at_step: int | None = None,
    explain: bool = True,
    on_progress: Callable[[float, float | None, float | None], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Any:
    """Solve an instance and return a plan that the independent checker has replayed.

    Parameters
    ----------
    instance
        An ``oros``, ``assignment`` or ``inspection`` instance.
    time_limit_s
        Wall time from call to return, s; the best plan known by then is returned. None for no limit.
    work_limit
        Counted work: with one thread and a seed the same plan on every run. None for no limit.
    gap
        Stop at this gap (a fraction); None to prove the optimum.
    solver
        Backend by name (see ``react-opt solvers``); for ``oros`` it asks for the monolith.
    method
        ``monolith``, ``routes`` (the decomposition) or ``auto``.
    threads
        Threads, None for all cores.
    seed
        Seed of everything random.
    start
        A plan of this instance to start from; the result is never worse.
    at_step
        With ``start``: keep the first ``at_step`` steps of it and replan the rest (``oros`` only).
    explain
        Whether reasons of deferred and skipped targets are tested by forcing them in.
    on_progress
        Called with elapsed seconds, incumbent and bound, None where unknown.
    should_stop
        Polled; True returns the best plan so far.

    Returns
    -------
    OrosPlan, AssignmentPlan or InspectionPlan
        With its claim: status, bound, gap, method and times.

    Raises
    ------
    UsageError
        Where options make no sense together.
    InputError
        Where ``start`` is no valid plan of the instance.
    MissingPartError
        Where the solver asked for is not installed.
    """
    if at_step is not None and start is None:
        raise UsageError("at step: expected together with a plan to start from")
    if at_step is not None and not isinstance(instance, OrosInstance):
        raise UsageError("at step: expected an oros instance")
    options = SolveOptions(
        time_limit_s=time_limit_s,
        work_limit=work_limit,
        gap=gap,
        solver=solver,
        method=method,
        seed=seed,
        explain=explain,
        on_progress=on_progress,
        should_stop=should_stop,
        **({} if threads is None else {"threads": threads}),
    )
    if solver is not None:
        backend(solver)  # bad options are refused at once, not after a first use has compiled its kernels
    if isinstance(instance, OrosInstance):
        from react_opt.solvers.oros import require_start

        require_start(instance, start, at_step)
    recipe = _recipe_of(instance)  # neither importing nor compiling it counts against the time limit
    warm_s = warm_up(instance.kind, recipe)
    options = replace(options, begun=time.perf_counter())
    plan = recipe(instance, options, start, at_step) if at_step is not None else recipe(instance, options, start)
    if warm_s < WARM_S:
        return plan
    wall_s = {"warm_up": warm_s, **plan.claim.wall_s}
    return plan.model_copy(update={"claim": plan.claim.model_copy(update={"wall_s": wall_s})})


def _recipe_of(instance: Any) -> Callable[..., Any]:
    """Return the function that solves this kind of instance."""
    if isinstance(instance, OrosInstance):
        from react_opt.solvers.oros import solve_oros

        return solve_oros
    if isinstance(instance, AssignmentInstance):
        from react_opt.solvers.assignment import solve_assignment

        return solve_assignment
    if isinstance(instance, InspectionInstance):
        from react_opt.solvers.inspection import solve_inspection

        return solve_inspection
    if isinstance(instance, Mission):
        raise InputError.single("<data>", "kind", "a mission is simulated, not solved: use react-opt simulate")
    raise InputError.single("<data>", "kind", "expected an oros, assignment or inspection instance")
