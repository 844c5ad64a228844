"""First use: compiled kernels are loaded, or compiled and cached on disk, before any clock runs."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from react_opt.instance import (
    AssignmentInstance,
    Document,
    InspectionInstance,
    OrosInstance,
)
from react_opt.options import SolveOptions
from react_opt.solvers.routes.choice import Pool, best_choice
from react_opt.solvers.routes.columns import Duals
from react_opt.solvers.routes.enumeration import enumerate_routes
from react_opt.solvers.routes.memory import Memory, fewest_steps
from react_opt.solvers.routes.pricing import RoutePricer
from react_opt.solvers.routes.setcuts import separate_sets
from react_opt.solvers.routes.setjoin import best_of_each
from react_opt.solvers.routes.setprices import coefficients_of_sets, set_prices
from react_opt.solvers.routes.smoothing import SmoothedDual
from react_opt.timegraph import route_problem

ANNOUNCE_AFTER_S = 6.0  # loading from the cache takes less, but on a busy machine
_warm: set[str] = set()


def warm_up(kind: str, solver: Callable[..., Any]) -> float:
    """Run tiny instances of a kind once per process, so that every kernel is ready; return the seconds it took.

    A machine's first use compiles for a minute or two, which is announced through the ``react_opt`` logger (on
    standard error where logging is not configured); later uses load the cache.

    Parameters
    ----------
    kind
        Kind of instance.
    solver
        The recipe of that kind, called with an instance, options and no start.
    """
    if kind in _warm:
        return 0.0
    begun = time.perf_counter()
    with _announced():
        for instance in _TINY[kind]():
            solver(instance, SolveOptions(time_limit_s=None, work_limit=40, threads=1, explain=True), None)
            if isinstance(instance, OrosInstance):
                _smooth(instance)
                _enumerate(instance)
    _warm.add(kind)
    return time.perf_counter() - begun


def _smooth(instance: OrosInstance) -> None:
    """Run the kernels that the route decomposition needs for large instances only."""
    problem = route_problem(instance)
    smooth = SmoothedDual(problem, [{cell} for cell in range(problem.n_cells)])
    smooth.value(np.zeros(problem.n_cells), 1.0)
    smooth.draw(0, 1, np.random.default_rng(0))


def _enumerate(instance: OrosInstance) -> None:
    """Run the kernels that it needs only where column generation leaves a gap."""
    problem = route_problem(instance)
    pricer = RoutePricer(problem, Memory(fewest_steps(problem), 4))
    none = np.zeros(0)
    duals = Duals(np.zeros(problem.n_cells), np.zeros(len(problem.classes)), none, none)
    found = enumerate_routes(pricer, 0, duals, 0.0)
    assert found is not None
    look = found.look(set_prices(duals.cell, (), none), 0.0, 1000)
    best_of_each(look.sets, look.value)  # where there are threads
    pool = Pool(look.value, np.zeros(len(look.value)), np.zeros(len(look.value), np.int64), look.sets)
    coefficients_of_sets(look.sets, ())
    separate_sets(1 - np.eye(6, dtype=np.uint8), np.full(6, 0.3), set(), 1)  # cells in common: sets grow to all sizes
    best_choice(pool, np.ones(1, np.int64), np.zeros(problem.n_cells), 1.0, 0.0, 1, pricer.stop)


@contextmanager
def _announced() -> Iterator[None]:
    text = "preparing compiled kernels: at their first use on a machine a minute or two, cached afterwards"
    timer = threading.Timer(ANNOUNCE_AFTER_S, logging.getLogger("react_opt").warning, [text])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _oros() -> Iterator[Document]:
    """A ring of cells with a chord: batteries that bind or not, chargers, limits between robots."""
    n, horizon = 8, 10
    travel = [
        {"from": f"c{i}", "to": f"c{j % n}", "steps": d, "energy_j": 3.0 * d}
        for i in range(n)
        for j, d in ((i + 1, 1), (i - 1, 1), (i + 3, 2))
    ]
    chargers = {"chargers": [{"cell": "c2", "power_w": 9.0}]}
    coupled = {"limits": {"robots_per_cell": 1, "forbid_swaps": True}}
    for battery_j, more in ((1000.0, {}), (60.0, {}), (60.0, chargers), (1000.0, coupled)):
        robots = [
            {"id": f"r{k}", "start": f"c{k}", "battery_j": battery_j, "capacity_j": battery_j, "idle_w": 1.0,
             "sensing_w": 5.0, "start_step": k}
            for k in range(2)
        ]  # fmt: skip
        yield OrosInstance.model_validate(
            {
                "name": "warm-up", "horizon_steps": horizon, "step_s": 1.0, "travel": travel, "robots": robots,
                "cells": [{"id": f"c{i}", "x_m": 0.0, "y_m": 0.0, "weight": 1.0 + i % 3} for i in range(n)],
                **more,
            }
        )  # fmt: skip


def _assignment() -> Iterator[Document]:
    """Plain, and with capacities and conflicts."""
    for capacity, conflicts in ((1, []), (2, [["t0", "t1"], ["t1", "t2"]])):
        yield AssignmentInstance.model_validate(
            {
                "name": "warm-up",
                "robots": [{"id": f"r{r}", "battery_j": 30.0, "capacity": capacity} for r in range(2)],
                "targets": [{"id": f"t{k}", "gain": 5.0 + k} for k in range(4)],
                "costs": [
                    {"robot": f"r{r}", "target": f"t{k}", "time_s": 1.0 + (r + k) % 3, "energy_j": 9.0 + k}
                    for r in range(2)
                    for k in range(4)
                ],
                "conflicts": conflicts,
            }
        )


def _inspection() -> Iterator[Document]:
    """Two robots and a handful of targets on a line, with a time budget that leaves some out."""
    names = [f"t{k}" for k in range(6)]
    at = {"a": 0.0, **{name: 1.0 + k for k, name in enumerate(names)}}
    travel = [
        {"from": i, "to": j, "time_s": abs(at[i] - at[j]), "energy_j": 2.0 * abs(at[i] - at[j])}
        for i in at
        for j in at
        if i != j
    ]
    yield InspectionInstance.model_validate(
        {
            "name": "warm-up", "time_left_s": 7.0, "travel": travel,
            "robots": [
                {"id": "r0", "at": "a", "battery_j": 14.0},
                {"id": "r1", "at": "t3", "battery_j": 9.0, "end": "a"},
            ],
            "targets": [{"id": name, "value": 1.0 + k % 2, "service_s": 0.5} for k, name in enumerate(names)],
        }
    )  # fmt: skip


_TINY: dict[str, Callable[[], Iterator[Document]]] = {
    "oros": _oros,
    "assignment": _assignment,
    "inspection": _inspection,
}


def tiny_instances(kind: str) -> list[Document]:
    """Return instances of a kind that any solver solves at once: what a benchmark runs before its clock."""
    return list(_TINY[kind]())
