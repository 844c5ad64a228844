"""From a suite to jobs, and from jobs to a results file that a killed run can be continued with."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import psutil

from benchmarks.families import FAMILIES
from benchmarks.peers import PEERS, load_peers
from benchmarks.readers import documents
from benchmarks.suites import Entry, Suite
from react_opt.claims import versions
from react_opt.errors import UsageError
from react_opt.jobs import Job, Record, run_jobs, run_one

SCHEMA = {"kind": "bench_results", "schema_version": 1}
GRACE_S = 100.0  # beyond the time limit: loading, checking, recomputing the bound
PREPARE_S = 900.0


@dataclass(frozen=True)
class Settings:
    """What a user chooses of a run.

    Parameters
    ----------
    limit_s, threads, memory_mb
        In place of the suite's; None for the suite's.
    seed
        Seed of the solvers.
    only
        Solvers to run; empty for the suite's.
    peer_files
        Python files that register further solvers, which then meet every instance that they take.
    workers
        Runs at a time; None for as many as the machine has cores for, by the threads of a run.
    cluster
        Address of a Ray cluster; None for this machine.
    """

    limit_s: float | None = None
    threads: int | None = None
    memory_mb: float | None = None
    seed: int = 0
    only: tuple[str, ...] = ()
    peer_files: tuple[str, ...] = ()
    workers: int | None = None
    cluster: str | None = None


def of_files(format: str, files: Sequence[str], limit_s: float = 60.0) -> Suite:
    """Return a suite of the instances in a user's files, met by every solver of their kind.

    Raises
    ------
    InputError
        Where a file is not of its format.
    """
    entries = []
    for file in files:
        for number, instance in enumerate(documents(format, file)):
            if instance.kind not in ("oros", "assignment", "inspection"):
                raise UsageError(f"{file}: there is nothing to solve in a file of kind {instance.kind!r}")
            case = {"format": format, "file": os.path.abspath(file), "number": number, "kind": instance.kind}
            entries.append(Entry({**case, "name": instance.name}, tuple(PEERS)))
    how = "" if format == "json" else f"--read {format} "
    return Suite("files", how + " ".join(Path(file).name for file in files), limit_s, tuple(entries))


def jobs_of(suite: Suite, settings: Settings, skipped: Callable[[str], None] = lambda text: None) -> list[Job]:
    """Return the jobs of a suite.

    Parameters
    ----------
    suite, settings
        What to run, and how.
    skipped
        Called with a line that names the solvers which are not installed here, where there are some.

    Raises
    ------
    UsageError
        Where a solver asked for does not exist, or nothing is left to run.
    """
    mine = load_peers(settings.peer_files)
    for name in settings.only:
        if name not in PEERS:
            raise UsageError(f"solver: expected one of {', '.join(PEERS)}, found {name!r}")
    missing = {name: peer.missing() for name, peer in PEERS.items()}
    wanted = {name for entry in suite.entries for name in (*entry.peers, *settings.only)} & set(PEERS)
    absent = sorted(name for name in wanted if missing[name] and (not settings.only or name in settings.only))
    if absent:
        skipped(f"not installed and left out: {', '.join(absent)} (react-opt bench --list says how to have them)")
    slow_start = 0.0 if settings.cluster is None else PREPARE_S  # a cluster's machines compile when they first run
    jobs: dict[str, Job] = {}
    for entry in suite.entries:
        kind = entry.case.get("kind") or FAMILIES[entry.case["family"]].kind
        names = settings.only or tuple(dict.fromkeys((*entry.peers, *mine)))
        for name in names:
            if name in PEERS and kind in PEERS[name].kinds and not missing[name]:
                job = _solving(entry, name, suite, settings)
                job = replace(job, time_limit_s=(job.time_limit_s or 0.0) + slow_start)
                jobs[job.key] = job
    for arguments in suite.paths if not settings.only else ():
        text = json.dumps(arguments, sort_keys=True)
        job = Job(f"paths {text}", "benchmarks.path_trial:run", arguments, suite.limit_s + GRACE_S, suite.memory_mb)
        jobs[job.key] = job
    if not jobs:
        raise UsageError("there is nothing to run: none of the solvers takes such instances, or none is installed")
    return list(jobs.values())


def _solving(entry: Entry, name: str, suite: Suite, settings: Settings) -> Job:
    limit_s = settings.limit_s or entry.limit_s or suite.limit_s
    memory_mb = settings.memory_mb or suite.memory_mb
    arguments = {
        "case": dict(entry.case), "peer": name, "files": list(settings.peer_files), "time_s": limit_s,
        "threads": settings.threads or suite.threads, "seed": settings.seed, "gap": entry.gap,
        "axis": entry.axis,
    }  # fmt: skip
    key = json.dumps({**arguments, "memory_mb": memory_mb}, sort_keys=True)
    until_s = 1.1 * limit_s + GRACE_S
    return Job(f"solve {key}", "benchmarks.trial:run", arguments, until_s, memory_mb, settings.threads or suite.threads)


def prepare(jobs: Sequence[Job]) -> Record | None:
    """Compile kernels before any run is timed: a minute or two at the first use on a machine."""
    cases = [job.arguments["case"] for job in jobs if job.target == "benchmarks.trial:run"]
    if not cases:
        return None
    families = sorted({case["family"] for case in cases if "family" in case})
    kinds = sorted({case.get("kind") or FAMILIES[case["family"]].kind for case in cases})
    arguments = {"kinds": kinds, "families": families}
    return run_one(Job("prepare", "benchmarks.trial:prepare", arguments, time_limit_s=PREPARE_S))


def run(
    suite: Suite,
    settings: Settings,
    file: str,
    jobs: Sequence[Job],
    on_record: Callable[[Record], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> list[Record]:
    """Run the jobs that the results file does not hold yet; see :func:`react_opt.jobs.run_jobs`."""
    what = suite.about if suite.name == "files" else suite.name
    header = {**SCHEMA, "suite": what, "machine": machine(), "versions": versions(), "commit": commit()}
    header["workers"] = places(suite, settings)
    header["settings"] = {key: value for key, value in asdict(settings).items() if value not in (None, ())}
    return run_jobs(
        jobs, file, workers=places(suite, settings), cluster=settings.cluster, retries=0, header=header,
        on_record=on_record, should_stop=should_stop,
    )  # fmt: skip


def places(suite: Suite, settings: Settings) -> int:
    """Return how many runs go on at a time."""
    return settings.workers or max(1, (os.cpu_count() or 1) // (settings.threads or suite.threads))


def machine() -> dict[str, Any]:
    """Return what a reader of the times should know of this machine."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        models = [line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if "model name" in line]
        name = models[0] if models else name
    return {
        "processor": name, "cores": os.cpu_count() or 1, "memory_gb": round(psutil.virtual_memory().total / 1e9, 1),
        "system": platform.system(), "load_before": round(os.getloadavg()[0], 2),
    }  # fmt: skip


