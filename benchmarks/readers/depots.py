"""Multi-depot cumulative vehicle routing files as minimum latency problems.

The file holds the numbers of customers and depots, the capacity of a vehicle, then x and y of each customer and of each
depot, then their demands. Any vehicle may begin at any depot and none comes back, so all of them leave one cell from
which each customer is as far as from its nearest depot.

What the engine cannot say is the capacity: it is left out. The least latency found is then at most that of the
capacitated problem, and equal to it where the loads of the plan fit (:func:`loads`). Distances are Euclidean; they are
rounded down to whole steps, so that a proven latency bounds that of the unrounded ones from below (it may be a step
less than the best order has, where passing through a customer is shorter than the way rounded down).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.readers.latency import latency_instance
from benchmarks.readers.text import Words, fault

MAX_CUSTOMERS = 3000


@dataclass(frozen=True)
class Depots:
    """A multi-depot cumulative vehicle routing problem: places in units of length, loads in units of demand."""

    customers: Any
    depots: Any
    demands: list[float]
    capacity: float

    def distances(self) -> Any:
        """Return the distances between cell 0, which stands for the nearest depot, and the customers, in units."""
        n = len(self.customers)
        matrix = np.zeros((n + 1, n + 1))
        matrix[1:, 1:] = np.hypot(*(self.customers[:, None] - self.customers[None]).transpose(2, 0, 1))
        first = np.hypot(*(self.depots[:, None] - self.customers[None]).transpose(2, 0, 1)).min(axis=0)
        matrix[0, 1:] = matrix[1:, 0] = first
        return matrix

    def instance(self, name: str, robots: int, steps_per_unit: int = 1) -> dict[str, Any]:
        """Return the ``oros`` instance for a number of robots; a unit of length takes ``steps_per_unit`` steps."""
        steps = np.floor(self.distances() * steps_per_unit + 1e-9).astype(np.int64)
        points = np.vstack((self.depots.mean(axis=0), self.customers))
        return latency_instance(name, steps, points, robots, step_s=1.0 / steps_per_unit)

    def loads(self, routes: list[list[int]]) -> list[float]:
        """Return the demand that each route, an order of cells, serves."""
        return [sum(self.demands[cell - 1] for cell in route) for route in routes]


def read(file: str, robots: int = 1, steps_per_unit: int = 1) -> list[dict[str, Any]]:
    """Return the one ``oros`` instance of a multi-depot cumulative vehicle routing file."""
    return [parsed(file).instance(f"latency_{Path(file).stem}", robots, steps_per_unit)]


def parsed(file: str) -> Depots:
    """Return the problem of a file."""
    words = Words.of(file)
    n, m = words.count("the number of customers"), words.count("the number of depots")
    if n > MAX_CUSTOMERS or m > MAX_CUSTOMERS:
        fault(file, "", f"expected at most {MAX_CUSTOMERS} customers and depots")
    capacity = words.next("the capacity")
    places = np.array([[words.next("x"), words.next("y")] for _ in range(n + m)])
    demands = [words.next("a demand") for _ in range(n + m)]
    if words.at < len(words.words):
        line, word = words.words[words.at]
        fault(file, f"line {line}", f"expected the end of the file, found {word[:40]!r}")
    return Depots(places[:n], places[n:], demands[:n], capacity)
