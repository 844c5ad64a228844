"""Assignment of local targets: from an instance to a checked plan."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from react_opt.certify_assignment import OPTIMAL_GAP, check_assignment
from react_opt.claims import instance_ref, versions
from react_opt.errors import UsageError
from react_opt.instance import AssignmentInstance
from react_opt.models.assignment import (
    AssignmentModel,
    IntArray,
    build,
    is_feasible,
    objective_of,
    program,
    robot_of_targets,
)
from react_opt.options import SolveOptions
from react_opt.plan import Assigned, AssignmentPlan, Claim, Deferred, Plan, gap_of
from react_opt.solvers.assignment.exact import Assignment, assign, solve_arrays, value_step
from react_opt.solvers.assignment.explain import Reason, reasons, with_losses
from react_opt.solvers.stated import Statement, require_start

__all__ = ["Assignment", "assign", "solve_assignment"]

CLOSED_GAP = 1e-9
TREE_S = 1.0  # how long the tree may take before a backend's cutting planes take over


def solve_assignment(instance: AssignmentInstance, options: SolveOptions, start: Plan | None = None) -> AssignmentPlan:
    """Solve an ``assignment`` instance; see :func:`react_opt.solve`.

    The plain case is a linear assignment problem (scipy). Else a branch and bound of its own solves it; after
    one second the monolith takes over (``method="auto"`` without a work limit). The unit of ``work_limit``
    is one relaxation solved.

    Raises
    ------
    UsageError
        Where the method is ``routes``, which an assignment does not have.
    InputError
        Where ``start`` is no valid plan of the instance.
    """
    if options.method == "routes":
        raise UsageError("method: an assignment has no routes; expected auto or monolith")
    model = build(instance)
    known = None if start is None else _started(model, require_start(instance, start, AssignmentPlan, check_assignment))
    statement = Statement(instance, options, check_assignment)
    if options.method == "monolith" or options.solver is not None:
        answer, found_with = _monolith(model, options, known, "asked for")
    else:
        answer, found_with = _own(model, options, known)
    statement.phase_done("solve")
    # A search that was stopped proves no more than it says: large gains would hide whole units in a relative gap.
    allowed = OPTIMAL_GAP if answer.limit == "none" else CLOSED_GAP
    optimal = answer.bound - answer.objective <= allowed * abs(answer.objective)
    if options.explain and optimal:
        why = with_losses(model, answer.robot_of, answer.objective, options.deadline, options.should_stop)
    else:
        why = reasons(model, answer.robot_of)
    statement.phase_done("explain")
    claim = Claim(
        status="optimal" if optimal else "feasible",
        objective=answer.objective,
        bound=answer.bound,
        gap=gap_of(answer.objective, answer.bound),
        limit="none" if optimal else answer.limit,
        **statement.facts(**found_with),
    )
    return statement.checked(
        AssignmentPlan(
            instance=instance_ref(instance),
            claim=claim,
            assigned=tuple(
                Assigned(robot=model.robots[answer.robot_of[k]], target=model.targets[k])
                for k in np.flatnonzero(answer.robot_of >= 0).tolist()
            ),
            deferred=tuple(_deferred(model, row) for row in why),
        )
    )


def _deferred(model: AssignmentModel, row: Reason) -> Deferred:
    return Deferred(target=model.targets[row.target], reason=row.reason, loss=row.loss)


def _started(model: AssignmentModel, start: AssignmentPlan) -> IntArray:
    """Return the assignment of a plan."""
    robot = {name: index for index, name in enumerate(model.robots)}
    column = {name: index for index, name in enumerate(model.targets)}
    known = np.full(len(model.targets), -1, dtype=np.int64)
    for pair in start.assigned:
        known[column[pair.target]] = robot[pair.robot]
    # A pair that gains nothing is dropped: without it the assignment is no worse, and still feasible.
    for k in np.flatnonzero(known >= 0).tolist():
        if model.arrays.value[known[k], k] <= 0:
            known[k] = -1
    return known


def _own(model: AssignmentModel, options: SolveOptions, known: IntArray | None) -> tuple[Assignment, dict[str, Any]]:
    """Solve with the package's own methods; after a while hand over to the monolith."""
    plain = model.arrays.plain
    hand_over = not plain and options.work_limit is None
    deadline = options.deadline
    switch = time.perf_counter() + TREE_S if hand_over else None
    early = min((t for t in (deadline, switch) if t is not None), default=None)
    answer = solve_arrays(model.arrays, early, options.work_limit, options.gap or 0.0, options.should_stop, known)
    name = "linear assignment (no side constraints)" if plain else "branch and bound over transportation problems"
    facts: dict[str, Any] = {
        "method": name,
        "solver": "scipy" if plain else "react_opt",
        "versions": versions("numpy", "scipy", "numba"),
        "settings": {"relaxations": answer.work},
    }
    if answer.limit != "time" or not hand_over or options.left_s() == 0.0:
        return answer, facts
    found, more = _monolith(model, options, answer.robot_of, f"not proven by branch and bound after {TREE_S:g} s")
    best = max((found, answer), key=lambda a: a.objective)
    bound = max(best.objective, min(found.bound, answer.bound))
    more["settings"] = {**more["settings"], "relaxations": answer.work}
    return Assignment(best.robot_of, best.objective, bound, found.limit, answer.work, False), more


def _monolith(
    model: AssignmentModel, options: SolveOptions, known: IntArray | None, why: str
) -> tuple[Assignment, dict[str, Any]]:
    """Solve the integer program with a backend."""
    from react_opt.solvers.outcome import Request
    from react_opt.solvers.registry import DEFAULT, backend

    name = options.solver or DEFAULT
    chosen = backend(name)
    mathematics = program(model.arrays)
    vector = None
    if known is not None:
        keys = mathematics.columns["x"].keys
        vector = (known[keys[:, 1]] == keys[:, 0]).astype(np.float64)
    request = Request(
        time_limit_s=options.left_s(),
        work_limit=options.work_limit,
        gap_rel=options.gap or 0.0,
        gap_abs=0.0,
        threads=options.threads,
        seed=options.seed,
        start=vector,
        on_progress=options.on_progress,
        should_stop=options.should_stop,
    )
    outcome = chosen.solve(mathematics, request)
    robot_of = known if known is not None else np.full(len(model.targets), -1, dtype=np.int64)
    settings = dict(outcome.settings)
    if outcome.x is not None:
        found = robot_of_targets(mathematics, outcome.x, len(model.targets))
        if not is_feasible(model.arrays, found):
            settings["rejected"] = "the solver's assignment breaks a limit"
        elif objective_of(model.arrays, found) >= objective_of(model.arrays, robot_of):
            robot_of = found
    objective = objective_of(model.arrays, robot_of)
    trivial = float(np.maximum(model.arrays.value, 0.0).max(axis=0, initial=0.0).sum())
    bound = min(trivial, outcome.bound if outcome.bound is not None else trivial)
    step = value_step(mathematics.cost)
    bound = max(objective, float(np.floor(bound / step + 1e-6)) * step if step > 0 else bound)
    facts = {
        "method": f"monolith: {why}",
        "solver": outcome.solver,
        "versions": {**versions("numpy", "scipy"), outcome.solver: outcome.version},
        "settings": settings,
    }
    return Assignment(robot_of, objective, bound, outcome.limit, 0, False), facts
