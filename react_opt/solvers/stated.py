"""How an answer of the middle layer becomes a plan: what its claim always holds, the check, and a plan to start from.

Assignment and inspection share this; what an OROS claim holds is in :mod:`react_opt.solvers.oros_answer`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from react_opt.certify_base import Certificate
from react_opt.errors import InputError, ReactError
from react_opt.instance import Document
from react_opt.options import SolveOptions
from react_opt.plan import PlanDocument

_I = TypeVar("_I", bound=Document)
_P = TypeVar("_P", bound=PlanDocument)


class Statement(Generic[_I, _P]):
    """Collects what the claim of one solve says, phase by phase.

    Parameters
    ----------
    instance, options
        What is solved, and how.
    check
        The independent checker of this kind of plan.
    """

    def __init__(self, instance: _I, options: SolveOptions, check: Callable[[_I, _P], Certificate]) -> None:
        self.instance, self.options, self.check = instance, options, check
        self.wall_s = {"build": time.perf_counter() - options.begun}
        self._begun = time.perf_counter()

    def phase_done(self, name: str) -> None:
        """Note the wall time since the last phase."""
        now = time.perf_counter()
        self.wall_s[name], self._begun = now - self._begun, now

    def facts(self, method: str, solver: str, versions: dict[str, str], settings: dict[str, Any]) -> dict[str, Any]:
        """Return the fields of a claim that say how it was solved."""
        options = self.options
        asked = {"time_limit_s": options.time_limit_s, "work_limit": options.work_limit, "gap": options.gap}
        return {
            "method": method, "solver": solver, "versions": versions, "settings": {**asked, **settings},
            "seed": options.seed, "threads": options.threads, "wall_s": dict(self.wall_s),
        }  # fmt: skip

    def checked(self, plan: _P) -> _P:
        """Return a plan that the checker has accepted, with the wall time of that in its claim.

        Raises
        ------
        ReactError
            Where it has not: a fault of this program.
        """
        self._begun = time.perf_counter()
        found = self.check(self.instance, plan)
        if not found.ok:
            raise ReactError(f"no plan passed the checker; please report this: {found.violations[0]}")
        self.phase_done("check")
        claim = plan.claim.model_copy(update={"wall_s": {**plan.claim.wall_s, "check": self.wall_s["check"]}})
        return plan.model_copy(update={"claim": claim})


def require_start(instance: _I, start: Any, kind: type[_P], check: Callable[[_I, _P], Certificate]) -> _P:
    """Return a plan to start from that the checker accepts.

    Raises
    ------
    InputError
        Where it is of another kind, or no valid plan of the instance.
    """
    if not isinstance(start, kind):
        expected = f"{instance.kind}_plan"
        raise InputError.single("<start>", "kind", f"expected an {expected}, found {start.kind!r}")
    found = check(instance, start)
    if not found.ok:
        raise InputError.single("<start>", "", f"expected a valid plan of this instance: {found.violations[0]}")
    return start
