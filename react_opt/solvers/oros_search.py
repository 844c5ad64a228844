"""What is known while an OROS instance is being solved."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from react_opt.claims import optimality_tolerance
from react_opt.instance import OrosInstance
from react_opt.models.replay import tidy, value
from react_opt.options import SolveOptions
from react_opt.replan import Frozen
from react_opt.route_problem import Route, RouteProblem


@dataclass
class Search:
    """What is known while an instance is being solved.

    ``candidates`` are (value, routes), routes class by class; ``bound`` is proven; both without ``constant``,
    what cells explored from the start earn.
    """

    instance: OrosInstance
    options: SolveOptions
    problem: RouteProblem
    constant: float
    bound: float
    frozen: Frozen | None = None
    at_step: int | None = None
    candidates: list[tuple[float, list[Route]]] = field(default_factory=list)
    limit: str = "none"
    infeasible: str | None = None
    method: str = ""
    solver: str = ""
    packages: tuple[str, ...] = ("numpy", "scipy", "numba")
    settings: dict[str, Any] = field(default_factory=dict)
    certificate: dict[str, Any] | None = None
    wall_s: dict[str, float] = field(default_factory=dict)

    def offer(self, routes: Sequence[Route]) -> None:
        """Add routes of the whole problem as a candidate."""
        kept = tidy(self.problem, routes)
        self.candidates.append((value(self.problem, kept), kept))

    @property
    def best(self) -> tuple[float, list[Route]] | None:
        """The best candidate; of equals the first."""
        return max(self.candidates, key=lambda candidate: candidate[0], default=None)

    def progress(self, elapsed_s: float, incumbent: float | None, bound: float | None) -> None:
        """Report in the instance's own objective, never worse than what is known."""
        if self.options.on_progress is None:
            return
        known = self.best
        values = [v for v in (incumbent, known[0] + self.constant if known else None) if v is not None]
        bounds = [v for v in (bound, self.bound + self.constant) if v is not None]
        elapsed_s = time.perf_counter() - self.options.begun
        self.options.on_progress(elapsed_s, max(values, default=None), min(bounds))


def proven(search: Search) -> bool:
    """Whether the gap that was asked for is reached."""
    known = search.best
    if known is None:
        return False
    objective = known[0] + search.constant
    return optimal(search) or search.bound - known[0] <= (search.options.gap or 0.0) * abs(objective)


def optimal(search: Search) -> bool:
    """Whether the best plan is proven optimal."""
    known = search.best
    if known is None:
        return False
    return search.bound - known[0] <= optimality_tolerance(known[0] + search.constant, search.problem.sigma)
