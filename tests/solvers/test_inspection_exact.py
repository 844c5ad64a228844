"""The inspection by decomposition against brute force and the monolith, with every option of the format."""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np
import pytest

from benchmarks.families import FAMILIES
from react_opt import jsonio
from react_opt.certify_inspection import check_inspection
from react_opt.errors import InputError
from react_opt.models.inspection import InspectionArrays, Routes, build
from react_opt.options import SolveOptions
from react_opt.solvers.inspection import decompose, gate, pricing, simple_rule, solve_inspection
from react_opt.solvers.inspection.answer import grid_of
from react_opt.solvers.inspection.control import Control
from react_opt.solvers.inspection.labels import ENUMERATE, EXACT, HEURISTIC
from react_opt.solvers.inspection.local import Searcher
from react_opt.solvers.inspection.pricing import Pricer


def random_instance(seed: int) -> Any:
    """A tiny instance: sparse or full, metric or not, own rows, shared places, ends or none, both objectives."""
    rng = np.random.default_rng(seed)
    n, n_robots = int(rng.integers(0, 6)), int(rng.integers(1, 4))
    targets = [f"k{i}" for i in range(n)]
    places = [*targets, "dock", "exit", "hall"]
    at = [str(rng.choice(["dock", "hall", *targets])) for _ in range(n_robots)]
    if seed % 3 == 0:
        xy = rng.uniform(0, 10, (len(places), 2))
        length = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    else:
        length = rng.integers(0, 12, (len(places), len(places))).astype(float)
    density = 1.0 if seed % 2 else 0.6
    rows = [
        {"from": a, "to": b, "time_s": float(length[i, j]), "energy_j": float(2 * length[i, j] + rng.integers(0, 4))}
        for i, a in enumerate(places)
        for j, b in enumerate(places)
        if i != j and rng.random() < density
    ]
    if seed % 4 == 0:
        rows += [
            dict(row, robot="r0", time_s=row["time_s"] * 1.5, energy_j=row["energy_j"] * 0.5)
            for row in rows
            if rng.random() < 0.3
        ]
    same = seed % 5 == 0
    return jsonio.parse(
        {
            "kind": "inspection",
            "name": f"tiny {seed}",
            "time_left_s": float(rng.integers(5, 30)),
            "robots": [
                {
                    "id": f"r{r}",
                    "at": at[0] if same else at[r],
                    "battery_j": 50.0 if same else float(rng.integers(10, 70)),
                    "reserve_j": float(rng.integers(0, 10)) if not same else 5.0,
                    "end": ["exit", None, "dock"][(seed // 7) % 3] if same else [None, "exit", "dock"][(seed + r) % 3],
                }
                for r in range(n_robots)
            ],
            "targets": [
                {
                    "id": name,
                    "value": float(rng.integers(0, 6)) if seed % 2 else float(rng.uniform(0, 3)),
                    "service_s": float(rng.integers(0, 3)),
                    "service_energy_j": float(rng.integers(0, 3)),
                }
                for name in targets
            ],
            "travel": rows,
            "minimise": "time" if seed % 4 < 2 else "energy",
        }
    )


def brute(arrays: InspectionArrays) -> tuple[float, float] | None:
    """Best (value, cost) over all ordered partial visits; None where some robot has no route."""
    n, n_robots = len(arrays.value), len(arrays.time_s)
    which = 0 if arrays.by_time else 1
    least: list[dict[int, float]] = []
    for r in range(n_robots):
        costs: dict[int, float] = {}
        for size in range(n + 1):
            for route in itertools.permutations(range(n), size):
                if arrays.allows(r, route):
                    key = sum(1 << k for k in route)
                    costs[key] = min(costs.get(key, np.inf), arrays.totals(r, route)[which])
        least.append(costs)
    known: dict[int, float] = {0: 0.0}
    for costs in least:
        following: dict[int, float] = {}
        for done, cost in known.items():
            for mine, more in costs.items():
                if not done & mine:
                    following[done | mine] = min(following.get(done | mine, np.inf), cost + more)
        known = following
    best: tuple[float, float] | None = None
    for done, cost in known.items():
        value = sum(float(arrays.value[k]) for k in range(n) if done >> k & 1)
        if best is None or value > best[0] + 1e-9 or (value > best[0] - 1e-9 and cost < best[1]):
            best = (value, cost)
    return best


def forced_brute(arrays: InspectionArrays, target: int) -> float | None:
    """Best value of a plan that visits a target; None where there is none."""
    value = arrays.value.copy()
    value[target] += 1000.0
    lifted = InspectionArrays(
        value, arrays.time_s, arrays.energy_j, arrays.time_limit_s, arrays.energy_limit_j, arrays.by_time
    )
    best = brute(lifted)
    return None if best is None or best[0] < 1000.0 else best[0] - 1000.0


@pytest.mark.parametrize("seed", range(160))
def test_both_objectives_are_those_of_brute_force(seed: int) -> None:
    instance = random_instance(seed)
    arrays = build(instance).arrays
    expected = brute(arrays)
    plan = solve_inspection(instance, SolveOptions(threads=1, explain=seed % 4 == 0))
    found = check_inspection(instance, plan)
    assert found.ok, found.violations
    if expected is None:
        assert plan.claim.status == "infeasible"
        assert "end" in (plan.claim.reason or "")
        return
    assert plan.claim.status == "optimal"
    assert plan.claim.objective == pytest.approx(expected[0], abs=1e-6)
    assert plan.claim.secondary is not None
    assert plan.claim.secondary.status == "optimal"
    assert plan.claim.secondary.objective == pytest.approx(expected[1], abs=1e-5)
    if seed % 4 == 0:
        names = [target.id for target in instance.targets]
        for row in plan.skipped:
            forced = forced_brute(arrays, names.index(row.target))
            if forced is None:
                assert row.loss is None
                assert row.reason in ("unreachable", "time", "battery")
            else:
                assert row.reason == "outbid"
                assert row.loss == pytest.approx(expected[0] - forced, abs=1e-5)


@pytest.mark.parametrize("seed", range(0, 160, 12))
def test_the_monolith_agrees(seed: int) -> None:
    instance = random_instance(seed)
    routes = solve_inspection(instance, SolveOptions(threads=1, explain=False))
    whole = solve_inspection(instance, SolveOptions(threads=1, explain=False, method="monolith"))
    assert whole.claim.status == routes.claim.status
    if routes.claim.status == "optimal":
        assert whole.claim.objective == pytest.approx(routes.claim.objective, abs=1e-5)
        assert whole.claim.secondary is not None
        assert routes.claim.secondary is not None
        assert whole.claim.secondary.objective == pytest.approx(routes.claim.secondary.objective, abs=1e-4)


@pytest.mark.parametrize("seed", range(0, 160, 5))
def test_what_is_for_many_targets_is_exact_for_few(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # Memories of one target, so that cycles do come up and must be forbidden one by one.
    instance = random_instance(seed)
    exact = solve_inspection(instance, SolveOptions(threads=1, explain=False)).claim
    for module in (pricing, decompose):
        monkeypatch.setattr(module, "ELEMENTARY_UP_TO", 0)
    monkeypatch.setattr(pricing, "NEIGHBOURHOOD", 1)
    found = solve_inspection(instance, SolveOptions(threads=1, explain=False, work_limit=400)).claim
    assert found.status in (exact.status, "feasible")
    if exact.status == "optimal":
        assert found.objective == pytest.approx(exact.objective)
        assert found.bound >= exact.objective - 1e-6
        assert found.status == "optimal"
        assert found.secondary.objective == pytest.approx(exact.secondary.objective, abs=1e-5)


def larger(seed: int = 0, targets: int = 24, robots: int = 3, ends: bool = True) -> Any:
    rng = np.random.default_rng(seed)
    names = [*(f"k{i}" for i in range(targets)), *(f"s{r}" for r in range(robots)), "exit"]
    xy = rng.uniform(0, 30, (len(names), 2))
    length = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    return jsonio.parse(
        {
            "kind": "inspection",
            "name": "larger",
            "time_left_s": 70.0,
            "robots": [
                {"id": f"r{r}", "at": f"s{r}", "battery_j": 1500.0, "end": "exit" if ends else None}
                for r in range(robots)
            ],
            "targets": [{"id": f"k{i}", "value": float(rng.integers(1, 9)), "service_s": 2.0} for i in range(targets)],
            "travel": [
                {"from": a, "to": b, "time_s": float(length[i, j]), "energy_j": 20 * float(length[i, j])}
                for i, a in enumerate(names)
                for j, b in enumerate(names)
                if i != j
            ],
        }
    )


def test_a_deadline_gives_a_checked_plan_with_a_bound_and_beats_the_simple_rule() -> None:
    instance = larger(1, targets=70, robots=4)
    begun = time.perf_counter()
    plan = solve_inspection(instance, SolveOptions(time_limit_s=1.0, threads=2, explain=False))
    assert time.perf_counter() - begun < 10.0  # generous: what is tested is that it returns at all
    assert check_inspection(instance, plan).ok
    assert plan.claim.bound is not None
    assert plan.claim.objective is not None
    arrays = build(instance).arrays
    baseline = simple_rule(arrays)
    assert baseline is not None
    assert arrays.is_feasible(baseline)
    assert plan.claim.objective >= arrays.worth(baseline)[0]


def test_no_time_at_all_still_gives_a_feasible_plan() -> None:
    instance = larger(2)
    plan = solve_inspection(instance, SolveOptions(time_limit_s=0.0, threads=1, explain=False))
    assert plan.claim.status in ("feasible", "optimal")  # a fast machine may prove it before the clock is looked at
    assert plan.claim.status == "optimal" or plan.claim.limit == "time"
    assert len(plan.routes) == 3
    assert check_inspection(instance, plan).ok


def test_a_work_limit_gives_the_same_plan_every_time() -> None:
    instance = larger(3, targets=40)
    plans = [
        solve_inspection(instance, SolveOptions(time_limit_s=None, work_limit=30, threads=1, explain=False))
        for _ in range(2)
    ]
    assert plans[0].routes == plans[1].routes
    assert plans[0].claim.bound == plans[1].claim.bound


def test_a_start_is_never_made_worse_and_a_foreign_one_is_refused() -> None:
    instance = larger(4)
    best = solve_inspection(instance, SolveOptions(threads=1, explain=False))
    again = solve_inspection(instance, SolveOptions(time_limit_s=0.0, threads=1, explain=False), best)
    assert again.claim.objective == best.claim.objective
    with pytest.raises(InputError, match="another instance"):
        solve_inspection(larger(5), SolveOptions(), best)


def test_an_interrupt_returns_the_best_plan() -> None:
    instance = larger(6, targets=60)
    begun = time.perf_counter()
    plan = solve_inspection(
        instance,
        SolveOptions(time_limit_s=60.0, explain=False, should_stop=lambda: time.perf_counter() > begun + 0.3),
    )
    assert plan.claim.limit in ("interrupt", "none")
    assert check_inspection(instance, plan).ok


def test_pricing_finds_the_best_single_route_in_every_mode_that_is_exact() -> None:
    arrays = build(random_instance(21)).arrays
    rng = np.random.default_rng(0)
    n = len(arrays.value)
    for r in range(len(arrays.time_s)):
        prize = rng.uniform(0, 3, n)
        best = max(
            (
                float(prize[list(route)].sum()) - 0.1 * arrays.totals(r, route)[0 if arrays.by_time else 1]
                for size in range(n + 1)
                for route in itertools.permutations(range(n), size)
                if arrays.allows(r, route)
            ),
            default=None,
        )
        pricer, stop = Pricer(arrays, 0, r), np.zeros(1, np.uint8)
        for mode in (EXACT, ENUMERATE):
            found = pricer.price(prize, 0.1, -1e6, mode, 100_000, 10_000, stop)
            assert (found.best is None or found.best == -1e6) if best is None else found.best == pytest.approx(best)
        assert pricer.price(prize, 0.1, -1e6, HEURISTIC, 100_000, 10_000, stop).best is None


def test_local_search_keeps_every_limit_and_repeats_itself() -> None:
    arrays = build(larger(7)).arrays
    empty: Routes = [[] for _ in arrays.time_s]
    runs = []
    for _ in range(2):
        searcher = Searcher(arrays, empty, seed=3)
        for _ in range(3):
            searcher.run(300)
            assert arrays.is_feasible(searcher.routes)
        runs.append(searcher.routes)
    assert runs[0] == runs[1]
    assert arrays.worth(runs[0])[0] > 0


def test_the_gate_opens_only_when_time_and_battery_suffice() -> None:
    assert gate(0, 10.0, 20.0, [5.0, 6.0], [5.0, 0.0]).go
    assert "areas" in gate(1, 10.0, 20.0, [5.0], [0.0]).reason
    assert "time" in gate(0, 21.0, 20.0, [5.0], [0.0]).reason
    assert "battery" in gate(0, 10.0, 20.0, [4.0], [5.0]).reason
    assert not gate(0, 10.0, 20.0, [0.0], [0.0]).go


@pytest.mark.parametrize(
    ("values", "step"),
    [([1.0, 2.0, 5.0], 1.0), ([0.5, 1.25], 0.25), ([0.1, 0.3], 0.1), ([4.0, 6.0], 2.0), ([0.0, 0.0], 0.0)],
)
def test_the_grid_of_values(values: list[float], step: float) -> None:
    assert grid_of(np.array(values)) == pytest.approx(step)


def test_values_without_a_useful_grid_have_none() -> None:
    assert grid_of(np.array([1.0, 2**0.5])) == 0.0


def test_a_control_counts_work_and_raises_its_flag() -> None:
    with Control(None, 2, None) as control:
        assert not control.stopped()
        control.work = 2
        assert control.stopped()
        assert control.limit == "work"
    assert control.flag[0] == 1


def test_a_stiff_first_program_is_no_reason_to_stop() -> None:
    # Here a robot only gets to its end by way of targets, so no plan is there from the start, and HiGHS gives up on the
    # second linear program once. 124 is what the integer program over all routes within the gap gives, the bound too.
    instance = jsonio.parse(FAMILIES["inspection_tight"].make(robots=4, targets=30, seed=2))
    plan = solve_inspection(instance, SolveOptions(explain=False))
    assert (plan.claim.status, plan.claim.objective, plan.claim.bound) == ("optimal", 124.0, 124.0)
    assert check_inspection(instance, plan).ok
