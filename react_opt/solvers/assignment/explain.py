"""Why a target is deferred, and what it would cost to force it in."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from react_opt.models.assignment import AssignmentArrays, AssignmentModel, FloatArray, IntArray
from react_opt.plan import AssignmentReason
from react_opt.solvers.assignment.exact import TOLERANCE, solve_arrays


@dataclass(frozen=True)
class Reason:
    """Why a target is deferred; ``loss`` is None where forcing it in is infeasible or was not tested."""

    target: int
    reason: AssignmentReason
    loss: float | None = None


def reasons(model: AssignmentModel, robot_of: IntArray) -> list[Reason]:
    """Return the reason of every deferred target, without solving anything.

    Unreachable, zone, energy and no_gain follow from the pairs alone. Else the target was free to be taken:
    ``conflict`` where only a conflict keeps it from a robot that would gain by taking it (also in place of
    what it takes now), ``energy`` where only a budget does, ``outbid`` where others make better use of the
    robots.

    Parameters
    ----------
    model
        The instance as arrays.
    robot_of
        ``(K,)`` the robot that takes each target, -1 where none does.
    """
    arrays = model.arrays
    able = (arrays.capacity > 0)[:, None]
    reach = np.any(model.reachable & able, axis=0).tolist()
    zone = np.any(model.reachable & able & model.in_zone, axis=0).tolist()
    best = arrays.value.max(axis=0, initial=-np.inf)
    taken = np.flatnonzero(robot_of >= 0)
    n_robots = len(arrays.capacity)
    load = np.bincount(robot_of[taken], minlength=n_robots).astype(np.int64)
    energy = arrays.energy_j[robot_of[taken], taken]
    spent = np.bincount(robot_of[taken], weights=energy, minlength=n_robots).astype(np.float64)
    least = np.full(n_robots, np.inf)  # value of the least of what a robot takes now
    np.minimum.at(least, robot_of[taken], arrays.value[robot_of[taken], taken])
    instead = np.where(load < arrays.capacity, 0.0, least)
    found = []
    for k in np.flatnonzero(robot_of < 0).tolist():
        if not reach[k]:
            found.append(Reason(k, "unreachable"))
        elif not zone[k]:
            found.append(Reason(k, "zone"))
        elif np.isneginf(best[k]):
            found.append(Reason(k, "energy"))
        elif best[k] <= 0:
            found.append(Reason(k, "no_gain"))
        else:
            found.append(Reason(k, _bid(arrays, robot_of, k, instead, load, spent)))
    return found


def _bid(
    arrays: AssignmentArrays,
    robot_of: IntArray,
    k: int,
    instead: FloatArray,
    load: NDArray[np.int64],
    spent: FloatArray,
) -> AssignmentReason:
    wants = arrays.value[:, k] > np.maximum(instead, 0.0)
    fits = (load >= arrays.capacity) | (spent + arrays.energy_j[:, k] <= arrays.energy_limit_j())
    pairs = arrays.conflicts
    others = np.concatenate([pairs[pairs[:, 0] == k, 1], pairs[pairs[:, 1] == k, 0]])
    if (robot_of[others] >= 0).any() and (wants & fits).any():
        return "conflict"
    return "energy" if (wants & ~fits).any() else "outbid"


def with_losses(
    model: AssignmentModel,
    robot_of: IntArray,
    objective: float,
    deadline: float | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> list[Reason]:
    """Return the reasons, each tested by forcing the target into an assignment that was proven best.

    ``conflict`` means: without the conflicts of this target alone a better assignment takes it; ``energy``:
    without its energy alone; ``outbid``: neither. The loss is the objective minus that of the best assignment
    that takes the target. What is not tested before the deadline keeps its untested reason without a loss.

    Parameters
    ----------
    model, robot_of, objective
        The instance as arrays, an optimal assignment and its value.
    deadline, should_stop
        As in :func:`react_opt.solvers.assignment.exact.assign`.
    """
    arrays, untested = model.arrays, reasons(model, robot_of)
    if arrays.plain:
        loss = plain_losses(arrays, robot_of)
        return [
            replace(row, loss=float(loss[row.target])) if np.isfinite(loss[row.target]) else row for row in untested
        ]
    tested = []
    for row in untested:
        late = deadline is not None and time.perf_counter() >= deadline
        if not _open(row) or late or (should_stop is not None and should_stop()):
            tested.append(row)
            continue
        forced = forced_objective(arrays, row.target, objective, deadline)
        if forced is None:
            tested.append(row)
            continue
        reason = row.reason if row.reason == "no_gain" else _cause(arrays, row.target, objective, robot_of, deadline)
        tested.append(Reason(row.target, reason or row.reason, max(0.0, objective - forced)))
    return tested


def _open(row: Reason) -> bool:
    return row.reason not in ("unreachable", "zone")


def forced_objective(
    arrays: AssignmentArrays, target: int, objective: float, deadline: float | None = None
) -> float | None:
    """Return the best value of an assignment that takes ``target``, None where none does or time ran out.

    The target's pairs are lifted above everything an assignment can earn, so that the best assignment takes it
    if any can.
    """
    able = np.isfinite(arrays.value[:, target])
    if not able.any():
        return None
    value = arrays.value.copy()
    lift = 2.0 * (abs(objective) + float(np.abs(value[able, target]).max()) + 1.0)
    value[able, target] += lift
    near = arrays.conflicts[(arrays.conflicts == target).any(axis=1)]
    others = near[near != target]
    value[:, others] = -np.inf
    lifted = replace(arrays, value=value)
    answer = solve_arrays(lifted, deadline)
    if answer.limit != "none" or answer.robot_of[target] < 0:
        return None
    return answer.objective - lift


def _cause(
    arrays: AssignmentArrays, target: int, objective: float, robot_of: IntArray, deadline: float | None
) -> AssignmentReason | None:
    """Return the limit whose absence would let the target in; None where time ran out."""
    mine = (arrays.conflicts == target).any(axis=1)
    energy = arrays.energy_j.copy()
    energy[:, target] = 0.0
    trials: list[tuple[AssignmentReason, AssignmentArrays]] = []
    if mine.any():
        trials.append(("conflict", replace(arrays, conflicts=arrays.conflicts[~mine])))
    if (arrays.capacity > 1).any():
        trials.append(("energy", replace(arrays, energy_j=energy)))
    for reason, relaxed in trials:
        answer = solve_arrays(relaxed, deadline, start=robot_of)
        if answer.limit != "none":
            return None
        if answer.objective > objective + 10 * TOLERANCE * max(1.0, abs(objective)):
            return reason
    return "outbid"


def plain_losses(arrays: AssignmentArrays, robot_of: IntArray) -> FloatArray:
    """Return ``(K,)`` what forcing each target costs in the plain case, from one shortest-path computation.

    Freeing a robot costs what it drops, or the loss of passing its target to another robot that is freed in
    turn. The graph of these exchanges has no negative cycle at an optimum, so Bellman and Ford's iteration
    ends. Entries of targets that no robot can take are infinite, those of taken targets meaningless.
    """
    value = arrays.value
    n_robots = len(value)
    held = np.full(n_robots, -1, dtype=np.int64)
    taken = np.flatnonzero(robot_of >= 0)
    held[robot_of[taken]] = taken
    busy = np.flatnonzero(held >= 0)
    mine = value[busy, held[busy]]
    free = np.zeros(n_robots)
    free[busy] = mine
    swap = mine[None, :] - value[:, held[busy]]  # robot r' (row) takes over what the busy one (column) holds
    for _ in range(n_robots):
        better = np.minimum(free[busy], (swap + free[:, None]).min(axis=0, initial=np.inf))
        if not (better < free[busy] - 1e-12).any():
            break
        free[busy] = better
    loss: FloatArray = (free[:, None] - value).min(axis=0, initial=np.inf)
    return np.maximum(loss, 0.0)
