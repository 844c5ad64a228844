"""The route decomposition on its families: one row per instance, ``python benchmarks/routes.py [--rows ...]``.

Prints status, objective, bound, gap and time of each instance beside its target. A row that misses its target is
marked with ``!``.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

from families import metric_complete, walled_grid

from react_opt.instance import OrosInstance
from react_opt.solvers.routes.engine import solve_routes
from react_opt.solvers.routes.result import RoutesResult
from react_opt.timegraph import route_problem


@dataclass(frozen=True)
class Row:
    """One instance of the table: its group, how to make it, its time limit and the gap wanted."""

    group: str
    rows: int
    cols: int
    robots: int
    horizon: int
    limit_s: float
    battery: float = 1.0
    gap: float = 0.0

    def data(self, seed: int) -> dict[str, object]:
        if self.rows == 0:
            return metric_complete(self.cols, self.robots, seed)
        return walled_grid(self.rows, self.cols, self.robots, self.horizon, seed, self.battery)


TABLE = [
    *(Row("paper", 2, 5, robots, 24, 0.1) for robots in (1, 2, 3, 4)),
    Row("small", 4, 10, 1, 40, 2.0),
    Row("small", 4, 10, 3, 24, 2.0),
    Row("small", 5, 8, 2, 30, 2.0),
    Row("medium", 6, 10, 3, 32, 30.0),
    Row("medium", 8, 8, 4, 28, 30.0),
    Row("medium", 10, 10, 4, 40, 30.0),
    Row("binding", 4, 10, 1, 40, 60.0, 0.5),
    Row("binding", 4, 10, 3, 24, 60.0, 0.5),
    Row("binding", 5, 8, 2, 30, 60.0, 0.5),
    Row("binding", 6, 10, 3, 32, 60.0, 0.5),
    Row("binding", 8, 8, 4, 28, 60.0, 0.5),
    Row("binding", 10, 10, 4, 40, 60.0, 0.5),
    Row("large", 20, 20, 4, 120, 60.0, gap=0.01),
    Row("huge", 40, 40, 10, 240, 300.0, gap=0.03),
    Row("metric", 0, 10, 2, 0, 30.0),
    Row("metric", 0, 20, 3, 0, 30.0),
    Row("metric", 0, 50, 4, 0, 120.0, gap=0.01),
]


def solved(row: Row, seed: int, threads: int) -> tuple[RoutesResult, float]:
    problem = route_problem(OrosInstance.model_validate(row.data(seed)))
    begun = time.perf_counter()
    result = solve_routes(problem, deadline=begun + row.limit_s, gap=row.gap or None, threads=threads, seed=seed)
    return result, time.perf_counter() - begun


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--groups", nargs="*", default=["paper", "small", "medium", "binding"])
    parser.add_argument("--seeds", nargs="*", type=int, default=[0])
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    for battery in (1.0, 0.5):  # compile, or load from the cache, what is compiled
        solved(Row("warm", 3, 4, 2, 12, 60.0, battery), 0, options.threads)
    print("group   cells robots T    battery seed status    objective    bound        gap       time_s limit_s")
    for row in TABLE:
        if row.group not in options.groups:
            continue
        for seed in options.seeds:
            result, spent_s = solved(row, seed, options.threads)
            gap = None
            if result.objective is not None and result.bound is not None:
                gap = (result.bound - result.objective) / max(abs(result.objective), 1e-9)
            met = gap is not None and (gap <= row.gap if row.gap else result.status == "optimal")
            cells = row.cols if row.rows == 0 else row.rows * row.cols
            print(
                f"{row.group:8}{cells:5d} {row.robots:6d} {row.horizon:4d} {row.battery:7g} {seed:4d} "
                f"{result.status:9} {result.objective or 0.0:12.4f} {result.bound or 0.0:12.4f} "
                f"{-1.0 if gap is None else gap:9.2e} {spent_s:8.3f} {row.limit_s:7g} "
                f"{'' if met and spent_s <= 1.1 * row.limit_s + 0.1 else '!'}",
                flush=True,
            )


if __name__ == "__main__":
    main()
