"""CP-SAT of OR-tools: whole numbers only, so a program is restated exactly or refused."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from react_opt.models.program import Program
from react_opt.solvers.backend import Abilities
from react_opt.solvers.lattice import Lattice, to_lattice
from react_opt.solvers.ortools_ import imported
from react_opt.solvers.outcome import Claim, Request
from react_opt.solvers.watch import Watch

ABILITIES = Abilities(warm_start=True, bound=True, incumbents=True, work_unit="deterministic ms", integer_only=True)
_WORK_UNITS = 1000


@dataclass(frozen=True)
class CpSatModel:
    """A program as a CP-SAT model.

    Parameters
    ----------
    model
        ``ortools.sat.python.cp_model.CpModel``.
    variables
        Its variables, in the order of the program's columns.
    scaling
        What a whole number of the model means.
    """

    model: Any
    variables: list[Any]
    scaling: Lattice


def to_cp_sat(program: Program) -> CpSatModel:
    """Hand out a program as a CP-SAT model, restated in whole numbers without loss.

    Raises
    ------
    UsageError
        Where that cannot be done (see :func:`react_opt.solvers.lattice.to_lattice`).
    MissingPartError
        Where OR-tools is not installed, or does not load.
    """
    cp_model = imported("ortools.sat.python.cp_model")
    lattice = to_lattice(program)
    model = cp_model.CpModel()
    model.name = program.name
    variables = []
    for low, high, label in zip(lattice.lower, lattice.upper, program.column_labels(), strict=True):
        variables.append(model.new_int_var(low, max(low, high), label))
        if high < low:
            model.add_bool_or([])
    for (columns, whole, low, high), label in zip(lattice.rows, program.row_labels(), strict=True):
        if low > high or (not columns and not low <= 0 <= high):
            model.add_bool_or([]).with_name(label)
        elif columns:
            total = cp_model.LinearExpr.weighted_sum([variables[j] for j in columns], whole)
            model.add_linear_constraint(total, low, high).with_name(label)
    objective = cp_model.LinearExpr.weighted_sum(variables, lattice.objective)
    if any(lattice.objective):
        (model.maximize if program.maximise else model.minimize)(objective)
    return CpSatModel(model, variables, lattice)


def run(program: Program, request: Request, watch: Watch) -> Claim:
    """Solve a program with CP-SAT; called in a worker process.

    Raises
    ------
    UsageError
        Where the program cannot be restated in whole numbers.
    """
    cp_model = imported("ortools.sat.python.cp_model")
    handed = to_cp_sat(program)
    lattice, scale = handed.scaling, float(handed.scaling.objective_scale)
    settings = _settings(request, scale)
    solver = cp_model.CpSolver()
    for name, value in settings.items():
        setattr(solver.parameters, name, value)
    settings["scaling"] = {
        "objective": str(lattice.objective_scale),
        "steps": sorted({str(step) for step, whole in zip(lattice.step, program.integer, strict=True) if not whole}),
    }
    if request.start is not None:
        for variable, value in zip(handed.variables, lattice.n(request.start), strict=True):
            handed.model.add_hint(variable, value)
    remaining_s = watch.remaining_s()
    if watch.stopped():
        return Claim("no_solution", settings=settings)
    if remaining_s is not None:
        solver.parameters.max_time_in_seconds = max(remaining_s, 1e-3)

    class Improved(cp_model.CpSolverSolutionCallback):  # type: ignore[name-defined, misc]
        def on_solution_callback(self) -> None:
            x = lattice.x(list(self.response_proto.solution))
            watch.found(x, program.objective(x))

    if any(lattice.objective):
        solver.best_bound_callback = lambda bound: watch.proved(bound / scale)
    watch.on_stop = solver.stop_search
    status = solver.solve(handed.model, Improved())
    return _claim(handed, request, watch, solver, status, settings, cp_model)


def _settings(request: Request, scale: float) -> dict[str, Any]:
    settings: dict[str, Any] = {
        "num_workers": request.threads,
        "random_seed": request.seed,
        "relative_gap_limit": request.gap_rel,
        "absolute_gap_limit": request.gap_abs * scale,
        "catch_sigint_signal": False,
    }
    if request.work_limit is not None:
        settings["max_deterministic_time"] = request.work_limit / _WORK_UNITS
    return settings


def _claim(
    handed: CpSatModel,
    request: Request,
    watch: Watch,
    solver: Any,
    status: Any,
    settings: dict[str, Any],
    cp_model: Any,
) -> Claim:
    claim = Claim("no_solution", settings=settings)
    scale = float(handed.scaling.objective_scale)
    if status in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        claim.x = handed.scaling.x(list(solver.response_proto.solution))
        if any(handed.scaling.objective):
            claim.bound = float(solver.best_objective_bound) / scale
        else:
            claim.bound = 0.0
    if status == cp_model.OPTIMAL:
        claim.status = "optimal"
    elif status == cp_model.INFEASIBLE:
        claim.status = "infeasible"
    elif status == cp_model.MODEL_INVALID:
        claim.notes.append(f"CP-SAT calls the model invalid: {handed.model.validate()}")
    elif (
        request.work_limit is not None and solver.response_proto.deterministic_time >= request.work_limit / _WORK_UNITS
    ):
        claim.limit = "work"
    elif request.time_limit_s is not None and watch.reason is None:
        claim.limit = "time"
    return claim
