"""TSPLIB files as minimum latency problems: every city a cell, the sum of arrival times as the objective.

One robot, or several that leave the first city together. See :mod:`benchmarks.readers.latency`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.readers.latency import latency_instance
from benchmarks.readers.text import fault, lines_of, number

MAX_CITIES = 3000
Distance = Callable[[float, float, float, float], int]


def read(file: str, robots: int = 1) -> list[dict[str, Any]]:
    """Return the one ``oros`` instance of a TSPLIB file (TSP or ATSP)."""
    header, sections = _parsed(file)
    n = header.get("DIMENSION", "")
    if not n.isdigit() or not 2 <= int(n) <= MAX_CITIES:
        fault(file, "DIMENSION", f"expected a whole number from 2 to {MAX_CITIES}, found {n!r}")
    matrix, points = _distances(file, int(n), header, sections)
    name = header.get("NAME", Path(file).stem)
    return [latency_instance(f"latency_{name}", matrix, points, robots)]


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
