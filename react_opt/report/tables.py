"""Plans as tables for a terminal."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from react_opt.instance import AssignmentInstance, InspectionInstance, OrosInstance
from react_opt.plan import AssignmentPlan, Claim, InspectionPlan, OrosPlan, OrosRobotPlan
from react_opt.solvers.registry import installed

COLOURS = ("cyan", "yellow", "magenta", "green", "blue", "red", "white")
MAX_MAP_COLUMNS = 12
MAX_MAP_ROWS = 40


def plan_table(
    instance: OrosInstance | AssignmentInstance | InspectionInstance, plan: OrosPlan | AssignmentPlan | InspectionPlan
) -> RenderableType:
    """Return a readable summary of a plan: the claim, who does what, and a small map where there is one."""
    parts: list[RenderableType] = [_claim_panel(instance.name, plan.claim)]
    if isinstance(plan, OrosPlan) and isinstance(instance, OrosInstance) and plan.objective is not None:
        parts.append(_oros_robots(instance, plan))
        picture = _cell_map(instance, plan)
        if picture is not None:
            parts.append(picture)
    elif isinstance(plan, AssignmentPlan) and plan.claim.objective is not None:
        parts.append(_assignment(plan))
    elif isinstance(plan, InspectionPlan) and plan.claim.objective is not None:
        parts.append(_inspection(plan))
    return Group(*parts)


def claim_line(claim: Claim) -> str:
    """Return a claim in one line."""
    if claim.objective is None:
        return claim.status
    stopped = "" if claim.limit == "none" else f", stopped by {claim.limit}"
    return (
        f"{claim.status}, objective {shown(claim.objective, 4)}, bound {shown(claim.bound, 4)}, "
        f"gap {percent(claim.gap)}{stopped}"
    )


def build_table(instance: OrosInstance) -> RenderableType:
    """Return a summary of an instance: its size, and how its cells are joined."""
    grid = Table.grid(padding=(0, 2))
    modes = {(arc.from_, arc.to) for arc in instance.travel}
    steps = [arc.steps for arc in instance.travel]
    joules = [arc.energy_j for arc in instance.travel]
    horizon_s = instance.horizon_steps * instance.step_s
    grid.add_row("horizon", f"{instance.horizon_steps} steps of {instance.step_s:g} s ({horizon_s:g} s)")
    grid.add_row("cells", str(len(instance.cells)))
    spread = f", {min(steps)} to {max(steps)} steps, {min(joules):.1f} to {max(joules):.1f} J" if steps else ""
    grid.add_row("travel arcs", f"{len(instance.travel)} between {len(modes)} pairs{spread}")
    grid.add_row("robots", ", ".join(f"{robot.id} in {robot.start}" for robot in instance.robots))
    if instance.chargers:
        grid.add_row("chargers", ", ".join(charger.cell for charger in instance.chargers))
    return Panel(grid, title=instance.name, expand=False)


def solvers_table() -> RenderableType:
    """Return the solvers that are installed, with versions and abilities, and how to get the others."""
    table = Table(box=box.SIMPLE, pad_edge=False)
    for heading in ("solver", "version", "warm\nstart", "bound", "keeps\nplans", "work limit\ncounts", "numbers"):
        table.add_column(heading, no_wrap=heading in ("solver", "version"))
    missing = Table.grid(padding=(0, 2))
    for listing in installed():
        able = listing.abilities
        if able is None:
            missing.add_row(listing.name, Text("missing", style="red"), listing.missing)
            continue
        table.add_row(
            listing.name, listing.version, _yes(able.warm_start), _yes(able.bound), _yes(able.incumbents),
            able.work_unit or "-", "whole only" if able.integer_only else "any",
        )  # fmt: skip
    return Group(table, missing) if missing.rows else table


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def shown(value: float | None, digits: int = 2, unit: str = "") -> str:
    """Return a number for people, ``unknown`` for None."""
    return "unknown" if value is None else f"{value:,.{digits}f}{unit}"


def percent(gap: float | None) -> str:
    """Return a gap as a percentage with as many digits as it needs."""
    if gap is None:
        return "unknown"
    if gap < 1e-8:
        return "0 %" if gap == 0 else "< 1e-6 %"
    return f"{100 * gap:.2g} %" if gap < 0.1 else f"{100 * gap:.1f} %"


def _claim_panel(name: str, claim: Claim) -> Panel:
    grid = Table.grid(padding=(0, 2))
    colour = {"optimal": "green", "feasible": "yellow"}.get(claim.status, "red")
    grid.add_row("status", Text(claim.status, style=f"bold {colour}"), "method", claim.method)
    grid.add_row("objective", shown(claim.objective, 4), "solver", claim.solver or "-")
    grid.add_row("bound", shown(claim.bound, 4), "stopped by", "nothing" if claim.limit == "none" else claim.limit)
    times = ", ".join(f"{phase} {seconds:.2f} s" for phase, seconds in claim.wall_s.items())
    grid.add_row("gap", percent(claim.gap), "wall time", times or "-")
    if claim.reason:
        grid.add_row("reason", claim.reason)
    return Panel(grid, title=name, expand=False)


def _oros_robots(instance: OrosInstance, plan: OrosPlan) -> RenderableType:
    assert plan.objective is not None
    table = Table(title=None, pad_edge=False)
    for heading, justify in (
        ("robot", "left"), ("explores", "right"), ("moves", "right"), ("waits", "right"), ("energy J", "right"),
        ("left J", "right"), ("route (* sensed)", "left"),
    ):  # fmt: skip
        table.add_column(heading, justify=justify, overflow="fold")  # type: ignore[arg-type]
    given = {robot.id: robot for robot in instance.robots}
    counts = {robot.id: sum(explored.robot == robot.id for explored in plan.explored) for robot in plan.robots}
    used_total = 0.0
    for k, robot in enumerate(plan.robots):
        charged = sum(step.charging_j for step in robot.steps)
        used = given[robot.id].battery_j + charged - robot.steps[-1].battery_j
        used_total += used
        moves = sum(step.arc is not None for step in robot.steps)
        waits = sum(step.cell is not None and step.arc is None for step in robot.steps[:-1])
        route = _fold(" > ".join(_visits(robot)))
        style = COLOURS[k % len(COLOURS)]
        table.add_row(
            Text(robot.id, style=style), str(counts[robot.id]), str(moves), str(waits), f"{used:,.0f}",
            f"{robot.steps[-1].battery_j:,.0f}", route,
        )  # fmt: skip
    objective = plan.objective
    unexplored = sum(not cell.explored for cell in instance.cells)
    horizon_s = instance.horizon_steps * instance.step_s
    last = max((explored.step for explored in plan.explored), default=0) * instance.step_s
    line = (
        f"{len(plan.explored)} of {unexplored} unexplored cells by {last:g} s of {horizon_s:g} s; "
        f"coverage {objective.coverage:,.6g} + battery {objective.battery:.6g} ({objective.battery_j:,.0f} J left, "
        f"{used_total:,.0f} J spent)"
    )
    return Group(table, line)


def _visits(robot: OrosRobotPlan) -> Iterator[str]:
    """Yield each stay of a robot: cell, ``*`` where it senses; several instants in a cell are one stay."""
    stay, sensed = robot.steps[0].cell, False
    for step in robot.steps:
        if step.cell is None:
            continue
        if step.cell != stay:
            yield f"{stay}{'*' if sensed else ''}"
            stay, sensed = step.cell, False
        sensed |= step.sensing
    yield f"{stay}{'*' if sensed else ''}"


def _fold(text: str, longest: int = 400) -> str:
    return text if len(text) <= longest else text[: longest - 1] + "…"


def _cell_map(instance: OrosInstance, plan: OrosPlan) -> RenderableType | None:
    """Return the cells where they lie, each with who explores it and when; None where they form no small grid."""
    xs = sorted({cell.x_m for cell in instance.cells})
    ys = sorted({cell.y_m for cell in instance.cells}, reverse=True)
    column, row = _ranks(xs), _ranks(ys)
    width, height = max(column.values(), default=0) + 1, max(row.values(), default=0) + 1
    if width > MAX_MAP_COLUMNS or height > MAX_MAP_ROWS or not instance.cells:
        return None
    robots = {robot.id: k for k, robot in enumerate(plan.robots)}
    done = {explored.cell: explored for explored in plan.explored}
    grid = [[Text() for _ in range(width)] for _ in range(height)]
    for cell in instance.cells:
        place = grid[row[cell.y_m]][column[cell.x_m]]
        if len(place):
            return None
        if cell.id in done:
            found = done[cell.id]
            colour = COLOURS[robots[found.robot] % len(COLOURS)]
            place.append(f"{found.robot} {found.step * instance.step_s:g} s", style=colour)
        else:
            place.append("known" if cell.explored else "not explored", style="dim" if cell.explored else "bold red")
    table = Table(show_header=False, show_lines=True, title="who explores what, when", title_justify="left")
    for line in grid:
        table.add_row(*line)
    return table


def _ranks(values: list[float]) -> dict[float, int]:
    """Return the grid line of each sorted value; values closer than a quarter of the usual distance share one."""
    gaps = sorted(abs(b - a) for a, b in itertools.pairwise(values))
    typical = gaps[-1] if gaps else 1.0
    ranks: dict[float, int] = {}
    line = 0
    for k, value in enumerate(values):
        if k and abs(value - values[k - 1]) > typical / 4:
            line += 1
        ranks[value] = line
    return ranks


def _assignment(plan: AssignmentPlan) -> RenderableType:
    table = Table(pad_edge=False)
    table.add_column("target")
    table.add_column("robot, or why not")
    table.add_column("loss if forced", justify="right")
    for taken in plan.assigned:
        table.add_row(taken.target, taken.robot, "")
    for left in plan.deferred:
        table.add_row(left.target, Text(left.reason, style="yellow"), "-" if left.loss is None else f"{left.loss:.4g}")
    return table


def _inspection(plan: InspectionPlan) -> RenderableType:
    table = Table(pad_edge=False)
    for heading, justify in (("robot", "left"), ("stops", "left"), ("finish s", "right"), ("battery J", "right")):
        table.add_column(heading, justify=justify)  # type: ignore[arg-type]
    for route in plan.routes:
        stops = " > ".join([stop.target for stop in route.stops] + ([route.end] if route.end else []))
        table.add_row(route.robot, _fold(stops or "-"), f"{route.finish_s:.1f}", f"{route.finish_battery_j:,.0f}")
    parts: list[RenderableType] = [table, f"t_dpi {shown(plan.t_dpi_s, 1, ' s')}"]
    if plan.skipped:
        skipped = Table(pad_edge=False)
        skipped.add_column("skipped")
        skipped.add_column("why")
        skipped.add_column("loss if forced", justify="right")
        for left in plan.skipped:
            skipped.add_row(left.target, left.reason, "-" if left.loss is None else f"{left.loss:.4g}")
        parts.append(skipped)
    return Group(*parts)
