"""OR-tools: its modules loaded when asked for, and SCIP through MathOpt."""

from __future__ import annotations

from datetime import timedelta
from importlib import import_module
from typing import Any

import numpy as np

from react_opt.errors import MissingPartError
from react_opt.models.program import Program
from react_opt.solvers.backend import Abilities
from react_opt.solvers.outcome import Claim, Limit, Request
from react_opt.solvers.watch import Watch

ABILITIES = Abilities(warm_start=True, bound=True, incumbents=True, work_unit="nodes")
_TOLERANCE = 1e-9
_LIMITS: dict[str, Limit] = {"TIME": "time", "NODE": "work", "ITERATION": "work", "MEMORY": "memory"}


def imported(module: str) -> Any:
    """Return a module of OR-tools.

    Raises
    ------
    MissingPartError
        Where it is not installed, or does not load.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise MissingPartError(f"OR-tools is not installed: pip install ortools ({error})") from error
    except ImportError as error:
        # Both bring a libhighs.so.1; of highspy 1.15 and later it is not the one that OR-tools was built for.
        raise MissingPartError(
            f"OR-tools does not load beside the highspy that is in use: pip install 'highspy<1.15' ({error})"
        ) from error


def to_mathopt(program: Program) -> Any:
    """Hand out a program as an ``ortools.math_opt.python.mathopt.Model``, columns and rows in order and by name.

    Raises
    ------
    MissingPartError
        Where OR-tools is not installed, or does not load.
    """
    mathopt, protos = imported("ortools.math_opt.python.mathopt"), imported("ortools.math_opt.model_pb2")
    matrix = program.matrix().tocoo()
    cost = program.cost
    costly = np.flatnonzero(cost)
    proto = protos.ModelProto(
        name=program.name,
        variables=protos.VariablesProto(
            ids=range(program.n_columns),
            lower_bounds=program.lower,
            upper_bounds=program.upper,
            integers=program.integer.tolist(),
            names=program.column_labels(),
        ),
        linear_constraints=protos.LinearConstraintsProto(
            ids=range(program.n_rows),
            lower_bounds=program.row_lower,
            upper_bounds=program.row_upper,
            names=program.row_labels(),
        ),
    )
    proto.objective.maximize = program.maximise
    proto.objective.linear_coefficients.ids.extend(costly.tolist())
    proto.objective.linear_coefficients.values.extend(cost[costly].tolist())
    proto.linear_constraint_matrix.row_ids.extend(matrix.row.tolist())
    proto.linear_constraint_matrix.column_ids.extend(matrix.col.tolist())
    proto.linear_constraint_matrix.coefficients.extend(matrix.data.tolist())
    return mathopt.Model.from_model_proto(proto)


def run(program: Program, request: Request, watch: Watch) -> Claim:
    """Solve a program with SCIP; called in a worker process."""
    mathopt = imported("ortools.math_opt.python.mathopt")
    gscip = imported("ortools.math_opt.solvers.gscip.gscip_pb2")
    model = to_mathopt(program)
    variables = list(model.variables())
    settings: dict[str, Any] = {
        "threads": 1,  # on more GSCIP races copies, without callbacks, and at times ends in a state it does not know
        "random_seed": request.seed,
        "relative_gap_tolerance": request.gap_rel,
        "absolute_gap_tolerance": request.gap_abs,
    }
    if request.work_limit is not None:
        settings["node_limit"] = request.work_limit
    own = gscip.GScipParameters(silence_output=True)
    own.real_params["numerics/feastol"] = _TOLERANCE
    if watch.stopped():
        return Claim("no_solution", settings=settings)

    probing = False

    def told(data: Any) -> Any:
        if probing:  # the objective is gone: what is found and proven is of another program
            return mathopt.CallbackResult(terminate=watch.stopped())
        if data.solution is not None and data.event == mathopt.Event.MIP_SOLUTION:
            x = np.array([data.solution[variable] for variable in variables])
            watch.found(x, program.objective(x))
        if data.event == mathopt.Event.MIP_NODE:  # before the first node the statistics hold zeros
            watch.proved(data.mip_stats.dual_bound)
        return mathopt.CallbackResult(terminate=watch.stopped())

    def solved() -> Any:
        left_s = watch.remaining_s()
        return mathopt.solve(
            model,
            mathopt.SolverType.GSCIP,
            params=mathopt.SolveParameters(
                **settings, time_limit=None if left_s is None else timedelta(seconds=left_s), gscip=own
            ),
            model_params=_hints(mathopt, variables, request),
            callback_reg=mathopt.CallbackRegistration(events={mathopt.Event.MIP_SOLUTION, mathopt.Event.MIP_NODE}),
            cb=told,
        )

    result = solved()
    reason = result.termination.reason.name
    limit = result.termination.limit
    claim = Claim("no_solution", limit=_LIMITS.get(limit.name, "none") if limit is not None else "none")
    claim.settings = {**settings, "numerics/feastol": _TOLERANCE}
    if request.threads > 1:
        claim.notes.append("SCIP runs on one thread")
    if result.has_primal_feasible_solution():
        claim.x = np.array(result.variable_values(variables))
    dual = result.termination.objective_bounds.dual_bound
    claim.bound = float(dual) if np.isfinite(dual) else None
    if reason == "INFEASIBLE_OR_UNBOUNDED":
        probing = True
        model.objective.clear()
        reason = "UNBOUNDED" if solved().termination.reason.name == "OPTIMAL" else "INFEASIBLE"
    if reason == "OPTIMAL":
        claim.status = "optimal"
    elif reason == "INFEASIBLE":
        claim.status = "infeasible"
    elif reason == "UNBOUNDED":
        claim.status = "unbounded"
    elif reason not in ("FEASIBLE", "NO_SOLUTION_FOUND"):
        claim.notes.append(f"SCIP stopped with {reason}: {result.termination.detail}")
    return claim


def _hints(mathopt: Any, variables: list[Any], request: Request) -> Any:
    if request.start is None:
        return mathopt.ModelSolveParameters()
    values = dict(zip(variables, request.start.tolist(), strict=True))
    return mathopt.ModelSolveParameters(solution_hints=[mathopt.SolutionHint(variable_values=values)])
