"""Where the cells of an instance lie: their outlines, found from places and names, and the walls between them."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.instance import Cell, OrosInstance

_GRID_ID = re.compile(r"[A-Za-z]*(-?\d+)[_,](-?\d+)")


class Box(NamedTuple):
    """The outline of a cell, m."""

    x0: float
    y0: float
    x1: float
    y1: float


class Layout(NamedTuple):
    """The outlines of all cells and who is beside whom: pairs of cells that share a side, with that side's ends."""

    boxes: dict[str, Box]
    sides: list[tuple[str, str | None, tuple[float, float], tuple[float, float]]]


def layout(cells: Sequence[Cell]) -> Layout | None:
    """Return the outlines of cells that form a grid, None where they form none.

    A cell's place is where a robot stands in it, not its centre. Where the ids count columns and rows (``g0_3``,
    as ``react-opt build`` names them) the grid is the one with square cells that holds every place; otherwise it
    is looked for in the places alone.
    """
    if not cells:
        return None
    return _from_ids(cells) or _from_places(cells)


def walls(instance: OrosInstance, grid: Layout) -> Iterable[tuple[tuple[float, float], tuple[float, float]]]:
    """Yield the sides that no travel arc crosses, and those at the edge of the grid."""
    joined = {frozenset((arc.from_, arc.to)) for arc in instance.travel}
    for one, other, start, end in grid.sides:
        if other is None or frozenset((one, other)) not in joined:
            yield start, end


def _from_ids(cells: Sequence[Cell]) -> Layout | None:
    found = [_GRID_ID.fullmatch(cell.id) for cell in cells]
    if any(match is None for match in found):
        return None
    numbers = np.array([[int(match[1]), int(match[2])] for match in found if match], dtype=np.float64)
    if np.abs(numbers).max() > 1e6:
        return None
    places = np.array([[cell.x_m, cell.y_m] for cell in cells])
    for order in ([0, 1], [1, 0]):  # column first as the builder has it, or row first
        index = numbers[:, order]
        pitch = _pitch(index, places)
        if pitch is None:
            continue
        low = (places - (index + 1) * pitch).max(axis=0)
        high = (places - index * pitch).min(axis=0)
        if (low <= high + 1e-6).all():
            on_grid = np.ceil(low / pitch - 1e-9) * pitch  # lines at multiples of the pitch, where they hold all
            start = np.where(on_grid <= high + 1e-6, on_grid, (low + high) / 2)
            return _outlined(cells, index.astype(int), start, pitch)
    return None


def _pitch(index: NDArray[np.float64], places: NDArray[np.float64]) -> float | None:
    """Return the side of the square cells that fits best, None where there is only one column and one row."""
    spread = index - index.mean(axis=0)
    square = float((spread**2).sum())
    if square == 0:
        return None
    pitch = float((spread * (places - places.mean(axis=0))).sum() / square)
    if pitch <= 0:
        return None
    for digits in range(1, 5):  # 9.97 of standing points beside the centres is 10
        rounded = float(f"{pitch:.{digits}g}")
        low, high = (places - (index + 1) * rounded).max(axis=0), (places - index * rounded).min(axis=0)
        if (low <= high + 1e-6).all():
            return rounded
    return pitch


def _outlined(cells: Sequence[Cell], index: NDArray[np.int_], start: NDArray[np.float64], pitch: float) -> Layout:
    x = {int(a): float(start[0] + a * pitch) for a in range(index[:, 0].min(), index[:, 0].max() + 2)}
    y = {int(b): float(start[1] + b * pitch) for b in range(index[:, 1].min(), index[:, 1].max() + 2)}
    return _joined({cell.id: (int(a), int(b)) for cell, (a, b) in zip(cells, index, strict=True)}, x, y)


def _from_places(cells: Sequence[Cell]) -> Layout | None:
    columns, x = _lines([cell.x_m for cell in cells])
    rows, y = _lines([cell.y_m for cell in cells])
    if len(set(zip(columns, rows, strict=True))) < len(cells) or (len(x) - 1) * (len(y) - 1) > 4 * len(cells) + 8:
        return None
    index = {cell.id: (a, b) for cell, a, b in zip(cells, columns, rows, strict=True)}
    return _joined(index, dict(enumerate(x)), dict(enumerate(y)))


def _lines(values: list[float]) -> tuple[list[int], list[float]]:
    """Return the grid line of each value, and the borders between lines."""
    ordered = sorted(set(values))
    typical = max((b - a for a, b in itertools.pairwise(ordered)), default=10.0)
    groups: list[list[float]] = []
    for value in ordered:
        if groups and value - groups[-1][-1] <= typical / 4:
            groups[-1].append(value)
        else:
            groups.append([value])
    line = {value: k for k, group in enumerate(groups) for value in group}
    centres = [sum(group) / len(group) for group in groups]
    inner = [(a + b) / 2 for a, b in itertools.pairwise(centres)]
    half = min((b - a for a, b in itertools.pairwise(centres)), default=typical) / 2
    return [line[value] for value in values], [centres[0] - half, *inner, centres[-1] + half]


def _joined(index: dict[str, tuple[int, int]], x: dict[int, float], y: dict[int, float]) -> Layout:
    at = {place: name for name, place in index.items()}
    boxes = {name: Box(x[a], y[b], x[a + 1], y[b + 1]) for name, (a, b) in index.items()}
    sides: list[tuple[str, str | None, tuple[float, float], tuple[float, float]]] = []
    for name, (a, b) in index.items():
        box = boxes[name]
        right, above = at.get((a + 1, b)), at.get((a, b + 1))
        sides.append((name, right, (box.x1, box.y0), (box.x1, box.y1)))
        sides.append((name, above, (box.x0, box.y1), (box.x1, box.y1)))
        if (a - 1, b) not in at:
            sides.append((name, None, (box.x0, box.y0), (box.x0, box.y1)))
        if (a, b - 1) not in at:
            sides.append((name, None, (box.x0, box.y0), (box.x1, box.y0)))
    return Layout(boxes, sides)
