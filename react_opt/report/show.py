"""``show``: the picture or page of any file, chosen by its kind and by the suffix of what is to be written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from react_opt.errors import InputError, MissingPartError, UsageError
from react_opt.geometry import load_map
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import AssignmentInstance, Fleet, InspectionInstance, Mission, OrosInstance
from react_opt.jsonio import load, sha256, write_bytes
from react_opt.plan import AssignmentPlan, InspectionPlan, OrosPlan, PlanDocument
from react_opt.trace import Trace

PICTURES = (".png", ".svg", ".pdf")
SUFFIXES = (*PICTURES, ".html")
_NEIGHBOURS = 200  # files beside a plan among which its instance is looked for
_LARGEST_NEIGHBOUR = 20_000_000


def show(
    files: Sequence[str | Path],
    output: str | Path,
    *,
    instance: str | Path | None = None,
    map_file: str | Path | None = None,
    truth: bool = True,
    bound: bool = True,
) -> list[str]:
    """Write the picture or page of a file.

    Parameters
    ----------
    files
        An instance, fleet, mission, plan or trace, or the results of ``react-opt bench`` (``.jsonl``, whose report
        is ``.html`` or ``.md``); two traces make a replay side by side.
    output
        What to write: ``.png``, ``.svg`` or ``.pdf`` is a picture, ``.html`` a page that needs nothing else
        (for a trace the replay).
    instance
        The instance of a plan, which a plan names but does not hold. By default the file beside the plan that
        has the SHA-256 which the plan names.
    map_file
        An occupancy map to draw below cells and robots.
    truth
        Whether walls that the robots have not seen are shown.
    bound
        Whether a trace's coverage curve gets its proven bound, which takes seconds on a large map.

    Returns
    -------
    list[str]
        What there is to tell: which instance was found, or that none was.

    Raises
    ------
    InputError
        Where a file is not good, or a plan is one of another instance.
    UsageError
        Where the suffix is not known, or options do not fit the kind of file.
    MissingPartError
        Where matplotlib is not installed and a figure needs it.
    """
    suffix = Path(output).suffix.lower()
    if len(files) == 1 and Path(files[0]).suffix == ".jsonl":  # the results of react-opt bench
        from benchmarks.report import write

        write(files[0], str(output))
        return []
    if suffix not in SUFFIXES:
        raise UsageError(f"-o: expected a file that ends in {', '.join(SUFFIXES)}, found {str(output)!r}")
    documents = [load(file) for file in files]
    for file, document in zip(files, documents, strict=True):
        if len(documents) > 1 and not isinstance(document, Trace):
            raise InputError.single(str(file), "kind", f"expected a trace beside a trace, found {document.kind!r}")
    if len(documents) > 2 or not documents:
        raise UsageError(f"expected one file, or two traces, found {len(documents)} files")
    if len(documents) == 2 and suffix != ".html":
        raise UsageError("two traces side by side are a replay: expected -o to end in .html")
    document = documents[0]
    if instance is not None and not isinstance(document, PlanDocument):
        raise UsageError(f"--instance: expected with a plan, not with a file of kind {document.kind!r}")
    if isinstance(document, Trace) and map_file is not None:
        raise UsageError("--map: a trace holds its own map")
    if isinstance(document, Trace) and suffix == ".html":
        from react_opt.report.replay import replay_page

        notes: list[str] = []
        bounds = [_bound(d, f, notes) if bound else None for d, f in zip(documents, files, strict=True)]
        write_bytes(replay_page(documents, truth=truth, bounds=bounds).encode(), output)
        return notes
    ground = None if map_file is None else load_map(map_file)
    content, notes = _picture(document, Path(files[0]), suffix, instance, ground, truth, bound)
    write_bytes(content, output)
    return notes


def _picture(
    document: Any,
    file: Path,
    suffix: str,
    instance: str | Path | None,
    ground: OccupancyMap | None,
    truth: bool,
    bound: bool,
) -> tuple[bytes, list[str]]:
    _require_matplotlib()
    import matplotlib

    from react_opt.report.page import figure_page
    from react_opt.report.style import RC, render

    notes: list[str] = []
    with matplotlib.rc_context(RC):
        figure = _figure(document, file, instance, ground, truth, bound, notes)
        if suffix != ".html":
            return render(figure, suffix[1:]), notes
        return figure_page(document, render(figure, "svg").decode()).encode(), notes


def _figure(
    document: Any,
    file: Path,
    instance: str | Path | None,
    ground: OccupancyMap | None,
    truth: bool,
    bound: bool,
    notes: list[str],
) -> Any:
    if isinstance(document, Trace):
        from react_opt.report.mission_figure import trace_figure

        return trace_figure(document, truth=truth, bound=_bound(document, file, notes) if bound else None)
    if isinstance(document, Fleet | Mission):
        from react_opt.report.mission_figure import fleet_figure

        if ground is None and isinstance(document, Mission):
            ground = load_map(file.parent / document.map)
        return fleet_figure(document, ground)
    if isinstance(document, OrosInstance):
        from react_opt.report.oros_figure import instance_figure

        return instance_figure(document, ground)
    if isinstance(document, AssignmentInstance | InspectionInstance):
        return _middle_instance(document)
    given = _instance_of(document, file, instance, notes)
    if isinstance(document, OrosPlan):
        from react_opt.report.oros_figure import plan_figure

        return plan_figure(document, given, ground)
    from react_opt.report.middle_figure import assignment_figure, inspection_figure

    if isinstance(document, AssignmentPlan):
        return assignment_figure(document, given)
    assert isinstance(document, InspectionPlan)
    return inspection_figure(document, given)


def _bound(trace: Trace, file: str | Path, notes: list[str]) -> Any:
    """Return the bound of a trace's coverage curve; None, and a note, where there is none."""
    from react_opt.limits.curve import coverage_bound

    try:
        return coverage_bound(trace)
    except UsageError as error:
        notes.append(f"{file}: no bound on the coverage: {error}")
        return None


def _middle_instance(document: AssignmentInstance | InspectionInstance) -> Any:
    from react_opt.report.middle_figure import assignment_figure, travel_figure

    if isinstance(document, AssignmentInstance):
        return assignment_figure(None, document, title=document.name)
    return travel_figure(document)


def _instance_of(plan: PlanDocument, file: Path, given: str | Path | None, notes: list[str]) -> Any:
    """Return the instance of a plan: the one given, or the one beside it; None where there is none."""
    kind = plan.kind.removesuffix("_plan")
    if given is not None:
        instance = load(given, kind)
        if sha256(instance) != plan.instance.sha256:
            message = f"expected the instance of {file} ({plan.instance.name!r}), found another one"
            raise InputError.single(str(given), "", message)
        return instance
    folder = file.parent if str(file) != "-" else Path()
    for other in sorted(folder.glob("*.json"))[:_NEIGHBOURS]:
        try:
            if other.stat().st_size > _LARGEST_NEIGHBOUR or f'"{kind}"' not in other.read_text(encoding="utf-8")[:200]:
                continue
            instance = load(other, kind)
        except (InputError, OSError, UnicodeDecodeError):
            continue  # not an instance of this kind: files beside a plan may be anything
        if sha256(instance) == plan.instance.sha256:
            notes.append(f"{file}: drawn with its instance {other}")
            return instance
    notes.append(
        f"{file}: its instance {plan.instance.name!r} is not beside it, so what only the instance knows is left out; "
        "name it with --instance"
    )
    return None


def _require_matplotlib() -> None:
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise MissingPartError("figures need matplotlib: pip install 'react_opt[plot]'") from None
