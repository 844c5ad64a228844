"""Grids of cells between walls: with ample batteries, with tight ones, and with chargers."""

from __future__ import annotations

from typing import Any

import numpy as np

from .registry import family

STEP_S = 10.0
IDLE_W = 2.0
SENSING_W = 16.9
MOVE_J = 70.0
WORST_STEP_J = 239.0  # one move and one sensing


@family(
    "oros", "4-neighbour grids whose walls force detours; batteries cannot bind",
    tiny={"rows": 2, "cols": 5, "robots": 2, "horizon": 24},
    small={"rows": 4, "cols": 10, "robots": 3, "horizon": 24},
    medium={"rows": 8, "cols": 8, "robots": 4, "horizon": 28},
    large={"rows": 10, "cols": 10, "robots": 4, "horizon": 40},
    huge={"rows": 20, "cols": 20, "robots": 4, "horizon": 120},
    giant={"rows": 40, "cols": 40, "robots": 10, "horizon": 240},
    colossal={"rows": 60, "cols": 60, "robots": 10, "horizon": 240},
)  # fmt: skip
def walled_grid(
    rows: int,
    cols: int,
    robots: int,
    horizon: int,
    seed: int,
    battery_factor: float = 1.0,
    *,
    removed: float = 0.2,
    starts: str = "corner",
    limits: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """4-neighbour grid with unit steps, some of whose edges are walls.

    Parameters
    ----------
    rows, cols
        Size of the grid.
    robots
        Number of robots.
    horizon
        T in steps of 10 s.
    seed
        Seed of the walls (and of the starts, where they are random).
    battery_factor
        Battery and capacity as a share of ``T * 239 J`` (plus 1 J): 1 cannot bind, 0.5 does.
    removed
        Share of the edges that are removed; the grid stays connected.
    starts
        ``"corner"`` (all in the first cell) or ``"random"``.
    limits
        The instance's ``limits`` group.
    """
    rng = np.random.default_rng(seed)
    edges = [(i, i + 1) for i in range(rows * cols) if (i + 1) % cols]
    edges += [(i, i + cols) for i in range((rows - 1) * cols)]
    kept = _without_walls(rows * cols, edges, round(removed * len(edges)), rng)
    battery = battery_factor * horizon * WORST_STEP_J + 1.0
    at = [0] * robots if starts == "corner" else [int(i) for i in rng.integers(0, rows * cols, robots)]
    return {
        "kind": "oros",
        "schema_version": 1,
        "name": f"walled_grid_{rows}x{cols}_r{robots}_t{horizon}_s{seed}_b{battery_factor:g}",
        "horizon_steps": horizon,
        "step_s": STEP_S,
        "cells": [
            {
                "id": f"g{i // cols}_{i % cols}",
                "x_m": 10.0 * (i % cols) + 5.0,
                "y_m": 10.0 * (i // cols) + 5.0,
            }
            for i in range(rows * cols)
        ],
        "travel": [
            {
                "from": f"g{i // cols}_{i % cols}",
                "to": f"g{j // cols}_{j % cols}",
                "steps": 1,
                "energy_j": MOVE_J,
            }
            for edge in kept
            for i, j in (edge, edge[::-1])
        ],
        "robots": [
            {
                "id": f"r{k}",
                "start": f"g{i // cols}_{i % cols}",
                "battery_j": battery,
                "capacity_j": battery,
                "idle_w": IDLE_W,
                "sensing_w": SENSING_W,
            }
            for k, i in enumerate(at)
        ],
        "limits": dict(limits or {}),
    }


@family(
    "oros", "walled grids whose batteries decide who may go how far",
    tiny={"rows": 2, "cols": 5, "robots": 2, "horizon": 24},
    small={"rows": 5, "cols": 8, "robots": 2, "horizon": 30},
    medium={"rows": 8, "cols": 8, "robots": 4, "horizon": 28},
    large={"rows": 10, "cols": 10, "robots": 4, "horizon": 40},
    huge={"rows": 20, "cols": 20, "robots": 4, "horizon": 120},
)  # fmt: skip
def tight_grid(rows: int, cols: int, robots: int, horizon: int, seed: int) -> dict[str, Any]:
    """Walled grid with half the battery that moving and sensing at every step would take."""
    instance = walled_grid(rows, cols, robots, horizon, seed, 0.5)
    return {**instance, "name": f"tight_grid_{rows}x{cols}_r{robots}_t{horizon}_s{seed}"}


@family(
    "oros", "tight batteries, and chargers with one slot that robots share",
    tiny={"rows": 2, "cols": 4, "robots": 2, "horizon": 14},
    small={"rows": 3, "cols": 5, "robots": 2, "horizon": 20},
    medium={"rows": 5, "cols": 8, "robots": 3, "horizon": 30},
    large={"rows": 10, "cols": 10, "robots": 4, "horizon": 40},
)  # fmt: skip
def chargers(rows: int, cols: int, robots: int, horizon: int, seed: int) -> dict[str, Any]:
    """Walled grid where a quarter of the battery is there and a charger stands in every 20th cell or so.

    A charger gives 30 W to one robot at a time: 300 J per step of 10 s, more than a move and a sensing take.
    """
    instance = walled_grid(rows, cols, robots, horizon, seed, 0.25)
    rng = np.random.default_rng([seed, 1])
    places = sorted(rng.choice(rows * cols, max(1, rows * cols // 20), replace=False).tolist())
    for robot in instance["robots"]:
        robot["capacity_j"] = 2 * robot["battery_j"]
    return {
        **instance,
        "name": f"chargers_{rows}x{cols}_r{robots}_t{horizon}_s{seed}",
        "chargers": [{"cell": instance["cells"][i]["id"], "power_w": 30.0, "slots": 1} for i in places],
    }


def _without_walls(
    n: int, edges: list[tuple[int, int]], remove: int, rng: np.random.Generator
) -> list[tuple[int, int]]:
    """Edges left after ``remove`` of them are taken out at random without disconnecting the graph.

    The kept edges are a random spanning tree and, at random, as many more as there must be.
    """
    parent = list(range(n))

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    tree, rest = [], []
    for k in rng.permutation(len(edges)):
        i, j = edges[int(k)]
        if root(i) == root(j):
            rest.append((i, j))
        else:
            parent[root(i)] = root(j)
            tree.append((i, j))
    return sorted(tree + rest[: max(0, len(rest) - remove)])
