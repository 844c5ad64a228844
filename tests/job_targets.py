"""Functions that jobs run in the tests."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any


def double(number: int) -> dict[str, Any]:
    return {"number": 2 * number, "process": os.getpid()}


def fail() -> None:
    raise ValueError("no luck\nat all")


def unwritable() -> float:
    return float("nan")


def hang() -> None:
    time.sleep(600)


def eat() -> int:
    blocks = []
    while True:
        blocks.append(bytearray(os.urandom(1) * 10_000_000))
        time.sleep(0.01)


def die_once(mark: str) -> str:
    """Kill the own process at the first call."""
    if not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "alive"


def kill_minder_once(mark: str) -> str:
    """Kill the process that minds this one at the first call; this one ends as its line is cut."""
    if not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(600)
    return "alive"


def die() -> None:
    print("a last word", flush=True)
    os._exit(7)


def note(log: str, number: int, pause_s: float = 0.0) -> int:
    """Write down that a job ran."""
    with Path(log).open("a") as file:
        file.write(f"{number}\n")
    time.sleep(pause_s)
    return number
