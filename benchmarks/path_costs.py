"""Path costs side by side: time to prepare a map, time of a cost matrix, and how long and slow the paths are.

    python benchmarks/path_costs.py [MAP.yaml] [--points 40 200] [--radius 0.333] [--rule strict] [--seed 0]

Without a map the project's own factory is taken. Every row is warm: compiled kernels are run once before. Times
are wall clock; lengths and times are ratios to the visibility graph's, averaged over the reachable pairs.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.families.factory import factory_map
from benchmarks.path_trial import spread
from react_opt.energy import RobotProfile
from react_opt.geometry import load_map
from react_opt.geometry.inflation import Footprint, FreeSpace, inflate
from react_opt.jsonio import load
from react_opt.paths.exact import exact_costs
from react_opt.paths.ompl_costs import OmplPathCosts
from react_opt.paths.protocol import PathCosts

FACTORY = factory_map()

JACKAL = RobotProfile(**load(FACTORY.with_name("fleet_1.json")).profiles["jackal"].model_dump())

# What is measured: a name and what prepares it. The first row is the reference of the ratios.
ROWS: list[tuple[str, Callable[[FreeSpace], PathCosts]]] = [
    ("visibility", lambda space: exact_costs(space, JACKAL, method="visibility")),
    ("dijkstra8", lambda space: exact_costs(space, JACKAL, method="dijkstra8")),
    ("dijkstra16", lambda space: exact_costs(space, JACKAL, method="dijkstra16")),
    ("fastest8", lambda space: exact_costs(space, JACKAL, method="fastest8")),
    ("fastest16", lambda space: exact_costs(space, JACKAL, method="fastest16")),
    ("ompl prm*", lambda space: OmplPathCosts(space, JACKAL)),
    ("ompl time", lambda space: OmplPathCosts(space, JACKAL, minimise="time")),
]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("map", nargs="?", type=Path, default=FACTORY)
    parser.add_argument("--points", nargs="+", type=int, default=[40, 200])
    parser.add_argument("--radius", type=float, default=JACKAL.radius_m)
    parser.add_argument("--rule", choices=("strict", "centres"), default="strict")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", choices=[name for name, _ in ROWS], help="rows to measure")
    options = parser.parse_args()
    rows = [row for row in ROWS if options.only is None or row[0] in options.only]
    source = load_map(options.map)
    inflate(source, Footprint(options.radius), rule=options.rule)
    begun = time.perf_counter()
    space = inflate(source, Footprint(options.radius), rule=options.rule)
    inflated_s = time.perf_counter() - begun
    print(
        f"{options.map.name}: {source.cols} x {source.rows} pixels of {source.resolution_m} m, refined {space.refine}"
    )
    print(f"inflated by {options.radius:.3f} m in {inflated_s * 1000:.0f} ms, {space.blocked.mean():.1%} blocked\n")
    print(f"{'method':<12}{'points':>7}{'prepare ms':>12}{'matrix ms':>11}{'pairs':>7}{'length':>8}{'time':>8}")
    references: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    for name, prepare in rows:
        prepare(space).cost_table(spread(space, 3, options.seed))  # compile
        begun = time.perf_counter()
        costs = prepare(space)
        prepared_s = time.perf_counter() - begun
        for count in options.points:
            points = spread(space, count, options.seed)
            begun = time.perf_counter()
            table = costs.cost_table(points)
            matrix_s = time.perf_counter() - begun
            length, seconds = references.setdefault(count, (table.length_m, table.time_s))
            pairs = np.triu(table.reachable, 1) & (length > 0)
            ratios = [
                float(np.mean(a[pairs] / b[pairs])) for a, b in ((table.length_m, length), (table.time_s, seconds))
            ]
            figures = f"{prepared_s * 1000:12.0f}{matrix_s * 1000:11.1f}{int(pairs.sum()):7d}"
            print(f"{name:<12}{count:7d}{figures}{ratios[0]:8.4f}{ratios[1]:8.4f}", flush=True)


if __name__ == "__main__":
    main()
