"""The paper's gate, and its simple rule as a baseline to beat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from react_opt.models.inspection import InspectionArrays, Routes


@dataclass(frozen=True)
class Gate:
    """Whether to go on the inspection, and why not where not."""

    go: bool
    reason: str = ""


def gate(
    cells_left: int, t_dpi_s: float, time_left_s: float, finish_battery_j: Sequence[float], reserve_j: Sequence[float]
) -> Gate:
    """Return whether the inspection may begin: time and battery on completion suffice (paper, equation 2).

    Parameters
    ----------
    cells_left
        Areas still to be explored; the inspection waits for none to be left.
    t_dpi_s, time_left_s
        Time that the inspection needs, and the time left, s.
    finish_battery_j, reserve_j
        Per robot its battery on completion, which must be positive, and the reserve it must keep, J.
    """
    if cells_left > 0:
        return Gate(False, f"{cells_left} areas are left to explore")
    if t_dpi_s > time_left_s:
        return Gate(False, f"time: needs {t_dpi_s:g} s of {time_left_s:g} s")
    for index, (battery, reserve) in enumerate(zip(finish_battery_j, reserve_j, strict=True)):
        if battery <= 0 or battery < reserve:
            return Gate(False, f"battery: robot {index} would finish with {battery:g} J, reserve {reserve:g} J")
    return Gate(True)


def simple_rule(arrays: InspectionArrays) -> Routes | None:
    """Return the routes of the paper's simple rule: the best charged robot takes the target nearest to it.

    Again and again the robot with the most energy left (ties: the first) drives to the target nearest in time
    among those that it can still serve and go to its end from; a robot that can serve none is done. None where
    a robot cannot even reach its end.

    Parameters
    ----------
    arrays
        The problem.
    """
    n, n_robots = len(arrays.value), len(arrays.time_s)
    routes: Routes = [[] for _ in range(n_robots)]
    if not arrays.is_feasible(routes):
        return None
    at, used_s, used_j = [n] * n_robots, [0.0] * n_robots, [0.0] * n_robots
    waiting, busy = set(range(n)), set(range(n_robots))
    while waiting and busy:
        r = max(sorted(busy), key=lambda robot: arrays.energy_limit_j[robot] - used_j[robot])
        time_s, energy_j = arrays.time_s[r], arrays.energy_j[r]
        within = [
            k
            for k in sorted(waiting)
            if used_s[r] + time_s[at[r], k] + time_s[k, n + 1] <= arrays.time_limit_s
            and used_j[r] + energy_j[at[r], k] + energy_j[k, n + 1] <= arrays.energy_limit_j[r]
        ]
        if not within:
            busy.discard(r)
            continue
        k = min(within, key=lambda target: float(time_s[at[r], target]))
        used_s[r] += float(time_s[at[r], k])
        used_j[r] += float(energy_j[at[r], k])
        routes[r].append(k)
        at[r] = k
        waiting.discard(k)
    return routes
