"""Inspections with many targets: ng-routes, growing memories, budgets that imply each other, and the promises."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import pytest

from react_opt import jsonio
from react_opt.certify_inspection import check_inspection
from react_opt.models.inspection import build
from react_opt.options import SolveOptions
from react_opt.solvers.inspection import solve_inspection
from react_opt.solvers.inspection.control import Control
from react_opt.solvers.inspection.labels import EXACT, best_routes
from react_opt.solvers.inspection.pricing import Pricer


def orienteering(targets: int, time_left_s: float, robots: int = 2, battery_j: float = 1e6, seed: int = 0) -> Any:
    """Team orienteering: one start, one end, straight lines, energies three times the times."""
    rng = np.random.default_rng(seed)
    names = [*(f"k{i}" for i in range(targets)), "start", "end"]
    xy = rng.uniform(0, 30, (len(names), 2))
    xy[-1] = xy[-2] + 1.0
    length = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    return jsonio.parse(
        {
            "kind": "inspection",
            "name": "orienteering",
            "time_left_s": time_left_s,
            "robots": [{"id": f"r{r}", "at": "start", "end": "end", "battery_j": battery_j} for r in range(robots)],
            "targets": [{"id": f"k{i}", "value": float(v)} for i, v in enumerate(rng.integers(1, 10, targets))],
            "travel": [
                {"from": a, "to": b, "time_s": float(length[i, j]), "energy_j": 3.0 * float(length[i, j])}
                for i, a in enumerate(names)
                for j, b in enumerate(names)
                if i != j
            ],
        }
    )


@pytest.mark.parametrize("battery_j", [1e6, 66.0, 75.0])
def test_ng_routes_by_budget_are_those_by_number_of_stops(battery_j: float) -> None:
    # Two orders of extension, one relaxation: the best profits must be the same, whichever budget binds.
    arrays = build(orienteering(45, 25.0, battery_j=battery_j)).arrays
    pricer, stop = Pricer(arrays, 0, 0), np.zeros(1, np.uint8)
    assert not pricer.elementary
    rng = np.random.default_rng(1)
    for _ in range(3):
        prize = arrays.value * rng.uniform(0.2, 1.0, 45)
        found = pricer.price(prize, 0.0, 1.0, EXACT, 1_000_000, 10, stop)
        most = 400_000
        room = (
            np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most), np.empty((most, 1), np.uint64),
            np.empty(most), np.empty(most), np.empty(most), np.empty(most, np.int64), np.empty(most, np.bool_),
            np.empty(most, np.uint64),
        )  # fmt: skip
        made = best_routes(
            prize, 0.0, arrays.time_s[0], arrays.time_s[0], arrays.energy_j[0], arrays.time_limit_s,
            arrays.energy_limit_j[0], pricer.memory, True, 1.0, EXACT, 0, 0, np.zeros(45, np.uint64), np.zeros(64),
            250, np.zeros(1), stop, *room,
        )  # fmt: skip
        assert made > 0
        assert found.best == pytest.approx(room[4][:made].max())


def test_a_budget_that_the_other_implies_is_dropped() -> None:
    by_time = Pricer(build(orienteering(45, 25.0, battery_j=100.0)).arrays, 0, 0)  # 3 * 25 J suffice
    assert (by_time.time_limit < np.inf, by_time.energy_limit) == (True, np.inf)
    by_energy = Pricer(build(orienteering(45, 25.0, battery_j=66.0)).arrays, 0, 0)
    assert (by_energy.time_limit, by_energy.energy_limit < np.inf) == (np.inf, True)


def test_memories_grow_until_they_forbid_a_cycle() -> None:
    pricer = Pricer(build(orienteering(45, 25.0)).arrays, 0, 0)
    far = int(np.argmax(pricer.arrays.time_s[0, 0, :45] * (np.arange(45) > 0)))
    assert pricer.allows([0, far, 0])  # far from 0 it is forgotten
    assert pricer.grow([0, far, 0])
    assert not pricer.allows([0, far, 0])
    assert pricer.allows([0, far])
    assert not pricer.grow([0, far])


def test_many_targets_are_proven_and_the_monolith_does_not_contradict() -> None:
    instance = orienteering(45, 14.0, seed=3)
    routes = solve_inspection(instance, SolveOptions(threads=1, explain=False))
    whole = solve_inspection(instance, SolveOptions(threads=1, explain=False, method="monolith", time_limit_s=2.0))
    assert routes.claim.status == "optimal"
    assert whole.claim.objective <= routes.claim.objective + 1e-6 <= whole.claim.bound + 2e-6


@pytest.mark.parametrize("targets", [15, 45])
def test_a_work_limit_gives_the_same_plan_byte_for_byte(targets: int) -> None:
    instance = orienteering(targets, 22.0)
    texts = []
    for _ in range(2):
        plan = solve_inspection(instance, SolveOptions(work_limit=25, threads=1, explain=False))
        texts.append(jsonio.dumps(plan.model_copy(update={"claim": plan.claim.model_copy(update={"wall_s": {}})})))
    assert texts[0] == texts[1]


def test_no_time_for_many_targets_still_gives_a_plan_and_a_bound() -> None:
    instance = orienteering(60, 40.0)
    plan = solve_inspection(instance, SolveOptions(time_limit_s=0.0, threads=2))
    assert (plan.claim.status, plan.claim.limit) == ("feasible", "time")
    assert plan.claim.bound <= sum(target.value for target in instance.targets)
    assert check_inspection(instance, plan).ok


def test_one_thread_watches_all_controls_and_stops_each_on_its_own() -> None:
    asked, stop = threading.Event(), threading.Event()

    def should_stop() -> bool:
        asked.set()
        return stop.is_set()

    with Control(None, None, should_stop) as control, Control(time.perf_counter() + 1e6, None, None) as other:
        assert asked.wait(60)
        assert control.flag[0] == 0
        stop.set()
        asked.clear()
        assert asked.wait(60)  # asked once more, so it has seen the wish to stop, or is about to
        assert control.stopped()
        assert (control.limit, control.flag[0], other.flag[0]) == ("interrupt", 1, 0)
