"""Brute force for tiny route problems without limits between robots: every route, every split of the cells."""

from __future__ import annotations

import math

import numpy as np

from react_opt.route_problem import RobotClass, RouteProblem


def best_per_set(problem: RouteProblem, group: RobotClass) -> dict[int, float]:
    """Value of the best route of a class for every set of cells (as bits) that it can collect."""
    best: dict[int, float] = {}
    arcs = [
        (int(i), int(j), int(d), float(q))
        for i, j, d, q in zip(problem.arc_from, problem.arc_to, problem.arc_steps, problem.arc_energy_j, strict=True)
    ]
    seen: dict[tuple[int, int, int], list[tuple[float, float]]] = {}

    def visit(cell: int, t: int, collected: int, coverage: float, battery: float) -> None:
        if battery < group.reserve_j - 1e-9:
            return
        known = seen.setdefault((cell, t, collected), [])
        if any(c >= coverage and b >= battery for c, b in known):
            return
        known.append((coverage, battery))
        if t == problem.horizon:
            if group.return_to in (-1, cell):
                worth = coverage + problem.sigma * battery
                best[collected] = max(best.get(collected, -math.inf), worth)
        else:
            visit_next(cell, t, collected, coverage, battery)
        if t >= max(1, group.start_step) and not collected >> cell & 1 and problem.reward[cell, t] > 0:
            visit(
                cell,
                t,
                collected | 1 << cell,
                coverage + float(problem.reward[cell, t]),
                battery - group.sense_j,
            )

    def visit_next(cell: int, t: int, collected: int, coverage: float, battery: float) -> None:
        visit(cell, t + 1, collected, coverage, battery - group.wait_j)
        for i, j, steps, energy in arcs:
            if i == cell and t + steps <= problem.horizon:
                visit(j, t + steps, collected, coverage, battery - energy)

    visit(group.start, group.start_step, 0, 0.0, group.battery_j)
    return best


def brute_force(problem: RouteProblem) -> float | None:
    """Optimum over all plans, None if there is no plan."""
    total = {0: 0.0}
    for group in problem.classes:
        single = best_per_set(problem, group)
        for _ in group.robots:
            joint: dict[int, float] = {}
            for taken, worth in total.items():
                for collected, more in single.items():
                    if not taken & collected:
                        both = taken | collected
                        joint[both] = max(joint.get(both, -math.inf), worth + more)
            total = joint
    return max(total.values()) if total else None


def random_problem(seed: int) -> RouteProblem:
    """A tiny problem with everything that the decomposition prices."""
    rng = np.random.default_rng(seed)
    n, horizon = int(rng.integers(2, 6)), int(rng.integers(2, 8))
    whole = rng.random() < 0.5
    arcs: dict[tuple[int, int, int], float] = {}
    for _ in range(int(rng.integers(n, 3 * n))):
        i, j = (int(k) for k in rng.integers(0, n, 2))
        if i != j:
            arcs[i, j, int(rng.integers(1, 4))] = float(rng.integers(10, 90)) if whole else rng.uniform(5, 90)
    keys = sorted(arcs)
    reward = np.zeros((n, horizon + 1))
    for i in range(n):
        deadline = int(rng.integers(0, horizon + 1)) if rng.random() < 0.3 else horizon
        weight = float(rng.integers(0, 4)) if whole else rng.uniform(0.2, 3.0)
        for t in range(1, deadline + 1):
            reward[i, t] = weight * (deadline - t + 1)
    classes = []
    robot = 0
    for _ in range(int(rng.integers(1, 3))):
        count = int(rng.integers(1, 3))
        battery = float(rng.integers(100, 900))
        wait = float(rng.integers(0, 15))
        start = int(rng.integers(0, n))
        classes.append(
            RobotClass(
                robots=tuple(range(robot, robot + count)),
                start=start,
                start_step=int(rng.integers(0, 3)) if rng.random() < 0.3 else 0,
                battery_j=battery,
                capacity_j=battery + float(rng.integers(0, 50)),
                reserve_j=float(rng.integers(0, 80)),
                wait_j=wait,
                sense_j=float(rng.integers(0, 120)),
                return_to=start if rng.random() < 0.25 else -1,
            )
        )
        robot += count
    capacity = sum(len(group.robots) * group.capacity_j for group in classes)
    sigma = [0.0, 1.0 / (1.0 + capacity), 0.01][int(rng.integers(0, 3))]
    arc_from = np.array([key[0] for key in keys], dtype=np.int64)
    return RouteProblem(
        horizon=horizon,
        n_cells=n,
        reward=reward,
        arc_from=arc_from,
        arc_to=np.array([key[1] for key in keys], dtype=np.int64),
        arc_steps=np.array([key[2] for key in keys], dtype=np.int64),
        arc_energy_j=np.array([arcs[key] for key in keys], dtype=np.float64),
        arc_travel=np.arange(len(keys), dtype=np.int64),
        out_start=np.searchsorted(arc_from, np.arange(n + 1)).astype(np.int64),
        sigma=sigma,
        classes=tuple(classes),
        charger_j=np.zeros(n),
        charger_slots=np.zeros(n, dtype=np.int64),
    )
