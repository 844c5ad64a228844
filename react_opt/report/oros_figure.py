"""Figures of the high level: an OROS instance, and a plan with or without its instance."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import OrosInstance
from react_opt.plan import Claim, OrosPlan
from react_opt.report.cellmap import draw_cells
from react_opt.report.claimtext import claim_text
from react_opt.report.colours import GREY, INK
from react_opt.report.layout import layout
from react_opt.report.style import WIDTH_IN, look, robot_key, shortened, tint
from react_opt.report.timeline import draw_battery, draw_coverage, draw_strip, strip_key

MOST_STRIPS = 12


def instance_figure(instance: OrosInstance, ground: OccupancyMap | None = None) -> Figure:
    """Return the map of an instance: cells, passages, walls, robots and chargers."""
    width, height = _extent(instance, ground)
    scale = min(6.4 / width, 7.0 / height)
    figure = Figure(figsize=(max(4.2, width * scale + 1.9), max(3.0, height * scale + 1.0)), layout="constrained")
    axes = figure.subplots()
    draw_cells(axes, instance, None, ground)
    axes.set_title(shortened(instance.name, 60))
    horizon_s = instance.horizon_steps * instance.step_s
    keys: list[Line2D | Patch] = [
        robot_key(k, f"{robot.id}: {robot.battery_j / 1000:.2f} kJ") for k, robot in enumerate(instance.robots)
    ]
    for key in keys:
        if isinstance(key, Line2D):
            key.set(linestyle="", markerfacecolor="white", markeredgewidth=1.4, markersize=6)
    if layout(instance.cells) is not None:
        keys.append(Line2D([], [], label="no passage", color=INK, linewidth=1.8 if ground is None else 0.9))
    if any(cell.explored for cell in instance.cells):
        keys.append(Patch(facecolor=tint(GREY, 0.2), label="known"))
    figure.legend(
        handles=keys, loc="outside right upper", title=f"{len(instance.cells)} cells\n{horizon_s:g} s in "
        f"{instance.horizon_steps} steps\n", alignment="left",
    )  # fmt: skip
    return figure


def plan_figure(plan: OrosPlan, instance: OrosInstance | None = None, ground: OccupancyMap | None = None) -> Figure:
    """Return a plan: its map, a timeline per robot above its battery, and the coverage curve with its limit.

    Without its instance a plan has no places and no seconds: instead of the map, the cells are listed in the
    order of their first visit and the robots are lines through them.

    Parameters
    ----------
    plan
        The plan.
    instance
        Its instance, where it is known.
    ground
        An occupancy map to draw below the cells.
    """
    if not plan.robots:
        return _claim_figure(plan.claim, plan.instance.name)
    shown = plan.robots[:MOST_STRIPS]
    width, height = (1.0, 2.0) if instance is None else _extent(instance, ground)
    tall = height >= 0.8 * width
    parts: Any
    rows_in = 0.95 * len(shown) + 1.5
    if tall:
        figure = Figure(figsize=(WIDTH_IN, max(4.6, min(rows_in + 0.9, 12))), layout="constrained")
        share = 0.42
        if instance is not None:
            share = min(max((figure.get_figheight() - 1.2) * width / height + 0.75, 1.6) / WIDTH_IN, 0.45)
        parts = figure.subfigures(1, 2, width_ratios=(share, 1 - share))
    else:
        map_in = min(WIDTH_IN * height / width, 6.0) + 0.9
        figure = Figure(figsize=(WIDTH_IN, map_in + rows_in + 0.6), layout="constrained")
        parts = figure.subfigures(2, 1, height_ratios=(map_in, rows_in))
    left, right = parts
    figure.suptitle(
        f"{shortened(plan.instance.name, 60)}: {claim_text(plan.claim)}", x=0.01, ha="left", fontsize=8.5,
    )  # fmt: skip
    axes = left.subplots()
    if instance is None:
        _draw_visits(axes, plan)
    else:
        draw_cells(axes, instance, plan, ground)
    axes.set_title("cells by first visit" if instance is None else "who explores what, when")
    keys = [robot_key(k, robot.id) for k, robot in enumerate(plan.robots)]
    left.legend(handles=keys, loc="outside lower left", ncols=min(4, len(keys)) if tall else 8)
    _draw_strips(right, plan, instance, len(shown))
    return figure


def _draw_strips(figure: Any, plan: OrosPlan, instance: OrosInstance | None, count: int) -> None:
    heights = [0.32, 1.0] * count + [1.35]
    rows = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    step_s = 1.0 if instance is None else instance.step_s
    given = {} if instance is None else {robot.id: robot for robot in instance.robots}
    for k, robot in enumerate(plan.robots[:count]):
        draw_strip(rows[2 * k], robot, k, step_s)
        data = given.get(robot.id)
        limits = (None, None) if data is None else (data.capacity_j, data.reserve_j)
        draw_battery(rows[2 * k + 1], robot, k, step_s, *limits)
    charging = any(step.charging_j > 0 for robot in plan.robots for step in robot.steps)
    rows[0].legend(
        handles=strip_key(charging=charging), loc="lower right", bbox_to_anchor=(1, 1.05), ncols=4,
        handlelength=1.2, columnspacing=1.2, borderaxespad=0,
    )  # fmt: skip
    if instance is not None:
        draw_coverage(rows[-1], instance, plan)
    else:
        _draw_count(rows[-1], plan)
    hidden = len(plan.robots) - count
    if hidden:
        rows[-1].set_title(f"{hidden} more robots not drawn above", fontsize=7)


def _draw_count(axes: Axes, plan: OrosPlan) -> None:
    last = max(step.t for robot in plan.robots for step in robot.steps)
    times = list(range(last + 1))
    counts = [sum(each.step <= t for each in plan.explored) for t in times]
    axes.fill_between(times, counts, step="post", color=tint(GREY, 0.22), linewidth=0)
    axes.step(times, counts, where="post", color=INK, linewidth=1.5)
    axes.set_ylim(0, max(counts[-1], 1) * 1.08)
    axes.set_ylabel("newly explored\n(cells)")
    axes.set_xlabel("time (steps)")
    axes.grid(axis="y")


def _draw_visits(axes: Axes, plan: OrosPlan) -> None:
    """Draw the robots as lines through the cells, which are listed in the order of their first visit."""
    first: dict[str, int] = {}
    for t, cell in sorted((step.t, step.cell) for robot in plan.robots for step in robot.steps if step.cell):
        first.setdefault(cell, t)
    row = {cell: k for k, cell in enumerate(first)}
    for k, robot in enumerate(plan.robots):
        style = look(k)
        at = [(step.t, row[step.cell] + 0.12 * (k - (len(plan.robots) - 1) / 2)) for step in robot.steps if step.cell]
        axes.plot(*zip(*at, strict=True), color=style.colour, linestyle=style.line, linewidth=1.3)
        found = [
            (step.t, y) for step, (_, y) in zip((s for s in robot.steps if s.cell), at, strict=True) if step.sensing
        ]
        if found:
            axes.plot(
                *zip(*found, strict=True), linestyle="", marker=style.marker, color=style.colour, markersize=4.5,
                markeredgecolor="white", markeredgewidth=0.5,
            )  # fmt: skip
    axes.set_yticks(
        range(len(row)), list(row) if len(row) <= 60 else [""] * len(row), fontsize=7 if len(row) < 30 else 4
    )
    axes.invert_yaxis()
    axes.set_xlabel("time (steps)")
    axes.grid(axis="both")


def _claim_figure(claim: Claim, name: str) -> Figure:
    """Return the claim of a plan that holds no routes."""
    figure = Figure(figsize=(WIDTH_IN, 1.4), layout="constrained")
    figure.suptitle(shortened(name, 80), x=0.01, ha="left", fontsize=9)
    figure.text(
        0.01, 0.5, f"{claim.status}: {shortened(claim.reason or 'no reason given', 150)}", fontsize=8, wrap=True
    )
    return figure


def _extent(instance: OrosInstance, ground: OccupancyMap | None) -> tuple[float, float]:
    """Return width and height of what the map shows, m."""
    if ground is not None:
        return ground.cols * ground.resolution_m, ground.rows * ground.resolution_m
    grid = layout(instance.cells)
    if grid is not None:
        boxes = list(grid.boxes.values())
        width = max(box.x1 for box in boxes) - min(box.x0 for box in boxes)
        return width, max(box.y1 for box in boxes) - min(box.y0 for box in boxes)
    xs, ys = [cell.x_m for cell in instance.cells] or [0.0], [cell.y_m for cell in instance.cells] or [0.0]
    return max(max(xs) - min(xs), 1.0), max(max(ys) - min(ys), 1.0)
