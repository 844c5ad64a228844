"""Which runs make a suite: instances, solvers, limits. A suite is data; the runner knows nothing of it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from benchmarks.families import FAMILIES
from benchmarks.peers import PEERS

MONOLITHS = ("highs", "cp-sat", "scip")
COMMERCIAL = ("gurobi", "cplex", "xpress", "copt", "mosek", "knitro")
ALL = ("react_opt", *MONOLITHS, "glpk", "cbc", *COMMERCIAL)
ROUTERS = ("pyvrp", "or-routing", "nearest_first")
MOST_SIDE = 20  # of a grid whose monolith is built: beyond it takes gigabytes
SINGLE = ("RRTConnect", "RRTstar", "InformedRRTstar", "BITstar")


@dataclass(frozen=True)
class Entry:
    """An instance and the solvers that meet on it.

    Parameters
    ----------
    case
        The instance, as :func:`benchmarks.trial.instance_of` takes it.
    peers
        Names of solvers.
    limit_s
        Time limit, s; None for the suite's.
    gap
        Gap at which they may stop; 0 to prove the optimum.
    axis
        What grows along the series that it belongs to (``cells``, ``steps``, ``robots``); empty for none.
    """

    case: Mapping[str, Any]
    peers: tuple[str, ...]
    limit_s: float | None = None
    gap: float = 0.0
    axis: str = ""


@dataclass(frozen=True)
class Suite:
    """A set of runs under common limits.

    Parameters
    ----------
    name, about
        Its name, and what it is for.
    limit_s
        Time limit of a run, s.
    entries
        Instances with their solvers.
    paths
        Arguments of :func:`benchmarks.path_trial.run`.
    threads, memory_mb
        Of every run.
    """

    name: str
    about: str
    limit_s: float
    entries: tuple[Entry, ...] = ()
    paths: tuple[Mapping[str, Any], ...] = field(default=())
    threads: int = 1
    memory_mb: float = 3000.0


def of_family(name: str, size: str, seeds: Sequence[int], peers: Sequence[str], **more: Any) -> list[Entry]:
    """Return entries for a family at a size, one per seed."""
    parameters = dict(FAMILIES[name].sizes[size])
    return [
        Entry({"family": name, "parameters": parameters, "seed": seed}, tuple(peers), **more) for seed in seeds
    ]  # fmt: skip


def kinds(kind: str) -> list[str]:
    """Return the families of a kind that have a size of each name from tiny to medium."""
    return [name for name, family in FAMILIES.items() if family.kind == kind]


def scaling(cells: Sequence[int], steps: Sequence[int], robots: Sequence[int]) -> Iterator[Entry]:
    """Yield square walled grids along which one thing grows, to a certified gap of 1 %."""
    series = (
        ("cells", [(n, 40, 3) for n in cells]),
        ("steps", [(8, t, 3) for t in steps]),
        ("robots", [(8, 30, r) for r in robots]),
    )
    for axis, sizes in series:
        for side, horizon, team in sizes:
            grid = {"rows": side, "cols": side, "robots": team, "horizon": horizon}
            case = {"family": "walled_grid", "parameters": grid, "seed": 1}
            rivals = ("highs", *COMMERCIAL) if side <= MOST_SIDE else ()
            yield Entry(case, ("react_opt", *rivals), gap=0.01, axis=axis)


def path_runs(points: Sequence[int], resolutions: Sequence[float], budgets: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Yield path cost runs: exact and pixel methods, roadmaps that are reused, and single-query planners."""
    for resolution_m, count in itertools.product(resolutions, points):
        common = {"resolution_m": resolution_m, "points": count, "seed": 0}
        for method in ("visibility", "dijkstra8", "dijkstra16", "fastest16"):
            yield {**common, "method": method, "parameters": {}}
        for samples in (250, 1000, 4000):
            yield {**common, "method": "PRMstar", "parameters": {"samples": samples}}
        if count <= 10:  # one search per pair
            for planner, iterations in itertools.product(SINGLE, budgets):
                yield {**common, "method": planner, "parameters": {"iterations": iterations}}


