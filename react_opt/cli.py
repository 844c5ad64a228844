"""The command line: ``react-opt build | solve | check | simulate | bench | show | schema | solvers``."""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn, TypeVar

import typer
from rich.console import Console

from react_opt.cli_bench import bench
from react_opt.cli_help import examples, kinds_begun, solvers_begun, strategies_begun
from react_opt.errors import InputError, MissingPartError, ReactError, UsageError
from react_opt.interrupt import Interruption

OK, VIOLATED, BAD_INPUT, INFEASIBLE, NO_PLAN, INTERRUPTED = 0, 1, 2, 3, 4, 130

T = TypeVar("T")
PATH_KINDS: tuple[Literal["exact", "ompl"], ...] = ("exact", "ompl")
UNKNOWN_SPACE: tuple[Literal["blocked", "free", "costlier"], ...] = ("blocked", "free", "costlier")

app = typer.Typer(
    name="react-opt",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Plan how battery-powered robots explore a building against the clock, with a proof of how good the plan is.",
)

Output = Annotated[str | None, typer.Option("-o", "--output", help="File to write, - for standard output.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result itself instead of a table.")]


def main() -> NoReturn:
    """Run the command line; every expected failure is one line on standard error and an exit code."""
    for name in ("stdout", "stderr"):  # closed by the caller: nobody reads what is printed
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
    try:
        code = app(standalone_mode=False)
        sys.stdout.flush()
    except typer.TyperException as error:
        context = getattr(error, "ctx", None)
        where = context.command_path if context else "react-opt"
        print(f"{where}: {error.format_message()}", file=sys.stderr)
        code = BAD_INPUT
    except (InputError, UsageError, MissingPartError) as error:
        print(error, file=sys.stderr)
        code = BAD_INPUT
    except ReactError as error:
        print(f"react-opt: {error}", file=sys.stderr)
        code = NO_PLAN
    except (KeyboardInterrupt, typer.Abort):
        print("interrupted", file=sys.stderr)
        code = INTERRUPTED
    except SystemError as error:  # what a compiled kernel makes of an interrupt
        if not isinstance(error.__cause__, KeyboardInterrupt):
            raise
        print("interrupted", file=sys.stderr)
        code = INTERRUPTED
    except MemoryError:
        print("react-opt: out of memory; nothing was written", file=sys.stderr)
        code = NO_PLAN
    except BrokenPipeError:
        _give_up_on_stdout()
        code = OK
    except OSError as error:  # files have said so already: this is standard output, on a full disk
        _give_up_on_stdout()
        print(f"react-opt: standard output cannot be written: {error.strerror or error}", file=sys.stderr)
        code = BAD_INPUT
    code = code if isinstance(code, int) else OK
    watching = sys.modules.get("react_opt.solvers.watch")
    if watching is not None and watching.left_behind():  # the deadline holds for a solver that does not stop, too
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def _give_up_on_stdout() -> None:
    """Let what is still to be flushed to standard output go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@app.callback(invoke_without_command=True)
def version(
    show: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Plan how battery-powered robots explore a building against the clock, with a proof of how good the plan is."""
    if show:
        import importlib.metadata

        print(importlib.metadata.version("react_opt"))
        raise typer.Exit


