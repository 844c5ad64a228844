"""From what a solver claims to an outcome: its solution is checked before it is believed."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from react_opt.models.program import Program
from react_opt.solvers.highs_model import completed
from react_opt.solvers.outcome import Claim, Limit, Outcome, Request, Status

FloatArray = NDArray[np.float64]
TOLERANCE = 1e-6
"""Largest violation of a row or bound at which a solution is believed."""
_ROUNDING = 1e-9


def conclude(
    program: Program,
    request: Request,
    claim: Claim,
    *,
    recorded: tuple[FloatArray | None, float | None],
    limit: Limit,
    solver: str,
    version: str,
    started: float,
    give_up: float | None,
) -> Outcome:
    """Turn a claim into an outcome.

    The best of the claimed solution, the recorded one and the start that satisfies the program within
    ``TOLERANCE`` (integers rounded) is the answer; one that does not is completed anew from its integers, or
    dropped with a note. ``optimal`` is only said where the bound proves it.

    Parameters
    ----------
    program, request
        What was to be solved, and how.
    claim
        What the solver says.
    recorded
        Best solution and bound it had told while it ran.
    limit
        What stopped it.
    solver, version, started
        For the outcome; ``started`` is a ``perf_counter()``.
    give_up
        ``perf_counter()`` after which no solution is repaired any more; None for none.
    """
    notes = list(claim.notes)
    x = _best(program, [claim.x, recorded[0]], request.start, notes, give_up)
    sign = 1.0 if program.maximise else -1.0
    if claim.status == "unbounded":
        notes.append("the objective is unbounded")
        claim.bound, recorded = None, (recorded[0], None)
    bound = recorded[1] if claim.bound is None else claim.bound
    status: Status
    objective: float | None = None
    if x is None:
        status = "infeasible" if claim.status == "infeasible" else "no_solution"
        if claim.status == "infeasible":
            bound = None
    else:
        status, objective = "feasible", program.objective(x)
        if claim.status == "infeasible":
            notes.append("called infeasible, though a solution is known: its bound is not believed")
            bound = None
        elif bound is not None:
            slack = sign * (bound - objective)
            if slack < -TOLERANCE * max(1.0, abs(objective)):
                notes.append(f"its bound {bound!r} is beaten by a checked solution and not believed")
                bound = None
            else:
                bound = objective if slack < 0 else bound
                allowed = max(request.gap_abs, max(request.gap_rel, _ROUNDING) * abs(objective))
                if slack <= allowed * (1.0 + TOLERANCE) + 1e-12:  # a solver that stops at its gap stops at it exactly
                    status = "optimal"
        if claim.status == "optimal" and status != "optimal":
            notes.append("called optimal, which its bound does not prove to the gap asked for")
    finished = status in ("optimal", "infeasible")
    settings = {**claim.settings, **({"notes": notes} if notes else {})}
    return Outcome(
        status, "none" if finished else limit, solver, version, x, objective, bound, settings, perf_counter() - started
    )


def _best(
    program: Program,
    found: list[FloatArray | None],
    start: FloatArray | None,
    notes: list[str],
    give_up: float | None,
) -> FloatArray | None:
    """Return the best solution that satisfies the program, repaired where that is needed; ties go to the solver."""
    sign = 1.0 if program.maximise else -1.0
    candidates = [(x, False) for x in found if x is not None] + ([(start, True)] if start is not None else [])
    candidates = [(x, own) for x, own in candidates if np.shape(x) == (program.n_columns,) and np.isfinite(x).all()]
    candidates.sort(key=lambda entry: -sign * program.objective(entry[0]))
    best: FloatArray | None = None
    for x, is_start in candidates:
        if best is not None and sign * program.objective(x) <= sign * program.objective(best):
            break
        rounded = np.where(program.integer, np.round(x), x)
        amount = program.violation(rounded)
        if amount <= TOLERANCE:
            best = rounded
            break
        whose = "the start" if is_start else "a solution of the solver"
        repaired = completed(program, rounded, give_up)
        if repaired is None or program.violation(repaired) > TOLERANCE:
            notes.append(f"{whose} violates a row or bound by {amount:.1e}: not believed")
            continue
        notes.append(f"{whose} violated a row or bound by {amount:.1e}: completed anew from its integers")
        if best is None or sign * program.objective(repaired) > sign * program.objective(best):
            best = repaired
    return best
