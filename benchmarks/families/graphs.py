"""Complete graphs with metric travel times, where every cell has a deadline of its own."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .grids import IDLE_W, SENSING_W
from .registry import family


@family(
    "oros", "a repairman problem with profits: metric travel over many steps, a deadline and a weight per cell",
    tiny={"n": 8, "robots": 2},
    small={"n": 15, "robots": 2},
    medium={"n": 20, "robots": 3},
    large={"n": 50, "robots": 4},
    huge={"n": 100, "robots": 5},
)  # fmt: skip
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
