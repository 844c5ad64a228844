"""Small random route problems with every option, and brute force over the routes of one robot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from react_opt.route_problem import RobotClass, Route, RouteProblem


def random_problem(rng: np.random.Generator, **given: Any) -> RouteProblem:
    """A connected graph of a few cells, several-step arcs, speed modes, and options at random."""
    n = int(given.get("cells", rng.integers(2, 5)))
    horizon = int(given.get("horizon", rng.integers(2, 6)))
    robots = int(given.get("robots", rng.integers(1, 4)))
    arcs: dict[tuple[int, int, int], float] = {}
    pairs: list[tuple[int, ...]] = [(int(rng.integers(0, j)), j) for j in range(1, n)]
    pairs += [tuple(int(v) for v in rng.choice(n, 2, replace=False)) for _ in range(n // 2)]
    for i, j in pairs:
        for _ in range(int(rng.integers(1, 3))):
            steps, energy = int(rng.integers(1, 3)), float(rng.integers(1, 9))
            arcs[i, j, steps] = arcs[j, i, steps] = energy
    keys = sorted(arcs)
    arc_from = np.array([k[0] for k in keys], dtype=np.int64)
    weight = rng.integers(0, 4, n)
    deadline = rng.integers(1, horizon + 1, n)
    reward = np.array(
        [
            [w * max(0, d - t + 1) if t else 0 for t in range(horizon + 1)]
            for w, d in zip(weight, deadline, strict=True)
        ],
        dtype=float,
    )
    tight = rng.random() < 0.5
    charged = bool(given.get("chargers", rng.random() < 0.4))
    classes, count = [], 0
    same_start = int(rng.integers(0, n))
    while count < robots:
        members = int(rng.integers(1, robots - count + 1))
        reserve = float(rng.integers(0, 4))
        battery = reserve + (float(rng.integers(3, 20)) if tight else 200.0)
        capacity = battery + (float(rng.integers(0, 6)) if charged else 0.0)
        start = same_start if rng.random() < 0.6 else int(rng.integers(0, n))
        start_step = int(rng.choice([0, 0, 0, 1, 2]))
        back = start if rng.random() < 0.3 else -1
        group = RobotClass(
            tuple(range(count, count + members)), start, min(start_step, horizon), battery, capacity, reserve,
            float(rng.integers(0, 3)), float(rng.integers(0, 6)), back,
        )  # fmt: skip
        classes.append(group)
        count += members
    charger = np.zeros(n)
    if charged:
        charger[rng.integers(0, n)] = float(rng.integers(1, 9)) + 0.5
    coupled = bool(given.get("coupled", True))
    return RouteProblem(
        horizon, n, reward, arc_from,
        np.array([k[1] for k in keys], dtype=np.int64), np.array([k[2] for k in keys], dtype=np.int64),
        np.array([arcs[k] for k in keys]), np.arange(len(keys)),
        np.searchsorted(arc_from, np.arange(n + 1)).astype(np.int64),
        float(rng.choice([0.0, 0.01, 0.3])), tuple(classes), charger, np.ones(n, dtype=np.int64),
        int(rng.integers(1, 3)) if coupled and rng.random() < 0.3 else None,
        bool(coupled and rng.random() < 0.3),
        int(rng.integers(1, 3)) if coupled and rng.random() < 0.3 else None,
    )  # fmt: skip


def all_routes(problem: RouteProblem, robot_class: int, free_charge: bool = False) -> Iterator[Route]:
    """Every route of a robot that keeps its own limits, charging all it can (or nothing, if ``free_charge``)."""
    group = problem.classes[robot_class]
    length = problem.horizon - group.start_step + 1
    cell = np.full(length, -1, dtype=np.int64)
    arc = np.full(length, -1, dtype=np.int64)
    sense = np.zeros(length, dtype=bool)
    charge = np.zeros(length)

    def arrive(t: int, i: int, b: float, most: float, seen: frozenset[int]) -> Iterator[Route]:
        """Stand at (t, i) with b before sensing and charging at most ``most``."""
        k = t - group.start_step
        cell[k] = i
        can = t >= 1 and problem.reward[i, t] > 0.0 and i not in seen
        for sensed in (True, False) if can else (False,):
            drained = b - (group.sense_j if sensed else 0.0)
            full = max(0.0, min(most, group.capacity_j - drained))
            for u in {full, 0.0} if free_charge else {full}:
                if drained + u < group.reserve_j - 1e-9:
                    continue
                sense[k], charge[k] = sensed, u
                yield from leave(t, i, drained + u, seen | {i} if sensed else seen)
                sense[k], charge[k] = False, 0.0
        cell[k] = -1

    def leave(t: int, i: int, b: float, seen: frozenset[int]) -> Iterator[Route]:
        if t == problem.horizon:
            if group.return_to in (-1, i):
                yield Route(robot_class, cell.copy(), arc.copy(), sense.copy(), charge.copy())
            return
        yield from arrive(t + 1, i, b - group.wait_j, problem.charger_j[i], seen)
        for a in range(problem.out_start[i], problem.out_start[i + 1]):
            if t + problem.arc_steps[a] <= problem.horizon:
                arc[t - group.start_step] = a
                yield from arrive(
                    t + int(problem.arc_steps[a]), int(problem.arc_to[a]), b - problem.arc_energy_j[a], 0.0, seen
                )
                arc[t - group.start_step] = -1

    yield from arrive(group.start_step, group.start, group.battery_j, 0.0, frozenset())


def best_value(values: list[float]) -> float:
    """Largest value, minus infinity of none."""
    return max(values, default=-math.inf)
