"""Pictures of a benchmark: colour-blind safe, a marker and a line style per solver, units on every axis."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import measures
from benchmarks.verdicts import case_of, is_right, meetings, truths_of

# Okabe and Ito's palette, which all common kinds of colour vision tell apart, and two more.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000", "#7F7F7F", "#8C510A", "#999933")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">")
DASHES = (
    "-",
    "--",
    "-.",
    ":",
    (0, (5, 1)),
    (0, (3, 1, 1, 1)),
    (0, (1, 1)),
    (0, (7, 2, 1, 2)),
    (0, (9, 2)),
    (0, (2, 2)),
)
KNOWN = (
    "react_opt", "highs", "cp-sat", "scip", "cbc", "glpk", "pyvrp", "or-routing", "nearest_first", "scipy",
)  # fmt: skip
Run = Mapping[str, Any]
FloatArray = NDArray[np.float64]


def style(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return colour, marker and line style of each solver or method; known solvers look the same in every picture."""
    free = [k for k, name in enumerate(KNOWN) if name not in names] or list(range(len(KNOWN)))
    others = sorted(name for name in names if name not in KNOWN)
    place = {name: KNOWN.index(name) for name in names if name in KNOWN}
    place |= {name: free[k % len(free)] for k, name in enumerate(others)}
    return {
        name: {"color": COLOURS[k], "marker": MARKERS[k], "linestyle": DASHES[k]} for name, k in place.items()
    }  # fmt: skip


def profiles(runs: Sequence[Run], wrong: set[tuple[str, str]], kind: str) -> bytes | None:
    """Return performance profiles of the solvers that met on the same instances, None where none did."""
    lines = measures.profile(runs, wrong)
    if not lines or not max(len(values) for values in lines.values()):
        return None
    plt = _pyplot()
    figure, axes = plt.subplots(figsize=(7.5, 4.5))
    count = len(next(iter(lines.values())))
    finite = [values[np.isfinite(values)] for values in lines.values()]
    most = max(2.0, 1.3 * max((values.max() for values in finite if values.size), default=2.0))
    looks = style(list(lines))
    for peer, values in sorted(lines.items(), key=lambda item: item[0] != "react_opt"):
        good = values[np.isfinite(values)]
        x = np.concatenate([[1.0], np.repeat(good, 2), [most]])
        steps = np.arange(len(good) + 1) / count
        y = np.concatenate([np.repeat(steps, 2)])
        axes.plot(x, 100 * y, label=f"{peer} ({len(good)} of {count} solved)", lw=2, **{**looks[peer], "marker": ""})
    axes.set_xscale("log")
    axes.set_xlim(1.0, most)
    axes.set_ylim(-2, 102)
    ticks = [value for value in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 10_000) if value <= most]
    axes.set_xticks(ticks)
    axes.set_xlabel("time as a multiple of the fastest solver's (log scale)")
    axes.xaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(plt.NullFormatter())
    axes.set_ylabel("instances solved within it, %")
    axes.set_title(f"{kind}: performance profile over {count} instances")
    return _finished(figure, axes)


def over_time(runs: Sequence[Run], wrong: set[tuple[str, str]], kind: str, what: str) -> bytes | None:
    """Return the mean gap over time of each solver on the instances that all of them met.

    Parameters
    ----------
    runs, wrong, kind
        The runs of one kind of instance, and those that are exposed.
    what
        ``proven`` (between plan and bound) or ``primal`` (between plan and the best known plan; the area under the
        line is the primal integral).
    """
    groups, truths = meetings(runs), truths_of(runs)
    limit = max(float(run["limit_s"]) for group in groups for run in group)
    at_s = np.geomspace(0.01, limit, measures.GAP_POINTS)
    sums: dict[str, list[FloatArray]] = {}
    for group in groups:
        best = truths[case_of(group[0])].best
        if best is None:
            continue
        for run in group:
            if what == "proven":
                gaps = measures.gap_over_time(run, at_s, wrong)
            else:
                gaps = np.ones(len(at_s))
                for t, incumbent, _ in run.get("trajectory", []) if is_right(run) else []:
                    if incumbent is not None:
                        gaps[at_s >= t] = np.minimum(gaps[at_s >= t], measures.primal_gap(incumbent, best))
            sums.setdefault(run["peer"], []).append(gaps)
    if what == "proven":  # solvers that prove nothing have no such line
        sums = {peer: gaps for peer, gaps in sums.items() if np.min(gaps) < 1.0}
    if not sums:
        return None
    plt = _pyplot()
    figure, axes = plt.subplots(figsize=(7.5, 4.5))
    looks = style(list(sums))
    for peer, found in sorted(sums.items(), key=lambda item: item[0] != "react_opt"):
        mean = 100 * np.mean(found, axis=0)
        axes.plot(at_s, mean, label=peer, lw=2, markevery=8, ms=5, drawstyle="steps-post", **looks[peer])
    axes.set_xscale("log")
    axes.set_xlim(at_s[0], limit)
    axes.set_ylim(-2, 102)
    axes.set_xlabel("wall time, s (log scale)")
    against = "plan and proven bound" if what == "proven" else "plan and best known plan"
    axes.set_ylabel(f"mean gap between {against}, %")
    count = len(next(iter(sums.values())))
    axes.set_title(f"{kind}: {'proven' if what == 'proven' else 'primal'} gap over time, mean of {count} instances")
    return _finished(figure, axes)


