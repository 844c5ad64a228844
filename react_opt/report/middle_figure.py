"""Figures of the middle layer: who takes which local target, and who inspects the postponed ones."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from react_opt.instance import AssignmentInstance, InspectionInstance
from react_opt.plan import AssignmentPlan, Deferred, InspectionPlan, Skipped
from react_opt.report.claimtext import claim_text
from react_opt.report.colours import GREY, INK
from react_opt.report.style import WIDTH_IN, look, robot_key, shortened, tint

MOST_ROWS = 100
_WORDS = {
    "unreachable": "no way to it",
    "zone": "outside every robot's zone",
    "energy": "batteries too low",
    "conflict": "conflicts with a target taken",
    "outbid": "others are worth more",
    "no_gain": "costs more than it gains",
    "time": "time too short",
    "battery": "batteries too low",
}


def assignment_figure(
    plan: AssignmentPlan | None, instance: AssignmentInstance | None = None, title: str = ""
) -> Figure:
    """Return who takes which target, what every pair is worth, and why the others wait and what that costs.

    Parameters
    ----------
    plan
        The assignment, None to show an instance alone.
    instance
        Its instance; without it the worth of the pairs is not known and left out.
    title
        What stands above; by default name and claim of the plan.
    """
    taken = {} if plan is None else {each.target: each.robot for each in plan.assigned}
    deferred = {} if plan is None else {each.target: each for each in plan.deferred}
    if instance is not None:
        robots, named = [robot.id for robot in instance.robots], [target.id for target in instance.targets]
    else:
        robots, named = list(dict.fromkeys(taken.values())), [*taken, *deferred]
    order = sorted(named, key=lambda name: (name not in taken, robots.index(taken[name]) if name in taken else 0))
    rows = order[:MOST_ROWS]
    figure = Figure(figsize=(WIDTH_IN, max(2.4, 0.19 * len(rows) + 1.5)), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(max(0.8, min(2.2, 0.24 * len(robots) + 0.4)), 2))
    if plan is not None:
        title = title or f"{shortened(plan.instance.name, 60)}: {claim_text(plan.claim)}"
    figure.suptitle(title, x=0.01, ha="left", fontsize=8.5)
    worth = {} if instance is None else _worth(instance)
    _draw_pairs(left, rows, robots, taken, worth)
    _draw_waiting(right, rows, taken, deferred, None if instance is None else instance, robots)
    left.set_yticks(range(len(rows)), [shortened(name, 14) for name in rows])
    left.set_ylim(len(rows) - 0.4, -0.6)
    if len(order) > len(rows):
        left.set_title(f"first {len(rows)} of {len(order)} targets")
    return figure


def _worth(instance: AssignmentInstance) -> dict[tuple[str, str], float]:
    """Return what each reachable pair adds to the objective."""
    gain = {target.id: target.gain for target in instance.targets}
    battery = {robot.id: robot.battery_j for robot in instance.robots}
    weights = instance.weights
    return {
        (cost.robot, cost.target): gain[cost.target]
        - weights.alpha * cost.time_s / weights.time_ref_s
        - weights.beta * cost.energy_j / battery[cost.robot]
        for cost in instance.costs
        if battery[cost.robot] > 0
    }


def _draw_pairs(
    axes: Axes, rows: list[str], robots: list[str], taken: dict[str, str], worth: dict[tuple[str, str], float]
) -> None:
    best = max((abs(value) for value in worth.values()), default=1.0) or 1.0
    for y, name in enumerate(rows):
        for x, robot in enumerate(robots):
            value = worth.get((robot, name))
            if value is not None:
                face = tint(GREY, 0.45 * max(value, 0.0) / best)
                axes.add_patch(_square(x, y, face))
                if taken.get(name) != robot and len(rows) <= 60:
                    axes.text(x, y, f"{value:.2g}", ha="center", va="center", fontsize=5.5, color=INK)
            elif worth:
                axes.text(x, y, "·", ha="center", va="center", color=GREY)
            if taken.get(name) == robot:
                style = look(x)
                axes.plot(x, y, marker=style.marker, markersize=7, color=style.colour, markeredgecolor="white")
    axes.set_xticks(range(len(robots)), [shortened(name, 8) for name in robots], rotation=90 if len(robots) > 8 else 0)
    axes.set_xlim(-0.6, max(len(robots), 1) - 0.4)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.set_xlabel("marked: taken. Number: worth of the pair, · no way" if worth else "marked: taken")
    for side in axes.spines.values():
        side.set_visible(False)


def _square(x: float, y: float, face: tuple[float, float, float]) -> Patch:
    return Rectangle((x - 0.47, y - 0.42), 0.94, 0.84, facecolor=face, edgecolor="none", zorder=0)


def _draw_waiting(
    axes: Axes,
    rows: list[str],
    taken: dict[str, str],
    deferred: dict[str, Deferred],
    instance: AssignmentInstance | None,
    robots: list[str],
) -> None:
    losses = [each.loss for each in deferred.values() if each.loss is not None]
    gains = {} if instance is None else {target.id: target.gain for target in instance.targets}
    top = max([*losses, *gains.values(), 1e-9])
    for y, name in enumerate(rows):
        if name in gains:
            axes.barh(y, gains[name], height=0.7, color=tint(GREY, 0.22), linewidth=0)
        if name in taken:
            axes.text(
                top * 0.01,
                y,
                f"{taken[name]} takes it",
                va="center",
                fontsize=6.5,
                color=look(robots.index(taken[name])).colour,
            )
        elif name in deferred:
            each = deferred[name]
            if each.loss is not None:
                axes.barh(y, each.loss, height=0.34, facecolor="white", edgecolor=INK, hatch="//////", linewidth=0.7)
            axes.text(top * 1.02, y, _reason(each), va="center", fontsize=6.5)
    axes.set_xlim(0, top * 1.9 if deferred else top * 1.1)
    axes.set_xlabel("objective")
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x")
    keys: list[Patch] = [Patch(facecolor=tint(GREY, 0.22), label="gain of the target")] if gains else []
    if losses:
        keys.append(Patch(facecolor="white", edgecolor=INK, hatch="//////", label="loss if it were forced in"))
    if keys:
        axes.legend(handles=keys, loc="lower right", bbox_to_anchor=(1, 1.0), ncols=2)


def _reason(each: Deferred | Skipped) -> str:
    text = f"{each.reason}: {_WORDS[each.reason]}"
    return text if each.loss is None else f"{text} ({each.loss:.3g})"


def inspection_figure(plan: InspectionPlan, instance: InspectionInstance | None = None) -> Figure:
    """Return the routes through the postponed targets over time, batteries, and what is left out and why."""
    robots = [route.robot for route in plan.routes]
    skipped = plan.skipped[:MOST_ROWS]
    heights = [max(0.9, 0.42 * len(robots) + 0.4), 1.4] + ([0.17 * len(skipped) + 0.5] if skipped else [])
    figure = Figure(figsize=(WIDTH_IN, sum(heights) + 1.1), layout="constrained")
    axes = figure.subplots(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    figure.suptitle(f"{shortened(plan.instance.name, 60)}: {claim_text(plan.claim)}", x=0.01, ha="left", fontsize=8.5)
    _draw_routes(axes[0], plan, instance)
    _draw_batteries(axes[1], plan, instance)
    axes[1].sharex(axes[0])
    axes[1].set_xlabel("time from now (s)")
    axes[0].tick_params(labelbottom=False)
    if skipped:
        losses = [each.loss for each in skipped if each.loss is not None]
        top = max([*losses, 1e-9])
        for y, each in enumerate(skipped):
            axes[2].barh(
                y, each.loss or 0.0, height=0.5, facecolor="white", edgecolor=INK, hatch="//////", linewidth=0.7
            )
            axes[2].text((each.loss or 0.0) + 0.01 * top, y, _reason(each), va="center", fontsize=6.5)
        axes[2].set_yticks(range(len(skipped)), [shortened(each.target, 14) for each in skipped])
        axes[2].set_ylim(len(skipped) - 0.4, -0.6)
        axes[2].set_xlim(0, top * 1.6)
        axes[2].set_xlabel("value lost if the target were forced in" if losses else "loss not tested")
        axes[2].set_title(f"left out ({len(plan.skipped)})")
    return figure


def _draw_routes(axes: Axes, plan: InspectionPlan, instance: InspectionInstance | None) -> None:
    last = max((route.finish_s for route in plan.routes), default=0.0)
    for k, route in enumerate(plan.routes):
        style = look(k)
        axes.plot([0, route.finish_s], [k, k], color=style.colour, linestyle=style.line, linewidth=1.3, zorder=1)
        axes.plot(0, k, marker=style.marker, color="white", markeredgecolor=style.colour, markeredgewidth=1.4)
        for stop in route.stops:
            axes.broken_barh(
                [(stop.arrive_s, max(stop.leave_s - stop.arrive_s, 0.004 * last))], (k - 0.16, 0.32),
                facecolor=style.colour, edgecolor="white", linewidth=0.4, zorder=2,
            )  # fmt: skip
            axes.text(
                (stop.arrive_s + stop.leave_s) / 2, k - 0.24, shortened(stop.target, 10), fontsize=6, ha="center",
                va="bottom", rotation=0 if sum(len(r.stops) for r in plan.routes) < 25 else 60,
            )  # fmt: skip
        axes.plot(route.finish_s, k, marker="|", markersize=11, color=style.colour, markeredgewidth=1.6)
        if route.end is not None:
            axes.annotate(
                f"ends at {shortened(route.end, 12)}", (route.finish_s, k), xytext=(0, -9), textcoords="offset points",
                fontsize=6, va="top", ha="right",
            )  # fmt: skip
    limit = None if instance is None else instance.time_left_s
    if limit is not None and limit <= 20 * max(last, 1e-9):
        axes.axvline(limit, color=INK, linewidth=0.9, linestyle=(0, (3, 2)))
        axes.text(limit, -0.62, "time left ", ha="right", va="top", fontsize=6.5)
    if plan.t_dpi_s is not None:
        axes.set_title(f"routes; the last finishes at t_dpi = {plan.t_dpi_s:.1f} s")
    axes.set_yticks(range(len(plan.routes)), [shortened(route.robot, 12) for route in plan.routes])
    axes.set_ylim(len(plan.routes) - 0.45, -0.75)
    axes.set_xlim(0, max(last * 1.12, (limit or 0.0) if (limit or 0.0) <= 20 * max(last, 1e-9) else 0.0, 1e-9))
    axes.grid(axis="x")


def _draw_batteries(axes: Axes, plan: InspectionPlan, instance: InspectionInstance | None) -> None:
    given = {} if instance is None else {robot.id: robot for robot in instance.robots}
    for k, route in enumerate(plan.routes):
        style = look(k)
        points = [(stop.leave_s, stop.battery_j / 1000) for stop in route.stops]
        points.append((route.finish_s, route.finish_battery_j / 1000))
        if route.robot in given:
            points.insert(0, (0.0, given[route.robot].battery_j / 1000))
            reserve = given[route.robot].reserve_j / 1000
            if reserve > 0:
                axes.plot(
                    [0, route.finish_s], [reserve, reserve], color=tint(style.colour, 0.6), linewidth=0.7,
                    linestyle=(0, (2, 2)),
                )  # fmt: skip
        axes.plot(
            *zip(*points, strict=True), color=style.colour, linestyle=style.line, marker=style.marker, markersize=3
        )
    axes.set_ylim(0, None)
    axes.set_ylabel("battery (kJ)")
    axes.grid(axis="y")
    keys: list[Line2D | Patch] = [robot_key(k, route.robot) for k, route in enumerate(plan.routes[:12])]
    if any(robot.reserve_j > 0 for robot in given.values()):
        keys.append(Line2D([], [], color=GREY, linewidth=0.9, linestyle=(0, (2, 2)), label="reserve"))
    axes.legend(handles=keys, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def travel_figure(instance: InspectionInstance) -> Figure:
    """Return an inspection instance: driving times between its places, values of targets, budgets of robots."""
    robots, targets = instance.robots, instance.targets[:MOST_ROWS]
    starts = list(dict.fromkeys([robot.at for robot in robots] + [robot.end for robot in robots if robot.end]))
    places = [*[name for name in starts if name not in {target.id for target in targets}], *(t.id for t in targets)]
    seconds = {(row.from_, row.to): row.time_s for row in instance.travel if row.robot is None}
    matrix = [[seconds.get((one, other), float("nan")) for other in places] for one in places]
    side = min(max(0.16 * len(places) + 0.8, 2.4), 4.4)
    figure = Figure(figsize=(WIDTH_IN, side + 0.9), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(side, WIDTH_IN - side))
    figure.suptitle(f"{shortened(instance.name, 60)}: {instance.time_left_s:g} s left", x=0.01, ha="left", fontsize=8.5)
    picture = left.imshow(matrix, cmap="cividis_r", vmin=0)
    figure.colorbar(picture, ax=left, label="driving time (s)", shrink=0.8)
    font = 6.5 if len(places) <= 25 else 3.5
    left.set_xticks(range(len(places)), [shortened(name, 10) for name in places], rotation=90, fontsize=font)
    left.set_yticks(range(len(places)), [shortened(name, 10) for name in places], fontsize=font)
    left.set_xlabel("to")
    left.set_ylabel("from")
    right.barh(range(len(targets)), [target.value for target in targets], color=tint(GREY, 0.4), height=0.7)
    right.set_yticks(range(len(targets)), [shortened(target.id, 10) for target in targets], fontsize=font)
    right.set_ylim(len(targets) - 0.4, -0.6)
    right.set_xlabel("value of the target")
    budgets = "\n".join(
        f"{shortened(robot.id, 10)}: at {shortened(robot.at, 10)}, {(robot.battery_j - robot.reserve_j) / 1000:.2f} kJ"
        + (f", to {shortened(robot.end, 10)}" if robot.end else "")
        for robot in robots[:10]
    )
    right.set_title(budgets, fontsize=7, fontweight="normal")
    return figure
