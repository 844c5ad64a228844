"""What every solver of a :class:`Program` looks like from outside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from react_opt.models.program import Program
from react_opt.solvers.outcome import Outcome, Request


@dataclass(frozen=True)
class Abilities:
    """What a backend can do beyond solving a program.

    Parameters
    ----------
    warm_start
        It searches on from ``Request.start``. Where it cannot, the start is still kept as the plan to beat.
    bound
        It proves a bound before it is done.
    incumbents
        It hands out its improving solutions while it runs, so the best one outlives a deadline that it overruns.
    work_unit
        Unit of ``Request.work_limit``; None where work cannot be limited reproducibly.
    integer_only
        It computes in whole numbers, and refuses a program that it cannot state exactly in them.
    """

    warm_start: bool
    bound: bool
    incumbents: bool
    work_unit: str | None
    integer_only: bool = False


class Backend(Protocol):
    """A solver that is installed."""

    @property
    def name(self) -> str:
        """Name in the registry."""
        ...

    @property
    def version(self) -> str:
        """Version of the library that solves."""
        ...

    @property
    def abilities(self) -> Abilities:
        """What it can do."""
        ...

    def solve(self, program: Program, request: Request) -> Outcome:
        """Solve a program within a request.

        Raises
        ------
        UsageError
            Where the request asks for what the backend has not, or it cannot state the program exactly.
        """
        ...
