"""When to stop: one flag that compiled kernels look at, set by the clock or by the caller."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType

import numpy as np

from react_opt.solvers.outcome import Limit

POLL_S = 0.01


class Control:
    """Watches a deadline, a count of work and the caller's wish to stop.

    Parameters
    ----------
    deadline
        ``time.perf_counter()`` at which to stop; None for none.
    work_limit
        Pricings and portions of local search at most; None for none.
    should_stop
        Polled from a thread of its own; True stops. None for never.

    Notes
    -----
    A context manager: the thread lives within it. ``flag[0]`` is nonzero once the deadline has passed or the
    caller wants to stop; kernels that run without the interpreter's lock read it.
    """

    def __init__(self, deadline: float | None, work_limit: int | None, should_stop: Callable[[], bool] | None) -> None:
        self.deadline, self.work_limit, self.should_stop = deadline, work_limit, should_stop
        self.work = 0
        self.flag = np.zeros(1, np.uint8)
        self.limit: Limit = "none"
        self._leave = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Control:
        """Start to watch."""
        if self.deadline is not None or self.should_stop is not None:
            self._thread = threading.Thread(target=self._watch, daemon=True)
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the watch, and whatever still runs on the flag."""
        self._leave.set()
        self.flag[0] = 1
        if self._thread is not None:
            self._thread.join()

    def _watch(self) -> None:
        while not self.stopped():
            left_s = np.inf if self.deadline is None else self.deadline - time.perf_counter()
            wait_s = min(POLL_S, left_s) if self.should_stop is not None else left_s
            if self._leave.wait(max(0.0, wait_s)):
                return

    def stopped(self) -> bool:
        """Whether to stop, with the reason in ``limit``."""
        if self.limit == "none":
            if self.deadline is not None and time.perf_counter() >= self.deadline:
                self.limit = "time"
            elif self.should_stop is not None and self.should_stop():
                self.limit = "interrupt"
            elif self.work_limit is not None and self.work >= self.work_limit:
                self.limit = "work"
        if self.limit in ("time", "interrupt"):
            self.flag[0] = 1
        return self.limit != "none"

    def part(self) -> Control:
        """Return a control for a part of the work that shares the deadline; the kernels read a flag of their own."""
        return Control(self.deadline, None, self.should_stop)

    def left_s(self) -> float | None:
        """Seconds left, None for no deadline."""
        return None if self.deadline is None else max(0.0, self.deadline - time.perf_counter())
