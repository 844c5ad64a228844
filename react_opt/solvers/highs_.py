"""HiGHS through highspy: the default backend."""

from __future__ import annotations

from typing import Any

import highspy
import numpy as np
from numpy.typing import NDArray

from react_opt.models.program import Program
from react_opt.solvers.backend import Abilities
from react_opt.solvers.highs_model import feasibility_tolerance, to_highs, write_model
from react_opt.solvers.outcome import Claim, Limit, Outcome, Request
from react_opt.solvers.watch import Watch
from react_opt.solvers.watchdog import supervise

__all__ = ["HighsBackend", "to_highs", "write_model"]

FloatArray = NDArray[np.float64]
_Status = highspy.HighsModelStatus
_LIMITS: dict[Any, Limit] = {
    _Status.kTimeLimit: "time",
    _Status.kIterationLimit: "work",
    _Status.kSolutionLimit: "work",
    _Status.kMemoryLimit: "memory",
}


class HighsBackend:
    """HiGHS, branch and cut."""

    name = "highs"
    abilities = Abilities(
        warm_start=True,
        bound=True,
        incumbents=True,
        work_unit="nodes (simplex iterations in an LP)",
    )

    @property
    def version(self) -> str:
        """Version of the HiGHS library."""
        return str(highspy.Highs().version())

    def solve(self, program: Program, request: Request) -> Outcome:
        """Solve a program within a request."""
        return supervise(
            program, request, solver=self.name, version=self.version, run=lambda watch: _run(program, request, watch)
        )


def _run(program: Program, request: Request, watch: Watch) -> Claim:
    mixed = bool(program.integer.any())
    highs = to_highs(program, names=False)
    settings = _settings(request, program)
    for name, value in settings.items():
        highs.setOptionValue(name, value)
    if watch.stopped():
        return Claim("no_solution", settings=settings)
    if request.start is not None and mixed:
        solution = highspy.HighsSolution()
        solution.col_value = request.start.tolist()
        highs.setSolution(solution)
    remaining_s = watch.remaining_s()
    if remaining_s is not None:
        highs.setOptionValue("time_limit", remaining_s)
    _listen(highs, watch)
    _obey(highs, watch)
    try:
        highs.run()
        status = highs.getModelStatus()
        claim = Claim("no_solution", limit=_LIMITS.get(status, "none"), settings=settings)
        if status == _Status.kUnboundedOrInfeasible:
            status = _tell_apart(program, watch)
        if status in (_Status.kOptimal, _Status.kModelEmpty):
            claim.status = "optimal"
        elif status == _Status.kInfeasible:
            claim.status = "infeasible"
        elif status == _Status.kUnbounded:
            claim.status = "unbounded"
        elif claim.limit == "none" and not watch.stopped():
            claim.notes.append(f"HiGHS stopped with the status {highs.modelStatusToString(status)!r}")
        if request.start is not None and not mixed:
            claim.notes.append("the start was not used: nothing in the program is integer")
        return _with_solution(highs, claim, mixed)
    finally:
        highspy.Highs.resetGlobalScheduler(False)  # the scheduler belongs to this thread


def _settings(request: Request, program: Program) -> dict[str, Any]:
    mixed = bool(program.integer.any())
    tolerance = feasibility_tolerance(program)
    settings: dict[str, Any] = {
        "threads": request.threads,
        "random_seed": request.seed,
        "primal_feasibility_tolerance": tolerance,
    }
    if mixed:
        settings |= {
            "mip_rel_gap": request.gap_rel,
            "mip_abs_gap": request.gap_abs,
            "mip_feasibility_tolerance": tolerance,
        }
    if request.work_limit is not None:
        settings["mip_max_nodes" if mixed else "simplex_iteration_limit"] = request.work_limit
    return settings


def _listen(highs: highspy.Highs, watch: Watch) -> None:
    """Record incumbents and bounds as HiGHS tells them."""

    def improved(event: Any) -> None:
        watch.found(event.data_out.mip_solution, event.data_out.objective_function_value)
        watch.proved(event.data_out.mip_dual_bound)

    highs.cbMipImprovingSolution.subscribe(improved)
    highs.cbMipInterrupt.subscribe(lambda event: watch.proved(event.data_out.mip_dual_bound))


def _obey(highs: highspy.Highs, watch: Watch) -> None:
    """Pass the order to stop on to HiGHS."""

    def polled(event: Any) -> None:
        if watch.stopped():
            event.interrupt()

    for callback in (highs.cbMipInterrupt, highs.cbSimplexInterrupt, highs.cbIpmInterrupt):
        callback.subscribe(polled)


def _tell_apart(program: Program, watch: Watch) -> Any:
    """Return which of the two a program is that HiGHS calls unbounded or infeasible: does it hold without objective?"""
    highs = to_highs(program, names=False)
    highs.changeColsCost(program.n_columns, np.arange(program.n_columns, dtype=np.int32), np.zeros(program.n_columns))
    remaining_s = watch.remaining_s()
    if remaining_s is not None:
        highs.setOptionValue("time_limit", remaining_s)
    _obey(highs, watch)
    highs.run()
    status = highs.getModelStatus()
    return _Status.kUnbounded if status == _Status.kOptimal else status


def _with_solution(highs: highspy.Highs, claim: Claim, mixed: bool) -> Claim:
    info = highs.getInfo()
    if info.primal_solution_status == highspy.SolutionStatus.kSolutionStatusFeasible:
        claim.x = np.array(highs.getSolution().col_value, dtype=np.float64)
    if mixed and np.isfinite(info.mip_dual_bound):
        claim.bound = float(info.mip_dual_bound)
    elif not mixed and claim.status == "optimal":
        claim.bound = float(info.objective_function_value)
    return claim
