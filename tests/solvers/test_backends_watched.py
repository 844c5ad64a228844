"""Solvers that lie, overrun, crash or hang: what comes out is checked, on time, and said."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable
from time import perf_counter

import numpy as np
import pytest
from small_programs import battery, knapsack

from react_opt.errors import UsageError
from react_opt.models.program import Program
from react_opt.solvers.highs_model import completed
from react_opt.solvers.outcome import Claim, Outcome, Request
from react_opt.solvers.watch import Watch
from react_opt.solvers.watchdog import supervise
from react_opt.solvers.worker import run_in_worker


def fake(run: Callable[[Watch], Claim], program: Program, request: Request | None = None) -> Outcome:
    return supervise(program, request or Request(), solver="fake", version="0", run=run)


def notes(outcome: Outcome) -> str:
    return " ".join(outcome.settings.get("notes", []))


def test_a_solution_that_breaks_a_row_is_not_believed() -> None:
    outcome = fake(lambda watch: Claim("optimal", x=np.ones(3), bound=30.0), knapsack())
    assert (outcome.status, outcome.x, outcome.objective) == ("no_solution", None, None)
    assert "violates a row or bound by 3.0e+00: not believed" in notes(outcome)


def test_an_earlier_solution_that_holds_is_taken_instead() -> None:
    def run(watch: Watch) -> Claim:
        watch.found(np.array([1.0, 0.0, 1.0]), 17.0)
        return Claim("no_solution", limit="time", x=np.ones(3), bound=25.0)

    outcome = fake(run, knapsack())
    assert (outcome.status, outcome.limit) == ("feasible", "time")
    assert (outcome.objective, outcome.bound) == (17.0, 25.0)


def test_polluted_batteries_are_computed_anew_from_the_moves() -> None:
    program = battery()
    polluted = np.array([1.0 - 1e-7, 0.0, 4.0, 1.5 + 1e-4, 1.5])
    outcome = fake(lambda watch: Claim("optimal", x=polluted, bound=1.015), program)
    assert outcome.status == "optimal"
    assert outcome.objective == pytest.approx(1.015, abs=1e-12)
    assert "violated a row or bound by 1.0e-04: completed anew from its integers" in notes(outcome)
    assert completed(program, np.array([1.0, 1.0, 0.0, 0.0, 0.0])) is None  # both moves cannot be made


def test_what_is_within_tolerance_is_rounded_and_kept() -> None:
    outcome = fake(lambda watch: Claim("optimal", x=np.array([1e-9, 1.0, 1.0 - 1e-9]), bound=20.0), knapsack())
    assert outcome.x is not None
    assert outcome.x.tolist() == [0.0, 1.0, 1.0]
    assert outcome.status == "optimal"
    assert notes(outcome) == ""


def test_optimal_without_a_bound_is_feasible() -> None:
    outcome = fake(lambda watch: Claim("optimal", x=np.array([0.0, 1.0, 1.0])), knapsack())
    assert (outcome.status, outcome.bound) == ("feasible", None)
    assert "called optimal, which its bound does not prove" in notes(outcome)


def test_a_bound_that_a_solution_beats_is_not_believed() -> None:
    outcome = fake(lambda watch: Claim("optimal", x=np.array([0.0, 1.0, 1.0]), bound=19.0), knapsack())
    assert (outcome.status, outcome.bound) == ("feasible", None)
    assert "its bound 19.0 is beaten" in notes(outcome)


def test_infeasible_is_not_believed_against_a_solution() -> None:
    start = np.array([1.0, 0.0, 0.0])
    outcome = fake(lambda watch: Claim("infeasible"), knapsack(), Request(start=start))
    assert (outcome.status, outcome.objective, outcome.bound) == ("feasible", 10.0, None)
    assert "called infeasible, though a solution is known" in notes(outcome)


def test_the_gap_asked_for_decides_what_optimal_means() -> None:
    def run(watch: Watch) -> Claim:
        return Claim("optimal", x=np.array([1.0, 0.0, 1.0]), bound=20.0)

    assert fake(run, knapsack(), Request(gap_abs=3.0)).status == "optimal"
    assert fake(run, knapsack(), Request(gap_rel=0.2)).status == "optimal"
    assert fake(run, knapsack(), Request(gap_abs=2.9)).status == "feasible"


def test_a_vector_of_another_shape_or_of_nothing_is_dropped() -> None:
    for x in (np.ones(2), np.array([0.0, np.nan, 1.0])):
        assert fake(lambda watch, x=x: Claim("optimal", x=x, bound=20.0), knapsack()).status == "no_solution"


def test_a_solver_that_ignores_its_deadline_is_left_behind_with_what_it_found() -> None:
    release = threading.Event()

    def run(watch: Watch) -> Claim:
        watch.found(np.array([1.0, 0.0, 1.0]), 17.0)
        watch.proved(21.0)
        release.wait(30.0)
        return Claim("optimal", x=np.array([0.0, 1.0, 1.0]), bound=20.0)

    began = perf_counter()
    outcome = fake(run, knapsack(), Request(time_limit_s=0.2))
    assert perf_counter() - began < 10.0  # the solver would have taken 30 s
    release.set()
    assert (outcome.status, outcome.limit) == ("feasible", "time")
    assert (outcome.objective, outcome.bound) == (17.0, 21.0)
    assert "left behind" in notes(outcome)


def test_memory_that_runs_out_is_a_limit() -> None:
    def run(watch: Watch) -> Claim:
        raise MemoryError

    outcome = fake(run, knapsack())
    assert (outcome.status, outcome.limit) == ("no_solution", "memory")


def test_a_fault_inside_is_not_swallowed() -> None:
    def run(watch: Watch) -> Claim:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fake(run, knapsack())


def test_bounds_and_solutions_only_get_better() -> None:
    watch = Watch(maximise=False)
    for objective in (5.0, 7.0, 4.0, 6.0):
        watch.found(np.array([objective]), objective)
    for bound in (1.0, -np.inf, 0.5, 2.0, 1.5):
        watch.proved(bound)
    assert (watch.objective, watch.bound) == (4.0, 2.0)
    assert watch.x is not None
    assert watch.x.tolist() == [4.0]


# --- solvers in a worker process; the functions below run there ---


def hang(program: Program, request: Request, watch: Watch) -> Claim:
    watch.found(np.array([1.0, 0.0, 1.0]), 17.0)
    threading.Event().wait()
    raise AssertionError("unreachable")


def crash(program: Program, request: Request, watch: Watch) -> Claim:
    print("out of cheese", file=sys.stderr, flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("unreachable")


def hold(program: Program, request: Request, watch: Watch, *args: str) -> Claim:
    if args:
        return Claim("no_solution", notes=[str(os.getpid())])
    ctypes.PyDLL(None).sleep(60)  # unlike CDLL, it keeps the lock, so no order to stop is heard
    return Claim("no_solution")


def fail(program: Program, request: Request, watch: Watch) -> Claim:
    raise ZeroDivisionError("by nought")


def refuse(program: Program, request: Request, watch: Watch) -> Claim:
    raise UsageError("not this one")


def obey(program: Program, request: Request, watch: Watch, *args: str) -> Claim:
    stopped = threading.Event()
    watch.on_stop = stopped.set
    if not args and not watch.stopped():
        stopped.wait(30.0)
    return Claim("no_solution", bound=21.0, notes=[str(os.getpid())])


def in_worker(function: Callable[..., Claim], request: Request, *args: str) -> Outcome:
    target = f"{__name__}:{function.__name__}"
    return fake(lambda watch: run_in_worker(target, args, knapsack(), request, watch), knapsack(), request)


def test_a_worker_that_hangs_is_killed_and_what_it_told_is_kept() -> None:
    told = threading.Event()

    def progress(elapsed_s: float, incumbent: float | None, bound: float | None) -> None:
        if incumbent is not None:
            told.set()

    outcome = in_worker(hang, Request(should_stop=told.is_set, on_progress=progress))
    assert outcome.limit == "interrupt"
    assert outcome.objective == 17.0
    assert "was killed" in notes(outcome)


def test_a_worker_that_is_left_behind_is_dead() -> None:
    """Its process says who it is, holds the interpreter's lock for itself, and is gone when the answer is there."""
    outcome = in_worker(hold, Request(), "warm")
    (pid,) = (int(note) for note in outcome.settings["notes"])
    outcome = in_worker(hold, Request(time_limit_s=0.1))
    assert outcome.limit == "time"
    deadline = perf_counter() + 20.0
    while alive(pid):
        assert perf_counter() < deadline


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_worker_that_crashes_is_reported_with_its_last_words() -> None:
    outcome = in_worker(crash, Request())
    assert outcome.status == "no_solution"
    assert "ended by itself (code -9): out of cheese" in notes(outcome)


def test_what_a_worker_raises_arrives() -> None:
    with pytest.raises(UsageError, match="not this one"):
        in_worker(refuse, Request())
    failed = in_worker(fail, Request(start=np.array([1.0, 0.0, 0.0])))
    assert (failed.status, failed.objective) == ("feasible", 10.0)
    assert "the solver failed: ZeroDivisionError: by nought" in notes(failed)


def test_a_worker_is_told_to_stop_and_then_serves_again() -> None:
    first = in_worker(obey, Request(), "at once")
    second = in_worker(obey, Request(should_stop=lambda: True))
    third = in_worker(obey, Request(), "at once")
    assert [outcome.limit for outcome in (first, second, third)] == ["none", "interrupt", "none"]
    assert second.bound == 21.0
    assert len({notes(outcome) for outcome in (first, second, third)}) == 1  # the same process