@app.command(epilog=examples("build"))
def build(
    map_file: Annotated[str, typer.Argument(metavar="MAP", help="ROS map YAML, or MovingAI .map.")],
    fleet: Annotated[str, typer.Option("--fleet", help="Fleet file (JSON).")],
    cell_m: Annotated[float, typer.Option("--cell-m", help="Side of a cell, m.")] = 10.0,
    horizon_s: Annotated[float, typer.Option("--horizon-s", help="Time to plan for, s.")] = 240.0,
    step_s: Annotated[float, typer.Option("--step-s", help="Length of a step, s.")] = 10.0,
    paths: Annotated[str, typer.Option("--paths", help="Path costs: exact or ompl.")] = "exact",
    unknown: Annotated[str, typer.Option("--unknown", help="Unknown space: blocked, free or costlier.")] = "blocked",
    output: Output = None,
    as_json: AsJson = False,
) -> int:
    """Build an oros instance from a map and a fleet."""
    from react_opt.build import build as build_instance
    from react_opt.geometry import load_map
    from react_opt.jsonio import dumps, load, save
    from react_opt.report.tables import build_table

    report = build_instance(
        load_map(map_file),
        load(fleet, "fleet"),
        cell_m=cell_m,
        horizon_s=horizon_s,
        step_s=step_s,
        paths=_one_of("--paths", paths, PATH_KINDS),
        unknown=_one_of("--unknown", unknown, UNKNOWN_SPACE),
        map_file=map_file,
        fleet_file=fleet,
    )
    if output is not None:
        save(report.instance, output)
    if as_json and output != "-":
        sys.stdout.write(dumps(report.instance))
    elif output is None:
        Console().print(build_table(report.instance))
    for line in [*report.notes, *map(str, report.dropped)]:
        print(line, file=sys.stderr)
    return OK


@app.command(epilog=examples("solve"))
def solve(
    instance_file: Annotated[
        str, typer.Argument(metavar="INSTANCE", help="Instance file (JSON), - for standard input.")
    ],
    output: Output = None,
    as_json: AsJson = False,
    solver: Annotated[
        str | None, typer.Option("--solver", help="Backend, see react-opt solvers.", autocompletion=solvers_begun)
    ] = None,
    method: Annotated[str, typer.Option("--method", help="auto, monolith or routes.")] = "auto",
    time_limit: Annotated[float, typer.Option("--time-limit", help="Seconds from call to answer.")] = 60.0,
    work_limit: Annotated[int | None, typer.Option("--work-limit", help="Counted work, for reproducible runs.")] = None,
    gap: Annotated[float | None, typer.Option("--gap", help="Stop at this gap (a fraction).")] = None,
    threads: Annotated[int | None, typer.Option("--threads", help="Threads, all cores by default.")] = None,
    seed: Annotated[int, typer.Option("--seed", help="Seed of everything random.")] = 0,
    start: Annotated[str | None, typer.Option("--start", help="Plan to start from: never worse than it.")] = None,
    at_step: Annotated[int | None, typer.Option("--at-step", help="Keep the first K steps of that plan.")] = None,
) -> int:
    """Solve an oros, assignment or inspection instance.

    Exit codes: 0 a plan, 2 bad input, 3 proven that no plan exists, 4 no plan found in time, 130 interrupted.
    """
    from react_opt.jsonio import dumps, load, require_writable, save
    from react_opt.planner import solve as solve_instance
    from react_opt.report.live import live_line
    from react_opt.report.tables import claim_line, plan_table

    if instance_file == start == "-":
        raise UsageError("--start: standard input is the instance already")
    instance = _instance(load(instance_file), instance_file)
    given = None if start is None else load(start)
    if output is not None:
        require_writable(output)
    names = {"<data>": instance_file, "<start>": start or ""}
    with _named(names), Interruption() as interruption, live_line() as progress:
        plan = solve_instance(
            instance,
            time_limit_s=time_limit,
            work_limit=work_limit,
            gap=gap,
            solver=solver,
            method=method,
            threads=threads,
            seed=seed,
            start=given,
            at_step=at_step,
            on_progress=progress,
            should_stop=interruption.asked,
        )
    if output is not None:
        save(plan, output)
    if as_json and output != "-":
        sys.stdout.write(dumps(plan))
    elif output is None:
        Console().print(plan_table(instance, plan))
    else:
        print(f"{output}: {claim_line(plan.claim)}", file=sys.stderr)
    if plan.claim.reason:
        print(f"{instance_file}: {plan.claim.reason}", file=sys.stderr)
    if interruption.asked():
        return INTERRUPTED
    return {"optimal": OK, "feasible": OK, "infeasible": INFEASIBLE, "no_plan": NO_PLAN}[plan.claim.status]


