"""Solvers run in a thread of their own, watched: the deadline and an interrupt hold even where a solver overruns."""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np

from react_opt.errors import UsageError
from react_opt.models.program import Program
from react_opt.solvers.outcome import Claim, Limit, Outcome, Request
from react_opt.solvers.verdict import conclude
from react_opt.solvers.watch import Watch, leave_behind

_POLL_S = 0.02
_PROGRESS_S = 0.1
_INTERRUPT_GRACE_S = 1.0


def supervise(
    program: Program, request: Request, *, solver: str, version: str, run: Callable[[Watch], Claim]
) -> Outcome:
    """Run a solver in a thread until it is done, its time is up, or an interrupt; return what is known by then.

    The thread is asked to stop at the deadline. Where it does not within a short grace, it is left behind with
    its stop flag set, and the best solution and bound that it recorded are the answer. ``KeyboardInterrupt`` in
    the waiting thread is an interrupt of the same kind, not an error.

    Parameters
    ----------
    program, request
        What to solve, and how.
    solver, version
        Names for the outcome.
    run
        Builds the solver's model and solves it; polls :meth:`Watch.stopped`.

    Returns
    -------
    Outcome
        After at most ``1.1 * time_limit_s + 0.1`` s.

    Raises
    ------
    UsageError
        From ``run``, or where the start has not the shape of the program.
    """
    started = perf_counter()
    if request.start is not None and np.shape(request.start) != (program.n_columns,):
        raise UsageError(f"the start has shape {np.shape(request.start)}, the program has {program.n_columns} columns")
    limit_s = request.time_limit_s
    watch = Watch(program.maximise, None if limit_s is None else started + limit_s)
    if program.n_columns == 0:
        claim = _without_columns(program)
    elif watch.stopped():
        claim = Claim("no_solution")
    else:
        claim = _in_thread(watch, request, started, run)
    give_up = None if limit_s is None else started + 1.07 * limit_s + 0.07
    limit: Limit = claim.limit if claim.limit != "none" or watch.reason is None else watch.reason
    return conclude(
        program, request, claim,
        recorded=(watch.x, watch.bound), limit=limit, solver=solver, version=version, started=started, give_up=give_up,
    )  # fmt: skip


def _without_columns(program: Program) -> Claim:
    holds = bool(np.all(program.row_lower <= 0) and np.all(program.row_upper >= 0))
    return Claim("optimal", x=np.empty(0), bound=0.0) if holds else Claim("infeasible")


def _in_thread(watch: Watch, request: Request, started: float, run: Callable[[Watch], Claim]) -> Claim:
    answer: list[Claim | BaseException] = []
    done = threading.Event()

    def target() -> None:
        try:
            answer.append(run(watch))
        except MemoryError:
            answer.append(Claim("no_solution", limit="memory"))
        except BaseException as error:  # handed on to the waiting thread, which raises it
            answer.append(error)
        finally:
            done.set()

    thread = threading.Thread(target=target, name="react_opt solver", daemon=True)
    thread.start()
    while True:
        try:
            _wait(watch, request, started, done)
            break
        except KeyboardInterrupt:
            if watch.reason == "interrupt":  # the second one: no more patience
                break
            watch.stop("interrupt")
        except BaseException:
            watch.stop("interrupt")
            leave_behind(thread)
            raise
    if not answer:
        if watch.on_leave is not None:
            watch.on_leave()
        leave_behind(thread)
        return Claim("no_solution", notes=["the solver had not stopped in time and was left behind"])
    if isinstance(answer[0], BaseException):
        raise answer[0]
    return answer[0]


def _wait(watch: Watch, request: Request, started: float, done: threading.Event) -> None:
    limit_s = request.time_limit_s
    overtime = np.inf if limit_s is None else started + 1.03 * limit_s + 0.04
    give_up: float | None = None
    reported, shown = 0.0, (None, None)
    while not done.wait(_POLL_S):
        now = perf_counter()
        if request.should_stop is not None and request.should_stop():
            watch.stop("interrupt")
        if watch.stopped():
            patience = _INTERRUPT_GRACE_S if watch.reason == "interrupt" else np.inf
            give_up = min(now + patience, overtime) if give_up is None else give_up
            if now >= give_up:
                return
        if request.on_progress is not None:
            state: Any = (watch.objective, watch.bound)
            if state != shown or now - reported >= _PROGRESS_S:
                reported, shown = now, state
                request.on_progress(now - started, *state)
