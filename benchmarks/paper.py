"""The paper's figures on the project's own factory, from missions simulated here and now.

Run ``python benchmarks/paper.py -o FOLDER``. Traces that are in the folder already, of the same missions, are taken
as they are, so a run that was stopped goes on. Battery and coverage over time (one robot; OROS, REACT, and REACT with
sensors always on), REACT against Naive, trajectories of one and three robots, coverage with one to four robots as mean
and standard deviation, and the energy table.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

from react_opt import InputError, load, save
from react_opt.instance import Mission, canonical
from react_opt.jsonio import write_bytes, write_text
from react_opt.sim.run import simulate, with_options
from react_opt.trace import Trace

FACTORY = Path(__file__).resolve().parent.parent / "examples" / "factory"


class Run(NamedTuple):
    """One mission of the campaign."""

    strategy: str
    robots: int
    seed: int
    always_on: bool = False

    @property
    def name(self) -> str:
        """Name of the trace's file."""
        return f"{self.strategy}_{self.robots}_seed{self.seed}{'_always_on' if self.always_on else ''}.json"

    def mission(self) -> Mission:
        """Return the mission."""
        mission: Mission = load(FACTORY / f"mission_{self.robots}.json", "mission")
        return with_options(mission, strategy=self.strategy, seed=self.seed, always_on=self.always_on)


def runs(seeds: int, most: int) -> list[Run]:
    """Return what is to be simulated: ``seeds`` missions per point, fleets of one to ``most`` robots."""
    fleets = range(1, most + 1)
    main = [Run(strategy, n, seed) for strategy in ("oros", "react") for n in fleets for seed in range(1, seeds + 1)]
    naive = [Run("naive", n, 1) for n in (1, min(3, most))]
    always = [Run(strategy, n, 1, True) for strategy in ("oros", "react") for n in range(1, min(3, most) + 1)]
    return list(dict.fromkeys([*main, *naive, *always]))


def trace_of(run: Run, folder: Path) -> Trace:
    """Return the trace of a run: from its file where that holds this very mission, else simulated and written."""
    mission, file = run.mission(), folder / run.name
    if file.exists():
        try:
            before: Trace = load(file, "trace")
        except InputError:  # of an older format: simulated anew
            pass
        else:
            if before.status == "finished" and canonical(before.mission) == canonical(mission):
                return before
    trace = simulate(mission, FACTORY)
    save(trace, file)
    return trace


def _simulated(run: Run, folder: Path) -> str:
    trace = trace_of(run, folder)
    return f"{run.name}: {trace.frames[-1].coverage:.1%} known after {trace.frames[-1].t_s:g} s"


def draw(traces: dict[Run, Trace], folder: Path, suffix: str) -> list[Path]:
    """Write all figures and the energy table; return the files."""
    import matplotlib

    from react_opt.report import paper_figures as paper
    from react_opt.report.style import RC, render

    most = max(run.robots for run in traces)
    three = min(3, most)
    by_group: dict[tuple[str, int], list[Trace]] = {}
    for run, trace in traces.items():
        if run.strategy in ("oros", "react") and not run.always_on:
            by_group.setdefault((run.strategy, run.robots), []).append(trace)
    pairs = [(traces[run._replace(always_on=False)], trace) for run, trace in traces.items() if run.always_on]
    single = [
        paper.Line(traces[Run("oros", 1, 1)], "OROS"),
        paper.Line(traces[Run("react", 1, 1)], "REACT"),
        paper.Line(traces[Run("react", 1, 1, True)], "REACT, sensors always on"),
    ]
    against = {
        n: [paper.Line(traces[Run("react", n, 1)], "REACT"), paper.Line(traces[Run("naive", n, 1)], "Naive")]
        for n in dict.fromkeys((1, three))
    }
    driven = [
        paper.Line(traces[Run("react", n, 1)], f"REACT, {n} robot{'s' if n > 1 else ''}")
        for n in dict.fromkeys((1, three))
    ]
    rows = paper.energies(pairs)
    files = []
    with matplotlib.rc_context(RC):
        for name, figure in (
            ("battery_and_coverage", paper.battery_and_coverage(single)),
            ("react_and_naive", paper.strategies_against_each_other(against)),
            ("trajectories", paper.trajectories(driven)),
            ("coverage_by_robots", paper.coverage_by_robots(by_group)),
            ("energy", paper.energy_figure(rows)),
        ):
            files.append(folder / f"{name}{suffix}")
            write_bytes(render(figure, suffix[1:]), files[-1])
    files.append(folder / "energy.md")
    write_text(paper.energy_table(rows), files[-1])
    return files


def main(arguments: Sequence[str] | None = None) -> None:
    """Simulate what is missing and draw."""
    parser = argparse.ArgumentParser(description="The paper's figures on the project's own factory.")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for traces and figures")
    parser.add_argument("--seeds", type=int, default=5, help="missions per point of the coverage curves")
    parser.add_argument("--most-robots", type=int, default=4, choices=(1, 2, 3, 4), help="largest fleet")
    parser.add_argument("--suffix", default=".svg", choices=(".svg", ".png", ".pdf"), help="kind of picture")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="missions at a time")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    wanted = runs(options.seeds, options.most_robots)
    folder = options.output
    if options.workers > 1:
        with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
            for line in pool.map(_simulated, wanted, [folder] * len(wanted)):
                print(line, file=sys.stderr)
    else:
        for run in wanted:
            print(_simulated(run, folder), file=sys.stderr)
    traces = {run: trace_of(run, folder) for run in wanted}
    for file in draw(traces, folder, options.suffix):
        print(file)


if __name__ == "__main__":
    main()
