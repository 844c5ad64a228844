"""Published multi-repairman problems with known least latencies: ``python -m benchmarks.repairmen``.

The places and demands are those of Lalla-Ruiz and Voss (2020), "A POPMUSIC approach for the multi-depot cumulative
capacitated vehicle routing problem", Optimization Letters 14, 671-691. The least latencies are those that the exact
method of Segredo, Nucamendi, Lalla-Ruiz and Miranda (2026), doi 10.1016/j.ejor.2026.06.022, reports as the first ends
of its fronts, with as many vehicles as there and with fewer; those of 10 customers agree with a dynamic programme over
all sets of customers (``tests/bench/test_repairmen.py``).

Each row says what is published, the latency of the plan in unrounded distances, what is proven as the least of the
distances rounded down, and whether the loads of the plan fit the capacity, which the engine does not know: where they
do, the plan is one of the capacitated problem too. ``-o`` writes the instances as files instead.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.readers.depots import Depots
from benchmarks.readers.latency import latency, latency_of
from react_opt import check, jsonio, solve

CAPACITY = 60.0

PROBLEMS = {
    "10x4-1": (
        "14,3 0,6 1,0 -10,10 -11,9 4,4 0,0 -9,0 -6,11 -7,0",
        "4,11 -11,8 -14,14 -1,-1",
        "1 1 2 2 1 1 2 1 8 2",
    ),
    "10x4-2": (
        "15,-4 -6,16 2,0 -8,0 12,11 0,2 -3,0 -10,1 5,0 11,14",
        "3,-3 11,5 16,5 2,-2",
        "2 4 1 4 2 8 2 1 4 4",
    ),
    "10x4-3": (
        "11,5 9,-2 3,3 11,10 -1,0 -6,5 -4,7 11,-4 -14,-3 10,0",
        "9,2 15,7 5,11 11,4",
        "8 1 1 1 1 2 2 8 12 8",
    ),
    "25x4-1": (
        (
            "0,9 -15,11 3,11 -6,16 -16,11 -11,4 7,4 12,-1 6,0 -15,-4 12,0 -1,10 6,11 11,15 4,-4 11,13 -14,-3 -5,0 "
            "-15,0 -10,0 0,-4 -11,16 -4,15 -2,2 -9,9"
        ),
        "0,10 0,13 -13,-2 -12,-1",
        "4 12 2 2 8 4 4 4 2 2 2 1 8 2 2 2 8 2 8 12 4 12 8 4 4",
    ),
    "25x4-2": (
        (
            "-3,14 -7,0 4,11 -2,0 11,15 -13,0 0,14 -4,11 10,12 -5,-5 11,11 -13,-2 9,13 -16,6 -11,10 -9,2 9,2 "
            "11,16 0,1 -11,15 5,16 14,14 14,8 0,13 15,-4"
        ),
        "-14,3 11,12 10,0 16,0",
        "12 4 4 12 8 8 4 2 12 12 8 1 2 2 8 12 8 1 4 12 2 12 12 4 4",
    ),
    "25x4-3": (
        (
            "-4,7 16,5 5,11 11,16 6,0 3,8 -9,2 -16,16 11,9 0,5 -16,6 9,2 5,0 -4,0 -14,0 7,15 -11,1 -3,-3 -8,0 "
            "-12,1 14,0 7,7 0,9 15,11 0,3"
        ),
        "16,0 1,1 -11,4 -9,0",
        "4 4 4 12 2 1 12 8 4 1 2 4 8 12 4 1 4 1 2 2 4 4 12 12 4",
    ),
    "50x4-1": (
        (
            "-14,14 -3,3 -3,8 -2,2 -2,13 5,11 0,16 -12,0 11,-4 1,10 11,0 -11,-1 7,0 0,9 -9,-2 11,15 4,15 -3,11 "
            "13,2 11,16 -11,0 -6,16 7,4 12,1 -10,12 -11,16 -3,0 7,15 0,-3 -11,11 2,13 13,-2 16,11 8,14 -4,15 "
            "10,12 -12,1 -11,3 10,0 0,11 0,-5 -13,0 6,6 -14,3 11,8 0,14 0,10 -13,-2 -14,0 7,-4"
        ),
        "0,-1 3,-3 2,-2 16,5",
        (
            "12 2 2 4 2 8 12 12 8 2 12 2 4 8 1 8 2 4 2 12 4 8 4 4 1 12 4 12 8 2 4 1 2 1 12 1 2 12 8 2 2 12 2 4 12 "
            "1 4 8 2 8"
        ),
    ),
}
"""Customers and depots as x,y in tens of units, and the demands of the customers."""


@dataclass(frozen=True)
class Row:
    """A problem, how many repairmen it has, its published least latency, and the steps that a unit of length takes."""

    name: str
    robots: int
    published: float
    steps_per_unit: int = 1

    def problem(self) -> Depots:
        customers, depots, demands = PROBLEMS[self.name]
        return Depots(_places(customers), _places(depots), [float(d) for d in demands.split()], CAPACITY)

    def instance(self) -> Any:
        data = self.problem().instance(f"latency_{self.name}", self.robots, self.steps_per_unit)
        return jsonio.parse(data)


TABLE = [
    Row("10x4-1", 5, 545.69071, 10),
    Row("10x4-2", 5, 832.68702, 10),
    Row("10x4-3", 5, 832.77903, 10),
    Row("10x4-2", 2, 1498.11442, 10),
    Row("10x4-3", 2, 1418.41588, 10),
    Row("25x4-1", 10, 2082.27658, 10),
    Row("25x4-2", 10, 1827.41121, 10),
    Row("25x4-3", 10, 1786.95351, 10),
    Row("25x4-2", 3, 4096.59921),
    Row("25x4-3", 3, 4034.86174),
    Row("50x4-1", 20, 5424.56848, 2),
]


def _places(words: str) -> Any:
    return 10.0 * np.array([[float(x) for x in word.split(",")] for word in words.split()])


def routes_of(plan: Any) -> list[list[int]]:
    """Return the cells that each robot senses first, in their order."""
    sensed = sorted(
        (step.t, k, int(step.cell[1:]))
        for k, robot in enumerate(plan.robots)
        for step in robot.steps
        if step.sensing and step.cell not in (None, "c0")
    )
    routes, seen = defaultdict(list), set()
    for _, k, cell in sensed:
        if cell not in seen:
            routes[k].append(cell)
            seen.add(cell)
    return list(routes.values())


def run(row: Row, limit_s: float, threads: int) -> str:
    """Solve a row and check its bound; return its line."""
    problem, instance = row.problem(), row.instance()
    begun, used = time.perf_counter(), time.process_time()
    plan = solve(instance, method="routes", threads=threads, time_limit_s=limit_s, explain=False)
    spent, used = time.perf_counter() - begun, time.process_time() - used
    routes = routes_of(plan)
    least = latency_of(instance, plan.claim.bound) / row.steps_per_unit
    found = latency(problem.distances(), routes) if sum(map(len, routes)) == len(problem.customers) else np.nan
    fits = "fit" if max(problem.loads(routes)) <= problem.capacity else "exceed"
    certificate = check(instance, plan, bound=True)
    return (
        f"{row.name:8}{row.robots:7d}{row.steps_per_unit:11d}{instance.horizon_steps:6d}{row.published:12.5f}"
        f"{found:12.5f}{least:10.1f}  {plan.claim.status:9}{spent:7.1f}{used:7.1f}  {fits:7}"
        f"{'ok' if certificate.ok else 'WRONG'}"
    )


def main(arguments: list[str] | None = None) -> int:
    """Print the table, or write its instances."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.repairmen", description=__doc__)
    parser.add_argument("--problems", nargs="+", choices=sorted(PROBLEMS), default=sorted(PROBLEMS), metavar="NAME")
    parser.add_argument("--limit-s", type=float, default=120.0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="write the instances here and solve nothing"
    )
    options = parser.parse_args(arguments)
    if not options.limit_s >= 0.0:
        parser.error(f"--limit-s: expected a number of seconds >= 0, found {options.limit_s}")
    if options.threads < 1:
        parser.error(f"--threads: expected a whole number >= 1, found {options.threads}")
    rows = [row for row in TABLE if row.name in options.problems]
    if options.output is not None:
        options.output.mkdir(parents=True, exist_ok=True)
        for row in rows:
            instance = row.instance()
            path = options.output / f"{instance.name}.json"
            jsonio.save(instance, path)
            print(path)
        return 0
    print("problem  robots steps/unit     T   published        plan  at least  status    wall_s  cpu_s  loads  check")
    for row in rows:
        print(run(row, options.limit_s, options.threads), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
