"""Ctrl-C and termination as a flag that solvers and the simulator poll, so that what there is so far is kept."""

from __future__ import annotations

import signal
import sys
import threading
from types import FrameType, TracebackType
from typing import Any, Self


class Interruption:
    """Context in which the first SIGINT or SIGTERM sets a flag and a second one raises ``KeyboardInterrupt``.

    Parameters
    ----------
    next_step
        What happens after the first one, to be told on standard error.
    """

    def __init__(self, next_step: str = "finishing with the best plan so far") -> None:
        self._next_step = next_step
        self._asked = threading.Event()
        self._before: dict[int, Any] = {}

    def asked(self) -> bool:
        """Whether an interrupt came."""
        return self._asked.is_set()

    def __enter__(self) -> Self:
        """Install the handlers; outside the main thread there is nothing to install."""
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Restore the handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self._asked.is_set():
            raise KeyboardInterrupt
        self._asked.set()
        print(f"interrupted: {self._next_step}", file=sys.stderr)
