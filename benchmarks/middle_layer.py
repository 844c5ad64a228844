"""The middle layer's table: latencies of assignments and inspections, and PyVRP beside the large inspections.

    python benchmarks/middle_layer.py [--seed 0] [--large 30] [--large-s 10] [--results FILE] [--only NAME]

Prints one line per row: what, how many, median, 99th percentile and largest wall time, and what was proven.
Run it on an idle machine; latencies are of a warm process.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks.peers import pyvrp_
from react_opt import jsonio, solve
from react_opt.models.assignment import AssignmentArrays, pair_values
from react_opt.models.inspection import build
from react_opt.options import SolveOptions
from react_opt.solvers.assignment.exact import linear_assignment, solve_arrays
from react_opt.solvers.inspection import solve_inspection

SPEED_M_S, MOVING_W, SERVICE_S, SERVICE_J = 0.89, 26.0, 5.0, 130.0


def assignment_case(rng: Any, robots: int, targets: int, conflicts: int, capacity: int) -> AssignmentArrays:
    """Robots and targets on a floor of 20 m x 50 m, detours of up to half, Jackal batteries partly empty."""
    size = np.array([20.0, 50.0])
    at, to = rng.uniform(0, size, (robots, 2)), rng.uniform(0, size, (targets, 2))
    length = np.linalg.norm(at[:, None] - to[None], axis=2) * rng.uniform(1, 1.5, (robots, targets))
    time_s = length / SPEED_M_S
    energy_j = time_s * MOVING_W
    battery = rng.uniform(0.2, 1.0, robots) * 8245.96
    budget = 0.9 * battery
    gain = rng.uniform(1, 10, targets)
    value = pair_values(gain, time_s, energy_j, battery, budget, alpha=1.0, beta=2.0, time_ref_s=20.0)
    pairs = np.sort(rng.choice(targets, (conflicts, 2)), axis=1)
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    limit = rng.integers(1, capacity + 1, robots)
    return AssignmentArrays(value, np.where(np.isneginf(value), 0.0, energy_j), budget, limit, pairs)


def as_instance(case: AssignmentArrays) -> Any:
    """The same problem as an instance: gains of a pair's value and more, the rest as time."""
    robots, targets = case.value.shape
    gain = np.maximum(case.value, 0.0).max(axis=0) + 1.0
    rows = [(r, k) for r in range(robots) for k in range(targets) if np.isfinite(case.value[r, k])]
    return jsonio.parse(
        {
            "kind": "assignment", "name": f"{robots} x {targets}", "weights": {"beta": 0.0},
            "robots": [
                {"id": f"r{r}", "battery_j": float(case.budget_j[r]), "capacity": int(case.capacity[r])}
                for r in range(robots)
            ],
            "targets": [{"id": f"k{k}", "gain": float(gain[k])} for k in range(targets)],
            "costs": [
                {"robot": f"r{r}", "target": f"k{k}", "time_s": float(gain[k] - case.value[r, k]),
                 "energy_j": float(case.energy_j[r, k])}
                for r, k in rows
            ],
            "conflicts": [[f"k{a}", f"k{b}"] for a, b in case.conflicts.tolist()],
        }
    )  # fmt: skip


def inspection_case(robots: int, targets: int, seed: int) -> Any:
    """Targets on a floor of 20 m x 50 m, robots where they last were, an exit; time for about two thirds of them."""
    rng = np.random.default_rng([seed, robots, targets])
    names = [*(f"k{i}" for i in range(targets)), *(f"s{r}" for r in range(robots)), "exit"]
    xy = rng.uniform(0, [20.0, 50.0], (len(names), 2))
    time_s = np.linalg.norm(xy[:, None] - xy[None], axis=2) / SPEED_M_S
    per_robot = 0.7124 * np.sqrt(targets * 1000.0) / robots / SPEED_M_S + targets * SERVICE_S / robots
    left_s = float(round(0.65 * per_robot + 20.0, 1))
    return jsonio.parse(
        {
            "kind": "inspection", "name": f"{robots} x {targets}, seed {seed}", "time_left_s": left_s,
            "robots": [
                {"id": f"r{r}", "at": f"s{r}", "end": "exit", "battery_j": float(battery)}
                for r, battery in enumerate(rng.uniform(0.8, 1.6, robots) * left_s * MOVING_W)
            ],
            "targets": [
                {"id": f"k{i}", "value": float(value), "service_s": SERVICE_S, "service_energy_j": SERVICE_J}
                for i, value in enumerate(rng.integers(1, 11, targets))
            ],
            "travel": [
                {"from": a, "to": b, "time_s": float(time_s[i, j]), "energy_j": MOVING_W * float(time_s[i, j])}
                for i, a in enumerate(names) for j, b in enumerate(names) if i != j
            ],
        }
    )  # fmt: skip