def commit() -> str | None:
    """Return the commit of the clone that this runs from, None for an installed package."""
    folder = Path(__file__).resolve().parent.parent
    if not (folder / ".git").exists():
        return None
    done = subprocess.run(
        ["git", "-C", str(folder), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.stdout.strip() or None


def runs_of(records: Sequence[Record] | Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the runs that records hold; one that was killed or died is a run without an answer."""
    runs = []
    for record in records:
        data = record if isinstance(record, Mapping) else record.__dict__
        if data["ending"] == "done":
            runs.append({**data["result"], "key": data["key"], "host": data["host"]})
        else:
            runs.append(_without_answer(data))
    return runs


def _without_answer(data: Mapping[str, Any]) -> dict[str, Any]:
    what, text = data["key"].split(" ", 1)
    asked = json.loads(text)
    common = {"key": data["key"], "status": data["ending"], "reason": data["error"], "host": data["host"]}
    if what == "paths":
        instance = f"factory_{asked['resolution_m']:g}m_{asked['points']}"
        return {**asked, **common, "what": "paths", "peer": asked["method"], "instance": instance}
    case = asked["case"]
    name = case.get("name") or f"{case['family']} {json.dumps(case['parameters'])} seed {case['seed']}"
    return {
        **common, "what": "solve", "instance": name, "case": case, "axis": asked["axis"], "peer": asked["peer"],
        "limit_s": asked["time_s"], "gap_asked": asked["gap"], "threads": asked["threads"],
        "seed": asked["seed"], "memory_mb": data["peak_mb"], "tolerance": None,
    }  # fmt: skip