@app.command(epilog=examples("check"))
def check(
    instance_file: Annotated[str, typer.Argument(metavar="INSTANCE", help="Instance file (JSON).")],
    plan_file: Annotated[str, typer.Argument(metavar="PLAN", help="Plan file (JSON).")],
    bound: Annotated[bool, typer.Option("--bound", help="Recompute the bound from the certificate.")] = False,
) -> int:
    """Replay a plan (or the trace of a mission) without any solver and print each rule that it breaks.

    Exit codes: 0 the plan is right, 1 it breaks a rule (or belongs to another instance), 2 bad input.
    """
    from react_opt.certify import check as check_plan
    from react_opt.jsonio import load
    from react_opt.report.live import share_bar

    if instance_file == plan_file == "-":
        raise UsageError("PLAN: standard input is the instance already")
    document = load(instance_file)
    plan = load(plan_file)
    if document.kind == "mission" and plan.kind == "trace":
        return _check_trace(document, instance_file, plan, plan_file)
    instance = _instance(document, instance_file)
    if not plan.kind.endswith("_plan"):
        raise InputError.single(plan_file, "kind", f"expected a plan, found {plan.kind!r}")
    with share_bar("recomputing the bound") if bound else contextlib.nullcontext() as progress:
        certificate = check_plan(instance, plan, bound=bound, on_progress=progress)
    for violation in certificate.violations:
        print(f"{plan_file}: {violation}")
    if certificate.ok:
        print(f"{plan_file}: {_verdict(plan, certificate, bound)}")
    return OK if certificate.ok else VIOLATED


@app.command(epilog=examples("simulate"))
def simulate(
    mission_file: Annotated[str, typer.Argument(metavar="MISSION", help="Mission file (JSON), - for standard input.")],
    output: Annotated[str | None, typer.Option("-o", "--output", help="Trace to write, - for standard output.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON instead of a table.")] = False,
    strategy: Annotated[
        str | None, typer.Option("--strategy", help="Instead of the mission's.", autocompletion=strategies_begun)
    ] = None,
    robots: Annotated[int | None, typer.Option("--robots", help="Only the first N robots.")] = None,
    seed: Annotated[int | None, typer.Option("--seed", help="Instead of the mission's.")] = None,
    always_on: Annotated[bool, typer.Option("--always-on", help="Never switch sensors off.")] = False,
    resume: Annotated[str | None, typer.Option("--resume", help="Go on with a trace that was stopped.")] = None,
) -> int:
    """Simulate a mission: robots explore a map that only the simulator knows.

    Exit codes: 0 done, 2 bad input, 130 interrupted (the trace so far is written and can be resumed).
    """
    from react_opt.jsonio import dumps, load, require_writable, save
    from react_opt.report.live import mission_bar
    from react_opt.report.missions import mission_table
    from react_opt.sim.run import simulate as simulate_mission
    from react_opt.sim.run import with_options
    from react_opt.sim.summary import summarise

    if mission_file == resume == "-":
        raise UsageError("--resume: standard input is the mission already")
    mission = with_options(
        load(mission_file, "mission"), strategy=strategy, robots=robots, seed=seed, always_on=always_on
    )
    before = None if resume is None else load(resume, "trace")
    if output is not None:
        require_writable(output)
    folder = Path() if mission_file == "-" else Path(mission_file).parent
    kept = "no trace is kept without -o" if output is None else "the trace so far is written and can be resumed"
    interruption = Interruption(f"stopping the mission; {kept}")
    with _named({"<data>": mission_file}), interruption, mission_bar(mission.horizon_s) as progress:
        trace = simulate_mission(mission, folder, resume=before, on_progress=progress, should_stop=interruption.asked)
    if output is not None:
        save(trace, output)
    if as_json and output != "-":
        sys.stdout.write(dumps(summarise(trace)))
    elif output is None:
        Console().print(mission_table(summarise(trace)))
    return INTERRUPTED if trace.status == "stopped" else OK