def scaling(series: Sequence[Run], wrong: set[tuple[str, str]], axis: str) -> bytes | None:
    """Return time and memory along what grows, with the fitted exponent of each solver."""
    plt = _pyplot()
    figure, pair = plt.subplots(1, 2, figsize=(10.5, 4.2))
    looks = style(list(dict.fromkeys(run["peer"] for run in series)))
    for peer in sorted(looks, key=lambda name: name != "react_opt"):
        mine = sorted((run for run in series if run["peer"] == peer and "size" in run), key=lambda r: r["size"][axis])
        good = [run for run in mine if measures.is_solved(run, wrong)]
        open_ = [run for run in mine if not measures.is_solved(run, wrong)]
        for axes, field in zip(pair, ("wall_s", "memory_mb"), strict=True):
            measured = mine if field == "memory_mb" else good
            measured = [run for run in measured if run.get(field)]
            x, y = [run["size"][axis] for run in measured], [float(run[field]) for run in measured]
            fit = measures.exponent(x, [value - base(run, field) for value, run in zip(y, measured, strict=True)])
            text = peer if fit is None else f"{peer}: exponent {fit[0]:.2f} ({len(measured)} of {len(mine)})"
            drawn = {run["size"][axis]: float(run[field]) for run in measured}  # a line stops where a run is unsolved
            line = [(run["size"][axis], drawn.get(run["size"][axis], math.nan)) for run in mine]
            axes.plot(*zip(*line, strict=True), label=text, lw=2, ms=6, **looks[peer])
            if fit is not None and field == "wall_s":
                axes.plot(x, [fit[1] * size ** fit[0] for size in x], lw=1, color=looks[peer]["color"], alpha=0.6)
        if open_:
            x = [run["size"][axis] for run in open_]
            y = [run["limit_s"] for run in open_]
            pair[0].scatter(
                x, y, s=60, facecolors="none", edgecolors=looks[peer]["color"], marker=looks[peer]["marker"]
            )
    for axes, text in zip(pair, ("wall time to a gap of 1 %, s", "largest resident memory, MB"), strict=True):
        axes.set_xscale("log")
        axes.set_yscale("log")
        sizes = sorted({run["size"][axis] for run in series if "size" in run})
        axes.set_xticks(sizes, [str(size) for size in sizes])
        axes.xaxis.set_minor_locator(plt.NullLocator())
        axes.yaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
        if axes is pair[1]:
            axes.yaxis.set_minor_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
        axes.set_xlabel(f"{axis} (log scale)")
        axes.set_ylabel(f"{text} (log scale)")
    pair[0].set_title(f"time along {axis}; thin: fit; hollow: unsolved, at the limit", fontsize=10)
    pair[1].set_title(f"memory along {axis}; fitted above what the libraries take", fontsize=10)
    return _finished(figure, *pair)


def base(run: Run, field: str) -> float:
    """Return what is not to be fitted: the memory that loaded libraries take before the solve, MB."""
    return 0.0 if field == "wall_s" else min(float(run.get("base_mb", 0.0)), 0.98 * float(run[field]))


def path_costs(runs: Sequence[Run]) -> bytes | None:
    """Return length against time of cost matrices, one panel per resolution and number of points."""
    groups = sorted({(-run["resolution_m"], run["points"]) for run in runs})
    if not groups:
        return None
    plt = _pyplot()
    columns = min(3, len(groups))
    rows = -(-len(groups) // columns)
    size = (3.9 * columns, 3.6 * rows + 0.6)
    figure, panels = plt.subplots(rows, columns, figsize=size, squeeze=False, sharex=True, sharey=True)
    looks = style(sorted({run["peer"] for run in runs}))
    for panel in panels.flat[len(groups) :]:
        panel.set_visible(False)
    for (minus_m, points), axes in zip(groups, panels.flat, strict=False):
        for run in runs:
            if (-run["resolution_m"], run["points"]) == (minus_m, points) and run.get("length_mean"):
                look = looks[run["peer"]]
                spent_s = run["prepare_s"] + run["matrix_s"]
                longer = max(100 * (run["length_mean"] - 1.0), 1e-3)
                face = "none" if run["missing"] else look["color"]
                axes.scatter(
                    spent_s, longer, edgecolors=look["color"], facecolors=face, marker=look["marker"], s=45,
                    label=run["peer"],
                )  # fmt: skip
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(plt.NullFormatter())
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("prepare and matrix, s (log scale)")
        axes.set_title(f"{points} points, {-minus_m:g} m", fontsize=10)
        axes.grid(True, which="major", alpha=0.3)
    for row in panels:
        row[0].set_ylabel("mean excess length, %\n(log; exact at the foot; hollow: pairs missing)")
    entries: dict[str, Any] = {}
    for axes in panels.flat:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    figure.legend(entries.values(), entries.keys(), loc="lower center", ncols=min(5, len(entries)), frameon=False)
    figure.tight_layout(rect=(0, 0.12 if rows == 1 else 0.08, 1, 1))
    return _png(figure)


def _pyplot() -> Any:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt


def _finished(figure: Any, *panels: Any) -> bytes:
    for axes in panels:
        axes.grid(True, which="major", alpha=0.3)
        axes.legend(fontsize=9, framealpha=0.9, edgecolor="none")
    figure.tight_layout()
    return _png(figure)


def _png(figure: Any) -> bytes:
    import matplotlib.pyplot as plt

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130, metadata={"Software": None})
    plt.close(figure)
    return buffer.getvalue()
