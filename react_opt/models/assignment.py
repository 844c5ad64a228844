"""Assignment of local targets: who takes which target now (generalised assignment with conflicts)::

    max   sum_rk value_rk x_rk,       value_rk = gain_k - alpha time_rk / time_ref - beta energy_rk / battery_r
    s.t.  sum_r x_rk <= 1                        one robot per target
          sum_k x_rk <= capacity_r               targets per robot
          sum_k energy_rk x_rk <= battery_r - reserve_r
          sum_r x_rk + sum_r x_rl <= 1           conflict pairs (k, l)

A pair is out where it is unreachable, outside the robot's zone, beyond the robot's energy, or the battery is
empty. Arrays are dense, ``(robots, targets)``; a pair that is out has value ``-inf``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from react_opt.instance import AssignmentInstance
from react_opt.models.program import Program

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

ENERGY_TOLERANCE = 1e-9  # relative: sums of decimal energies may miss a budget they meet on paper


@dataclass(frozen=True)
class AssignmentArrays:
    """The plain mathematics: what the fast solvers take, without names.

    Parameters
    ----------
    value
        ``(R, K)`` value of each pair, ``-inf`` where the pair is out.
    energy_j
        ``(R, K)`` energy of each pair, J; 0 where the pair is out.
    budget_j
        ``(R,)`` battery minus reserve, J.
    capacity
        ``(R,)`` targets per robot.
    conflicts
        ``(C, 2)`` targets that must not be taken at once.
    """

    value: FloatArray
    energy_j: FloatArray
    budget_j: FloatArray
    capacity: IntArray
    conflicts: IntArray

    @property
    def plain(self) -> bool:
        """Whether it is a linear assignment problem: one target per robot, no conflicts.

        The energy of a single target is settled pair by pair, so it does not couple anything.
        """
        return len(self.conflicts) == 0 and bool((self.capacity == 1).all())

    def energy_limit_j(self) -> FloatArray:
        """``(R,)`` budgets with the tolerance that sums of energies need."""
        return self.budget_j + ENERGY_TOLERANCE * np.maximum(1.0, self.budget_j)


@dataclass(frozen=True)
class AssignmentModel:
    """An instance as arrays, with its names and with what barred each pair.

    Parameters
    ----------
    robots, targets
        Ids in the order of the arrays.
    arrays
        The mathematics.
    reachable, in_zone
        ``(R, K)`` whether a cost row exists, and whether the robot's zone holds the target.
    """

    robots: tuple[str, ...]
    targets: tuple[str, ...]
    arrays: AssignmentArrays
    reachable: NDArray[np.bool_]
    in_zone: NDArray[np.bool_]


def pair_values(
    gain: FloatArray,
    time_s: FloatArray,
    energy_j: FloatArray,
    battery_j: FloatArray,
    budget_j: FloatArray,
    *,
    alpha: float = 1.0,
    beta: float = 1.0,
    time_ref_s: float = 1.0,
) -> FloatArray:
    """Return ``(R, K)`` values of the pairs, ``-inf`` for those that time or energy bars.

    Parameters
    ----------
    gain
        ``(K,)`` gain of each target.
    time_s, energy_j
        ``(R, K)`` costs, ``inf`` where unreachable, s and J.
    battery_j, budget_j
        ``(R,)`` battery, and battery minus reserve, J.
    alpha, beta, time_ref_s
        Weights of time and energy, and the time (s) that costs one ``alpha``.
    """
    per_joule = beta / np.where(battery_j > 0, battery_j, 1.0)
    value = time_s * (-alpha / time_ref_s) if alpha > 0 else np.where(np.isinf(time_s), -np.inf, 0.0)
    value -= energy_j * per_joule[:, None] if beta > 0 else np.where(np.isinf(energy_j), np.inf, 0.0)
    value += gain
    limit = budget_j + ENERGY_TOLERANCE * np.maximum(1.0, budget_j)
    value[(energy_j > limit[:, None]) | (battery_j <= 0)[:, None]] = -np.inf
    return value


def build(instance: AssignmentInstance) -> AssignmentModel:
    """Return an instance as arrays."""
    robots = tuple(robot.id for robot in instance.robots)
    targets = tuple(target.id for target in instance.targets)
    row = {name: index for index, name in enumerate(robots)}
    column = {name: index for index, name in enumerate(targets)}
    shape = (len(robots), len(targets))
    time_s, energy_j = np.full(shape, np.inf), np.full(shape, np.inf)
    costs, n = instance.costs, len(instance.costs)
    at = np.fromiter((row[cost.robot] * shape[1] + column[cost.target] for cost in costs), np.int64, n)
    time_s.ravel()[at] = np.fromiter((cost.time_s for cost in costs), np.float64, n)
    energy_j.ravel()[at] = np.fromiter((cost.energy_j for cost in costs), np.float64, n)
    battery = np.array([robot.battery_j for robot in instance.robots], dtype=np.float64)
    budget = battery - np.array([robot.reserve_j for robot in instance.robots], dtype=np.float64)
    weights = instance.weights
    value = pair_values(
        np.array([target.gain for target in instance.targets], dtype=np.float64), time_s, energy_j, battery, budget,
        alpha=weights.alpha, beta=weights.beta, time_ref_s=weights.time_ref_s,
    )  # fmt: skip
    reachable, in_zone = np.isfinite(time_s), np.ones(shape, dtype=np.bool_)
    for index, robot in enumerate(instance.robots):
        if robot.zone is not None:
            in_zone[index] = False
            in_zone[index, [column[name] for name in robot.zone]] = True
    capacity = np.array([min(robot.capacity, len(targets)) for robot in instance.robots], dtype=np.int64)
    out = ~in_zone | (capacity == 0)[:, None]
    value[out] = -np.inf
    energy_j[np.isneginf(value)] = 0.0
    conflicts = np.array(
        sorted({(min(pair), max(pair)) for pair in ((column[a], column[b]) for a, b in instance.conflicts)}),
        dtype=np.int64,
    ).reshape(-1, 2)
    arrays = AssignmentArrays(value, energy_j, budget, capacity, conflicts)
    return AssignmentModel(robots, targets, arrays, reachable, in_zone)


def program(arrays: AssignmentArrays, name: str = "assignment") -> Program:
    """Return the assignment as an integer program over the pairs that gain something.

    Columns ``x`` with subscripts (robot, target); rows ``target``, ``capacity``, ``energy`` and ``conflict``.
    """
    robot, target = np.nonzero(arrays.value > 0)
    model = Program(name, maximise=True)
    keys = np.column_stack([robot, target])
    columns = model.add_columns("x", keys, cost=arrays.value[robot, target], upper=1.0, integer=True)
    n_robots, n_targets = arrays.value.shape
    model.add_rows("target", np.arange(n_targets), row=target, column=columns, value=1.0, upper=1.0)
    model.add_rows("capacity", np.arange(n_robots), row=robot, column=columns, value=1.0, upper=arrays.capacity)
    model.add_rows(
        "energy", np.arange(n_robots), row=robot, column=columns, value=arrays.energy_j[robot, target],
        upper=arrays.budget_j,
    )  # fmt: skip
    row: list[int] = []
    column: list[int] = []
    by_target = [columns[target == k] for k in range(n_targets)]
    for index, (k, other) in enumerate(arrays.conflicts.tolist()):
        members = np.concatenate([by_target[k], by_target[other]])
        row += [index] * len(members)
        column += members.tolist()
    model.add_rows("conflict", arrays.conflicts, row=row, column=column, value=1.0, upper=1.0)
    return model


def robot_of_targets(model: Program, x: FloatArray, n_targets: int) -> IntArray:
    """Return ``(K,)`` the robot that takes each target, -1 where none, from a solution vector."""
    taken = model.columns["x"].keys[model.values(x, "x") > 0.5]
    answer = np.full(n_targets, -1, dtype=np.int64)
    answer[taken[:, 1]] = taken[:, 0]
    return answer


def objective_of(arrays: AssignmentArrays, robot_of: IntArray) -> float:
    """Return the value of an assignment, ``(K,)`` robots or -1."""
    targets = np.flatnonzero(robot_of >= 0)
    return float(arrays.value[robot_of[targets], targets].sum())


def is_feasible(arrays: AssignmentArrays, robot_of: IntArray) -> bool:
    """Whether an assignment, ``(K,)`` robots or -1, meets every limit."""
    targets = np.flatnonzero(robot_of >= 0)
    robots = robot_of[targets]
    if np.isneginf(arrays.value[robots, targets]).any():
        return False
    n_robots = len(arrays.capacity)
    spent = np.bincount(robots, weights=arrays.energy_j[robots, targets], minlength=n_robots)
    both = (robot_of[arrays.conflicts] >= 0).all(axis=1)
    return bool(
        (np.bincount(robots, minlength=n_robots) <= arrays.capacity).all()
        and (spent <= arrays.energy_limit_j()).all()
        and not both.any()
    )
