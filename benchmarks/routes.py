"""The route decomposition on its families, beside peers on the monolith: ``python benchmarks/routes.py``.

Each line is an instance and a solver: status, objective, bound, gap and time beside the row's target. ``!`` marks what
misses the target, ``worse`` a plan of the decomposition that a peer beats, ``slower`` a proof that a peer had earlier.
A peer that ends without a proof counts with its limit. At the end: how many times as long each peer took as the
decomposition, and the fastest peer of each instance (geometric means). With ``--results`` every run is kept in a file,
and what is there is not run again.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from families import metric_complete, walled_grid

from react_opt.errors import UsageError
from react_opt.instance import OrosInstance
from react_opt.models.replay import value
from react_opt.solvers.monolith import solve_monolith
from react_opt.solvers.oros import solve_oros
from react_opt.solvers.outcome import Request
from react_opt.solvers.routes.engine import solve_routes
from react_opt.solvers.warm import warm_up
from react_opt.timegraph import route_problem

PEERS = ["highs", "cp-sat", "scip"]


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

    @property
    def cells(self) -> int:
        return self.cols if self.rows == 0 else self.rows * self.cols

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
    Row("giant", 60, 60, 20, 300, 300.0, gap=0.05),
    Row("metric", 0, 10, 2, 0, 30.0),
    Row("metric", 0, 20, 3, 0, 30.0),
    Row("metric", 0, 50, 4, 0, 120.0, gap=0.01),
]


@dataclass(frozen=True)
class Outcome:
    """What one solver reached on one instance."""

    status: str
    objective: float | None
    bound: float | None
    spent_s: float

    @property
    def gap(self) -> float | None:
        if self.objective is None or self.bound is None:
            return None
        return (self.bound - self.objective) / max(abs(self.objective), 1e-9)


def decomposed(row: Row, seed: int, threads: int, limit_s: float) -> Outcome:
    problem = route_problem(OrosInstance.model_validate(row.data(seed)))
    begun = time.perf_counter()
    result = solve_routes(problem, deadline=begun + limit_s, gap=row.gap or None, threads=threads, seed=seed)
    return Outcome(result.status, result.objective, result.bound, time.perf_counter() - begun)


def by_peer(name: str, row: Row, seed: int, threads: int, limit_s: float) -> Outcome:
    """Solve the monolith by a backend, without a plan to start from; building it counts."""
    instance = OrosInstance.model_validate(row.data(seed))
    problem = route_problem(instance)
    begun = time.perf_counter()
    request = Request(time_limit_s=limit_s, gap_rel=row.gap or 1e-9, threads=threads, seed=seed)
    try:
        outcome, routes = solve_monolith(instance, problem, name, request, None)
    except UsageError:  # CP-SAT refuses what it cannot state exactly
        return Outcome("refused", None, None, limit_s)
    objective = None if routes is None else value(problem, routes)
    spent_s = time.perf_counter() - begun
    bound = outcome.bound
    found = Outcome("optimal" if outcome.status == "optimal" else "feasible", objective, bound, spent_s)
    return found if found.status == "optimal" else replace(found, spent_s=max(limit_s, spent_s))


class Results:
    """Outcomes by what was run, kept in a file of one JSON object per line if there is one."""

    def __init__(self, file: str | None) -> None:
        self.path = None if file is None else Path(file)
        self.known: dict[str, Outcome] = {}
        if self.path is not None and self.path.exists():
            lines = self.path.read_text().splitlines()
            for number, text in enumerate(lines, start=1):
                try:
                    kept = json.loads(text)
                    self.known[_key(kept["run"])] = Outcome(**kept["outcome"])
                except (ValueError, KeyError, TypeError):
                    if number < len(lines):  # the last line may be half written
                        raise SystemExit(f"{file}, line {number}: expected a run and its outcome") from None

    def get(self, run: dict[str, Any], solve: Callable[[], Outcome]) -> Outcome:
        """Return the outcome of a run, which is made and kept if it is not known."""
        key = _key(run)
        if key not in self.known:
            self.known[key] = solve()
            if self.path is not None:
                text = self.path.read_text() if self.path.exists() else ""
                whole = text[: text.rfind("\n") + 1]
                added = json.dumps({"run": run, "outcome": asdict(self.known[key])}) + "\n"
                fresh = self.path.with_name(self.path.name + ".part")
                fresh.write_text(whole + added)
                fresh.replace(self.path)
        return self.known[key]


def _key(run: dict[str, Any]) -> str:
    return json.dumps(run, sort_keys=True)


def seeds_of(words: list[str]) -> list[int]:
    """Return seeds written one by one or as ranges: ``0 5-7`` is 0, 5, 6, 7."""
    ends = [word.split("-") for word in words]
    return [seed for end in ends for seed in range(int(end[0]), int(end[-1]) + 1)]


def line(row: Row, seed: int, solver: str, found: Outcome, remark: str) -> str:
    gap = "-" if found.gap is None else f"{found.gap:.2e}"
    return (
        f"{row.group:8}{row.cells:5d} {row.robots:6d} {row.horizon:4d} {row.battery:7g} {seed:4d} {solver:7} "
        f"{found.status:9} {found.objective or 0.0:12.4f} {found.bound or 0.0:12.4f} {gap:>9} "
        f"{found.spent_s:8.3f} {row.limit_s:7g} {remark}"
    )


def main() -> None:
    groups = list(dict.fromkeys(row.group for row in TABLE))
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--groups", nargs="+", choices=groups, default=["paper", "small", "medium", "binding"], metavar="GROUP",
        help=f"rows of the table: {', '.join(groups)} (default: paper small medium binding)",
    )  # fmt: skip
    parser.add_argument("--seeds", nargs="+", default=["0"], help="numbers or ranges such as 0-4")
    parser.add_argument("--most-cells", type=int, metavar="N", help="leave out instances with more cells")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument(
        "--peers", nargs="+", choices=PEERS, default=[], metavar="PEER",
        help=f"backends that solve the monolith: {', '.join(PEERS)}",
    )  # fmt: skip
    parser.add_argument("--limit-s", type=float, help="limit of every solver instead of the row's target")
    parser.add_argument("--results", metavar="FILE.jsonl", help="keep each run here, and skip those that are there")
    options = parser.parse_args()
    results = Results(options.results)

    def own_outcome(row: Row, seed: int, limit_s: float) -> Outcome:
        warm_up("oros", solve_oros)
        return decomposed(row, seed, options.threads, limit_s)

    print(
        "group   cells robots    T battery seed solver  status       objective        bound       gap   time_s limit_s"
    )
    ratios: dict[str, list[float]] = {name: [] for name in [*options.peers, "best peer"]}
    most_cells = math.inf if options.most_cells is None else options.most_cells
    rows = [row for row in TABLE if row.group in options.groups and row.cells <= most_cells]
    for row, seed in ((row, seed) for row in rows for seed in seeds_of(options.seeds)):
        limit_s = options.limit_s or row.limit_s
        run = {**asdict(row), "seed": seed, "threads": options.threads, "limit_s": limit_s}
        own = results.get({**run, "solver": "routes"}, partial(own_outcome, row, seed, limit_s))
        met = own.gap is not None and (own.gap <= row.gap if row.gap else own.status == "optimal")
        met &= own.spent_s <= 1.1 * row.limit_s + 0.1
        print(line(row, seed, "routes", own, "" if met else "!"), flush=True)
        spent_s = []
        for name in options.peers:
            solve = partial(by_peer, name, row, seed, options.threads, limit_s)
            peer = results.get({**run, "solver": name}, solve)
            spent_s.append(peer.spent_s)
            ratios[name].append(peer.spent_s / own.spent_s)
            slack = 1e-6 * abs(own.objective or 0.0)
            worse = peer.objective is not None and peer.objective > (own.objective or 0.0) + slack
            slower = peer.status == "optimal" and (own.status != "optimal" or peer.spent_s < own.spent_s)
            print(line(row, seed, name, peer, " ".join(["worse"] * worse + ["slower"] * slower)), flush=True)
        if spent_s:
            ratios["best peer"].append(min(spent_s) / own.spent_s)
    for name, times in ratios.items():
        if times:
            mean = math.exp(sum(map(math.log, times)) / len(times))
            print(f"{name}: {mean:.1f} times the decomposition's time (geometric mean of {len(times)})")


if __name__ == "__main__":
    main()
