"""The report of a results file: who solved what, who was wrong, where we lose; Markdown, HTML or a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import util
from os import PathLike
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table as RichTable
from rich.text import Text as RichText

from benchmarks import figures, measures, page
from benchmarks.chapters import certificates, details, losses, path_table, refusals, scaling_table
from benchmarks.runner import runs_of
from benchmarks.verdicts import Exposure, by_instance, exposures, meetings
from react_opt.errors import InputError, UsageError
from react_opt.jobs_file import read_lines

OURS = "react_opt"
OPTIONS = {"limit_s": "time-limit", "memory_mb": "memory-mb", "cluster": "ray", "only": "solver", "peer_files": "peer"}


@dataclass(frozen=True)
class Results:
    """What a results file holds.

    Parameters
    ----------
    headers
        One per time that it was worked on: suite, machine, versions, commit, settings.
    solves, paths
        The runs of solvers, and of path cost methods.
    """

    headers: tuple[Mapping[str, Any], ...]
    solves: tuple[dict[str, Any], ...]
    paths: tuple[dict[str, Any], ...]

    @property
    def compared(self) -> list[dict[str, Any]]:
        """The runs that are no part of a scaling series, of solvers that take the instance."""
        return [run for run in self.solves if not run.get("axis") and run["status"] != "not met"]

    @property
    def impossible_paths(self) -> list[dict[str, Any]]:
        """Path cost runs with paths shorter than the shortest."""
        return [run for run in self.paths if run.get("impossible")]


def of_file(file: str | PathLike[str]) -> Results:
    """Return what a results file holds.

    Parameters
    ----------
    file
        The file (JSON lines), as ``react-opt bench`` writes it.

    Raises
    ------
    InputError
        Where it cannot be read or is no results file.
    """
    lines = read_lines(file)
    headers = tuple(line for line in lines if line.get("kind") == "bench_results")
    if not headers:
        raise InputError.single(str(file), "", "expected results of react-opt bench, with a line of kind bench_results")
    runs = runs_of([line for line in lines if "ending" in line])
    return Results(
        headers,
        tuple(run for run in runs if run["what"] == "solve"),
        tuple(run for run in runs if run["what"] == "paths"),
    )


def form_of(file: str) -> str:
    """Return ``md`` or ``html`` from a report's name.

    Raises
    ------
    UsageError
        Where it ends otherwise.
    """
    form = Path(file).suffix.lower().lstrip(".")
    if form not in ("md", "html"):
        raise UsageError(f"{file}: a report ends in .md or .html")
    return form


def write(found: Results | str | PathLike[str], file: str) -> None:
    """Write the report of results, or of a results file, as Markdown or HTML by the name's ending.

    Figures need matplotlib (the ``plot`` extra); without it the report says so and holds the tables.
    """
    form = form_of(file)
    results = found if isinstance(found, Results) else of_file(found)
    (page.markdown if form == "md" else page.page)(blocks(results), file)


def summary(found: Results) -> RenderableType:
    """Return the standings and what was exposed, for a terminal."""
    exposed = exposures(found.solves)
    parts: list[RenderableType] = []
    for name, runs in fields_of(found.compared):
        table = RichTable(title=name, title_justify="left")
        headings, rows = _standings(runs, exposed)
        for k, heading in enumerate(headings):
            if heading != "version":
                table.add_column(SHORT.get(heading, heading), justify="left" if k == 0 else "right", no_wrap=True)
        for row in rows:
            table.add_row(row[0], *row[2:])
        parts.append(table)
    parts += [RichText(f"WRONG  {item}", style="bold red") for item in exposed]
    parts += [RichText(f"WRONG  {run['peer']} on {run['instance']}: impossible paths", style="bold red")
              for run in found.impossible_paths]  # fmt: skip
    if not exposed and not found.impossible_paths:
        parts.append(RichText("no answer is contradicted by another one, by the checker or by its certificate"))
    return Group(*parts)


def blocks(found: Results) -> list[page.Block]:
    """Return the whole report."""
    exposed = exposures(found.solves)
    wrong = {(item.peer, item.instance) for item in exposed}
    parts: list[page.Block] = [page.Heading("Benchmark results", 1), *_provenance(found)]
    parts.append(page.Heading("Wrong answers"))
    parts += _exposed(exposed, found)
    drawn = util.find_spec("matplotlib") is not None
    if not drawn:
        parts.append(page.Text("The figures are left out: they need matplotlib (pip install 'react_opt[plot]')."))
    for kind in kinds_of(found.compared):
        runs = [run for run in found.compared if kind_of(run) == kind]
        parts.append(page.Heading(f"{kind}: {counted(len(by_instance(runs)), 'instance')}"))
        parts.append(page.Text(STANDINGS))
        for number, (name, field) in enumerate(fields_of(runs), start=1):
            headings, rows = _standings(field, exposed)
            parts.append(page.Table(headings, rows, f"On the {name}:"))
            if drawn and len(by_instance(field)) > 1 and len(rows) > 1:
                parts += _pictures(field, wrong, kind, number)
        parts += losses(runs, wrong, OURS)
        parts += details(runs, wrong)
        parts += refusals(runs)
    parts += certificates(found.solves)
    parts += _scaling(found, wrong, drawn)
    parts += path_table(found.paths)
    if drawn and found.paths and (png := figures.path_costs(found.paths)) is not None:
        parts.append(page.Figure("path_costs", png, "Time of a cost matrix against the mean excess over exact paths."))
    return parts


SHORT = {"best plan": "best", "no plan": "none", "mean time s": "time s", "primal integral": "primal"}
STANDINGS = (
    "Solved: proven within the limit and not contradicted. Best plan: nobody has a better one. Mean time: shifted "
    "geometric mean (shift 1 s) over all instances met, unsolved ones at the limit. Primal integral: mean over the "
    "limit of the distance to the best known plan (shifted geometric mean, shift 0.01)."
)


def _standings(runs: Sequence[dict[str, Any]], exposed: Sequence[Exposure]) -> tuple[list[str], list[list[str]]]:
    headings = [
        "solver",
        "version",
        "solved",
        "best plan",
        "no plan",
        "mean time s",
        "primal integral",
        "wrong",
        "late",
    ]
    rows = [
        [
            row.peer, row.version, f"{row.solved}/{row.runs}", f"{row.best}/{row.runs}", str(row.without),
            f"{row.mean_s:.3f}", "-" if row.primal is None else f"{row.primal:.4f}", str(row.wrong), str(row.late),
        ]
        for row in measures.standings(runs, exposed)
    ]  # fmt: skip
    return headings, rows


def _pictures(runs: Sequence[dict[str, Any]], wrong: set[tuple[str, str]], kind: str, number: int) -> list[page.Block]:
    """Return the pictures of the solvers that met on the same instances."""
    named = [
        ("profile", figures.profiles(runs, wrong, kind), "Share of the instances solved within a multiple of the "
         "fastest solver's time."),
        ("gap", figures.over_time(runs, wrong, kind, "proven"), "Mean proven gap over time; 100 % while a solver has "
         "no plan or no bound."),
        ("primal", figures.over_time(runs, wrong, kind, "primal"), "Mean distance to the best known plan; the area "
         "under a line is the primal integral."),
    ]  # fmt: skip
    return [page.Figure(f"{kind}_{number}_{name}", png, text) for name, png, text in named if png is not None]


def fields_of(runs: Sequence[dict[str, Any]]) -> list[tuple[str, list[dict[str, Any]]]]:
    """Return the runs by the set of solvers that met, so that means compare: each with a name, the largest first."""
    fields: dict[tuple[str, frozenset[str]], list[dict[str, Any]]] = {}
    for group in meetings(runs):
        key = (kind_of(group[0]), frozenset(run["peer"] for run in group))
        fields.setdefault(key, []).extend(group)  # type: ignore[arg-type]
    found = []
    for (kind, _), field in fields.items():
        count = len(by_instance(field))
        families = dict.fromkeys(str(run["case"].get("family", "files")) for run in field)
        found.append((f"{counted(count, f'{kind} instance')} of {', '.join(families)}", field))
    return found


def _provenance(found: Results) -> list[page.Block]:
    first = found.headers[0]
    machine = first["machine"]
    commands = list(dict.fromkeys(_command(header) for header in found.headers))
    loads = ", ".join(str(header["machine"]["load_before"]) for header in found.headers)
    limits = sorted({f"{run['limit_s']:g}" for run in found.solves}, key=float)
    commits = list(dict.fromkeys(str(header["commit"] or "of a release") for header in found.headers))
    return [
        page.Text(
            f"Made by {', then '.join(f'`{command}`' for command in commands)}; begun {first['begun']}, react_opt "
            f"{first['versions'].get('react_opt', 'unknown')}, commit {', '.join(commits)}."
        ),
        page.Text(
            f"Machine: {machine['processor']}, {machine['cores']} cores, {machine['memory_gb']} GB, "
            f"{machine['system']}, Python {first['versions'].get('python', 'unknown')}, load {loads} "
            f"before, {counted(first['workers'], 'run')} at a time. Time limits: {', '.join(limits) or '-'} s per "
            "run, the same for every solver on an instance, as are threads and seeds."
        ),
        page.Text(
            "Every plan was replayed by the independent checker. Objectives, bounds and verdicts of solved instances "
            "repeat on another machine; times do so as ratios. Plans and bounds of runs that their time limit cut "
            "off depend on the machine; `--compare` asks of them that none contradicts another."
        ),
    ]


def _command(header: Mapping[str, Any]) -> str:
    """Return the command that made a part of the results."""
    settings = header.get("settings", {})
    options = ""
    for key in ("workers", "threads", "seed", "limit_s", "memory_mb", "cluster", "only", "peer_files"):
        given = settings.get(key) or ()
        for value in given if isinstance(given, list | tuple) else (given,):
            shown = Path(value).name if key == "peer_files" else f"{value:g}" if isinstance(value, float) else value
            options += f" --{OPTIONS.get(key, key)} {shown}"
    return f"react-opt bench {header['suite']}{options} -o results.jsonl --report results.md"


def _exposed(exposed: Sequence[Exposure], found: Results) -> list[page.Block]:
    rows = [[item.peer, item.instance, item.fault, item.text] for item in exposed]
    rows += [
        [run["peer"], run["instance"], "path", f"{run['impossible']} paths that the exact search rules out"]
        for run in found.impossible_paths
    ]
    if not rows:
        return [page.Text("None: no plan breaks a rule, and no claim is contradicted by another answer.")]
    return [page.Table(["solver", "instance", "what", "how it was exposed"], rows)]


def _scaling(found: Results, wrong: set[tuple[str, str]], drawn: bool) -> list[page.Block]:
    axes = list(dict.fromkeys(run["axis"] for run in found.solves if run.get("axis")))
    parts: list[page.Block] = [page.Heading("Scaling")] if axes else []
    for axis in axes:
        series = [run for run in found.solves if run.get("axis") == axis]
        parts.append(scaling_table(series, wrong, axis))
        if drawn and (png := figures.scaling(series, wrong, axis)) is not None:
            text = f"Time to a certified gap of 1 % and memory along {axis}, with fitted exponents."
            parts.append(page.Figure(f"scaling_{axis}", png, text))
    return parts


def counted(count: int, what: str) -> str:
    """Return a number of things."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def kind_of(run: Mapping[str, Any]) -> str:
    """Return the kind of instance of a run."""
    from benchmarks.families import FAMILIES

    case = run["case"]
    return str(run.get("kind") or case.get("kind") or FAMILIES[case["family"]].kind)


def kinds_of(runs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the kinds of instances among runs, in their order."""
    return list(dict.fromkeys(kind_of(run) for run in runs))
