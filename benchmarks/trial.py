"""One run of one solver on one instance, in the child process that a job gives it: solve, measure, check."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from typing import Any

import psutil

from benchmarks.families import FAMILIES
from benchmarks.peers import PEERS, Limits, load_peers
from benchmarks.readers import read
from react_opt import check, jsonio
from react_opt.claims import optimality_tolerance
from react_opt.errors import ReactError, UsageError
from react_opt.jobs import Job, run_one
from react_opt.solvers.warm import tiny_instances

MAX_POINTS = 400  # of a trajectory
WARM_S = 20.0  # for a solver's first go at tiny instances, which loads its libraries
CERTIFY_S = 60.0  # for the independent recomputation of a bound


def prepare(kinds: list[str], families: list[str]) -> None:
    """Compile what is compiled, once on a machine, so that no run pays for it."""
    if "factory" in families:  # built from a map
        FAMILIES["factory"].make(seed=0, **FAMILIES["factory"].sizes["tiny"])
    for kind in kinds:
        for instance in tiny_instances(kind):
            PEERS["react_opt"].solve(instance, Limits(WARM_S), lambda *_: None)


def instance_of(case: Mapping[str, Any]) -> Any:
    """Return the instance of a case: a family with parameters and a seed, or a file in one of the known formats."""
    if "file" in case:
        return read(case["format"], case["file"], case["number"])
    made = FAMILIES[case["family"]].make(seed=case["seed"], **case["parameters"])
    return jsonio.parse(made)


def run(
    case: Mapping[str, Any],
    peer: str,
    files: list[str],
    time_s: float,
    threads: int,
    seed: int,
    gap: float,
    axis: str = "",
) -> dict[str, Any]:
    """Run a solver on an instance and return what is known of its answer, as JSON data.

    Parameters
    ----------
    case
        The instance; see :func:`instance_of`.
    peer
        Name of the solver.
    files
        Python files that register further solvers.
    time_s, threads, seed, gap
        Its limits.
    axis
        What grows along the series that the instance belongs to; recorded.
    """
    load_peers(files)
    solver = PEERS[peer]
    instance = instance_of(case)
    facts = {
        "what": "solve", "instance": instance.name, "case": dict(case), "axis": axis,
        "sha256": jsonio.sha256(instance), "kind": instance.kind,
        "size": size_of(instance), "peer": peer, "version": solver.version, "threads": threads, "seed": seed,
        "limit_s": time_s, "gap_asked": gap, "tolerance": tolerance_of(instance),
    }  # fmt: skip
    if not solver.takes(instance):
        return {**facts, "status": "not met", "reason": "does not take such instances"}
    for tiny in tiny_instances(instance.kind):  # libraries load, kernels come from the cache
        if solver.takes(tiny):
            _quietly(solver, tiny)
            break
    seen: list[tuple[float, float | None, float | None]] = []

    def tell(elapsed_s: float, incumbent: float | None, bound: float | None) -> None:
        point = (round(elapsed_s, 4), _finite(incumbent), _finite(bound))
        if not seen or point[1:] != seen[-1][1:]:
            seen.append(point)

    begun = time.perf_counter()
    with Memory() as memory:
        try:
            plan = solver.solve(instance, Limits(time_s, threads, seed, gap), tell)
        except ReactError as error:  # what it says on purpose: it cannot state this instance
            return {**facts, "status": "refused", "reason": str(error).splitlines()[0]}
    expected = f"{instance.kind}_plan"
    if getattr(plan, "kind", None) != expected:
        raise TypeError(f"the solver returned {type(plan).__name__}: expected a plan of kind {expected}")
    wall_s = time.perf_counter() - begun - plan.claim.wall_s.get("warm_up", 0.0)
    found = check(instance, plan)
    claim = plan.claim
    secondary = getattr(claim, "secondary", None)
    seen.append((round(wall_s, 4), claim.objective, claim.bound))
    return {
        **facts, "status": claim.status, "objective": found.objective, "claimed": claim.objective,
        "bound": claim.bound, "limit": claim.limit, "method": claim.method, "reason": claim.reason,
        "notes": claim.settings.get("notes", []),
        "secondary": None if secondary is None else secondary.model_dump(mode="json"),
        "wall_s": round(wall_s, 4), "memory_mb": round(memory.peak_mb, 1), "base_mb": round(memory.base_mb, 1),
        "trajectory": thinned(seen), "violations": [str(violation) for violation in found.violations[:5]],
        "certified": _certified(instance, plan) if claim.certificate else None,
    }  # fmt: skip


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _quietly(solver: Any, tiny: Any) -> None:
    try:
        solver.solve(tiny, Limits(0.2 if solver.endless else WARM_S, gap=0.5), lambda *_: None)
    except UsageError:
        return  # it refuses this one, and may take the other


def _certified(instance: Any, plan: Any) -> dict[str, Any]:
    """Recompute the bound in a process of its own, which may be slow: a plain dynamic programme."""
    arguments = {"instance": instance.model_dump(mode="json", by_alias=True), "plan": plan.model_dump(mode="json")}
    record = run_one(Job("certify", "benchmarks.trial:recompute", arguments, time_limit_s=CERTIFY_S))
    return record.result if record.ending == "done" else {"bound": None, "why": record.error}


def recompute(instance: dict[str, Any], plan: dict[str, Any]) -> dict[str, Any]:
    """Recompute the bound of a plan from its certificate, as ``react-opt check --bound`` does."""
    certificate = check(jsonio.parse(instance), jsonio.parse(plan), bound=True)
    broken = [str(violation) for violation in certificate.violations if violation.rule == "bound"]
    return {"bound": certificate.bound, "why": broken[0] if broken else ""}


def size_of(instance: Any) -> dict[str, int]:
    """Return what an instance counts: cells, steps, arcs, targets, robots."""
    size = {"robots": len(instance.robots)}
    if instance.kind == "oros":
        return {
            "cells": len(instance.cells), "steps": instance.horizon_steps, "arcs": len(instance.travel), **size,
        }  # fmt: skip
    return {"targets": len(instance.targets), **size}


def tolerance_of(instance: Any) -> float | None:
    """Return the value of a joule, which settles when two values of an OROS instance agree; None for other kinds."""
    return float(instance.sigma) if instance.kind == "oros" else None


def agreed(value: float, sigma: float | None) -> float:
    """Return how far two values that are called optimal may differ (the format's own definition of optimal)."""
    size = abs(value)
    return optimality_tolerance(value, sigma) + 1e-9 if sigma is not None else 1e-6 * size + 1e-9


def thinned(points: list[tuple[float, float | None, float | None]]) -> list[tuple[float, float | None, float | None]]:
    """Return at most ``MAX_POINTS`` of a trajectory, its ends among them."""
    if len(points) <= MAX_POINTS:
        return points
    step = len(points) / MAX_POINTS
    return [points[int(k * step)] for k in range(MAX_POINTS - 1)] + [points[-1]]


class Memory:
    """Most resident memory of this process and its children while the block runs, MB, and before it."""

    def __init__(self, poll_s: float = 0.05) -> None:
        self._poll_s = poll_s
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._self = psutil.Process()
        self.base_mb = self.peak_mb = self._now_mb()

    def __enter__(self) -> Memory:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()
        self.peak_mb = max(self.peak_mb, self._now_mb())

    def _watch(self) -> None:
        while not self._done.wait(self._poll_s):
            self.peak_mb = max(self.peak_mb, self._now_mb())

    def _now_mb(self) -> float:
        total_mb = 0.0
        for process in (self._self, *self._self.children(recursive=True)):
            try:
                total_mb += process.memory_info().rss / 1e6
            except psutil.Error:  # it ended meanwhile
                continue
        return total_mb
