"""Seeded families of OROS instances, as JSON dictionaries of kind ``oros``.

Nothing of react_opt is imported: the families can be handed to any other solver.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

STEP_S = 10.0
IDLE_W = 2.0
SENSING_W = 16.9
MOVE_J = 70.0
WORST_STEP_J = 239.0  # one move and one sensing


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


def metric_complete(
    n: int, robots: int, seed: int, *, horizon: int | None = None, side_m: float = 60.0
) -> dict[str, Any]:
    """Complete graph on random points: metric travel times, every cell with a deadline and weight of its own.

    Parameters
    ----------
    n
        Number of cells; the robots start in the first.
    robots
        Number of robots.
    seed
        Seed of points, weights and deadlines.
    horizon
        T in steps of 1 s; by default about the length of a tour shared by the robots, some hundreds of steps.
    side_m
        Side of the square that holds the points; robots drive 1 m/s (rounded up to whole steps, which keeps
        the triangle inequality).
    """
    rng = np.random.default_rng(seed)
    x_m, y_m = rng.uniform(0.0, side_m, (2, n))
    if horizon is None:
        horizon = max(200, math.ceil(1.2 * side_m * math.sqrt(n) / robots))
    battery = horizon * 26.0 + 1.0
    weights = rng.integers(1, 6, n)
    deadlines = rng.integers(horizon // 4, horizon + 1, n)
    return {
        "kind": "oros",
        "schema_version": 1,
        "name": f"metric_complete_{n}_r{robots}_t{horizon}_s{seed}",
        "horizon_steps": horizon,
        "step_s": 1.0,
        "cells": [
            {
                "id": f"c{i}",
                "x_m": float(x_m[i]),
                "y_m": float(y_m[i]),
                "weight": float(weights[i]),
                "deadline_step": int(deadlines[i]),
            }
            for i in range(n)
        ],
        "travel": [
            {
                "from": f"c{i}",
                "to": f"c{j}",
                "steps": steps,
                "energy_j": 9.0 * steps,
            }
            for i in range(n)
            for j in range(n)
            if i != j
            for steps in [max(1, math.ceil(math.hypot(x_m[i] - x_m[j], y_m[i] - y_m[j])))]
        ],
        "robots": [
            {
                "id": f"r{k}",
                "start": "c0",
                "battery_j": battery,
                "capacity_j": battery,
                "idle_w": IDLE_W,
                "sensing_w": SENSING_W,
            }
            for k in range(robots)
        ],
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
