"""The options of ``react-opt bench``."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer


def bench(
    what: Annotated[
        list[str] | None,
        typer.Argument(metavar="[SUITE | FILE...]", help="smoke (default), standard, full, scaling, paths; or files."),
    ] = None,
    results: Annotated[str | None, typer.Option("-o", "--output", help="Results, else bench_SUITE.jsonl.")] = None,
    report: Annotated[list[str] | None, typer.Option("--report", help="Report to write, .md or .html.")] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Runs at a time, else cores / threads.")
    ] = None,
    time_limit: Annotated[float | None, typer.Option("--time-limit", help="Seconds per run, the suite's else.")] = None,
    memory_mb: Annotated[float | None, typer.Option("--memory-mb", help="MB per run, the suite's else.")] = None,
    threads: Annotated[int | None, typer.Option("--threads", help="Threads per run, the suite's else.")] = None,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the solvers.")] = 0,
    solver: Annotated[list[str] | None, typer.Option("--solver", help="Only these solvers.")] = None,
    peer: Annotated[list[str] | None, typer.Option("--peer", help="Python file with a solver of your own.")] = None,
    read: Annotated[str | None, typer.Option("--read", help="Format of the files, see --list.")] = None,
    export: Annotated[str | None, typer.Option("--export", help="Write JSON and MPS to a folder, run nothing.")] = None,
    ray: Annotated[str | None, typer.Option("--ray", help="Ray cluster: local, auto or an address.")] = None,
    compare: Annotated[str | None, typer.Option("--compare", help="Other results: what differs, time ratios.")] = None,
    show_list: Annotated[bool, typer.Option("--list", help="List suites, families, solvers and formats.")] = False,
) -> int:
    """Run solvers side by side on instances, check every answer, and report who solved what and who was wrong.

    A run that was stopped goes on with its results file. Exit codes: 0 good, 1 an answer was exposed as wrong, 2 bad
    input, 130 interrupted.

    Example: react-opt bench smoke --report smoke.html

    Example: react-opt bench standard --compare other_machine.jsonl

    Example: react-opt bench --read chao p4.2.a.txt p4.2.b.txt
    """
    from benchmarks import command
    from benchmarks.runner import Settings

    if show_list:
        print(command.listing(peer or []))
        return 0
    chosen = command.suite_of(what or ["smoke"], read)
    if export is not None:
        count = command.export(chosen, export)
        print(f"{export}: {count} instances", file=sys.stderr)
        return 0
    file = results or f"bench_{chosen.name}.jsonl"
    if compare is not None:
        return command.compare(compare, file)
    settings = Settings(
        limit_s=time_limit, threads=threads, memory_mb=memory_mb, seed=seed, only=tuple(solver or ()),
        peer_files=tuple(os.path.abspath(file) for file in peer or ()), workers=workers, cluster=ray,
    )  # fmt: skip
    return command.bench(chosen, settings, file, report or [])
