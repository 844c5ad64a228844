"""``react-opt bench``: what the command does, apart from reading its options."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from benchmarks import report, runner
from benchmarks.families import FAMILIES
from benchmarks.peers import PEERS, load_peers
from benchmarks.readers import FORMATS
from benchmarks.suites import SUITES, Suite
from benchmarks.trial import instance_of
from benchmarks.verdicts import exposures
from react_opt.errors import InputError, ReactError, UsageError
from react_opt.interrupt import Interruption
from react_opt.jobs import Record
from react_opt.jobs_file import read_lines
from react_opt.jsonio import require_writable, save

OK, EXPOSED, INTERRUPTED = 0, 1, 130


def suite_of(what: Sequence[str], format: str | None) -> Suite:
    """Return a suite by its name, or the one that a user's files make.

    Parameters
    ----------
    what
        The name of a suite, or files.
    format
        Format of the files (:data:`benchmarks.readers.FORMATS`); None for our own, or where a suite is named.

    Raises
    ------
    UsageError
        Where there is no such suite.
    InputError
        Where a file is not of its format.
    """
    if format is None and len(what) == 1 and what[0] in SUITES:
        return SUITES[what[0]]
    if format is None and not any(Path(file).suffix for file in what):
        raise UsageError(f"SUITE: expected one of {', '.join(SUITES)}, or files, found {what[0]!r}")
    return runner.of_files(format or "json", what)


def bench(suite: Suite, settings: runner.Settings, results: str, reports: Sequence[str]) -> int:
    """Run what a results file does not hold yet, print the report, write it, and return the exit code.

    The report is of the whole file, which several suites may share.

    Parameters
    ----------
    suite, settings
        What to run, and how.
    results
        The results file (JSON lines); a run that is stopped goes on with it.
    reports
        Files to write the report to: ``.md`` or ``.html``.
    """
    for file in (results, *reports):
        require_writable(file)
    for file in reports:
        report.form_of(file)
    jobs = runner.jobs_of(suite, settings, lambda text: print(text, file=sys.stderr))
    console = Console(stderr=True)
    finished = _finished(results)
    left = [job for job in jobs if job.key not in finished]
    if settings.cluster is None and left:
        with console.status("preparing compiled kernels: at their first use on a machine a minute or two"):
            prepared = runner.prepare(left)
        if prepared is not None and prepared.ending != "done":
            raise ReactError(f"the solvers cannot be prepared: {prepared.error}")
    columns = (TextColumn("{task.description:48}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    quiet = not console.is_terminal
    with Interruption() as interruption, Progress(*columns, console=console, transient=True, disable=quiet) as bar:
        task = bar.add_task(suite.name, total=len(jobs), completed=len(jobs) - len(left))

        def show(record: Record) -> None:
            run = runner.runs_of([record])[0]
            bar.update(task, advance=1, description=f"{run['peer']} {run['instance']}"[:48])

        records = runner.run(suite, settings, results, jobs, show, interruption.asked)
    found = report.of_file(results)
    Console().print(report.summary(found))
    for file in reports:
        report.write(found, file)
        print(f"written: {file}", file=sys.stderr)
    print(f"results: {results} ({len(records)} of {len(jobs)} runs)", file=sys.stderr)
    if len(records) < len(jobs):
        return INTERRUPTED
    return EXPOSED if exposures(found.solves) or found.impossible_paths else OK


def _finished(results: str) -> set[str]:
    """Return the keys of the runs that a file holds; refuse one that holds something else before any work is done."""
    if not Path(results).exists() or not Path(results).stat().st_size:
        return set()
    lines = read_lines(results)
    if not lines or lines[0].get("kind") != runner.SCHEMA["kind"]:
        raise InputError.single(results, "", "holds something else than results: expected another file, or none")
    return {line["key"] for line in lines if "key" in line}


def compare(other: str, mine: str) -> int:
    """Print what differs between two results files, with times as ratios; return 1 where they disagree."""
    from benchmarks.compare import compare as compare_results

    found = compare_results(report.of_file(other), report.of_file(mine))
    print(found)
    return EXPOSED if found.differences or found.contradictions else OK


def export(suite: Suite, folder: str) -> int:
    """Write the instances of a suite as JSON, and their monolithic models as MPS; return how many."""
    from react_opt.models.assignment import build as build_assignment
    from react_opt.models.assignment import program as assignment_program
    from react_opt.models.inspection import build as build_inspection
    from react_opt.models.inspection import program as inspection_program
    from react_opt.models.oros import column_count, oros_model
    from react_opt.solvers.highs_model import write_model
    from react_opt.timegraph import route_problem

    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    written: set[str] = set()
    for entry in suite.entries:
        instance = instance_of(entry.case)
        if instance.name in written:
            continue
        written.add(instance.name)
        base = target / instance.name.replace("/", "_")
        save(instance, f"{base}.json")
        if instance.kind == "oros":
            problem = route_problem(instance)
            if column_count(problem) > MOST_COLUMNS:
                print(f"{base}.mps is left out: more than {MOST_COLUMNS} columns", file=sys.stderr)
                continue
            program = oros_model(instance, problem).program
        elif instance.kind == "assignment":
            program = assignment_program(build_assignment(instance).arrays, instance.name)
        else:
            program = inspection_program(build_inspection(instance).arrays)
        write_model(program, f"{base}.mps")
    return len(written)


MOST_COLUMNS = 2_000_000  # of an exported model: larger MPS files fill disks


def listing(peer_files: Sequence[str] = ()) -> str:
    """Return what there is: suites, families with their sizes, solvers, formats."""
    load_peers(peer_files)
    lines = ["suites"]
    for suite in SUITES.values():
        lines.append(f"  {suite.name:12} {len(suite.entries):4} instances, {suite.limit_s:g} s each: {suite.about}")
    lines.append("families")
    for family in FAMILIES.values():
        lines.append(f"  {family.name:18} {family.kind:11} {', '.join(family.sizes)}: {family.about}")
    lines.append("solvers")
    for peer in PEERS.values():
        missing = peer.missing()
        lines.append(f"  {peer.name:18} {peer.version if missing is None else missing}: {peer.about}")
    lines.append("formats")
    lines += [f"  {name:12} {about}" for name, (_, about) in FORMATS.items()]
    return "\n".join(lines)
