"""How a result is stated: when it counts as optimal, which versions made it, and a bound that always holds."""

from __future__ import annotations

import importlib.metadata
import platform

import numpy as np

from react_opt.instance import Document
from react_opt.jsonio import sha256
from react_opt.plan import InstanceRef
from react_opt.route_problem import RouteProblem
from react_opt.timegraph import steps_between


def optimality_tolerance(objective: float, sigma: float) -> float:
    """Return the largest ``bound - objective`` at which a plan counts as optimal.

    ``max(1e-9 |objective|, min(1e-6 |objective|, sigma * 1 J))``; without the last term when sigma is 0.

    Parameters
    ----------
    objective
        Value of the plan.
    sigma
        Weight of one joule.
    """
    size = abs(objective)
    return max(1e-9 * size, min(1e-6 * size, sigma) if sigma > 0 else 1e-6 * size)


def instance_ref(instance: Document) -> InstanceRef:
    """Return the reference by which a plan names its instance."""
    return InstanceRef(name=instance.name, sha256=sha256(instance))


def versions(*packages: str) -> dict[str, str]:
    """Return the versions of react_opt, Python and some installed packages."""
    found = {"react_opt": importlib.metadata.version("react_opt"), "python": platform.python_version()}
    for package in packages:
        found[package] = importlib.metadata.version(package)
    return found


def relaxation_bound(problem: RouteProblem) -> float:
    """Return a bound on any plan that needs no solver.

    Each cell earns at most what it would if the robot that gets there first sensed it on arrival; each robot
    keeps at most its battery less the cheapest way to pass every step (its capacity where there are chargers).

    Parameters
    ----------
    problem
        The problem.
    """
    earliest = np.full(problem.n_cells, problem.horizon + 1, dtype=np.int64)
    left_j = 0.0
    cheapest_arc = float((problem.arc_energy_j / problem.arc_steps).min()) if problem.n_arcs else np.inf
    charging = bool((problem.charger_j > 0).any())
    for group in problem.classes:
        earliest = np.minimum(earliest, group.start_step + steps_between(problem, group.start))
        idle_j = (problem.horizon - group.start_step) * min(group.wait_j, cheapest_arc)
        left_j += len(group.robots) * (group.capacity_j if charging else group.battery_j - idle_j)
    coverage = 0.0
    for i in range(problem.n_cells):
        if earliest[i] <= problem.horizon:
            coverage += max(0.0, float(problem.reward[i, max(1, earliest[i]) :].max()))
    return coverage + problem.sigma * left_j
