"""Seeded random buildings, to tune strategies on: never those that results are reported for.

    python benchmarks/buildings.py FOLDER [--count 6]

writes ``building_S.yaml`` and ``.pgm`` (ROS maps) and ``building_S.json`` (start points of four robots, m). A building
is a hall divided by walls with doors of 0.9 to 3 m into rooms, with machines, shelves and pillars on the floor, some of
them so near to a wall that only a narrow passage is left, and an entry corridor.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from react_opt.geometry.mapfile import save_map
from react_opt.geometry.occupancy import FREE, OCCUPIED, OccupancyMap

RES_M = 0.1
ROBOT_M = 0.34  # radius with which a place must be reachable, m
SHAPES_M = ((20, 50), (30, 30), (20, 40), (40, 20), (30, 40), (20, 30))

Cells = NDArray[np.uint8]


def building(seed: int) -> tuple[OccupancyMap, list[tuple[float, float]]]:
    """Return a building and the start points of four robots, m."""
    rng = np.random.default_rng(seed)
    while True:
        width, height = SHAPES_M[seed % len(SHAPES_M)]
        cells = np.full((round(height / RES_M), round(width / RES_M)), FREE, dtype=np.uint8)
        _divide(cells, rng, 0, 0, cells.shape[1], cells.shape[0])
        _furnish(cells, rng)
        cells[[0, 1, -1, -2]] = OCCUPIED
        cells[:, [0, 1, -1, -2]] = OCCUPIED
        starts = _entry(cells, rng)
        if _opened_up(cells, starts):
            return OccupancyMap(cells, RES_M), starts


def _divide(cells: Cells, rng: np.random.Generator, left: int, low: int, right: int, high: int) -> None:
    """Divide a room in two by a wall with one or two doors, again and again."""
    width, height = right - left, high - low
    if max(width, height) < 110 or (max(width, height) < 220 and rng.random() < 0.25):
        return
    thick = int(rng.integers(2, 6))
    along_x = width < height
    side, other = (height, width) if along_x else (width, height)
    at = int(side * rng.uniform(0.35, 0.65))
    wall = np.zeros(other, dtype=bool)
    wall[:] = True
    for _ in range(int(rng.integers(1, 3))):
        door = int(rng.uniform(9, 30))
        place = int(rng.integers(4, max(5, other - door - 4)))
        wall[place : place + door] = False
    for n in np.flatnonzero(wall):
        if along_x:
            cells[low + at : low + at + thick, left + n] = OCCUPIED
        else:
            cells[low + n, left + at : left + at + thick] = OCCUPIED
    if along_x:
        _divide(cells, rng, left, low, right, low + at)
        _divide(cells, rng, left, low + at + thick, right, high)
    else:
        _divide(cells, rng, left, low, left + at, high)
        _divide(cells, rng, left + at + thick, low, right, high)


def _furnish(cells: Cells, rng: np.random.Generator) -> None:
    """Put machines, shelves and pillars on the floor."""
    rows, cols = cells.shape
    for _ in range(rows * cols // 2200):
        kind = rng.random()
        if kind < 0.35:
            w, h = rng.integers(8, 35, 2)
        elif kind < 0.6:
            w, h = (int(rng.integers(25, 60)), 8) if rng.random() < 0.5 else (8, int(rng.integers(25, 60)))
        else:
            w = h = int(rng.integers(3, 7))
        r, c = int(rng.integers(3, max(4, rows - h - 3))), int(rng.integers(3, max(4, cols - w - 3)))
        if (cells[max(0, r - 8) : r + h + 8, max(0, c - 8) : c + w + 8] == FREE).all() or rng.random() < 0.25:
            cells[r : r + h, c : c + w] = OCCUPIED


def _entry(cells: Cells, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Clear an entry corridor at the lower edge and return start points in it."""
    col = int(rng.integers(15, cells.shape[1] - 15))
    cells[2:64, col - 12 : col + 12] = FREE
    cells[2:50, col - 14 : col - 11] = OCCUPIED
    cells[2:50, col + 11 : col + 14] = OCCUPIED
    return [((col + 0.5) * RES_M, y) for y in (1.2, 2.4, 3.6, 4.8)]


def _opened_up(cells: Cells, starts: list[tuple[float, float]]) -> bool:
    """Fill what no robot can see into from where it can go; tell whether three quarters of the floor are left."""
    clear = ndimage.distance_transform_edt(cells == FREE) * RES_M
    parts, _ = ndimage.label(clear > ROBOT_M)
    part = parts[int(starts[0][1] / RES_M), int(starts[0][0] / RES_M)]
    if part == 0:
        return False
    near = ndimage.binary_dilation(parts == part, iterations=round(ROBOT_M / RES_M) + 1) & (cells == FREE)
    floor = int((cells == FREE).sum())
    regions, _ = ndimage.label(cells == FREE)
    kept = np.isin(regions, np.unique(regions[near])) & (regions > 0)
    cells[~kept] = OCCUPIED
    return bool(near.sum() > 0.75 * floor)


def main() -> None:
    """Write buildings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=6)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    for seed in range(options.count):
        made, starts = building(seed)
        save_map(made, options.folder / f"building_{seed}.yaml")
        (options.folder / f"building_{seed}.json").write_text(json.dumps(starts) + "\n")


if __name__ == "__main__":
    main()
