"""How a result is stated: when it counts as optimal, which versions made it, and a bound that always holds."""

from __future__ import annotations

import functools
import importlib.metadata
import platform

import numpy as np

from react_opt.instance import Document
from react_opt.jsonio import sha256
from react_opt.plan import InstanceRef
from react_opt.route_problem import FloatArray, RouteProblem
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
    return {"react_opt": _version("react_opt"), "python": platform.python_version()} | {
        package: _version(package) for package in packages
    }


@functools.cache
def _version(package: str) -> str:
    """Return a package's version, looked up once: its metadata is a mail header that takes a millisecond to parse."""
    return importlib.metadata.version(package)


def relaxation_bound(problem: RouteProblem) -> float:
    """Return a bound on any plan that needs no solver.

    Coverage is bounded twice, and the smaller counts. By cells: each earns at most what it would if the robot that
    gets there first sensed it on arrival. By robots: at an instant each robot senses at most one cell, so what is
    sensed there earns at most the largest rewards of that instant, and no more cells are sensed in all than there
    are or than the batteries have sensings in them. Each robot keeps at most its battery less the cheapest way to
    pass every step (its capacity where there are chargers).

    Parameters
    ----------
    problem
        The problem.
    """
    steps = problem.horizon + 1
    earliest = np.full(problem.n_cells, steps, dtype=np.int64)
    robots_at = np.zeros(steps, dtype=np.int64)
    left_j, sensings = 0.0, 0.0
    cheapest_arc = float((problem.arc_energy_j / problem.arc_steps).min()) if problem.n_arcs else np.inf
    charging = bool((problem.charger_j > 0).any())
    for group in problem.classes:
        size = len(group.robots)
        earliest = np.minimum(earliest, group.start_step + steps_between(problem, group.start))
        robots_at[group.start_step :] += size
        idle_j = (problem.horizon - group.start_step) * min(group.wait_j, cheapest_arc)
        left_j += size * (group.capacity_j if charging else group.battery_j - idle_j)
        spare_j = group.battery_j - group.reserve_j - idle_j
        endless = charging or group.sense_j <= 0
        sensings += np.inf if endless else size * max(0.0, np.floor(spare_j / group.sense_j + 1e-6))
    instant = np.arange(steps)[None, :]
    reward = np.where(instant >= np.maximum(1, earliest)[:, None], np.maximum(problem.reward, 0.0), 0.0)
    by_cells = float(reward.max(axis=1, initial=0.0).sum())
    if problem.sensing_robots_per_step is not None:
        robots_at = np.minimum(robots_at, problem.sensing_robots_per_step)
    places = [_largest(reward[:, t], int(robots_at[t])) for t in range(1, steps)]
    most = min(float((reward.max(axis=1, initial=0.0) > 0).sum()), sensings)
    by_robots = float(_largest(np.concatenate(places), int(most)).sum())
    return min(by_cells, by_robots) + problem.sigma * left_j


def _largest(values: FloatArray, count: int) -> FloatArray:
    """Return the ``count`` largest of some values, all of them where there are fewer."""
    if count >= len(values):
        return values
    return np.partition(values, len(values) - count)[len(values) - count :] if count else values[:0]
