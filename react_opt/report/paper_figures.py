"""The figures of the paper's evaluation, drawn from traces of one's own missions.

Whoever runs the missions chooses them; here is only how they are drawn. The sensors' share of the energy is the
difference between a mission and the same mission with sensors always on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from react_opt.report.colours import BLUE, GREEN, GREY, INK, ORANGE, PALE, PURPLE, SKY, VERMILLION
from react_opt.report.mission_figure import draw_known, draw_track
from react_opt.report.style import WIDTH_IN, look, robot_key, tint
from react_opt.report.tracks import FloatArray, tracks
from react_opt.trace import Trace

STRATEGY_LOOKS = {
    "oros": (BLUE, "-"),
    "react": (VERMILLION, (0, (5, 1.5))),
    "naive": (GREEN, (0, (6, 1.5, 1, 1.5))),
}
_OTHERS = ((PURPLE, (0, (1.5, 1.2))), (ORANGE, "-"), (SKY, (0, (3, 1, 1, 1))), (INK, ":"))


class Line(NamedTuple):
    """A mission to be drawn as a line: its trace and its name in the legend."""

    trace: Trace
    name: str


class Energy(NamedTuple):
    """What a robot spent, J, with sensors switched off where nothing is new, and with sensors always on."""

    strategy: str
    robots: int
    robot: str
    switched_j: float
    always_on_j: float

    @property
    def saving(self) -> float:
        """Share of the always-on energy that switching saves."""
        return 1 - self.switched_j / self.always_on_j if self.always_on_j > 0 else 0.0


def _look(strategy: str, k: int) -> tuple[str, object]:
    return STRATEGY_LOOKS.get(strategy, _OTHERS[k % len(_OTHERS)])


def battery_and_coverage(lines: Sequence[Line]) -> Figure:
    """Return battery (of all robots together) over time above coverage over time, one line per mission."""
    figure = Figure(figsize=(WIDTH_IN * 0.75, 4.4), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    for k, (trace, name) in enumerate(lines):
        paths = tracks(trace)
        colour, style = _look(trace.mission.strategy, k)
        if trace.mission.always_on:
            colour, style = INK, (0, (1.5, 1.2))
        battery = np.nansum(paths.battery_j, axis=1) / 1000
        upper.plot(paths.t_s, battery, color=colour, linestyle=style, linewidth=1.4, label=name)
        lower.plot(paths.t_s, 100 * paths.coverage, color=colour, linestyle=style, linewidth=1.4)
    upper.set_ylim(0, None)
    upper.set_ylabel("battery (kJ)")
    upper.legend(loc="lower left")
    _coverage_axes(lower)
    upper.grid(axis="y")
    return figure


def strategies_against_each_other(groups: Mapping[int, Sequence[Line]]) -> Figure:
    """Return coverage over time of several strategies, one panel per number of robots."""
    figure = Figure(figsize=(WIDTH_IN, 2.9), layout="constrained")
    panels = figure.subplots(1, len(groups), sharex=True, sharey=True, squeeze=False)[0]
    for axes, (robots, lines) in zip(panels, groups.items(), strict=True):
        for k, (trace, name) in enumerate(lines):
            paths = tracks(trace)
            colour, style = _look(trace.mission.strategy, k)
            axes.plot(paths.t_s, 100 * paths.coverage, color=colour, linestyle=style, linewidth=1.4, label=name)
        _coverage_axes(axes)
        axes.set_title(_count(robots))
    for axes in panels[1:]:
        axes.set_ylabel("")
    panels[-1].legend(loc="lower right")
    return figure


def trajectories(lines: Sequence[Line]) -> Figure:
    """Return the ways driven, one map per mission side by side; thin where sensors were off."""
    figure = Figure(figsize=(WIDTH_IN, 5.4), layout="constrained")
    most = 0
    for axes, (trace, name) in zip(figure.subplots(1, len(lines), squeeze=False)[0], lines, strict=True):
        paths = tracks(trace)
        draw_known(axes, trace)
        for k, _ in enumerate(paths.robots):
            draw_track(axes, paths, k)
        most = max(most, len(paths.robots))
        axes.set_title(name)
    keys = [robot_key(k, f"robot {k + 1}") for k in range(most)]
    for key in keys:
        key.set_linestyle("-")
    keys.append(Line2D([], [], color=GREY, linewidth=0.6, label="sensors off"))
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys))
    return figure


def coverage_by_robots(groups: Mapping[tuple[str, int], Sequence[Trace]]) -> Figure:
    """Return mean and standard deviation of the coverage over time, a panel per strategy, a line per fleet size.

    Parameters
    ----------
    groups
        Traces by strategy and number of robots, one per seed.
    """
    strategies = list(dict.fromkeys(strategy for strategy, _ in groups))
    figure = Figure(figsize=(WIDTH_IN, 2.9), layout="constrained")
    panels = figure.subplots(1, len(strategies), sharex=True, sharey=True, squeeze=False)[0]
    for axes, strategy in zip(panels, strategies, strict=True):
        seeds = 0
        for (name, robots), traces in groups.items():
            if name != strategy:
                continue
            seeds = max(seeds, len(traces))
            times, known = on_common_times(traces)
            mean, spread = 100 * known.mean(axis=0), 100 * known.std(axis=0)
            colour, style, _ = look(robots - 1)
            axes.fill_between(times, mean - spread, mean + spread, color=tint(colour, 0.25), linewidth=0, zorder=1)
            axes.plot(times, mean, color=colour, linestyle=style, linewidth=1.4, label=_count(robots), zorder=2)
        _coverage_axes(axes)
        axes.set_title(f"{strategy}: " + ("one run" if seeds == 1 else f"mean ± standard deviation of {seeds} runs"))
    for axes in panels[1:]:
        axes.set_ylabel("")
    panels[-1].legend(loc="lower right")
    return figure


def on_common_times(traces: Sequence[Trace]) -> tuple[FloatArray, FloatArray]:
    """Return times, s, and the coverage of each trace at them; a mission that has ended keeps its coverage."""
    all_ = [tracks(trace) for trace in traces]
    last = max(float(paths.t_s[-1]) for paths in all_)
    times = np.arange(0.0, last + 0.5, 1.0)
    rows = [paths.coverage[np.searchsorted(paths.t_s, times + 1e-9, side="right") - 1] for paths in all_]
    return times, np.array(rows)


def energies(pairs: Sequence[tuple[Trace, Trace]]) -> list[Energy]:
    """Return what every robot spent in missions with switching and in the same missions with sensors always on."""
    rows = []
    for switched, always in pairs:
        one, other = tracks(switched), tracks(always)
        for k, name in enumerate(one.robots):
            spent = [float(paths.battery_j[0, k] - paths.battery_j[-1, k]) for paths in (one, other)]
            rows.append(Energy(switched.mission.strategy, len(one.robots), name, *spent))
    return rows


def energy_table(rows: Sequence[Energy]) -> str:
    """Return the energies as a Markdown table."""
    lines = [
        "| strategy | robots | robot | switched off, J | always on, J | saved, J | saved |",
        "|---|--:|---|--:|--:|--:|--:|",
    ]
    for row in rows:
        saved = row.always_on_j - row.switched_j
        lines.append(
            f"| {row.strategy} | {row.robots} | {row.robot} | {row.switched_j:.0f} | {row.always_on_j:.0f} "
            f"| {saved:.0f} | {row.saving:.1%} |"
        )
    return "\n".join(lines) + "\n"


def energy_figure(rows: Sequence[Energy]) -> Figure:
    """Return the energies as bars: switched off where nothing is new beside always on."""
    figure = Figure(figsize=(WIDTH_IN, 2.8), layout="constrained")
    axes = figure.subplots()
    for k, row in enumerate(rows):
        axes.bar(k - 0.2, row.switched_j / 1000, 0.38, color=_look(row.strategy, 0)[0], linewidth=0)
        axes.bar(k + 0.2, row.always_on_j / 1000, 0.38, facecolor=PALE, edgecolor=GREY, hatch="//////", linewidth=0.6)
        axes.text(k, max(row.switched_j, row.always_on_j) / 1000, f"{row.saving:.0%}", ha="center", va="bottom")
    axes.set_xticks(range(len(rows)), [f"{row.strategy}\n{row.robots}: {row.robot}" for row in rows], fontsize=6)
    axes.set_ylabel("energy (kJ)")
    axes.set_title("energy per robot: plain, sensors off where nothing is new; hatched, always on; number, saving")
    axes.grid(axis="y")
    axes.margins(y=0.1)
    return figure


def _coverage_axes(axes: Axes) -> None:
    axes.set_ylim(0, 103)
    axes.set_yticks([0, 25, 50, 75, 100])
    axes.set_ylabel("known (%)")
    axes.set_xlabel("time (s)")
    axes.grid(axis="y")


def _count(robots: int) -> str:
    return f"{robots} robot" if robots == 1 else f"{robots} robots"
