"""Chapters of the report: where we lose, every instance, what was refused, certificates, scaling, path costs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks import figures, measures, page
from benchmarks.verdicts import case_of, confirmation, is_right, meetings, truths_of

Run = Mapping[str, Any]
MARGIN, LEAST_S = 1.2, 0.05  # what counts as faster: a fifth, and more than a twentieth of a second


def losses(runs: Sequence[Run], wrong: set[tuple[str, str]], ours: str) -> list[page.Block]:
    """Return every instance on which another solver did better than ours, and how."""
    rows, truths = [], truths_of(runs)
    for group in meetings(runs):
        mine = next((run for run in group if run["peer"] == ours), None)
        if mine is None:
            continue
        truth = truths[case_of(group[0])]
        solved = measures.is_solved(mine, wrong)
        if not measures.has_best(mine, truth) and truth.best is not None:
            found = f"{mine['objective']:.6g}" if is_right(mine) else "no plan"
            rows.append([mine["instance"], "worse plan", f"{found} against {truth.best:.6g} of {truth.by}"])
        for other in group:
            if other is mine or not measures.is_solved(other, wrong):
                continue
            if not solved:
                text = (
                    f"{other['peer']} in {other['wall_s']:.2f} s; ours ended {mine['status']} at {mine['limit_s']:g} s"
                )
                rows.append([mine["instance"], "not solved", text])
            elif mine["wall_s"] > MARGIN * other["wall_s"] and mine["wall_s"] - other["wall_s"] > LEAST_S:
                text = f"{mine['wall_s']:.2f} s against {other['wall_s']:.2f} s of {other['peer']}"
                rows.append([mine["instance"], "slower", text])
    if not any(run["peer"] == ours for run in runs):
        return []
    if not rows:
        return [page.Text(f"Where {ours} loses: nowhere on these instances.")]
    return [page.Table(["instance", "loss", "how"], rows, f"Where {ours} loses, every case:")]


def details(runs: Sequence[Run], wrong: set[tuple[str, str]]) -> list[page.Block]:
    """Return a table of all instances: the best plan and bound, and each solver's time, or gap at the limit."""
    peers = list(dict.fromkeys(run["peer"] for run in runs))
    rows, truths = [], truths_of(runs)
    for group in meetings(runs):
        truth = truths[case_of(group[0])]
        known = {run["peer"]: run for run in group}
        state = "infeasible" if truth.infeasible else "optimal" if truth.optimal else "open"
        rows.append([
            group[0]["instance"], "-" if truth.best is None else f"{truth.best:.9g}",
            "-" if truth.bound is None else f"{truth.bound:.9g}", state,
            *(_cell(known.get(peer), wrong) for peer in peers),
        ])  # fmt: skip
    text = (
        "Every instance: seconds where solved, else what there was at the limit: the proven gap, 'plan' without a "
        "bound, 'none', or how it ended; blank where a solver was not run."
    )
    return [page.Table(["instance", "best plan", "bound", "state", *peers], rows, text)]


def _cell(run: Run | None, wrong: set[tuple[str, str]]) -> str:
    if run is None:
        return ""
    if (run["peer"], run["instance"]) in wrong:
        return "WRONG"
    if measures.is_solved(run, wrong):
        return f"{run['wall_s']:.2f}"
    gap = measures.gap_of(run)
    if is_right(run):
        return "plan" if gap is None else "gap > 100 %" if gap > 1 else f"gap {100 * gap:.2g} %"
    return "none" if run["status"] == "no_plan" else str(run["status"])


def refusals(runs: Sequence[Run]) -> list[page.Block]:
    """Return which solvers could not run on which instances, and what they said."""
    said = Counter((run["peer"], str(run["reason"])[:160]) for run in runs if run["status"] not in ANSWERS)
    rows = [[peer, str(count), text] for (peer, text), count in sorted(said.items())]
    return [page.Table(["solver", "runs", "why there is no answer"], rows, "Runs without an answer:")] if rows else []


