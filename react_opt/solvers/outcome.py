"""What a backend answers, and what it is asked: why it stopped, what it found and what it knows are kept apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Status = Literal["optimal", "feasible", "infeasible", "no_solution"]
Limit = Literal["time", "memory", "work", "interrupt", "none"]
Progress = Callable[[float, float | None, float | None], None]  # elapsed_s, incumbent, bound


@dataclass(frozen=True)
class Request:
    """How to solve a program.

    Parameters
    ----------
    time_limit_s
        Wall time from the call of ``solve`` to its return, s; None for no limit.
    work_limit
        Counted work (the backend documents its unit), reproducible with one thread and a seed; None for no
        limit.
    gap_rel, gap_abs
        Stop as soon as ``bound - objective <= max(gap_abs, gap_rel * |objective|)``.
    threads, seed
        Threads to use, and the seed of all that is random.
    start
        A feasible solution vector to start from, None for none.
    on_progress
        Called with elapsed seconds, incumbent and bound (None where unknown).
    should_stop
        Polled; True stops the solve as an interrupt.
    """

    time_limit_s: float | None = None
    work_limit: int | None = None
    gap_rel: float = 1e-9
    gap_abs: float = 0.0
    threads: int = 1
    seed: int = 0
    start: FloatArray | None = None
    on_progress: Progress | None = None
    should_stop: Callable[[], bool] | None = None


@dataclass
class Claim:
    """What a solver says when it stops, in the program's own sense.

    Parameters
    ----------
    status
        ``optimal``, ``infeasible`` or ``unbounded`` where it says it has proven that, else ``no_solution``;
        whether there is a solution is told by ``x`` alone.
    limit
        The limit that it says stopped it.
    x
        Its best solution, or None.
    bound
        Its proven bound, or None.
    settings
        The settings it was given beyond its defaults.
    notes
        What the user should know.
    """

    status: Literal["optimal", "infeasible", "unbounded", "no_solution"]
    limit: Limit = "none"
    x: FloatArray | None = None
    bound: float | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Outcome:
    """What a backend claims of a program; nobody trusts it before the replay.

    Parameters
    ----------
    status
        ``optimal``, ``feasible``, ``infeasible`` (proven) or ``no_solution``.
    limit
        What stopped it; ``none`` when it ran to its end.
    x, objective
        Best solution vector and its value in the program's own sense; None where there is none.
    bound
        Proven bound in the program's own sense; None where unknown.
    solver, version
        What solved it.
    settings
        The settings it was given beyond its defaults (integer scaling among them), and under ``notes`` a list of
        lines that the user should know (a start that was not used, a solution that was not believed).
    wall_s
        Seconds spent.
    """

    status: Status
    limit: Limit
    solver: str
    version: str
    x: FloatArray | None = None
    objective: float | None = None
    bound: float | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    wall_s: float = 0.0
