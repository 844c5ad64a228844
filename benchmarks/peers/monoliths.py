"""MILP solvers on the monolithic models, from scratch: none is given our plans, bounds or starts."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import lru_cache, partial
from importlib import util
from typing import Any

from benchmarks.peers.plans import oros_plan, without_plan
from benchmarks.peers.registry import Limits, Tell, needs, peer
from react_opt import solve
from react_opt.claims import optimality_tolerance
from react_opt.instance import OrosInstance
from react_opt.models.oros import oros_model
from react_opt.models.readback import explored_value
from react_opt.solvers.outcome import Request
from react_opt.solvers.registry import backend
from react_opt.timegraph import route_problem

KINDS = ("oros", "assignment", "inspection")
EXTRA = "pip install 'react_opt[peers]'"


def monolith(name: str, instance: Any, limits: Limits, tell: Tell) -> Any:
    """Solve the integer program of an instance with a backend of :mod:`react_opt.solvers.registry`."""
    if isinstance(instance, OrosInstance):
        return _oros(name, instance, limits, tell)
    return solve(
        instance, solver=name, method="monolith", time_limit_s=limits.time_s, threads=limits.threads, seed=limits.seed,
        gap=limits.gap or None, explain=False, on_progress=tell,
    )  # fmt: skip


def _oros(name: str, instance: OrosInstance, limits: Limits, tell: Tell) -> Any:
    begun = time.perf_counter()
    chosen = backend(name)
    problem = route_problem(instance)
    model = oros_model(instance, problem)
    most = sum(cell.weight * instance.horizon_steps for cell in instance.cells)
    request = Request(
        time_limit_s=max(0.0, limits.time_s - (time.perf_counter() - begun)),
        gap_rel=limits.gap,
        gap_abs=0.25 * optimality_tolerance(max(1.0, explored_value(instance), 0.1 * most), problem.sigma),
        threads=limits.threads,
        seed=limits.seed,
        on_progress=lambda elapsed_s, found, bound: tell(time.perf_counter() - begun, found, bound),
    )
    outcome = chosen.solve(model.program, request)
    if outcome.x is not None:
        return oros_plan(instance, problem, model.routes(outcome.x), outcome.bound, outcome.limit, outcome.solver)
    if outcome.status == "infeasible":
        return without_plan(
            instance, outcome.solver, infeasible="fleet: the solver proved that no plan keeps all rules"
        )
    notes = "; ".join(outcome.settings.get("notes", [])) or None
    return without_plan(instance, outcome.solver, limit=outcome.limit, bound=outcome.bound, reason=notes)


@lru_cache(maxsize=1)
def _cvxpy_solvers() -> frozenset[str]:
    if util.find_spec("cvxpy") is None:
        return frozenset()
    from react_opt.solvers.cvxpy_ import mip_solvers

    return frozenset(mip_solvers())


def _found_by_cvxpy(solver: str, install: str) -> Callable[[], str | None]:
    return lambda: None if solver in _cvxpy_solvers() else f"cvxpy does not find {solver}: {install}"


def _register(name: str, backend_name: str, about: str, package: str, missing: Callable[[], str | None]) -> None:
    peer(name, KINDS, about=about, package=package, missing=missing)(partial(monolith, backend_name))


_register("highs", "highs", "HiGHS on the monolithic MILP", "highspy", needs("highspy", "pip install highspy"))
_register("cp-sat", "cp-sat", "CP-SAT on the monolithic MILP", "ortools", needs("ortools", "pip install ortools"))
_register(
    "scip", "scip", "SCIP (GSCIP of OR-tools) on the monolith", "ortools", needs("ortools", "pip install ortools")
)
for _name, _solver, _package, _install in (
    ("glpk", "GLPK_MI", "cvxopt", EXTRA),
    ("cbc", "CBC", "cylp", EXTRA),
    ("gurobi", "GUROBI", "gurobipy", "pip install gurobipy, and a licence"),
    ("cplex", "CPLEX", "cplex", "pip install cplex, and a licence"),
    ("xpress", "XPRESS", "xpress", "pip install xpress, and a licence"),
    ("copt", "COPT", "coptpy", "pip install coptpy, and a licence"),
    ("mosek", "MOSEK", "mosek", "pip install mosek, and a licence"),
    ("knitro", "KNITRO", "knitro", "pip install knitro, and a licence"),
):
    _about = f"{_solver} on the monolith, through cvxpy (no incumbents or bounds while it runs)"
    _register(_name, f"cvxpy:{_solver}", _about, _package, _found_by_cvxpy(_solver, _install))
