"""How to solve: one frozen record of the options that every kind of instance shares, and the clock they run on."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from react_opt.errors import UsageError

Progress = Callable[[float, float | None, float | None], None]
METHODS = ("auto", "monolith", "routes")


@dataclass(frozen=True)
class SolveOptions:
    """Options of one solve.

    Parameters
    ----------
    time_limit_s
        Wall time from the call to the return, s; None for no limit.
    work_limit
        Counted work, whose unit the method documents; None for no limit.
    gap
        Stop as soon as the gap (a fraction) is at most this; None to prove the optimum.
    solver
        Backend of the monolith by name; None for the method's own.
    method
        ``auto``, ``monolith`` or ``routes``.
    threads
        Threads to use.
    seed
        Seed of everything random.
    explain
        Whether reasons of deferred and skipped targets are tested.
    on_progress
        Called with elapsed seconds, incumbent and bound, None where unknown.
    should_stop
        Polled; True ends the solve with the best plan so far.
    begun
        ``time.perf_counter()`` at the call.

    Raises
    ------
    UsageError
        Where a value makes no sense.
    """

    time_limit_s: float | None = 60.0
    work_limit: int | None = None
    gap: float | None = None
    solver: str | None = None
    method: str = "auto"
    threads: int = field(default_factory=lambda: os.cpu_count() or 1)
    seed: int = 0
    explain: bool = True
    on_progress: Progress | None = None
    should_stop: Callable[[], bool] | None = None
    begun: float = field(default_factory=time.perf_counter)

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        if self.time_limit_s is not None and not (self.time_limit_s >= 0 and math.isfinite(self.time_limit_s)):
            raise UsageError(f"time limit: expected a number of seconds >= 0, found {self.time_limit_s}")
        if self.work_limit is not None and self.work_limit < 0:
            raise UsageError(f"work limit: expected a whole number >= 0, found {self.work_limit}")
        if self.gap is not None and not 0 <= self.gap < math.inf:
            raise UsageError(f"gap: expected a fraction >= 0, found {self.gap}")
        if self.method not in METHODS:
            raise UsageError(f"method: expected one of {', '.join(METHODS)}, found {self.method!r}")
        if self.threads < 1:
            raise UsageError(f"threads: expected a whole number >= 1, found {self.threads}")
        if not 0 <= self.seed < 2**31:
            raise UsageError(f"seed: expected a whole number from 0 to {2**31 - 1}, found {self.seed}")

    @property
    def deadline(self) -> float | None:
        """``time.perf_counter()`` at which the solve must have returned, None for no limit."""
        return None if self.time_limit_s is None else self.begun + self.time_limit_s

    def left_s(self, reserve_s: float = 0.0) -> float | None:
        """Seconds left before the deadline less a reserve, at least 0; None for no limit."""
        deadline = self.deadline
        return None if deadline is None else max(0.0, deadline - reserve_s - time.perf_counter())

    def stopped(self) -> bool:
        """Whether the caller asked to stop."""
        return self.should_stop is not None and self.should_stop()
