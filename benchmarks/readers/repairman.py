"""Multi-repairman problems with profits: a customer of profit p served at time t earns ``p - t``, if that is positive.

The file's first line holds the number of nodes (the depot first) and of repairmen; each further line holds
``x y profit``, or a number of the node before them. A cell of weight 1 and deadline p - 1 earns exactly ``p - t``,
with t the driven distance; T is the largest profit. Distances are Euclidean, rounded to whole steps, 0 counting as 1;
profits are rounded down.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.readers.latency import robot
from benchmarks.readers.text import fault, lines_of, number

MAX_NODES = 3000


def read(file: str) -> list[dict[str, Any]]:
    """Return the one ``oros`` instance of a file of a multi-repairman problem with profits."""
    rows = [(k, line.split()) for k, line in enumerate(lines_of(file), start=1) if line.strip()]
    if not rows or len(rows[0][1]) != 2:
        fault(file, "line 1", "expected the number of nodes and the number of repairmen")
    n, repairmen = (number(file, f"line {rows[0][0]}", word) for word in rows[0][1])
    if n != int(n) or repairmen != int(repairmen) or not 2 <= n <= MAX_NODES or repairmen < 1:
        fault(file, f"line {rows[0][0]}", f"expected 2 to {MAX_NODES} nodes and at least 1 repairman")
    if len(rows) - 1 != n:
        fault(file, "", f"expected {int(n)} lines with x, y and profit, found {len(rows) - 1}")
    nodes = np.zeros((int(n), 3))
    for i, (line, words) in enumerate(rows[1:]):
        if len(words) not in (3, 4):
            fault(file, f"line {line}", f"expected x, y and profit, found {len(words)} words")
        nodes[i] = [number(file, f"line {line}", word) for word in words[-3:]]
    nodes[0, 2] = 0.0
    profit = np.floor(nodes[:, 2] + 1e-9).astype(np.int64)
    horizon = int(max(1, profit.max()))
    return [
        {
            "kind": "oros",
            "schema_version": 1,
            "name": f"repairmen_{Path(file).stem}",
            "horizon_steps": horizon,
            "step_s": 1.0,
            "cells": [
                {
                    "id": f"c{i}", "x_m": float(x), "y_m": float(y), "weight": float(i > 0 and profit[i] > 1),
                    "deadline_step": int(max(0, profit[i] - 1)),
                }
                for i, (x, y, _) in enumerate(nodes)
            ],
            "travel": [
                {"from": f"c{i}", "to": f"c{j}", "steps": steps, "energy_j": 0.0}
                for i in range(int(n))
                for j in range(1, int(n))
                if i != j
                for steps in [max(1, math.floor(math.hypot(*(nodes[i, :2] - nodes[j, :2])) + 0.5))]
                if steps <= horizon
            ],
            "robots": [robot(f"r{k}", "c0") for k in range(int(repairmen))],
        }
    ]  # fmt: skip
