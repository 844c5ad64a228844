"""What each robot does when: moving, sensing, waiting and charging, above its battery; and the coverage curve."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from react_opt.instance import OrosInstance
from react_opt.plan import OrosPlan, OrosRobotPlan
from react_opt.report.colours import GREEN, GREY, INK, PALE
from react_opt.report.style import look, tint


class Span(NamedTuple):
    """What a robot does between two instants: ``moving``, ``waiting`` or ``charging``."""

    what: str
    from_t: int
    to_t: int


def spans(robot: OrosRobotPlan) -> Iterator[Span]:
    """Yield what a robot does, one span per move or per stretch of waiting or charging."""
    open_: Span | None = None
    for step, after in zip(robot.steps, robot.steps[1:], strict=False):
        if step.arc is not None or step.cell is None:
            what = "moving"
        else:
            what = "charging" if after.charging_j > 0 else "waiting"
        begins = step.arc is not None
        if open_ is not None and open_.what == what and not begins:
            open_ = open_._replace(to_t=after.t)
            continue
        if open_ is not None:
            yield open_
        open_ = Span(what, step.t, after.t)
    if open_ is not None:
        yield open_


def draw_strip(axes: Axes, robot: OrosRobotPlan, k: int, step_s: float) -> None:
    """Draw what the k-th robot does as a strip; triangles are the instants at which it senses."""
    colour = look(k).colour
    faces = {"moving": (colour, ""), "waiting": (PALE, ""), "charging": (tint(GREEN, 0.35), "//////")}
    for span in spans(robot):
        face, hatch = faces[span.what]
        axes.broken_barh(
            [(span.from_t * step_s, (span.to_t - span.from_t) * step_s)], (0, 1), facecolor=face, hatch=hatch,
            edgecolor=GREEN if span.what == "charging" else "white", linewidth=0.6,
        )  # fmt: skip
    sensed = [step.t * step_s for step in robot.steps if step.sensing]
    axes.plot(sensed, [1.28] * len(sensed), "v", color=INK, markersize=3.2, clip_on=False)
    axes.set_ylim(0, 1.5)
    axes.set_yticks([])
    axes.tick_params(axis="x", bottom=False, labelbottom=False)
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)


def draw_battery(
    axes: Axes, robot: OrosRobotPlan, k: int, step_s: float, capacity_j: float | None, reserve_j: float | None
) -> None:
    """Draw the battery of the k-th robot, kJ, with its reserve where it has one."""
    style = look(k)
    t = [step.t * step_s for step in robot.steps]
    battery = [step.battery_j / 1000 for step in robot.steps]
    axes.plot(t, battery, color=style.colour, linestyle=style.line, linewidth=1.3)
    axes.fill_between(t, battery, color=tint(style.colour, 0.14), linewidth=0)
    top = max(battery) if capacity_j is None else max(capacity_j / 1000, *battery)
    axes.set_ylim(0, max(top, 1e-9) * 1.05)
    if reserve_j:
        axes.axhline(reserve_j / 1000, color=INK, linewidth=0.8, linestyle=(0, (2, 2)))
        axes.text(t[-1], reserve_j / 1000, "reserve", ha="right", va="bottom", fontsize=6)
    axes.set_ylabel(f"{robot.id}\nbattery (kJ)")
    axes.grid(axis="y")
    axes.annotate(
        f"{battery[-1]:.2f}", (t[-1], battery[-1]), xytext=(3, 0), textcoords="offset points", fontsize=6.5,
        color=style.colour, va="center",
    )  # fmt: skip


def strip_key(colour: str = GREY, *, charging: bool = True) -> list[Patch | Line2D]:
    """Return the legend of the strips."""
    keys: list[Patch | Line2D] = [Patch(facecolor=colour, label="moving"), Patch(facecolor=PALE, label="waiting")]
    if charging:
        keys.append(Patch(facecolor=tint(GREEN, 0.35), edgecolor=GREEN, hatch="//////", label="charging"))
    keys.append(Line2D([], [], color=INK, marker="v", linestyle="", markersize=3.5, label="senses"))
    return keys


def coverage(instance: OrosInstance, plan: OrosPlan) -> tuple[list[float], list[float]]:
    """Return times, s, and the explored weight at them (what was known from the start included)."""
    weight = {cell.id: cell.weight for cell in instance.cells}
    gained = np.zeros(instance.horizon_steps + 1)
    gained[0] = sum(cell.weight for cell in instance.cells if cell.explored)
    for each in plan.explored:
        gained[each.step] += weight[each.cell]
    times = [t * instance.step_s for t in range(instance.horizon_steps + 1)]
    return times, [float(value) for value in np.cumsum(gained)]


def coverage_limit(instance: OrosInstance) -> list[float]:
    """Return, per instant, explored weight that no plan can exceed.

    A cell counts from the first instant at which some robot can stand in it (walls between robots, batteries and
    all other limits left aside), and every robot explores at most one cell per instant. Of the cells in reach the
    heaviest are taken.
    """
    first = _first_reached(instance)
    horizon = instance.horizon_steps
    known = sum(cell.weight for cell in instance.cells if cell.explored)
    unexplored = [cell for cell in instance.cells if not cell.explored]
    limit, taken = [known], 0
    for t in range(1, horizon + 1):
        reached = sorted((cell.weight for cell in unexplored if first.get(cell.id, horizon + 1) <= t), reverse=True)
        standing = sum(robot.start_step <= t for robot in instance.robots)
        taken = min(taken + standing, len(reached))
        limit.append(known + sum(reached[:taken]))
    return limit


def _first_reached(instance: OrosInstance) -> dict[str, int]:
    """Return the first instant at which some robot can stand in each cell within the horizon."""
    import heapq

    out: dict[str, list[tuple[str, int]]] = {}
    for arc in instance.travel:
        out.setdefault(arc.from_, []).append((arc.to, arc.steps))
    queue = [(robot.start_step, robot.start) for robot in instance.robots]
    heapq.heapify(queue)
    first: dict[str, int] = {}
    while queue:
        t, cell = heapq.heappop(queue)
        if cell in first or t > instance.horizon_steps:
            continue
        first[cell] = t
        for to, steps in out.get(cell, ()):
            if to not in first:
                heapq.heappush(queue, (t + steps, to))
    return first


def draw_coverage(axes: Axes, instance: OrosInstance, plan: OrosPlan) -> None:
    """Draw the share of the weight that is explored over time, and what no plan can exceed."""
    times, explored = coverage(instance, plan)
    total = sum(cell.weight for cell in instance.cells)
    share = 100 / total if total > 0 else 0.0
    limit = [value * share for value in coverage_limit(instance)]
    curve = [value * share for value in explored]
    axes.fill_between(times, curve, step="post", color=tint(GREY, 0.22), linewidth=0)
    axes.step(times, limit, where="post", color=INK, linewidth=0.9, linestyle=(0, (3, 2)), label="no plan can be above")
    axes.step(times, curve, where="post", color=INK, linewidth=1.5, label="this plan")
    axes.set_ylim(0, 108)
    axes.set_yticks([0, 25, 50, 75, 100])
    axes.set_ylabel("explored (%)")
    axes.set_xlabel("time (s)")
    axes.grid(axis="y")
    axes.legend(loc="lower right")
