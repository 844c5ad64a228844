"""What the decomposition answers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from react_opt.route_problem import Route
from react_opt.solvers.routes.budget import Limit

Status = Literal["optimal", "feasible", "infeasible", "no_plan"]


@dataclass(frozen=True)
class RoutesResult:
    """What the decomposition found and knows.

    Parameters
    ----------
    routes
        One route per robot, classes in order; None if no plan was found.
    objective, bound
        Value of the plan and proven bound on every plan; None where unknown.
    status
        ``optimal``, ``feasible``, ``infeasible`` (proven) or ``no_plan``.
    limit
        What stopped it.
    certificate
        What recomputes the bound (see ``docs/decomposition.md``); empty if there is none.
    iterations
        Units of work done: pricings, linear programmes, iterations of the primal search.
    notes
        How the bound came about and what was not possible, in words.
    """

    routes: list[Route] | None
    objective: float | None
    bound: float | None
    status: Status
    limit: Limit
    certificate: dict[str, Any] = field(default_factory=dict)
    iterations: int = 0
    notes: tuple[str, ...] = ()