def timed(name: str, runs: int, once: Callable[[int], str]) -> None:
    """Run a row and print its line."""
    once(-1)  # warm
    walls, proven = [], 0
    for run in range(runs):
        begun = time.perf_counter()
        proven += once(run) in ("optimal", "infeasible")
        walls.append(1000 * (time.perf_counter() - begun))
    print(
        f"{name:48s} runs {runs:4d}  median {np.median(walls):8.2f} ms  p99 {np.quantile(walls, 0.99):8.2f} ms"
        f"  max {max(walls):8.2f} ms  proven {proven}",
        flush=True,
    )


def assignments(seed: int) -> None:
    for name, runs, shape in (
        ("assignment 4 x 20, 15 conflicts", 500, (4, 20, 15, 1)),
        ("assignment 20 x 100, 60 conflicts, capacity 1-3", 100, (20, 100, 60, 3)),
    ):
        rng = np.random.default_rng(seed)
        cases = [assignment_case(rng, *shape) for _ in range(runs + 1)]

        def once(run: int, cases: list[AssignmentArrays] = cases) -> str:
            return "optimal" if solve_arrays(cases[run]).limit == "none" else "feasible"

        timed(name, runs, once)
        instances = [as_instance(case) for case in cases]

        def whole(run: int, instances: list[Any] = instances) -> str:
            return str(solve(instances[run], explain=False).claim.status)

        timed("  the same through solve, checked", runs, whole)


def plain(seed: int) -> None:
    rng = np.random.default_rng(seed)
    value = assignment_case(rng, 1000, 1000, 0, 1).value
    gain = np.maximum(value, 0.0)
    for name, method in (
        ("plain assignment 1000 x 1000", linear_assignment),
        ("  scipy alone on the same values", lambda _: linear_sum_assignment(gain, maximize=True)),
    ):

        def once(run: int, method: Any = method) -> str:
            method(value)
            return "optimal"

        timed(name, 7, once)


def inspections(seed: int) -> None:
    for robots, targets, runs in ((3, 15, 100), (4, 30, 20)):
        cases = [inspection_case(robots, targets, seed + run) for run in range(runs + 1)]

        def once(run: int, cases: list[Any] = cases) -> str:
            status: str = solve_inspection(cases[run], SolveOptions(explain=False)).claim.status
            return status

        timed(f"inspection {robots} robots, {targets} targets", runs, once)


def large(seed: int, runs: int, seconds: float, results: Path | None) -> None:
    """Compare with PyVRP; with a file of results each run is written as it ends, and what is there is not repeated."""
    done = {}
    if results is not None and results.exists():
        rows = [json.loads(line) for line in results.read_text().splitlines()]
        done = {row["seed"]: row for row in rows if row["seconds"] == seconds}
    for run in range(runs):
        if seed + run in done:
            continue
        instance = inspection_case(4, 100, seed + run)
        arrays = build(instance).arrays
        limits: dict[str, Any] = {"time_limit_s": seconds, "explain": False, "seed": seed}
        plan = solve_inspection(instance, SolveOptions(**limits))
        alone = solve_inspection(instance, SolveOptions(**limits, threads=1))
        routes = pyvrp_.search(arrays, seconds, seed)
        assert routes is not None
        assert arrays.is_feasible(routes)
        row = {
            "seed": seed + run, "seconds": seconds, "value": plan.claim.objective, "bound": plan.claim.bound,
            "one_thread": alone.claim.objective, "pyvrp": arrays.worth(routes)[0], "load": os.getloadavg()[0],
        }  # fmt: skip
        done[seed + run] = row
        print(f"  {row}", flush=True)
        if results is not None:
            with results.open("a") as file:
                file.write(json.dumps(row) + "\n")
    rows = [done[seed + run] for run in range(runs)]
    theirs = np.array([row["pyvrp"] for row in rows])
    gap = np.mean([(row["bound"] - row["value"]) / row["value"] for row in rows])
    print(
        f"inspection 4 robots, 100 targets, {seconds:g} s, {runs} runs: PyVRP (one thread) {theirs.mean():.2f}",
        flush=True,
    )
    for name, key in (("all threads", "value"), ("one thread", "one_thread")):
        ours = np.array([row[key] for row in rows])
        print(f"  react_opt, {name}: mean value {ours.mean():.2f} (better {(ours > theirs).sum()}, equal "
              f"{(ours == theirs).sum()}, worse {(ours < theirs).sum()})", flush=True)  # fmt: skip
    print(f"  mean gap {gap:.4f}; PyVRP has no bound", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--large", type=int, default=30, help="runs of 4 robots and 100 targets")
    parser.add_argument("--large-s", type=float, default=10.0, help="seconds for each of them")
    parser.add_argument("--results", type=Path, help="file of one line per large run, to go on from")
    parser.add_argument("--only", choices=("assignments", "plain", "inspections", "large"))
    options = parser.parse_args()
    rows = {
        "assignments": lambda: assignments(options.seed),
        "plain": lambda: plain(options.seed),
        "inspections": lambda: inspections(options.seed),
        "large": lambda: large(options.seed, options.large, options.large_s, options.results),
    }
    for name, row in rows.items():
        if options.only in (None, name):
            row()


if __name__ == "__main__":
    main()
