"""TSPLIB files as minimum latency problems: one robot, every city a cell, the sum of arrival times as the objective.

A city first sensed at t earns ``T - t + 1``, so a plan that explores all n - 1 cities has the coverage
``(n - 1) (T + 1) - latency``: the most coverage is the least latency. T is such that nothing better takes longer (see
:func:`enough_steps`).
The depot is the first city and weighs nothing; moving costs no energy; distances of 0 count as 1.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse.csgraph import dijkstra

from benchmarks.readers.text import fault, lines_of, number

MAX_CITIES = 3000
MOST_IMPROVED = 60  # cities of a tour that is improved
Distance = Callable[[float, float, float, float], int]


def read(file: str) -> list[dict[str, Any]]:
    """Return the one ``oros`` instance of a TSPLIB file (TSP or ATSP)."""
    header, sections = _parsed(file)
    n = header.get("DIMENSION", "")
    if not n.isdigit() or not 2 <= int(n) <= MAX_CITIES:
        fault(file, "DIMENSION", f"expected a whole number from 2 to {MAX_CITIES}, found {n!r}")
    matrix, points = _distances(file, int(n), header, sections)
    name = header.get("NAME", Path(file).stem)
    return [latency_instance(f"latency_{name}", matrix, points)]


def latency_instance(name: str, matrix: Any, points: Any) -> dict[str, Any]:
    """Return the minimum latency problem on a matrix of whole distances, as an ``oros`` instance."""
    n = len(matrix)
    steps = np.maximum(matrix, 1)
    horizon = enough_steps(steps)
    return {
        "kind": "oros",
        "schema_version": 1,
        "name": name,
        "horizon_steps": horizon,
        "step_s": 1.0,
        "cells": [
            {"id": f"c{i}", "x_m": float(points[i][0]), "y_m": float(points[i][1]), "weight": float(i > 0)}
            for i in range(n)
        ],
        "travel": [
            {"from": f"c{i}", "to": f"c{j}", "steps": int(steps[i, j]), "energy_j": 0.0}
            for i in range(n)
            for j in range(n)
            if i != j and j > 0
        ],
        "robots": [robot("r0", "c0")],
    }


def robot(name: str, start: str) -> dict[str, Any]:
    """Return a robot whose battery plays no part."""
    return {"id": name, "start": start, "battery_j": 0.0, "capacity_j": 0.0, "idle_w": 0.0, "sensing_w": 0.0}


def enough_steps(steps: Any) -> int:
    """Return a horizon that no minimum latency tour exceeds, and by which leaving out cities does not pay.

    The tour of the nearest neighbours, improved by moving cities and turning stretches round, has some latency U. A
    tour whose last arrival is after T has its k-th last arrival after T - (k - 1) d, with d the longest leg, and its
    k-th arrival not before the distance of the k-th nearest city. Where these sum up to U or more, T is enough. A plan
    that leaves out cities for which there is no time any more counts each as if it came at T + 1: the same sum.
    """
    n, longest = len(steps), int(steps.max())
    if n < 2:
        return 1
    near = np.sort(dijkstra(steps, indices=0)[1:])
    known = _good_latency(steps)
    later = longest * np.arange(n - 2, -1, -1)
    return bisect_left(range(known), known, lo=longest, key=lambda t: np.maximum(near, t + 1 - later).sum())


def _good_latency(steps: Any) -> int:
    """Return the latency of a good tour: nearest neighbours, then the best of moves and turns until there is none."""
    left, tour = set(range(1, len(steps))), [0]
    while left:
        tour.append(min(left, key=lambda j: (steps[tour[-1], j], j)))
        left.discard(tour[-1])

    def latency(order: list[int]) -> int:
        return int(np.cumsum(steps[order[:-1], order[1:]]).sum())

    best, improved = latency(tour), len(tour) <= MOST_IMPROVED
    while improved:
        improved = False
        for a in range(1, len(tour)):
            for b in range(1, len(tour)):
                moved = tour[:a] + tour[a + 1 :]
                moved.insert(b, tour[a])
                turned = tour[:a] + tour[a : b + 1][::-1] + tour[b + 1 :]
                for order in (moved, turned) if a < b else (moved,):
                    if (worth := latency(order)) < best:
                        best, tour, improved = worth, order, True
    return best


def _parsed(file: str) -> tuple[dict[str, str], dict[str, list[tuple[int, list[str]]]]]:
    """Return the specification and the data sections, as words by line."""
    header: dict[str, str] = {}
    sections: dict[str, list[tuple[int, list[str]]]] = {}
    section: list[tuple[int, list[str]]] | None = None
    for k, line in enumerate(lines_of(file), start=1):
        text = line.strip()
        if not text:
            continue
        if text == "EOF":
            break
        key = text.split(":")[0].strip().upper()
        if ":" in text and not key.endswith("_SECTION"):
            header[key] = text.split(":", 1)[1].strip()
            section = None
        elif key.endswith("_SECTION"):
            section = sections.setdefault(key, [])
        elif section is not None:
            section.append((k, text.split()))
        else:
            fault(file, f"line {k}", f"expected KEY : VALUE or a section, found {text[:40]!r}")
    return header, sections


def _distances(file: str, n: int, header: dict[str, str], sections: Any) -> tuple[Any, Any]:
    kind = header.get("EDGE_WEIGHT_TYPE", "")
    points = np.zeros((n, 2))
    if kind == "EXPLICIT":
        return _explicit(file, n, header.get("EDGE_WEIGHT_FORMAT", ""), sections), points
    if kind not in DISTANCES:
        fault(file, "EDGE_WEIGHT_TYPE", f"expected one of EXPLICIT, {', '.join(DISTANCES)}, found {kind!r}")
    rows = sections.get("NODE_COORD_SECTION", [])
    if len(rows) != n:
        fault(file, "NODE_COORD_SECTION", f"expected {n} lines, found {len(rows)}")
    for i, (line, words) in enumerate(rows):
        if len(words) != 3:
            fault(file, f"line {line}", f"expected a number of the city and two coordinates, found {len(words)} words")
        points[i] = [number(file, f"line {line}", word) for word in words[1:]]
    distance = DISTANCES[kind]
    matrix = np.array([[distance(*points[i], *points[j]) for j in range(n)] for i in range(n)], dtype=np.int64)
    return matrix, points


def _explicit(file: str, n: int, form: str, sections: Any) -> Any:
    upper = [(i, j) for i in range(n) for j in range(n) if j > i]
    places = {
        "FULL_MATRIX": [(i, j) for i in range(n) for j in range(n)],
        "UPPER_ROW": upper,
        "UPPER_DIAG_ROW": [(i, j) for i in range(n) for j in range(i, n)],
        "LOWER_ROW": [(i, j) for i in range(n) for j in range(i)],
        "LOWER_DIAG_ROW": [(i, j) for i in range(n) for j in range(i + 1)],
    }
    if form not in places:
        fault(file, "EDGE_WEIGHT_FORMAT", f"expected one of {', '.join(places)}, found {form!r}")
    words = [(line, word) for line, row in sections.get("EDGE_WEIGHT_SECTION", []) for word in row]
    if len(words) != len(places[form]):
        fault(file, "EDGE_WEIGHT_SECTION", f"expected {len(places[form])} numbers, found {len(words)}")
    matrix = np.zeros((n, n), dtype=np.int64)
    for (i, j), (line, word) in zip(places[form], words, strict=True):
        value = number(file, f"line {line}", word)
        if value != int(value) or value < 0:
            fault(file, f"line {line}", f"expected a whole distance >= 0, found {word!r}")
        matrix[i, j] = int(value)
        if form != "FULL_MATRIX":
            matrix[j, i] = int(value)
    return matrix


def _round(value: float) -> int:
    return int(value + 0.5)


def _att(x: float, y: float, u: float, v: float) -> int:
    r = math.sqrt(((x - u) ** 2 + (y - v) ** 2) / 10.0)
    t = _round(r)
    return t + 1 if t < r else t


def _geo(x: float, y: float, u: float, v: float) -> int:
    def radians(value: float) -> float:
        degrees = math.trunc(value)
        return 3.141592 * (degrees + 5.0 * (value - degrees) / 3.0) / 180.0  # TSPLIB's own pi

    q1 = math.cos(radians(y) - radians(v))
    q2, q3 = math.cos(radians(x) - radians(u)), math.cos(radians(x) + radians(u))
    return int(6378.388 * math.acos(max(-1.0, min(1.0, 0.5 * ((1.0 + q1) * q2 - (1.0 - q1) * q3)))) + 1.0)


DISTANCES: dict[str, Distance] = {
    "EUC_2D": lambda x, y, u, v: _round(math.hypot(x - u, y - v)),
    "CEIL_2D": lambda x, y, u, v: math.ceil(math.hypot(x - u, y - v)),
    "MAN_2D": lambda x, y, u, v: _round(abs(x - u) + abs(y - v)),
    "MAX_2D": lambda x, y, u, v: max(_round(abs(x - u)), _round(abs(y - v))),
    "ATT": _att,
    "GEO": _geo,
}
