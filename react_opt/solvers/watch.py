"""What a running solver shares with whoever waits for it: the order to stop, and the best it has found."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
_EXIT_GRACE_S = 5.0
_stray: list[threading.Thread] = []


def leave_behind(thread: threading.Thread) -> None:
    """Remember a thread whose solver does not stop; the interpreter gives it some seconds to end before it exits."""
    if not _stray:
        atexit.register(_join_stray)  # native code that outlives the interpreter aborts the process
    _stray[:] = [other for other in _stray if other.is_alive()] + [thread]


def left_behind() -> bool:
    """Whether a solver that was left behind still runs; a command may then end by ``os._exit`` and not wait for it."""
    return any(thread.is_alive() for thread in _stray)


def _join_stray() -> None:
    deadline = perf_counter() + _EXIT_GRACE_S
    for thread in _stray:
        thread.join(max(0.0, deadline - perf_counter()))


@dataclass
class Watch:
    """What the thread of a solver shares with the thread that waits for it.

    Parameters
    ----------
    maximise
        Sense of the program.
    deadline
        ``perf_counter()`` at which the solver has to stop; None for none.
    on_stop
        Called once by :meth:`stop`, for solvers that are told rather than asked.
    on_leave
        Called where the solver is left behind, for solvers that can be killed.
    """

    maximise: bool
    deadline: float | None = None
    x: FloatArray | None = None
    objective: float | None = None
    bound: float | None = None
    reason: Literal["time", "interrupt"] | None = None
    on_stop: Callable[[], None] | None = None
    on_leave: Callable[[], None] | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def stop(self, reason: Literal["time", "interrupt"]) -> None:
        """Ask the solver to stop; the first reason counts."""
        if self.reason is None:
            self.reason = reason
            if self.on_stop is not None:
                self.on_stop()

    def stopped(self) -> bool:
        """Whether the solver has to stop; solvers poll it."""
        if self.reason is None and self.deadline is not None and perf_counter() >= self.deadline:
            self.stop("time")
        return self.reason is not None

    def remaining_s(self) -> float | None:
        """Seconds left, not negative; None for no limit."""
        return None if self.deadline is None else max(0.0, self.deadline - perf_counter())

    def found(self, x: FloatArray, objective: float) -> None:
        """Record a solution and its value; the best one is kept."""
        with self._lock:
            sign = 1.0 if self.maximise else -1.0
            if self.objective is None or sign * objective > sign * self.objective:
                self.x, self.objective = np.array(x, dtype=np.float64), float(objective)

    def proved(self, bound: float) -> None:
        """Record a proven bound; the tightest one is kept, what is not finite says nothing."""
        if not np.isfinite(bound):
            return
        with self._lock:
            pick = min if self.maximise else max
            self.bound = float(bound) if self.bound is None else pick(self.bound, float(bound))
