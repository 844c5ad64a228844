"""A simulated mission as a table for a terminal."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table

from react_opt.sim.summary import Summary

_TOLD = ("robot_dead", "battery_empty", "robot_stuck", "target_abandoned", "yield", "area_unreachable", "area_added")


def mission_table(summary: Summary) -> RenderableType:
    """Return a readable summary of a mission: coverage over time, robots, and what went wrong."""
    head = Table.grid(padding=(0, 2))
    head.add_row("strategy", f"{summary.strategy}, seed {summary.seed}")
    head.add_row("known", f"{summary.coverage:.1%} of {summary.coverable_m2:.1f} m² after {summary.end_s:g} s")
    head.add_row("decisions", f"{summary.decisions} in {summary.decision_wall_s:.1f} s of computing")
    head.add_row("computing", f"{summary.wall_s:.1f} s")
    coverage = Table(title="coverage", pad_edge=False)
    for heading in ("share", "time s", "energy J"):
        coverage.add_column(heading, justify="right")
    for row in summary.milestones:
        reached = row.t_s is not None and row.energy_j is not None
        time, energy = (f"{row.t_s:.2f}", f"{row.energy_j:.0f}") if reached else ("-", "-")
        coverage.add_row(f"{row.coverage:.0%}", time, energy)
    robots = Table(title="robots", pad_edge=False)
    for heading in ("robot", "energy J", "battery J", "sensing s", "driven m", "died s"):
        robots.add_column(heading, justify="left" if heading == "robot" else "right")
    for robot in summary.robots:
        robots.add_row(
            robot.id,
            f"{robot.energy_j:.0f}",
            f"{robot.battery_j:.0f}",
            f"{robot.sensing_s:.1f}",
            f"{robot.driven_m:.1f}",
            "-" if robot.died_s is None else f"{robot.died_s:.2f}",
        )
    parts: list[RenderableType] = [Panel(head, title=summary.mission, expand=False), coverage, robots]
    told = [f"{kind.replace('_', ' ')} {summary.events[kind]}" for kind in _TOLD if kind in summary.events]
    if told:
        parts.append("events: " + ", ".join(told))
    if summary.unreachable_areas:
        parts.append("unreachable areas: " + ", ".join(summary.unreachable_areas))
    return Group(*parts)
