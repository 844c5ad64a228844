"""The map of an OROS instance: cells, passages and walls, robots, chargers, and the routes of a plan."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import OrosInstance
from react_opt.plan import OrosPlan, OrosRobotPlan
from react_opt.report.colours import GREEN, GREY, INK, PALE
from react_opt.report.layout import Box, Layout, layout, walls
from react_opt.report.style import look, tint

MOST_LABELLED = 160
_GROUND = ListedColormap(["#FFFFFF", "#4A4A4A", "#DADADA"])


class Leg(NamedTuple):
    """A move of a plan: from cell to cell, between two instants."""

    start: str
    end: str
    from_t: int
    to_t: int


def legs(instance: OrosInstance, robot: OrosRobotPlan) -> Iterator[Leg]:
    """Yield the moves of a robot in order."""
    for step in robot.steps:
        if step.arc is not None:
            arc = instance.travel[step.arc]
            yield Leg(arc.from_, arc.to, step.t, step.t + arc.steps)


def draw_ground(axes: Axes, source: OccupancyMap) -> None:
    """Draw an occupancy map in greys: white free, dark walls, light grey unknown."""
    corners = source.pixel_to_world(np.array([[0, 0], [source.cols, 0], [0, source.rows], [source.cols, source.rows]]))
    if source.origin_yaw_rad == 0:
        extent = (corners[0][0], corners[3][0], corners[0][1], corners[3][1])
        axes.imshow(
            source.cells, cmap=_GROUND, vmin=0, vmax=2, origin="lower", extent=extent, interpolation="nearest", zorder=0
        )
        return
    columns, rows = np.meshgrid(np.arange(source.cols + 1), np.arange(source.rows + 1))
    at = source.pixel_to_world(np.stack((columns, rows), axis=-1))
    axes.pcolormesh(at[..., 0], at[..., 1], source.cells, cmap=_GROUND, vmin=0, vmax=2, rasterized=True, zorder=0)


def draw_cells(
    axes: Axes, instance: OrosInstance, plan: OrosPlan | None = None, ground: OccupancyMap | None = None
) -> None:
    """Draw the map of an instance, and into it the routes of a plan.

    Parameters
    ----------
    axes
        Where to draw; afterwards its axes are in metres with equal scales.
    instance
        The instance.
    plan
        A plan of it: its routes, and in each cell when it is explored.
    ground
        An occupancy map in the same frame, drawn below.
    """
    grid = layout(instance.cells)
    if ground is not None:
        draw_ground(axes, ground)
    number = {robot.id: k for k, robot in enumerate(instance.robots)}
    found = {each.cell: each for each in plan.explored} if plan is not None else {}
    colours = {name: look(number[each.robot]).colour for name, each in found.items() if each.robot in number}
    size = _cell_size(instance, grid)
    if grid is not None:
        _draw_grid(axes, instance, grid, colours, planned=plan is not None, thin=ground is not None)
    else:
        _draw_points(axes, instance, colours, size)
    _draw_chargers(axes, instance, size)
    if plan is not None:
        _draw_routes(axes, instance, plan, size)
        _label_explored(axes, instance, plan, grid, size)
    elif grid is not None and len(instance.cells) <= MOST_LABELLED:
        _label_cells(axes, instance, grid)
    _draw_starts(axes, instance, size)
    metres(axes)


def metres(axes: Axes) -> None:
    """Give a map its axes: metres, equal scales, no frame."""
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.margins(0.03)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)


def _cell_size(instance: OrosInstance, grid: Layout | None) -> float:
    """Return the side of a cell, m; without a grid the usual distance between neighbours."""
    if grid is not None:
        return min(min(box.x1 - box.x0, box.y1 - box.y0) for box in grid.boxes.values())
    xs, ys = [cell.x_m for cell in instance.cells], [cell.y_m for cell in instance.cells]
    if not xs:
        return 1.0
    area = max(max(xs) - min(xs), 1e-3) * max(max(ys) - min(ys), 1e-3)
    return max(math.sqrt(area / len(xs)), 1e-3)


def _draw_grid(
    axes: Axes, instance: OrosInstance, grid: Layout, colours: dict[str, str], *, planned: bool, thin: bool
) -> None:
    for cell in instance.cells:
        box = grid.boxes[cell.id]
        if cell.id in colours:
            fill, hatch = tint(colours[cell.id], 0.16), ""
        elif cell.explored:
            fill, hatch = tint(GREY, 0.2), ""
        else:
            fill, hatch = (1.0, 1.0, 1.0), "////" if planned else ""
        outline = Rectangle((box.x0, box.y0), box.x1 - box.x0, box.y1 - box.y0, hatch=hatch, zorder=0.5)
        outline.set(facecolor=(*fill, 0.4 if thin else 1.0), edgecolor="#BDBDBD", linewidth=0.5)
        axes.add_patch(outline)
    lines = LineCollection(list(walls(instance, grid)), colors=INK, capstyle="round", zorder=2)
    lines.set(linewidth=0.9 if thin else 1.8)
    axes.add_collection(lines)


def _draw_points(axes: Axes, instance: OrosInstance, colours: dict[str, str], size: float) -> None:
    place = {cell.id: (cell.x_m, cell.y_m) for cell in instance.cells}
    pairs = {tuple(sorted((arc.from_, arc.to))) for arc in instance.travel}
    if len(pairs) <= 6 * len(place):  # a complete graph would only be a grey cloud
        lines = [(place[one], place[other]) for one, other in sorted(pairs)]
        axes.add_collection(LineCollection(lines, colors=PALE, linewidths=1.0, zorder=0.5))
    for cell in instance.cells:
        colour = colours.get(cell.id)
        fill = tint(colour, 0.35) if colour else tint(GREY, 0.35) if cell.explored else "white"
        axes.add_patch(
            Circle((cell.x_m, cell.y_m), 0.16 * size, facecolor=fill, edgecolor=colour or GREY, linewidth=0.8, zorder=3)
        )
    axes.update_datalim(list(place.values()))


def _label_cells(axes: Axes, instance: OrosInstance, grid: Layout) -> None:
    for cell in instance.cells:
        box = grid.boxes[cell.id]
        _corner(axes, box, cell.id, _font(len(instance.cells)), GREY)
        axes.plot(cell.x_m, cell.y_m, ".", color=GREY, markersize=2.5, zorder=3)
        extra = []
        if cell.weight != 1:
            extra.append(f"weight {cell.weight:g}")
        if cell.deadline_step is not None:
            extra.append(f"by {cell.deadline_step * instance.step_s:g} s")
        if extra:
            axes.text(
                box.x0 + 0.06 * (box.x1 - box.x0), box.y0 + 0.06 * (box.y1 - box.y0), "\n".join(extra),
                fontsize=_font(len(instance.cells)) - 1, color=INK, va="bottom", zorder=6,
            )  # fmt: skip


def _label_explored(axes: Axes, instance: OrosInstance, plan: OrosPlan, grid: Layout | None, size: float) -> None:
    if len(instance.cells) > MOST_LABELLED:
        return
    number = {robot.id: k for k, robot in enumerate(instance.robots)}
    place = {cell.id: cell for cell in instance.cells}
    font = _font(len(instance.cells))
    for each in plan.explored:
        text = f"{each.step * instance.step_s:g} s"
        colour = look(number.get(each.robot, 0)).colour
        if grid is not None:
            _corner(axes, grid.boxes[each.cell], text, font, colour)
        else:
            cell = place[each.cell]
            axes.text(cell.x_m + 0.2 * size, cell.y_m + 0.2 * size, text, fontsize=font, color=colour, zorder=6)


def _corner(axes: Axes, box: Box, text: str, font: float, colour: str) -> None:
    axes.text(
        box.x0 + 0.05 * (box.x1 - box.x0), box.y1 - 0.05 * (box.y1 - box.y0), text, fontsize=font, color=colour,
        va="top", fontweight="bold", zorder=6, path_effects=[withStroke(linewidth=1.6, foreground="white")],
    )  # fmt: skip


def _font(cells: int) -> float:
    return 7.0 if cells <= 20 else 5.5 if cells <= 60 else 4.0


def _offset(k: int, count: int, size: float) -> float:
    """Return how far the route of the k-th of several robots is drawn beside the true one, m."""
    return (k - (count - 1) / 2) * min(0.07, 0.4 / max(count, 1)) * size


def _draw_routes(axes: Axes, instance: OrosInstance, plan: OrosPlan, size: float) -> None:
    place = {cell.id: (cell.x_m, cell.y_m) for cell in instance.cells}
    number = {robot.id: k for k, robot in enumerate(instance.robots)}
    for robot in plan.robots:
        k = number[robot.id]
        style, shift = look(k), _offset(k, len(instance.robots), size)
        moves = list(legs(instance, robot))
        for leg in moves:
            (x0, y0), (x1, y1) = place[leg.start], place[leg.end]
            arrow = FancyArrowPatch(
                (x0 + shift, y0 + shift), (x1 + shift, y1 + shift), connectionstyle="arc3,rad=0.09",
                arrowstyle="-|>,head_length=3,head_width=1.5", mutation_scale=1, color=style.colour,
                linestyle=style.line, linewidth=1.2, shrinkA=0, shrinkB=0, zorder=4,
            )  # fmt: skip
            axes.add_patch(arrow)
        stops = _sensed(robot, place, shift)
        axes.plot(
            [x for x, _ in stops], [y for _, y in stops], linestyle="", marker=style.marker, markersize=4.2,
            color=style.colour, markeredgecolor="white", markeredgewidth=0.5, zorder=5,
        )  # fmt: skip


def _sensed(robot: OrosRobotPlan, place: dict[str, tuple[float, float]], shift: float) -> Sequence[tuple[float, float]]:
    names = dict.fromkeys(step.cell for step in robot.steps if step.sensing and step.cell is not None)
    return [(place[name][0] + shift, place[name][1] + shift) for name in names]


def _draw_starts(axes: Axes, instance: OrosInstance, size: float) -> None:
    place = {cell.id: (cell.x_m, cell.y_m) for cell in instance.cells}
    for k, robot in enumerate(instance.robots):
        x, y = place[robot.start]
        shift = _offset(k, len(instance.robots), size)
        style = look(k)
        axes.plot(
            x + shift, y + shift, marker=style.marker, markersize=6.5, markerfacecolor="white",
            markeredgecolor=style.colour, markeredgewidth=1.6, zorder=6,
        )  # fmt: skip


def _draw_chargers(axes: Axes, instance: OrosInstance, size: float) -> None:
    place = {cell.id: (cell.x_m, cell.y_m) for cell in instance.cells}
    for charger in instance.chargers:
        x, y = place[charger.cell]
        axes.text(
            x + 0.3 * size, y - 0.3 * size, f"charger\n{charger.power_w:g} W", fontsize=5.5, color="white", zorder=6,
            ha="center", va="center", bbox={"boxstyle": "round,pad=0.3", "facecolor": GREEN, "edgecolor": "none"},
        )  # fmt: skip
