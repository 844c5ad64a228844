"""Buildings as graphs: corridors with rooms on both sides, and trees that force every robot to come back."""

from __future__ import annotations

from typing import Any

import numpy as np

from .grids import IDLE_W, MOVE_J, SENSING_W, STEP_S, WORST_STEP_J
from .registry import family


@family(
    "oros", "corridors with dead-end rooms: every room is entered and left through its door",
    tiny={"length": 5, "robots": 2, "horizon": 20},
    small={"length": 14, "robots": 2, "horizon": 30},
    medium={"length": 25, "robots": 3, "horizon": 50},
    large={"length": 60, "robots": 4, "horizon": 100},
    huge={"length": 200, "robots": 8, "horizon": 200},
)  # fmt: skip
def corridor(length: int, robots: int, horizon: int, seed: int) -> dict[str, Any]:
    """A corridor of cells, most of which have a room to the left, to the right, or both; rooms weigh 1 to 5.

    Parameters
    ----------
    length
        Cells of the corridor; the robots start at its first.
    robots, horizon
        Number of robots, and T in steps of 10 s.
    seed
        Seed of the rooms and their weights.
    """
    rng = np.random.default_rng(seed)
    cells: list[tuple[str, float, float, float]] = []
    edges: list[tuple[str, str]] = []
    for k in range(length):
        cells.append((f"h{k}", 10.0 * k + 5.0, 15.0, 1.0))
        if k:
            edges.append((f"h{k - 1}", f"h{k}"))
        for side, y_m in (("a", 5.0), ("b", 25.0)):
            if rng.random() < 0.7:
                cells.append((f"{side}{k}", 10.0 * k + 5.0, y_m, float(rng.integers(1, 6))))
                edges.append((f"h{k}", f"{side}{k}"))
    return _instance(f"corridor_{length}_r{robots}_t{horizon}_s{seed}", cells, edges, robots, horizon)


@family(
    "oros", "random trees: no way round, so what is passed twice earns once",
    tiny={"n": 10, "robots": 2, "horizon": 20},
    small={"n": 40, "robots": 2, "horizon": 40},
    medium={"n": 80, "robots": 3, "horizon": 60},
    large={"n": 200, "robots": 4, "horizon": 100},
    huge={"n": 1000, "robots": 8, "horizon": 200},
)  # fmt: skip
def tree(n: int, robots: int, horizon: int, seed: int) -> dict[str, Any]:
    """A random tree in which every cell hangs on one of the six before it; cells weigh 1 to 3.

    Parameters
    ----------
    n
        Number of cells; the robots start at the root.
    robots, horizon
        Number of robots, and T in steps of 10 s.
    seed
        Seed of the tree and the weights.
    """
    rng = np.random.default_rng(seed)
    above = [max(0, k - int(rng.integers(1, 7))) for k in range(1, n)]
    depth = [0]
    for parent in above:
        depth.append(depth[parent] + 1)
    weight = rng.integers(1, 4, n)
    cells = [(f"c{k}", 10.0 * (k % 30) + 5.0, 10.0 * depth[k] + 5.0, float(weight[k])) for k in range(n)]
    edges = [(f"c{parent}", f"c{k}") for k, parent in enumerate(above, start=1)]
    return _instance(f"tree_{n}_r{robots}_t{horizon}_s{seed}", cells, edges, robots, horizon)


def _instance(
    name: str, cells: list[tuple[str, float, float, float]], edges: list[tuple[str, str]], robots: int, horizon: int
) -> dict[str, Any]:
    battery = horizon * WORST_STEP_J + 1.0
    return {
        "kind": "oros",
        "schema_version": 1,
        "name": name,
        "horizon_steps": horizon,
        "step_s": STEP_S,
        "cells": [{"id": i, "x_m": x_m, "y_m": y_m, "weight": weight} for i, x_m, y_m, weight in cells],
        "travel": [
            {"from": i, "to": j, "steps": 1, "energy_j": MOVE_J}
            for one, other in edges
            for i, j in ((one, other), (other, one))
        ],
        "robots": [
            {
                "id": f"r{k}", "start": cells[0][0], "battery_j": battery, "capacity_j": battery, "idle_w": IDLE_W,
                "sensing_w": SENSING_W,
            }
            for k in range(robots)
        ],
    }  # fmt: skip