ANSWERS = ("optimal", "feasible", "infeasible", "no_plan")


def certificates(runs: Sequence[Run]) -> list[page.Block]:
    """Return how many bounds were recomputed from their certificates, and with what result."""
    counts = Counter((run["peer"], confirmation(run)) for run in runs if run.get("bound") is not None)
    peers = sorted({peer for peer, what in counts if what != "none"})
    if not peers:
        return []
    kinds = ("confirmed", "partly", "refuted", "not recomputed", "none")
    rows = [[peer, *(str(counts[peer, kind]) for kind in kinds)] for peer in peers]
    text = (
        "Bounds recomputed by the independent checker from the certificate of the claim. Partly: the certificate "
        "proves a weaker bound, and the claim says what else it rests on. None: no certificate was handed in."
    )
    return [page.Heading("Certificates"), page.Table(["solver", *kinds], rows, text)]


def scaling_table(series: Sequence[Run], wrong: set[tuple[str, str]], axis: str) -> page.Table:
    """Return time and memory along what grows, with the fitted exponents in the last row."""
    peers = list(dict.fromkeys(run["peer"] for run in series))
    sizes = sorted({run["size"][axis] for run in series if "size" in run})
    at = {(run["peer"], run["size"][axis]): run for run in series if "size" in run}
    rows = []
    for size in sizes:
        row = [str(size)]
        for peer in peers:
            run = at.get((peer, size))
            solved = run is not None and measures.is_solved(run, wrong)
            row.append("" if run is None else f"{run['wall_s']:.2f}" if solved else f">{run['limit_s']:g}")
            row.append("" if run is None or not run.get("memory_mb") else f"{run['memory_mb']:.0f}")
        rows.append(row)
    last = ["exponent"]
    for peer in peers:
        mine = [run for run in series if run["peer"] == peer and "size" in run]
        for field in ("wall_s", "memory_mb"):
            good = [r for r in mine if r.get(field) and (field == "memory_mb" or measures.is_solved(r, wrong))]
            values = [float(r[field]) - figures.base(r, field) for r in good]
            fit = measures.exponent([r["size"][axis] for r in good], values)
            last.append("-" if fit is None else f"{fit[0]:.2f} ({len(good)}/{len(mine)})")
    headings = [axis, *(f"{peer} {unit}" for peer in peers for unit in ("s", "MB"))]
    text = (
        f"Along {axis}: time to a certified gap of 1 % (> limit where unsolved) and largest resident memory. Exponents "
        "are fitted to the runs counted behind them: times of solved runs only, so that a series with unsolved runs "
        "grows faster than its exponent says; memory above what loaded libraries take."
    )
    return page.Table(headings, [*rows, last], text)


def path_table(runs: Sequence[Run]) -> list[page.Block]:
    """Return time and quality of cost matrices."""
    if not runs:
        return []
    rows = []
    for run in runs:
        budget = ", ".join(f"{value} {key}" for key, value in run["parameters"].items()) or "-"
        head = [f"{run['resolution_m']:g} m", str(run["points"]), run["peer"], budget]
        if "matrix_s" not in run:
            rows.append([*head, str(run["status"]), "", "", "", "", ""])
            continue
        rows.append([
            *head, f"{1000 * run['prepare_s']:.1f}", f"{1000 * run['matrix_s']:.1f}",
            f"{run['missing']}/{run['pairs']}", _ratio(run["length_mean"]), _ratio(run["length_worst"]),
            _ratio(run["time_mean"]),
        ])  # fmt: skip
    headings = [
        "map", "points", "method", "budget", "prepare ms", "matrix ms", "missing", "length", "worst", "drive time",
    ]  # fmt: skip
    text = (
        "Cost matrices on the factory: lengths and driving times are ratios to exact any-angle shortest paths (mean "
        "and worst over the pairs found). Single-query planners search once per pair; PRMstar reuses one roadmap."
    )
    return [page.Heading("Path costs"), page.Table(headings, rows, text)]


def _ratio(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"
