"""Solve one instance with everything that is installed and compare what each knows after the same time.

Run ``python examples/compare_solvers.py [INSTANCE] [--time-limit S]``.
"""

from __future__ import annotations

import argparse
from collections.abc import Collection
from pathlib import Path

from rich.console import Console
from rich.table import Table

from react_opt import UsageError, check, load, solve
from react_opt.plan import OrosPlan
from react_opt.solvers.registry import installed

FACTORY = Path(__file__).parent / "factory"


def compare(instance_file: Path, time_limit_s: float, only: Collection[str] = ()) -> dict[str, OrosPlan]:
    """Return a plan per way to solve an OROS instance; a solver that cannot state it is left out and named."""
    instance = load(instance_file, "oros")
    ways: dict[str, dict[str, str]] = {"routes": {"method": "routes"}}
    ways |= {each.name: {"solver": each.name} for each in installed() if each.abilities is not None}
    plans = {}
    for name, how in ways.items():
        if only and name not in only:
            continue
        try:
            plans[name] = solve(instance, time_limit_s=time_limit_s, threads=1, **how)
        except UsageError as error:
            print(f"{name}: {error}")
            continue
        assert check(instance, plans[name]).ok
    return plans


def table(plans: dict[str, OrosPlan]) -> Table:
    """Return the claims side by side."""
    grid = Table("way", "status", "objective", "proven bound", "gap", "s", pad_edge=False)
    for column in grid.columns[2:]:
        column.justify = "right"
    for name, plan in plans.items():
        claim = plan.claim
        numbers = [f"{x:.4f}" if x is not None else "unknown" for x in (claim.objective, claim.bound)]
        gap = "unknown" if claim.gap is None else f"{claim.gap:.2%}"
        spent = sum(seconds for phase, seconds in claim.wall_s.items() if phase != "warm_up")
        grid.add_row(name, claim.status, *numbers, gap, f"{spent:.1f}")
    return grid


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("instance", nargs="?", type=Path, default=FACTORY / "factory_2_10m.json")
    parser.add_argument("--time-limit", type=float, default=10.0, help="seconds per solver")
    parser.add_argument("--only", nargs="*", default=(), help="these ways only, for instance routes highs")
    options = parser.parse_args()
    Console().print(table(compare(options.instance, options.time_limit, options.only)))
