"""Where solvers put themselves: one decorated function from an instance to a plan."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import util
from typing import Any

Tell = Callable[[float, float | None, float | None], None]
"""Called with elapsed seconds, the objective of the best plan so far, and the best proven bound; None: unknown."""


@dataclass(frozen=True)
class Limits:
    """What a solver may use.

    Parameters
    ----------
    time_s
        Wall time, s: the same for every solver of a run.
    threads
        Threads.
    seed
        Seed of everything random.
    gap
        It may stop at this gap (a fraction); 0 to prove the optimum.
    """

    time_s: float
    threads: int = 1
    seed: int = 0
    gap: float = 0.0


Solver = Callable[[Any, Limits, Tell], Any]


@dataclass(frozen=True)
class Peer:
    """A solver of the benchmark.

    Parameters
    ----------
    name
        Its name in commands, results and reports.
    kinds
        The kinds of instances that it takes.
    solve
        ``(instance, limits, tell)`` to a plan with its claim.
    about
        What it is, in one line.
    package
        The distribution whose version is recorded.
    missing
        Says what to install, or why it cannot run here; None where it can.
    takes
        Which instances of these kinds it takes.
    endless
        Whether it always searches until its time is up, having no proof to end with.
    """

    name: str
    kinds: tuple[str, ...]
    solve: Solver
    about: str
    package: str
    missing: Callable[[], str | None]
    takes: Callable[[Any], bool] = lambda instance: True
    endless: bool = False

    @property
    def version(self) -> str:
        """Version of what solves."""
        try:
            return importlib.metadata.version(self.package)
        except importlib.metadata.PackageNotFoundError:
            return "unknown"


PEERS: dict[str, Peer] = {}


def needs(module: str, install: str) -> Callable[[], str | None]:
    """Return a test for a module: None where it is installed, else what to do."""

    def missing() -> str | None:
        return None if util.find_spec(module) is not None else f"needs {module}: {install}"

    return missing


def peer(
    name: str,
    kinds: Sequence[str],
    *,
    about: str,
    package: str,
    missing: Callable[[], str | None] = lambda: None,
    takes: Callable[[Any], bool] = lambda instance: True,
    endless: bool = False,
) -> Callable[[Solver], Solver]:
    """Register a solver ``(instance, limits, tell) -> plan``; see :class:`Peer`."""

    def register(solve: Solver) -> Solver:
        PEERS[name] = Peer(name, tuple(kinds), solve, about, package, missing, takes, endless)
        return solve

    return register
