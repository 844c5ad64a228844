"""A backend whose solver runs in a worker process."""

from __future__ import annotations

from dataclasses import dataclass

from react_opt.errors import UsageError
from react_opt.models.program import Program
from react_opt.solvers.backend import Abilities
from react_opt.solvers.outcome import Outcome, Request
from react_opt.solvers.watchdog import supervise
from react_opt.solvers.worker import run_in_worker


@dataclass(frozen=True)
class WorkerBackend:
    """A solver in a process of its own.

    Parameters
    ----------
    name, version, abilities
        As every backend has them.
    target
        ``module:function`` that solves, called in the worker.
    args
        Further arguments of it.
    """

    name: str
    version: str
    abilities: Abilities
    target: str
    args: tuple[str, ...] = ()

    def solve(self, program: Program, request: Request) -> Outcome:
        """Solve a program within a request.

        Raises
        ------
        UsageError
            Where the request asks for what the solver has not, or it cannot state the program exactly.
        """
        if request.work_limit is not None and self.abilities.work_unit is None:
            raise UsageError(f"the solver {self.name} has no reproducible work limit; give it a time limit")
        return supervise(
            program,
            request,
            solver=self.name,
            version=self.version,
            run=lambda watch: run_in_worker(self.target, self.args, program, request, watch),
        )
