"""Minimum latency problems as ``oros`` instances: every customer a cell, the sum of arrival times as the objective.

A customer first sensed at t earns ``T - t + 1``, so a plan that explores all n of them has the coverage
``n (T + 1) - latency``: the most coverage is the least latency. T is such that nothing better takes longer (see
:func:`enough_steps`). All robots leave cell 0, which weighs nothing and which nobody comes back to; moving costs no
energy; distances of 0 count as 1.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse.csgraph import dijkstra

MOST_IMPROVED = 80  # cells, with a mark between each two robots, of routes that are improved


def latency_instance(name: str, matrix: Any, points: Any, robots: int = 1, step_s: float = 1.0) -> dict[str, Any]:
    """Return the minimum latency problem on a matrix of whole distances, as an ``oros`` instance."""
    n = len(matrix)
    steps = np.maximum(matrix, 1)
    return {
        "kind": "oros",
        "schema_version": 1,
        "name": name if robots == 1 else f"{name}_{robots}",
        "horizon_steps": enough_steps(steps, robots),
        "step_s": step_s,
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
        "robots": [robot(f"r{k}", "c0") for k in range(robots)],
    }


def robot(name: str, start: str) -> dict[str, Any]:
    """Return a robot whose battery plays no part."""
    return {"id": name, "start": start, "battery_j": 0.0, "capacity_j": 0.0, "idle_w": 0.0, "sensing_w": 0.0}


def latency_of(instance: Any, coverage: float) -> float:
    """Return the latency, in steps, of a coverage (or the least latency that a bound on the coverage leaves)."""
    return float((len(instance.cells) - 1) * (instance.horizon_steps + 1) - coverage)


def enough_steps(steps: Any, robots: int = 1) -> int:
    """Return a horizon that no routes of minimum latency exceed, and by which leaving out customers does not pay.

    Good routes have some latency U. Where somebody's last arrival is after T, the k-th last arrival of that route, and
    so of all, is after T - (k - 1) d, with d the longest leg (its first is by d, so there are arrivals as long as this
    says anything), and the k-th of all arrivals is not before the distance of the k-th nearest customer. Where these
    sum up to U or more, T is enough. A plan that leaves out customers counts each as if it came at T + 1: the same sum,
    for if it is best, nobody's last arrival is before T + 1 - d.
    """
    n, longest = len(steps), int(steps[:, 1:].max())
    near = np.sort(dijkstra(steps, indices=0)[1:])
    known = latency(steps, good_routes(steps, robots))
    later = longest * np.arange(n - 2, -1, -1)
    return bisect_left(range(known), known, lo=int(near.max()), key=lambda t: np.maximum(near, t + 1 - later).sum())


def latency(distances: Any, routes: Sequence[Sequence[int]]) -> Any:
    """Return the sum of arrival times of routes from cell 0, each an order of cells."""
    return sum(np.cumsum(distances[[0, *route[:-1]], list(route)]).sum() for route in routes if route)


def good_routes(steps: Any, robots: int) -> list[list[int]]:
    """Return routes of a good latency: a first order of cells, then the best of moves and turns until there is none.

    The routes are one order of cells with a 0 between each two robots, so that moving a cell or turning a stretch
    round also moves what is in it from one robot to another. First orders are that of the nearest neighbours and, for
    several robots, that of the cheapest insertions.
    """
    orders = [_nearest(steps, robots)]
    if len(orders[0]) <= MOST_IMPROVED:
        orders += [_inserted(steps, robots)] if robots > 1 else []
        orders = [_improved(steps, order) for order in orders]
    order = min(orders, key=lambda order: _latency_of_order(steps, order))
    starts = [i for i, cell in enumerate(order) if cell == 0]
    return [order[i + 1 : j] for i, j in zip(starts, [*starts[1:], len(order)], strict=True)]


def _nearest(steps: Any, robots: int) -> list[int]:
    left, routes, ready = set(range(1, len(steps))), [[0] for _ in range(robots)], [0] * robots
    while left:
        t, k, j = min((ready[k] + steps[route[-1], j], k, j) for k, route in enumerate(routes) for j in left)
        routes[k].append(j)
        ready[k] = t
        left.discard(j)
    return [cell for route in routes for cell in route]


def _inserted(steps: Any, robots: int) -> list[int]:
    order, left = [0] * robots, set(range(1, len(steps)))
    while left:
        order = min(
            ([*order[:b], j, *order[b:]] for j in left for b in range(1, len(order) + 1)),
            key=lambda longer: (_latency_of_order(steps, longer), longer),
        )
        left -= set(order)
    return order


def _improved(steps: Any, order: list[int]) -> list[int]:
    best, improved = _latency_of_order(steps, order), True
    while improved:
        improved = False
        for a in range(1, len(order)):
            for b in range(1, len(order)):
                moved = order[:a] + order[a + 1 :]
                moved.insert(b, order[a])
                turned = order[:a] + order[a : b + 1][::-1] + order[b + 1 :]
                for changed in (moved, turned) if a < b else (moved,):
                    if (worth := _latency_of_order(steps, changed)) < best:
                        best, order, improved = worth, changed, True
    return order


def _latency_of_order(steps: Any, order: list[int]) -> int:
    to = np.array(order[1:])
    mark = to == 0
    passed = np.cumsum(np.where(mark, 0, steps[order[:-1], to]))
    return int((passed - np.maximum.accumulate(np.where(mark, passed, 0)))[~mark].sum())