def _smoke() -> Suite:
    oros = [
        entry
        for name in ("walled_grid", "tight_grid", "factory", "corridor")
        for entry in of_family(name, "tiny", [1], ("react_opt", *MONOLITHS, "cbc"))
    ]
    rest = [
        *of_family("metric_complete", "tiny", [1], ("react_opt",)),
        *of_family("plain", "small", [1], ("react_opt", "highs", "scip", "scipy")),
        *of_family("conflicts", "tiny", [1], ("react_opt", *MONOLITHS)),
        *of_family("generalised", "tiny", [1], ("react_opt", *MONOLITHS)),
        *of_family("inspection_floor", "tiny", [1], ("react_opt", "highs", "scip", *ROUTERS), limit_s=2.0),
        *of_family("inspection_tight", "tiny", [1], ("react_opt", "highs", "scip", *ROUTERS), limit_s=2.0),
    ]
    common = {"resolution_m": 0.1, "points": 10, "seed": 0}
    paths = (
        {**common, "method": "visibility", "parameters": {}},
        {**common, "method": "dijkstra8", "parameters": {}},
        {**common, "method": "PRMstar", "parameters": {"samples": 250}},
    )
    return Suite("smoke", "a minute: does everything run, and do all agree", 5.0, (*oros, *rest), paths)


def _standard() -> Suite:
    entries: list[Entry] = []
    for name in kinds("oros"):
        entries += of_family(name, "tiny", [1, 2], ALL)
        entries += of_family(name, "small", [1, 2], ("react_opt", *MONOLITHS, *COMMERCIAL))
        entries += of_family(name, "medium", [1], ("react_opt", *MONOLITHS, *COMMERCIAL))
        entries += of_family(name, "large", [1], ("react_opt",))
    for name in kinds("assignment"):
        for size in ("tiny", "small", "medium"):
            entries += of_family(name, size, [1, 2], (*ALL, "scipy"))
    for name in kinds("inspection"):
        entries += of_family(name, "tiny", [1, 2], (*ALL, *ROUTERS))
        entries += of_family(name, "small", [1, 2], ("react_opt", "highs", "scip", *ROUTERS))
        entries += of_family(name, "medium", [1, 2], ("react_opt", "highs", *ROUTERS))
        entries += of_family(name, "large", [1], ("react_opt", *ROUTERS))
    entries += scaling([4, 6, 8, 10, 14, 20, 30, 40, 60], [20, 40, 80, 160], [1, 2, 4, 8])
    paths = tuple(path_runs([10, 40, 200], [0.1, 0.05], [500, 4000]))
    return Suite("standard", "an hour on two cores", 20.0, tuple(entries), paths)


def _full() -> Suite:
    entries: list[Entry] = []
    for name, family in FAMILIES.items():
        for size in family.sizes:
            rivals = ALL if size in ("tiny", "small") else ("react_opt", *MONOLITHS, *COMMERCIAL)
            alone = size in ("huge", "giant", "colossal")
            entries += of_family(name, size, [1, 2, 3], ("react_opt",) if alone else (*rivals, *ROUTERS, "scipy"))
    entries += scaling([4, 6, 8, 10, 14, 20, 30, 40, 60], [20, 40, 80, 160, 320], [1, 2, 4, 8, 16])
    paths = tuple(path_runs([10, 40, 200], [0.1, 0.05], [500, 4000, 16000]))
    return Suite("full", "every family at every size, three seeds: a night", 120.0, tuple(entries), paths)


def _scaling() -> Suite:
    entries = tuple(scaling([4, 6, 8, 10, 14, 20, 30, 40, 60], [20, 40, 80, 160], [1, 2, 4, 8]))
    return Suite("scaling", "how time and memory grow with cells, steps and robots", 20.0, entries)


def _paths() -> Suite:
    return Suite("paths", "path costs alone", 60.0, (), tuple(path_runs([10, 40, 200], [0.1, 0.05], [500, 4000])))


SUITES = {suite.name: suite for suite in (_smoke(), _standard(), _full(), _scaling(), _paths())}


def serves(entry: Entry, kind: str) -> list[str]:
    """Return the solvers of an entry that take its kind, without those that nobody registered."""
    return [name for name in entry.peers if name in PEERS and kind in PEERS[name].kinds]
