"""Chao's team orienteering files: ``n N``, ``m M``, ``tmax T``, then a line ``x y score`` per point.

Routes lead from the first point to the last within T; distances are Euclidean. They become ``inspection`` instances
whose batteries play no part.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from benchmarks.readers.text import fault, lines_of, number


def read(file: str) -> list[dict[str, Any]]:
    """Return the one ``inspection`` instance of a team orienteering file."""
    rows = [(k, line.replace(";", " ").split()) for k, line in enumerate(lines_of(file), start=1) if line.strip()]
    head: dict[str, float] = {}
    for key, (line, words) in zip(("n", "m", "tmax"), rows[:3], strict=False):
        if len(words) != 2 or words[0].lower() != key:
            fault(file, f"line {line}", f"expected '{key} NUMBER', found {' '.join(words)[:40]!r}")
        head[key] = number(file, f"line {line}", words[1])
    if len(head) < 3:
        fault(file, "", "expected the lines n, m and tmax")
    n, robots = int(head["n"]), int(head["m"])
    if n != head["n"] or robots != head["m"] or n < 2 or robots < 1 or head["tmax"] < 0:
        fault(file, "", "expected n >= 2 and m >= 1 whole, and tmax >= 0")
    if len(rows) - 3 != n:
        fault(file, "", f"expected {n} points, found {len(rows) - 3}")
    points = []
    for line, words in rows[3:]:
        if len(words) != 3:
            fault(file, f"line {line}", f"expected x, y and score, found {len(words)} words")
        points.append([number(file, f"line {line}", word) for word in words])
        if points[-1][2] < 0:
            fault(file, f"line {line}", f"expected a score >= 0, found {words[2]}")
    names = ["start", *(f"p{i}" for i in range(1, n - 1)), "end"]
    return [
        {
            "kind": "inspection",
            "schema_version": 1,
            "name": f"orienteering_{Path(file).stem}",
            "time_left_s": head["tmax"],
            "robots": [{"id": f"r{k}", "at": "start", "end": "end", "battery_j": 0.0} for k in range(robots)],
            "targets": [{"id": names[i], "value": points[i][2]} for i in range(1, n - 1)],
            "travel": [
                {"from": names[i], "to": names[j], "time_s": math.dist(points[i][:2], points[j][:2]), "energy_j": 0.0}
                for i in range(n - 1)
                for j in range(1, n)
                if i != j
            ],
        }
    ]
