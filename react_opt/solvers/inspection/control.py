"""When to stop: one flag that compiled kernels look at, set by the clock or by the caller."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType

import numpy as np

from react_opt.solvers.outcome import Limit

POLL_S = 0.01
LABELS = 2000
"""Labels of a pricing that are one unit of work more: enumerations make so many that pricings alone would not count."""


class Control:
    """Watches a deadline, a count of work and the caller's wish to stop.

    Parameters
    ----------
    deadline
        ``time.perf_counter()`` at which to stop; None for none.
    work_limit
        Work at most: pricings, with one more for every :data:`LABELS` labels, and portions of local search; None for
        no limit.
    should_stop
        Polled from another thread; True stops. None for never.

    Notes
    -----
    A context manager: a thread watches within it. ``flag[0]`` is nonzero once the deadline has passed or the
    caller wants to stop; kernels that run without the interpreter's lock read it.
    """

    def __init__(self, deadline: float | None, work_limit: int | None, should_stop: Callable[[], bool] | None) -> None:
        self.deadline, self.work_limit, self.should_stop = deadline, work_limit, should_stop
        self.work = 0
        self.flag = np.zeros(1, np.uint8)
        self.limit: Limit = "none"

    def __enter__(self) -> Control:
        """Start to watch."""
        if self.deadline is not None or self.should_stop is not None:
            _WATCH.add(self)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the watch, and whatever still runs on the flag."""
        _WATCH.remove(self)
        self.flag[0] = 1

    def wake_at(self, now: float) -> float:
        """``time.perf_counter()`` at which to look again."""
        next_poll = now + POLL_S if self.should_stop is not None else np.inf
        return float(next_poll if self.deadline is None else min(next_poll, self.deadline))

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

    def affordable(self, labels: int) -> int:
        """Return how many labels the next pricing may make: so many, or as many as the work left allows."""
        return labels if self.work_limit is None else min(labels, max(1, self.work_limit - self.work) * LABELS)

    def count(self, labels: int) -> None:
        """Count the work of a pricing that made so many labels."""
        self.work += 1 + labels // LABELS

    def part(self) -> Control:
        """Return a control for a part of the work that shares the deadline; the kernels read a flag of their own."""
        return Control(self.deadline, None, self.should_stop)

    def left_s(self) -> float | None:
        """Seconds left, None for no deadline."""
        return None if self.deadline is None else max(0.0, self.deadline - time.perf_counter())


class _Watch:
    """One thread for all controls of the process: starting and joining one per solve costs more than a small solve."""

    def __init__(self) -> None:
        self._change = threading.Condition()
        self._controls: list[Control] = []
        self._wake_at = np.inf
        self._thread: threading.Thread | None = None

    def add(self, control: Control) -> None:
        with self._change:
            self._controls.append(control)
            if self._thread is None or not self._thread.is_alive():  # the first, or in a forked child
                self._wake_at = np.inf
                self._thread = threading.Thread(target=self._run, name="react_opt watch", daemon=True)
                self._thread.start()
            if control.wake_at(time.perf_counter()) < self._wake_at:
                self._change.notify()

    def remove(self, control: Control) -> None:
        with self._change:
            if control in self._controls:
                self._controls.remove(control)

    def _run(self) -> None:
        while True:
            with self._change:
                now = time.perf_counter()
                self._wake_at = min((c.wake_at(now) for c in self._controls), default=self._wake_at)
                self._change.wait(None if self._wake_at == np.inf else max(0.0, self._wake_at - now))
                watched, self._wake_at = list(self._controls), np.inf
            for control in watched:  # without the lock: what the caller wants to know is the caller's code
                if control.stopped():
                    self.remove(control)


_WATCH = _Watch()