@app.command(epilog=examples("show"))
def show(
    files: Annotated[list[str], typer.Argument(metavar="FILE...", help="Any file; two traces make one replay.")],
    output: Annotated[str, typer.Option("-o", "--output", help="Picture (.png, .svg, .pdf) or page (.html) to write.")],
    instance: Annotated[str | None, typer.Option("--instance", help="Instance of a plan, if not beside it.")] = None,
    map_file: Annotated[str | None, typer.Option("--map", help="Occupancy map to draw below.")] = None,
    hide_truth: Annotated[bool, typer.Option("--hide-truth", help="Leave out walls that nobody has seen.")] = False,
    bound: Annotated[bool, typer.Option(help="A trace's proven bound on what can be known; takes seconds.")] = True,
) -> int:
    """Draw a file: an instance, fleet, mission, plan or trace. The page of a trace is its replay."""
    from react_opt.report.show import show as show_files

    for line in show_files(files, output, instance=instance, map_file=map_file, truth=not hide_truth, bound=bound):
        print(line, file=sys.stderr)
    return OK


app.command()(bench)


@app.command(epilog=examples("schema"))
def schema(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help="For instance oros or oros_plan.", autocompletion=kinds_begun)
    ],
) -> int:
    """Print the JSON Schema of a kind of file."""
    from react_opt.jsonio import json_schema

    print(json.dumps(json_schema(kind), indent=2))
    return OK


@app.command(epilog=examples("solvers"))
def solvers() -> int:
    """List the solvers that are installed, with versions and what each can do."""
    from react_opt.report.tables import solvers_table

    Console().print(solvers_table())
    return OK


def _check_trace(mission: Any, mission_file: str, trace: Any, trace_file: str) -> int:
    from react_opt.certify_trace import check_trace
    from react_opt.geometry import load_map

    folder = Path() if mission_file == "-" else Path(mission_file).parent
    certificate = check_trace(mission, trace, load_map(folder / mission.map).cells)
    for violation in certificate.violations:
        print(f"{trace_file}: {violation}")
    if certificate.ok:
        print(f"{trace_file}: ok: {trace.status}, {certificate.objective:.4%} of the coverable area known")
    return OK if certificate.ok else VIOLATED


def _one_of(option: str, value: str, allowed: Sequence[T]) -> T:
    for item in allowed:
        if item == value:
            return item
    raise UsageError(f"{option}: expected one of {', '.join(map(str, allowed))}, found {value!r}")


@contextlib.contextmanager
def _named(files: dict[str, str]) -> Iterator[None]:
    """Say the names of files in faults that were found in data."""
    try:
        yield
    except InputError as error:
        raise InputError([replace(fault, file=files.get(fault.file, fault.file)) for fault in error.faults]) from None


def _instance(document: Any, file: str) -> Any:
    if document.kind == "mission":
        raise InputError.single(file, "kind", "a mission is simulated, not solved: use react-opt simulate")
    if document.kind not in ("oros", "assignment", "inspection"):
        expected = "expected an oros, assignment or inspection instance"
        raise InputError.single(file, "kind", f"{expected}, found {document.kind!r}")
    return document


def _verdict(plan: Any, certificate: Any, bound: bool) -> str:
    claim = plan.claim
    if claim.objective is None:
        return f"ok: claims {claim.status}"
    text = f"ok: {claim.status}, objective {claim.objective:.9g}"
    if bound:
        return f"{text}, bound recomputed {certificate.bound:.9g} (claimed {claim.bound:.9g})"
    return text if claim.bound is None else f"{text}, claimed bound {claim.bound:.9g}"


if __name__ == "__main__":
    sys.argv[0] = Path(sys.argv[0]).name
    main()
