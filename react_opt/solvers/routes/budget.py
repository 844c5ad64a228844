"""Limits of one solve, and the best plan and bound known so far."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from react_opt.models.replay import feasible, tidy, value
from react_opt.route_problem import Route, RouteProblem
from react_opt.solvers.routes.bounds import Lattice, tolerance

Limit = Literal["time", "work", "interrupt", "none"]
OnProgress = Callable[[float, float | None, float | None], None]


class Budget:
    """When to stop: a deadline, a number of counted iterations, or the user.

    One unit of work is one call of the pricing, one linear programme of the master or one iteration of the
    primal search, so that a work limit is reproducible.

    Parameters
    ----------
    deadline
        ``time.perf_counter()`` value, None for no deadline.
    work_limit
        Units of work, None for no limit.
    should_stop
        Polled; True stops as an interrupt.
    """

    def __init__(self, deadline: float | None, work_limit: int | None, should_stop: Callable[[], bool] | None) -> None:
        self.begun = time.perf_counter()
        self.deadline, self.work_limit, self._should_stop = deadline, work_limit, should_stop
        self.work = 0
        self.limit: Limit = "none"
        self.aside: Callable[[], None] | None = None  # done whenever the limits are asked for
        self.alone: Callable[[], AbstractContextManager[None]] = nullcontext  # within it nothing runs beside

    def spend(self, units: int = 1) -> None:
        """Count work."""
        self.work += units

    def left_s(self) -> float | None:
        """Return the seconds left, None without a deadline."""
        return None if self.deadline is None else self.deadline - time.perf_counter()

    def over(self) -> bool:
        """Return whether a limit is reached; the first one reached is kept in ``limit``."""
        if self.limit == "none":
            if self.aside is not None:
                self.aside()
            if self._should_stop is not None and self._should_stop():
                self.limit = "interrupt"
            elif self.work_limit is not None and self.work >= self.work_limit:
                self.limit = "work"
            elif self.deadline is not None and time.perf_counter() >= self.deadline:
                self.limit = "time"
        return self.limit != "none"


@contextmanager
def stopping(deadline: float | None, stop: NDArray[np.uint8]) -> Iterator[None]:
    """Set the flag that compiled passes look at when the deadline is there; one of them may take many seconds."""
    timer = None
    if deadline is not None:
        timer = threading.Timer(max(0.0, deadline - time.perf_counter()), stop.fill, [1])
        timer.daemon = True
        timer.start()
    try:
        yield
    finally:
        if timer is not None:
            timer.cancel()


class Standing:
    """The best plan and the best bound known so far.

    Parameters
    ----------
    problem
        The route problem.
    budget
        Limits of the solve.
    gap
        Relative gap at which to stop, None for proven optimality only.
    on_progress
        Called with elapsed seconds, incumbent and bound after each change.
    """

    def __init__(
        self, problem: RouteProblem, budget: Budget, gap: float | None, on_progress: OnProgress | None
    ) -> None:
        self.problem, self.budget, self.gap, self._on_progress = problem, budget, gap, on_progress
        self.lattice = Lattice(problem)
        self.routes: list[Route] | None = None
        self.objective: float | None = None
        self.bound: float | None = None

    def offer(self, routes: Sequence[Route]) -> bool:
        """Take a complete plan if it keeps every limit and is better; return whether it was taken."""
        better = tidy(self.problem, routes)
        worth = value(self.problem, better)
        if self.objective is not None and worth <= self.objective:
            return False
        if feasible(self.problem, better):
            return False
        self.routes, self.objective = better, worth
        self._tell()
        return True

    def lower_bound_to(self, bound: float) -> bool:
        """Take a valid bound if it is better, rounded down to a value a plan can have; return whether it was."""
        rounded = self.lattice.round_down(bound)
        if self.bound is not None and rounded >= self.bound:
            return False
        self.bound = rounded
        self._tell()
        return True

    @property
    def slack(self) -> float | None:
        """How far the bound may lie above the plan for it to be optimal."""
        return None if self.objective is None else tolerance(self.objective, self.problem.sigma)

    def proven(self, bound: float | None = None) -> bool:
        """Return whether the plan is optimal by this bound (the best known by default)."""
        bound = self.bound if bound is None else bound
        if bound is None or self.objective is None or self.slack is None:
            return False
        return bound - self.objective <= self.slack

    def done(self) -> bool:
        """Return whether optimality or the wanted gap is reached, or a limit."""
        if self.proven():
            return True
        if self.gap is None or self.bound is None or self.objective is None:
            return self.budget.over()
        return self.bound - self.objective <= self.gap * max(abs(self.objective), 1e-9) or self.budget.over()

    def _tell(self) -> None:
        if self._on_progress is not None:
            self._on_progress(time.perf_counter() - self.budget.begun, self.objective, self.bound)
