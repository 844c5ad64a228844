"""Any mixed-integer solver that cvxpy finds installed, and programs handed out as cvxpy problems."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from react_opt.errors import MissingPartError, UsageError
from react_opt.models.program import Program
from react_opt.solvers.backend import Abilities
from react_opt.solvers.highs_model import feasibility_tolerance
from react_opt.solvers.outcome import Claim, Request
from react_opt.solvers.watch import Watch

ABILITIES = Abilities(warm_start=False, bound=False, incumbents=False, work_unit=None)
INSTALL = {
    "SCIP": "pip install pyscipopt",
    "HIGHS": "pip install highspy",
    "CBC": "pip install cylp",
    "GLPK_MI": "pip install cvxopt",
    "SCIPY": "pip install scipy",
    "GUROBI": "pip install gurobipy, and a licence",
    "CPLEX": "pip install cplex, and a licence",
    "COPT": "pip install coptpy, and a licence",
    "XPRESS": "pip install xpress, and a licence",
    "MOSEK": "pip install mosek, and a licence",
    "CUOPT": "pip install cuopt, and a GPU",
    "KNITRO": "pip install knitro, and a licence",
    "ECOS_BB": "pip install ecos",
}
"""Mixed-integer solvers that cvxpy knows, those tried first by plain ``cvxpy`` first."""
_TOLERANCE = 1e-9


def _highs(request: Request, left_s: float | None) -> dict[str, Any]:
    options = {
        "mip_rel_gap": request.gap_rel,
        "mip_abs_gap": request.gap_abs,
        "threads": request.threads,
        "random_seed": request.seed,
    }
    return options | ({} if left_s is None else {"time_limit": left_s})


def _scip(request: Request, left_s: float | None) -> dict[str, Any]:
    params = {
        "limits/gap": request.gap_rel,
        "limits/absgap": request.gap_abs,
        "numerics/feastol": _TOLERANCE,
        "randomization/randomseedshift": request.seed,
    }
    return {"scip_params": params | ({} if left_s is None else {"limits/time": left_s})}


def _scipy(request: Request, left_s: float | None) -> dict[str, Any]:
    return {"scipy_options": {"mip_rel_gap": request.gap_rel} | ({} if left_s is None else {"time_limit": left_s})}


def _glpk(request: Request, left_s: float | None) -> dict[str, Any]:
    return {"mip_gap": request.gap_rel} | ({} if left_s is None else {"tm_lim": max(1, int(1000 * left_s))})


def _cbc(request: Request, left_s: float | None) -> dict[str, Any]:
    options = {"allowableGap": request.gap_abs, "allowableFractionGap": request.gap_rel}
    return options | ({} if left_s is None else {"maximumSeconds": left_s})


def _gurobi(request: Request, left_s: float | None) -> dict[str, Any]:
    options = {
        "MIPGap": request.gap_rel,
        "MIPGapAbs": request.gap_abs,
        "FeasibilityTol": _TOLERANCE,
        "IntFeasTol": _TOLERANCE,
        "Threads": request.threads,
        "Seed": request.seed,
    }
    return options | ({} if left_s is None else {"TimeLimit": left_s})


_OPTIONS: dict[str, Callable[[Request, float | None], dict[str, Any]]] = {
    "HIGHS": _highs,
    "SCIP": _scip,
    "SCIPY": _scipy,
    "GLPK_MI": _glpk,
    "CBC": _cbc,
    "GUROBI": _gurobi,
}
"""How limits and gaps are told to the solvers for which that has been tried."""


def _cvxpy() -> Any:
    with contextlib.suppress(ImportError):
        import_module("highspy")  # before anything else brings a libhighs of another version
    return import_module("cvxpy")


def mip_solvers() -> list[str]:
    """Names of the mixed-integer solvers that cvxpy finds, the preferred one first; imports cvxpy."""
    found = list(import_module("cvxpy.reductions.solvers.defines").INSTALLED_MI_SOLVERS)
    return [name for name in INSTALL if name in found] + sorted(set(found) - set(INSTALL))


def chosen(variant: str) -> str:
    """Return the solver of cvxpy that a variant names; the first one found for an empty variant.

    Raises
    ------
    UsageError
        Where cvxpy knows no mixed-integer solver of that name.
    MissingPartError
        Where it is not installed; the text says what to install.
    """
    _cvxpy()
    found = mip_solvers()
    if not variant:
        if not found:
            raise MissingPartError(f"cvxpy finds no mixed-integer solver: {INSTALL['SCIP']}")
        return found[0]
    if variant in found:
        return variant
    if variant in INSTALL:
        raise MissingPartError(f"cvxpy does not find the solver {variant}: {INSTALL[variant]}")
    raise UsageError(f"cvxpy knows no mixed-integer solver {variant!r}; it knows {', '.join(INSTALL)}")


def to_cvxpy(program: Program) -> tuple[Any, dict[str, Any]]:
    """Hand out a program as a cvxpy problem.

    Parameters
    ----------
    program
        The program.

    Returns
    -------
    problem
        ``cvxpy.Problem``, with the program's own sense.
    variables
        One ``cvxpy.Variable`` per block of columns, by name; empty blocks have none.
    """
    cp = _cvxpy()
    matrix = program.matrix().tocsc()
    cost, lower, upper, integer = program.cost, program.lower, program.upper, program.integer
    variables: dict[str, Any] = {}
    constraints: list[Any] = []
    objective: Any = cp.Constant(0.0)
    activity: Any = np.zeros(program.n_rows)
    for name, block in program.columns.items():
        if not block.size:
            continue
        part = slice(block.first, block.first + block.size)
        whole = bool(integer[part].all())
        binary = whole and bool((lower[part] >= 0).all() and (upper[part] <= 1).all())
        x = cp.Variable(block.size, name=name, boolean=binary, integer=whole and not binary)
        variables[name] = x
        objective = objective + cost[part] @ x
        if matrix[:, part].nnz:
            activity = activity + matrix[:, part] @ x
        low = np.flatnonzero(lower[part] > (0 if binary else -np.inf))
        high = np.flatnonzero(upper[part] < (1 if binary else np.inf))
        constraints += [x[low] >= lower[part][low]] if len(low) else []
        constraints += [x[high] <= upper[part][high]] if len(high) else []
    if program.n_rows:
        constraints += _rows(program, activity, cp)
    sense = cp.Maximize if program.maximise else cp.Minimize
    return cp.Problem(sense(objective), constraints), variables


def _rows(program: Program, activity: Any, cp: Any) -> list[Any]:
    row_lower, row_upper = program.row_lower, program.row_upper
    activity = cp.Constant(activity) if isinstance(activity, np.ndarray) else activity
    equal = np.flatnonzero(row_lower == row_upper)
    low = np.flatnonzero((row_lower != row_upper) & np.isfinite(row_lower))
    high = np.flatnonzero((row_lower != row_upper) & np.isfinite(row_upper))
    rows = [activity[equal] == row_lower[equal]] if len(equal) else []
    rows += [activity[low] >= row_lower[low]] if len(low) else []
    rows += [activity[high] <= row_upper[high]] if len(high) else []
    return rows


def run(program: Program, request: Request, watch: Watch, variant: str = "") -> Claim:
    """Solve a program with a solver of cvxpy; called in a worker process."""
    cp = _cvxpy()
    solver = chosen(variant)
    problem, variables = to_cvxpy(program)
    if watch.stopped():
        return Claim("no_solution")
    options = _OPTIONS[solver](request, watch.remaining_s()) if solver in _OPTIONS else {}
    notes = ["cvxpy has no way to start from a solution: the start was only kept"] if request.start is not None else []
    if solver not in _OPTIONS:
        notes.append(f"how to set limits and gaps of {solver} is not known here: it runs with its own, until killed")
    if solver == "HIGHS":
        tolerance = feasibility_tolerance(program)
        options |= {"mip_feasibility_tolerance": tolerance, "primal_feasibility_tolerance": tolerance}
    claim = Claim("no_solution", settings=dict(options), notes=notes)
    try:
        problem.solve(solver=solver, **options)
        status = problem.status
    except cp.SolverError as error:
        notes.append(f"cvxpy: {error}")
        status = None
    if status in (None, cp.settings.INFEASIBLE_OR_UNBOUNDED):
        status = _told_apart(problem, solver, request, watch, status)
    if status is not None and variables and all(x.value is not None for x in variables.values()):
        claim.x = np.concatenate([np.atleast_1d(x.value) for x in variables.values()])
    claim.bound = _bound(problem, program)
    if status == cp.OPTIMAL:
        claim.status = "optimal"
        if claim.bound is None and claim.x is not None and solver in _OPTIONS:
            # Its own gap limit is all that such a solver proves.
            claim.bound = _loosened(program.objective(claim.x), request, program.maximise)
    elif status == cp.INFEASIBLE:
        claim.status, claim.bound = "infeasible", None
    elif status == cp.UNBOUNDED:
        claim.status, claim.bound = "unbounded", None
    elif status in (cp.USER_LIMIT, cp.OPTIMAL_INACCURATE) and request.time_limit_s is not None:
        claim.limit = "time"
    elif status is not None:
        notes.append(f"cvxpy: {solver} stopped with the status {status!r}")
    return claim


def _told_apart(problem: Any, solver: str, request: Request, watch: Watch, status: Any) -> Any:
    """Return what a solver that knows nothing, or not which of the two, says of the program without its objective."""
    cp = _cvxpy()
    left_s = watch.remaining_s()
    if watch.stopped():
        return status
    options = _OPTIONS[solver](request, left_s) if solver in _OPTIONS else {}
    without = cp.Problem(cp.Minimize(0), problem.constraints)
    try:
        without.solve(solver=solver, **options)
    except cp.SolverError:
        return status
    if without.status == cp.INFEASIBLE:
        return cp.INFEASIBLE
    return cp.UNBOUNDED if without.status == cp.OPTIMAL and status is not None else status


def _loosened(objective: float, request: Request, maximise: bool) -> float:
    gap = max(request.gap_abs, request.gap_rel * abs(objective))
    return objective + gap if maximise else objective - gap


def _bound(problem: Any, program: Program) -> float | None:
    """Return the bound that the solver left in its statistics (of a minimisation), where it did."""
    stats = problem.solver_stats.extra_stats if problem.solver_stats is not None else None
    value: Any = None
    if isinstance(stats, dict) and hasattr(stats.get("model"), "getDualbound"):
        value = stats["model"].getDualbound()
    elif isinstance(stats, dict):
        value = stats.get("mip_dual_bound")
    else:
        value = getattr(stats, "mip_dual_bound", None)
    if value is None or not np.isfinite(value) or abs(value) >= 1e20 or not program.integer.any():
        return None
    return -float(value) if program.maximise else float(value)
