"""Figures of a fleet, a mission, and a mission as it went (a trace)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import Fleet, FleetCharger, Mission
from react_opt.limits.curve import CoverageBound, share_at
from react_opt.report.cellmap import draw_ground, metres
from react_opt.report.colours import GREEN, GREY, INK, ORANGE, PALE
from react_opt.report.style import WIDTH_IN, look, robot_key, shortened, tint
from react_opt.report.tracks import Tracks, extent, known_s, target_states, tracks
from react_opt.trace import Trace

TARGETS = {  # state: marker, colour, filled
    "new": ("o", ORANGE, False),
    "taken": ("o", ORANGE, True),
    "deferred": ("d", GREY, False),
    "postponed": ("D", "#CC79A7", True),
    "abandoned": ("X", "#D55E00", True),
    "inspected": ("P", GREEN, True),
}
_KNOWN = ListedColormap(["#FFFFFF", "#2F2F2F", "#DADADA"])


def fleet_figure(fleet: Fleet | Mission, ground: OccupancyMap | None = None) -> Figure:
    """Return the robots of a fleet or mission where they start, what they draw, and how long a battery lasts."""
    points = [(robot.x_m, robot.y_m) for robot in fleet.robots] + [(each.x_m, each.y_m) for each in fleet.chargers]
    reach = max(fleet.profiles[robot.profile].lidar_range_m for robot in fleet.robots)
    if ground is not None:
        width, height = ground.cols * ground.resolution_m, ground.rows * ground.resolution_m
    else:
        spread = np.ptp(np.array(points), axis=0) + 2 * reach
        width, height = float(spread[0]), float(spread[1])
    map_in = min(max(4.2 * width / height, 2.2), 4.2)
    figure = Figure(figsize=(WIDTH_IN, min(max(map_in * height / width, 2.6), 6.5) + 0.9), layout="constrained")
    sides: Any = figure.subfigures(1, 2, width_ratios=(map_in, WIDTH_IN - map_in))
    axes = sides[0].subplots()
    bars_in = 0.55 * len(dict.fromkeys(robot.profile for robot in fleet.robots)) + 0.3
    rest_in = max(figure.get_figheight() - bars_in - 1.2, 0.1)
    right, blank = sides[1].subplots(2, 1, height_ratios=(bars_in, rest_in))
    blank.set_axis_off()
    figure.suptitle(shortened(fleet.name, 80), x=0.01, ha="left", fontsize=8.5)
    if ground is not None:
        draw_ground(axes, ground)
    for k, robot in enumerate(fleet.robots):
        style, profile = look(k), fleet.profiles[robot.profile]
        reach_disc = Circle((robot.x_m, robot.y_m), profile.lidar_range_m, fill=False, linewidth=0.8)
        reach_disc.set(edgecolor=style.colour, linestyle=style.line)
        axes.add_patch(reach_disc)
        axes.plot(robot.x_m, robot.y_m, marker=style.marker, color=style.colour, markersize=4.5, zorder=5)
        nose = 0.06 * max(min(width, height), 1.0)
        axes.plot(
            [robot.x_m, robot.x_m + nose * np.cos(robot.yaw_rad)],
            [robot.y_m, robot.y_m + nose * np.sin(robot.yaw_rad)], color=style.colour, linewidth=1.2, zorder=5,
        )  # fmt: skip
    _draw_chargers(axes, fleet.chargers)
    if isinstance(fleet, Mission) and ground is not None:
        _draw_areas(axes, ground, fleet.cell_m)
    if isinstance(fleet, Mission) and fleet.link is not None:
        link = fleet.link
        axes.plot(link.x_m, link.y_m, marker="1", markersize=10, color=INK, zorder=5)
        axes.add_patch(Circle((link.x_m, link.y_m), link.range_m, fill=False, linestyle=":", edgecolor=INK))
    metres(axes)
    if ground is not None:
        left, bottom = ground.pixel_to_world((0, 0))
        if ground.origin_yaw_rad == 0:
            axes.set_xlim(left - 0.02 * width, left + 1.02 * width)
            axes.set_ylim(bottom - 0.02 * height, bottom + 1.02 * height)
    handles: list[Line2D | Patch] = []
    for k, robot in enumerate(fleet.robots[:12]):
        key = robot_key(k, f"{robot.id} ({robot.profile})")
        key.set_linestyle("")
        handles.append(key)
    handles.append(Line2D([], [], color=GREY, linewidth=0.8, label="reach of the LiDAR"))
    sides[0].legend(handles=handles, loc="outside lower left", ncols=2)
    _draw_powers(right, fleet)
    return figure


def _draw_chargers(axes: Axes, chargers: tuple[FleetCharger, ...]) -> None:
    for charger in chargers:
        axes.text(
            charger.x_m, charger.y_m, f"charger {charger.power_w:g} W", fontsize=5.5, color="white", ha="center",
            va="center", zorder=6, bbox={"boxstyle": "round,pad=0.3", "facecolor": GREEN, "edgecolor": "none"},
        )  # fmt: skip


def _draw_areas(axes: Axes, ground: OccupancyMap, cell_m: float) -> None:
    left, bottom = ground.pixel_to_world((0, 0))
    right, top = ground.pixel_to_world((ground.cols, ground.rows))
    if ground.origin_yaw_rad != 0 or (right - left) * (top - bottom) > 1e4 * cell_m**2:
        return
    for x in np.arange(np.ceil(left / cell_m), np.floor(right / cell_m) + 1) * cell_m:
        axes.axvline(float(x), color="#9A9A9A", linewidth=0.5, linestyle=(0, (4, 3)), zorder=1)
    for y in np.arange(np.ceil(bottom / cell_m), np.floor(top / cell_m) + 1) * cell_m:
        axes.axhline(float(y), color="#9A9A9A", linewidth=0.5, linestyle=(0, (4, 3)), zorder=1)


def _draw_powers(axes: Axes, fleet: Fleet | Mission) -> None:
    """Draw what each profile draws while exploring, and how long its battery lasts like that."""
    names = list(dict.fromkeys(robot.profile for robot in fleet.robots))
    parts = (("idle", PALE, ""), ("motion", tint(INK, 0.45), ""), ("sensing", "white", "//////"))
    for y, name in enumerate(names):
        profile = fleet.profiles[name]
        begin = 0.0
        for (_, face, hatch), watts in zip(parts, (profile.idle_w, profile.motion_w, profile.sensing_w), strict=True):
            axes.barh(y, watts, left=begin, height=0.5, facecolor=face, edgecolor=INK, hatch=hatch, linewidth=0.6)
            begin += watts
        usable = profile.battery_j - profile.reserve_j
        lasts = f" last {usable / begin:,.0f} s like this" if begin > 0 else ""
        axes.text(
            0, y + 0.33, f"{profile.battery_j / 1000:,.2f} kJ{lasts}, LiDAR {profile.lidar_range_m:g} m",
            fontsize=6.5, va="bottom",
        )  # fmt: skip
    axes.set_yticks(range(len(names)), [shortened(name, 14) for name in names])
    axes.set_ylim(-0.6, len(names) + 0.4)
    axes.set_xlabel("power at full speed with sensors on (W)")
    keys = [Patch(facecolor=face, edgecolor=INK, hatch=hatch, label=label) for label, face, hatch in parts]
    axes.legend(handles=keys, loc="upper left", bbox_to_anchor=(0, -0.45), ncols=3, borderpad=0)


# --- trace ---


def trace_figure(trace: Trace, *, truth: bool = True, bound: CoverageBound | None = None) -> Figure:
    """Return a mission as it went: final map and trajectories, sensors and batteries over time, coverage.

    Parameters
    ----------
    trace
        The mission's record.
    truth
        Whether walls that nobody has seen are drawn, lightly.
    bound
        What any team can have seen at most, by time (:func:`react_opt.limits.curve.coverage_bound`).
    """
    paths = tracks(trace)
    left_m, right_m, bottom_m, top_m = extent(trace)
    count = len(paths.robots)
    rows_in = 0.3 * count + 1.6 + 1.6 + 1.0
    height_in = max(4.8, rows_in)
    share = min(max((height_in - 1.3) * (right_m - left_m) / (top_m - bottom_m) + 0.75, 2.4) / WIDTH_IN, 0.5)
    figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
    figure.suptitle(_trace_title(trace, paths), x=0.01, ha="left", fontsize=8.5)
    parts: Any = figure.subfigures(1, 2, width_ratios=(share, 1 - share))
    left, right = parts
    axes = left.subplots()
    draw_known(axes, trace, truth=truth)
    for k in range(count):
        draw_track(axes, paths, k)
    _draw_targets(axes, trace)
    axes.set_title("trajectories")
    keys: list[Line2D | Patch] = [robot_key(k, name) for k, name in enumerate(paths.robots)]
    states = {state for _, _, state in target_states(trace).values()}
    for state, (marker, colour, filled) in TARGETS.items():
        if state in states:
            keys.append(Line2D([], [], linestyle="", marker=marker, color=colour, markersize=4,
                               markerfacecolor=colour if filled else "white", label=state))  # fmt: skip
    keys.append(Line2D([], [], color=GREY, linewidth=0.6, label="sensors off"))
    left.legend(handles=keys, loc="outside lower left", ncols=2)
    strips, battery, curve = right.subplots(3, 1, sharex=True, height_ratios=(0.3 * count + 0.25, 1.6, 1.6))
    _draw_sensing(strips, trace, paths)
    draw_batteries(battery, paths)
    draw_curve(curve, trace, paths, bound)
    curve.set_xlabel("time (s)")
    return figure


def _trace_title(trace: Trace, paths: Tracks) -> str:
    end = f"{100 * paths.coverage[-1]:.1f} % known after {paths.t_s[-1]:.0f} s" if len(paths.t_s) else "no frames"
    stopped = "" if trace.status == "finished" else ", stopped"
    return f"{shortened(trace.mission.name, 40)}: {trace.mission.strategy}, seed {trace.seed}: {end}{stopped}"


def draw_known(axes: Axes, trace: Trace, *, truth: bool = True) -> None:
    """Draw the map as it was known at the end; unseen walls lightly where ``truth`` is set."""
    values = trace.truth.array("u1") & 3
    seen = ~np.isnan(known_s(trace))
    picture = np.ones((*seen.shape, 4))
    picture[...] = (0.86, 0.86, 0.86, 1)
    if truth:
        picture[values == 1] = (0.74, 0.74, 0.74, 1)
    picture[seen & (values == 1)] = (0.18, 0.18, 0.18, 1)
    picture[seen & (values != 1)] = (1, 1, 1, 1)
    axes.imshow(picture, origin="lower", extent=extent(trace), interpolation="nearest", zorder=0)
    metres(axes)


def draw_track(axes: Axes, paths: Tracks, k: int) -> None:
    """Draw the way of the k-th robot: thick where its sensors were on."""
    style = look(k)
    points = np.stack((paths.x_m[:, k], paths.y_m[:, k]), axis=1)
    there = ~np.isnan(points[:, 0])
    points, on = points[there], paths.sensing[there, k]
    if not len(points):
        return
    segments = np.stack((points[:-1], points[1:]), axis=1)
    for sensing, width in ((True, 1.5), (False, 0.6)):
        chosen = segments[on[1:] == sensing]
        axes.add_collection(LineCollection(list(chosen), colors=style.colour, linewidths=width, zorder=3))
    axes.plot(*points[0], marker=style.marker, markersize=6, markerfacecolor="white", markeredgecolor=style.colour,
              markeredgewidth=1.4, zorder=5)  # fmt: skip
    axes.plot(*points[-1], marker=style.marker, markersize=5, color=style.colour, markeredgecolor="white", zorder=5)


def _draw_targets(axes: Axes, trace: Trace) -> None:
    for x, y, state in target_states(trace).values():
        marker, colour, filled = TARGETS[state]
        axes.plot(
            x, y, marker=marker, markersize=3.2, color=colour, markerfacecolor=colour if filled else "white",
            markeredgewidth=0.7, linestyle="", zorder=4,
        )  # fmt: skip


def _draw_sensing(axes: Axes, trace: Trace, paths: Tracks) -> None:
    for k, _ in enumerate(paths.robots):
        on = np.concatenate(([False], paths.sensing[:, k], [False])).astype(np.int8)
        edges = np.flatnonzero(np.diff(on))
        last = len(paths.t_s) - 1
        bars = [(float(paths.t_s[a]), float(paths.t_s[min(b, last)] - paths.t_s[a])) for a, b in edges.reshape(-1, 2)]
        axes.broken_barh([(float(paths.t_s[0]), float(paths.t_s[-1] - paths.t_s[0]))], (k - 0.3, 0.6), facecolor=PALE)
        axes.broken_barh(bars, (k - 0.3, 0.6), facecolor=look(k).colour)
    axes.set_yticks(range(len(paths.robots)), [shortened(name, 10) for name in paths.robots])
    axes.set_ylim(len(paths.robots) - 0.4, -0.6)
    axes.set_title("sensors on")
    axes.tick_params(axis="y", length=0)


def draw_batteries(axes: Axes, paths: Tracks) -> None:
    """Draw all batteries over time, kJ."""
    for k, name in enumerate(paths.robots):
        style = look(k)
        axes.plot(paths.t_s, paths.battery_j[:, k] / 1000, color=style.colour, linestyle=style.line, linewidth=1.3,
                  label=name)  # fmt: skip
    axes.set_ylim(0, None)
    axes.set_ylabel("battery (kJ)")
    axes.grid(axis="y")


def draw_curve(axes: Axes, trace: Trace, paths: Tracks, bound: CoverageBound | None = None) -> None:
    """Draw the known share of the coverable area over time, its bound, and when the high level was replanned."""
    axes.plot(paths.t_s, 100 * paths.coverage, color=INK, linewidth=1.5)
    axes.fill_between(paths.t_s, 100 * paths.coverage, color=tint(GREY, 0.22), linewidth=0)
    decided = [event.t_s for event in trace.events if event.type == "replan"]
    if decided:
        axes.plot(decided, [2.0] * len(decided), "|", color=INK, markersize=5, label="solver called")
    axes.set_ylim(0, 104)
    axes.set_yticks([0, 25, 50, 75, 100])
    axes.set_ylabel("known (%)")
    axes.grid(axis="y")
    if bound is not None:
        axes.plot(
            paths.t_s, 100 * share_at(bound, paths.t_s), color=INK, linewidth=0.9, linestyle=(0, (4, 2)),
            drawstyle="steps-post", label="at most, any team (proven)",
        )  # fmt: skip
    if decided or bound is not None:
        axes.legend(loc="lower right")
