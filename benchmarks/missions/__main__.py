"""Run a campaign of missions and print the paper's tables.

    python -m benchmarks.missions                                  the project's own factory
    python -m benchmarks.missions mission.json --map other.yaml    starts and robots of a mission or fleet, on any map

Missions run in processes of their own and are appended to the results file one by one; called again with the same
file, the campaign goes on where it was stopped. With ``--ray`` they spread over a Ray cluster (the ``ray`` extra),
whose machines find the map and the folder of ``--traces`` under the same paths. Without ``--seeds`` there are ten.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import platform
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from benchmarks.families.factory import factory_map
from benchmarks.missions.paper import RATED, Campaign, all_tables
from benchmarks.missions.runs import RULES, Setting, limit_jobs, mission_jobs
from benchmarks.runner import commit
from react_opt.errors import ReactError
from react_opt.instance import Fleet, Mission, canonical
from react_opt.interrupt import Interruption
from react_opt.jobs import Job, Record, run_jobs
from react_opt.jsonio import load, parse, write_text
from react_opt.orchestrator.registry import strategy_names

FACTORY = factory_map().with_name("mission_4.json")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is missing, print the tables, write them where asked."""
    options = _options(arguments)
    try:
        base, folder = _mission(options)
        settings = settings_of(options, len(base.robots))
        teams = sorted({setting.robots for setting in settings})
        jobs: list[Job] = []
        if not options.no_limits:
            jobs += limit_jobs(base, folder, teams, options.steps, options.restarts)
        if options.traces is not None:
            Path(options.traces).mkdir(parents=True, exist_ok=True)
        jobs += mission_jobs(base, folder, settings, options.seeds, options.traces, options.time_limit_s)
        digest = hashlib.sha256(json.dumps(canonical(base), sort_keys=True).encode()).hexdigest()[:12]
        file = options.output or f"missions_{Path(base.map).stem}.jsonl"
        header = {"campaign": base.name, "map": base.map, "mission_sha256": digest, **machine()}
        with Interruption() as interruption, _bar() as bar:
            task = bar.add_task("missions", total=len(jobs))

            def tell(record: Record) -> None:
                bar.advance(task)
                if record.ending != "done":
                    print(f"{record.key}: {record.ending}: {record.error}", file=sys.stderr)

            records = run_jobs(
                jobs, file, workers=options.workers, reuse=50, cluster=options.ray, header=header,
                on_record=tell, should_stop=interruption.asked,
            )  # fmt: skip
    except ReactError as error:
        print(error, file=sys.stderr)
        return 2
    results = {record.key: record.result for record in records if record.ending == "done"}
    tables = all_tables(Campaign(settings, options.seeds, results))
    lost = [record for record in records if record.ending != "done"]
    print("\n\n".join(table.text() for table in tables))
    if lost:
        print(f"\n{len(lost)} of {len(records)} jobs failed: {', '.join(record.key for record in lost[:5])}")
    if options.markdown:
        command = "python -m benchmarks.missions " + " ".join(sys.argv[1:] if arguments is None else arguments)
        write_text(_page(base, command, options.seeds, lost, tables), options.markdown)
    if options.csv:
        write_text("\n".join(table.csv() for table in tables), options.csv)
    return 130 if len(records) < len(jobs) else 0


