"""The assignment on arrays, exactly: scipy's linear assignment where it is plain, else branch and bound."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from react_opt.models.assignment import AssignmentArrays, FloatArray, IntArray, objective_of
from react_opt.solvers.assignment.pairs import pairs_of
from react_opt.solvers.assignment.tree import DONE, STACK_FULL, STOPPED, greedy, search
from react_opt.solvers.outcome import Limit

TOLERANCE = 1e-9  # relative to the objective: nodes within it are closed
CHUNK_S = 0.02  # how long the tree works between two looks at the clock
FIRST_CHUNK = 200


@dataclass(frozen=True)
class Assignment:
    """An assignment of targets on arrays.

    Parameters
    ----------
    robot_of
        ``(K,)`` the robot that takes each target, -1 where none does.
    objective, bound
        Its value, and a proven bound on any assignment's value.
    limit
        What stopped the search: ``none``, ``time``, ``work`` or ``interrupt``.
    work
        Relaxations solved, the unit of ``work_limit``; 0 in the plain case.
    plain
        Whether it was solved as a linear assignment problem.
    """

    robot_of: IntArray
    objective: float
    bound: float
    limit: Limit
    work: int
    plain: bool


def assign(
    value: FloatArray,
    *,
    energy_j: FloatArray | None = None,
    budget_j: FloatArray | None = None,
    capacity: IntArray | None = None,
    conflicts: IntArray | None = None,
    deadline: float | None = None,
    work_limit: int | None = None,
    gap: float = 0.0,
    should_stop: Callable[[], bool] | None = None,
    start: IntArray | None = None,
) -> Assignment:
    """Assign targets to robots, arrays in and arrays out: the entry for a control loop.

    Parameters
    ----------
    value
        ``(R, K)`` value of each pair, ``-inf`` where the pair is out
        (:func:`react_opt.models.assignment.pair_values`).
    energy_j, budget_j
        ``(R, K)`` energies and ``(R,)`` budgets, J; None for no budgets.
    capacity
        ``(R,)`` targets per robot; None for 1 each.
    conflicts
        ``(C, 2)`` targets that must not be taken at once; None for none.
    deadline
        ``time.perf_counter()`` at which to return the best assignment known; None for no limit.
    work_limit
        Relaxations to solve at most; None for no limit.
    gap
        Relative gap at which to stop; 0 proves the optimum within 1e-9.
    should_stop
        Polled about every 20 ms; True returns the best assignment known.
    start
        ``(K,)`` a feasible assignment to beat; None for none.
    """
    n_robots = len(value)
    arrays = AssignmentArrays(
        np.asarray(value, dtype=np.float64),
        np.zeros(value.shape) if energy_j is None else np.asarray(energy_j, dtype=np.float64),
        np.zeros(n_robots) if budget_j is None else np.asarray(budget_j, dtype=np.float64),
        np.ones(n_robots, dtype=np.int64) if capacity is None else np.asarray(capacity, dtype=np.int64),
        np.empty((0, 2), dtype=np.int64) if conflicts is None else np.asarray(conflicts, dtype=np.int64),
    )
    return solve_arrays(arrays, deadline, work_limit, gap, should_stop, start)


def solve_arrays(
    arrays: AssignmentArrays,
    deadline: float | None = None,
    work_limit: int | None = None,
    gap: float = 0.0,
    should_stop: Callable[[], bool] | None = None,
    start: IntArray | None = None,
) -> Assignment:
    """Assign targets; see :func:`assign`."""
    if arrays.plain:
        robot_of = linear_assignment(arrays.value)
        objective = objective_of(arrays, robot_of)
        return Assignment(robot_of, objective, objective, "none", 0, True)
    return _branch(arrays, deadline, work_limit, gap, should_stop, start)


def linear_assignment(value: FloatArray) -> IntArray:
    """Return ``(K,)`` the robot of each target, -1 for none, one target per robot, of greatest total value.

    Pairs worth nothing stand for staying free. Where every target's column must be filled (at least as many
    robots as targets) subtracting its best value changes no comparison, and scipy is up to ten times faster.
    """
    n_robots, n_targets = value.shape
    answer = np.full(n_targets, -1, dtype=np.int64)
    if n_robots == 0 or n_targets == 0:
        return answer
    gain = np.maximum(value, 0.0)
    shifted = gain - gain.max(axis=0) if n_robots >= n_targets else gain
    robot, target = linear_sum_assignment(shifted, maximize=True)
    worth = value[robot, target] > 0
    answer[target[worth]] = robot[worth]
    return answer


def value_step(value: FloatArray) -> float:
    """Return the step of which all values are multiples where they are whole numbers, else 0."""
    whole = np.rint(value)
    if not len(value) or np.abs(whole).max() > 2**53 or not (whole == value).all():
        return 0.0
    return float(np.gcd.reduce(whole.astype(np.int64)))


def _branch(
    arrays: AssignmentArrays,
    deadline: float | None,
    work_limit: int | None,
    gap: float,
    should_stop: Callable[[], bool] | None,
    start: IntArray | None,
) -> Assignment:
    n_robots, n_targets = arrays.value.shape
    pairs = pairs_of(arrays)
    n_pairs, n_prices = len(pairs.robot), n_robots + len(pairs.clique_start) - 1
    size = 32
    states, prices, bounds = np.zeros((size, n_pairs), np.int8), np.zeros((size, n_prices)), np.zeros(size)
    bounds[0], bounds[-1] = np.inf, -np.inf
    counters = np.array([1, 0, STOPPED, 0], dtype=np.int64)
    best, best_value = greedy(pairs, n_targets)
    if start is not None and objective_of(arrays, start) > best_value:
        best_value, best[:] = objective_of(arrays, start), -1
        kept = np.flatnonzero(start[pairs.target] == pairs.robot)
        best[pairs.target[kept]] = kept
    step = value_step(pairs.value)
    tolerance = max(TOLERANCE * float(pairs.value.max(initial=0.0)), 0.999 * step)  # what is better is so by a step
    limit: Limit = "none"
    chunk = FIRST_CHUNK
    while counters[2] != DONE:
        begun = time.perf_counter()
        if deadline is not None and begun >= deadline:
            limit = "time"
            break
        if should_stop is not None and should_stop():
            limit = "interrupt"
            break
        if work_limit is not None:
            chunk = min(chunk, work_limit - int(counters[1]))
            if chunk <= 0:
                limit = "work"
                break
        done = int(counters[1])
        best_value = search(
            pairs.start, pairs.robot, pairs.target, pairs.value, pairs.energy, pairs.order, pairs.units,
            pairs.clique_start, pairs.clique, pairs.near_start, pairs.near, states, prices, bounds, counters, best,
            best_value, chunk, gap, tolerance,
        )  # fmt: skip
        if counters[2] == STACK_FULL:
            states, prices = np.concatenate([states, states]), np.concatenate([prices, prices])
            bounds = np.concatenate([bounds[:-1], np.zeros(size), bounds[-1:]])
            size *= 2
        per_solve_s = (time.perf_counter() - begun) / max(1, int(counters[1]) - done)
        left_s = CHUNK_S if deadline is None else min(CHUNK_S, max(0.0, deadline - time.perf_counter()))
        chunk = max(1, int(left_s / max(per_solve_s, 1e-7)))
    robot_of = np.full(n_targets, -1, dtype=np.int64)
    taken = best[best >= 0]
    robot_of[pairs.target[taken]] = pairs.robot[taken]
    objective = objective_of(arrays, robot_of)
    bound = max([objective, float(bounds[-1]), *bounds[: counters[0]].tolist()])
    if not np.isfinite(bound):
        bound = float(arrays.value.max(axis=0, initial=0.0).sum())
    if step > 0:
        bound = max(objective, float(np.floor(bound / step + 1e-6)) * step)
    if gap == 0.0 and limit == "none":
        bound = objective
    return Assignment(robot_of, objective, bound, limit, int(counters[1]), False)