def settings_of(options: argparse.Namespace, most: int) -> list[Setting]:
    """Return the points of a campaign."""
    teams = [n for n in options.robots if n <= most]
    settings = [Setting(name, n) for name in options.strategies for n in teams]
    paper = [name for name in options.strategies if name in options.variants and not options.quick]
    settings += [Setting(name, n, rule) for name in paper for n in teams if n <= 3 for rule in RULES[1:]]
    settings += [Setting(name, n, always_on=True) for name in paper for n in teams if n <= 3]
    rated = [name for name in paper if name in RATED]
    settings += [Setting(name, n, blocking=False) for name in rated for n in teams if n >= 3]
    settings += [Setting(name, 1, horizon_s=360.0) for name in rated if 1 in teams]
    return settings


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.missions", description=__doc__.splitlines()[0])
    parser.add_argument(
        "mission", nargs="?", default=str(FACTORY), help="mission or fleet file; by default the factory"
    )
    parser.add_argument("--map", help="map file to use instead of the mission's")
    parser.add_argument("--strategies", nargs="+", choices=strategy_names(), default=list(strategy_names()))
    parser.add_argument("--robots", nargs="+", type=int, default=[1, 2, 3, 4], help="team sizes: the first robots")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--quick", action="store_true", help="main table alone: one rule, no always-on, no no-blocking")
    parser.add_argument(
        "--variants",
        nargs="*",
        choices=strategy_names(),
        default=["oros", *RATED],
        help="strategies also run with the other switching rules and always on (react and react_plus: T = 360 s too)",
    )
    parser.add_argument("--no-limits", action="store_true", help="no bounds and no full-map plans")
    parser.add_argument("--steps", type=int, default=600_000, help="moves per search of a full-map plan")
    parser.add_argument("--restarts", type=int, default=4, help="searches per full-map plan")
    parser.add_argument("--horizon-s", type=float, help="instead of the mission's")
    parser.add_argument("--workers", type=int, default=1, help="missions at a time")
    parser.add_argument("--ray", help="Ray cluster: local, auto or an address.")
    parser.add_argument("--time-limit-s", type=float, default=600.0, help="wall time after which a mission is given up")
    parser.add_argument("-o", "--output", help="results, JSON lines; by default missions_MAP.jsonl")
    parser.add_argument("--traces", help="folder to keep traces in")
    parser.add_argument("--markdown", help="page to write the tables to")
    parser.add_argument("--csv", help="file to write the tables to as comma-separated values")
    return parser.parse_args(arguments)


def _mission(options: argparse.Namespace) -> tuple[Mission, str]:
    """Return the mission and the folder of its map; a fleet takes what it lacks from the factory's mission."""
    document: Any = load(options.mission)
    folder = Path(options.mission).resolve().parent
    data = canonical(document)
    if isinstance(document, Fleet):
        lent = canonical(load(FACTORY, "mission"))
        data = {**lent, **{name: data[name] for name in ("name", "profiles", "robots", "chargers")}}
        if options.map is None:
            raise ReactError("a fleet needs a map: --map MAP.yaml")
    if options.map is not None:
        file = Path(options.map).resolve()
        folder, data["map"], data["prior_map"] = file.parent, file.name, None
        data["name"] = f"{data['name']} on {file.stem}"
    if options.horizon_s is not None:
        data["horizon_s"] = options.horizon_s
    mission: Mission = parse(data, kind="mission")
    return mission, str(folder)


def machine() -> dict[str, str]:
    """Return the commit, the package and the machine."""
    return {
        "commit": commit() or "of a release",
        "react_opt": version("react_opt"),
        "python": platform.python_version(),
        "machine": f"{platform.machine()} {platform.system()}",
    }


def _page(base: Mission, command: str, seeds: int, lost: list[Record], tables: list[Any]) -> str:
    about = machine()
    lines = [
        "# Simulated missions: the paper's tables and ours",
        "",
        f"Generated by `{command}` at commit {about['commit']}, Python {about['python']}, {about['machine']}.",
        f"Mission: {base.name}, map {base.map}, horizon {base.horizon_s:g} s, {seeds} seeds per point.",
    ]
    if lost:
        lines.append(f"{len(lost)} jobs failed: {', '.join(f'{r.key} ({r.ending})' for r in lost)}.")
    return "\n".join([*lines, "", "\n\n".join(table.markdown() for table in tables), ""])


def _bar() -> Progress:
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=console, disable=not console.is_terminal)


if __name__ == "__main__":
    sys.exit(main())
