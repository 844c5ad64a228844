"""The assignment's own solver against brute force, scipy and the monolith; its reasons against forcing."""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from react_opt import jsonio
from react_opt.certify_assignment import check_assignment
from react_opt.errors import InputError, UsageError
from react_opt.models.assignment import build, is_feasible, objective_of, pair_values
from react_opt.options import SolveOptions
from react_opt.solvers.assignment import assign, solve_assignment
from react_opt.solvers.assignment.exact import linear_assignment, solve_arrays, value_step
from react_opt.solvers.assignment.explain import plain_losses
from react_opt.solvers.assignment.transport import transport


def random_instance(seed: int, robots: int = 3, targets: int = 5) -> Any:
    """A tiny instance with every option of the format."""
    rng = np.random.default_rng(seed)
    n, k = int(rng.integers(1, robots + 1)), int(rng.integers(1, targets + 1))
    capacity = int(rng.integers(1, 4)) if seed % 3 else 1
    return jsonio.parse(
        {
            "kind": "assignment",
            "name": f"tiny {seed}",
            "robots": [
                {
                    "id": f"r{i}",
                    "battery_j": float(rng.integers(0, 12)),
                    "capacity": int(rng.integers(0, capacity + 1)) if seed % 5 == 0 else capacity,
                    **({"zone": [f"k{j}" for j in range(k) if rng.random() < 0.7]} if rng.random() < 0.2 else {}),
                }
                for i in range(n)
            ],
            "targets": [{"id": f"k{j}", "gain": float(rng.integers(0, 8))} for j in range(k)],
            "costs": [
                {
                    "robot": f"r{i}",
                    "target": f"k{j}",
                    "time_s": float(rng.integers(0, 6)),
                    "energy_j": float(rng.integers(0, 8)),
                }
                for i in range(n)
                for j in range(k)
                if rng.random() < 0.85
            ],
            "conflicts": [[f"k{i}", f"k{j}"] for i in range(k) for j in range(i) if seed % 2 and rng.random() < 0.3],
            "weights": {"alpha": float(rng.choice([0.0, 0.5, 1.0])), "beta": 1.0, "time_ref_s": 2.0},
        }
    )


def brute(arrays: Any, must: int | None = None) -> float | None:
    """Best value over every way to give each target to one robot or none; None where nothing takes ``must``."""
    n_robots, n_targets = arrays.value.shape
    best = None
    for choice in itertools.product(range(-1, n_robots), repeat=n_targets):
        robot_of = np.array(choice, dtype=np.int64)
        if (must is None or robot_of[must] >= 0) and is_feasible(arrays, robot_of):
            worth = objective_of(arrays, robot_of)
            best = worth if best is None or worth > best else best
    return best


@pytest.mark.parametrize("seed", range(150))
def test_the_optimum_and_every_loss_are_those_of_brute_force(seed: int) -> None:
    instance = random_instance(seed, robots=3, targets=5 if seed % 4 else 6)
    arrays = build(instance).arrays
    expected = brute(arrays)
    plan = solve_assignment(instance, SolveOptions(threads=1))
    assert plan.claim.status == "optimal"
    assert plan.claim.objective == pytest.approx(expected, abs=1e-9)
    assert check_assignment(instance, plan).ok
    names = [target.id for target in instance.targets]
    for row in plan.deferred:
        forced = brute(arrays, names.index(row.target))
        if forced is None:
            assert row.loss is None
            assert row.reason in ("unreachable", "zone", "energy")
        else:
            assert row.loss == pytest.approx(expected - forced, abs=1e-6)
            assert row.reason in ("conflict", "outbid", "no_gain", "energy")


@pytest.mark.parametrize("seed", range(0, 150, 10))
def test_the_monolith_agrees(seed: int) -> None:
    instance = random_instance(seed)
    own = solve_assignment(instance, SolveOptions(explain=False))
    other = solve_assignment(instance, SolveOptions(explain=False, solver="highs"))
    assert other.claim.objective == pytest.approx(own.claim.objective, abs=1e-7)
    assert other.claim.method.startswith("monolith")


def test_transport_has_matching_duals() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        n, k = rng.integers(1, 5), rng.integers(1, 8)
        weight = np.round(rng.normal(size=(n, k)) * 2) / 2  # halves, so that ties abound
        robot, target = np.nonzero(rng.random((n, k)) < 0.8)
        units = rng.integers(1, 4, n)
        start = np.searchsorted(robot, np.arange(n + 1))
        owner, u, v = np.empty(k, np.int64), np.empty(n), np.empty(k)
        w = weight[robot, target]
        found = transport(start, robot, target, w, np.ones(len(w), np.bool_), units, owner, u, v)
        dense = np.zeros((n, k))
        dense[robot, target] = np.maximum(w, 0)
        copies = np.repeat(dense, units, axis=0)
        i, j = linear_sum_assignment(copies, maximize=True)
        assert found == pytest.approx(copies[i, j].sum())
        assert found == pytest.approx(-(units @ u + v.sum()))
        assert (-w - u[robot] - v[target] >= -1e-9).all()


@pytest.mark.parametrize("shape", [(5, 5), (4, 9), (9, 4), (1, 1), (0, 3), (3, 0)])
def test_the_plain_case_is_the_linear_assignment_and_leaves_worthless_pairs(shape: tuple[int, int]) -> None:
    value = np.random.default_rng(1).normal(size=shape)
    robot_of = linear_assignment(value)
    gain = np.maximum(value, 0)
    i, j = linear_sum_assignment(gain, maximize=True)
    taken = np.flatnonzero(robot_of >= 0)
    assert value[robot_of[taken], taken].sum() == pytest.approx(gain[i, j].sum())
    assert (value[robot_of[taken], taken] > 0).all()
    assert len(set(robot_of[taken].tolist())) == len(taken)


def test_plain_losses_are_those_of_forcing_each_target() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        value = np.round(rng.uniform(-1, 5, (4, 7)), 1)
        value[rng.random((4, 7)) < 0.2] = -np.inf
        answer = assign(value)
        arrays_value = np.where(np.isneginf(value), -1e6, value)
        loss = plain_losses(_arrays(value), answer.robot_of)
        for k in np.flatnonzero(answer.robot_of < 0):
            if np.isneginf(value[:, k]).all():
                continue
            forced = max(
                arrays_value[r, k] + assign(np.delete(np.delete(value, r, 0), k, 1)).objective for r in range(4)
            )
            assert loss[k] == pytest.approx(answer.objective - forced, abs=1e-9)


def _arrays(value: np.ndarray) -> Any:  # type: ignore[type-arg]
    from react_opt.models.assignment import AssignmentArrays

    n = len(value)
    return AssignmentArrays(value, np.zeros(value.shape), np.zeros(n), np.ones(n, np.int64), np.empty((0, 2), np.int64))


def test_the_better_charged_of_two_equally_placed_robots_wins() -> None:
    value = pair_values(
        np.array([5.0]), np.array([[4.0], [4.0]]), np.array([[10.0], [10.0]]), np.array([50.0, 100.0]),
        np.array([50.0, 100.0]),
    )  # fmt: skip
    assert assign(value).robot_of.tolist() == [1]


def test_equal_robots_give_the_same_answer_every_time() -> None:
    value, conflicts = np.ones((3, 6)), np.array([[0, 1], [2, 3]])
    answers = {tuple(assign(value, conflicts=conflicts).robot_of.tolist()) for _ in range(5)}
    assert len(answers) == 1


def _hard(seed: int = 0) -> tuple[Any, Any, Any, Any, Any]:
    rng = np.random.default_rng(seed)
    value, energy = rng.uniform(1, 10, (10, 50)), rng.uniform(1, 10, (10, 50))
    pairs = np.unique(np.sort(rng.choice(50, (150, 2)), axis=1), axis=0)
    return value, energy, np.full(10, 9.0), np.full(10, 4), pairs[pairs[:, 0] != pairs[:, 1]]


def test_a_passed_deadline_still_gives_a_feasible_answer_and_a_true_bound() -> None:
    value, energy, budget, capacity, conflicts = _hard()
    short = assign(
        value, energy_j=energy, budget_j=budget, capacity=capacity, conflicts=conflicts, deadline=time.perf_counter()
    )
    full = assign(value, energy_j=energy, budget_j=budget, capacity=capacity, conflicts=conflicts, work_limit=20_000)
    assert short.limit == "time"
    assert 0 < short.objective <= full.objective <= short.bound
    assert full.bound <= short.bound


def test_a_work_limit_gives_the_same_answer_every_time() -> None:
    value, energy, budget, capacity, conflicts = _hard(1)
    runs = [
        assign(value, energy_j=energy, budget_j=budget, capacity=capacity, conflicts=conflicts, work_limit=500)
        for _ in range(2)
    ]
    assert runs[0].robot_of.tolist() == runs[1].robot_of.tolist()
    assert (runs[0].objective, runs[0].bound, runs[0].work) == (runs[1].objective, runs[1].bound, runs[1].work)


def test_a_start_is_never_made_worse() -> None:
    value, energy, budget, capacity, conflicts = _hard(2)
    best = assign(value, energy_j=energy, budget_j=budget, capacity=capacity, conflicts=conflicts, work_limit=5000)
    again = assign(
        value, energy_j=energy, budget_j=budget, capacity=capacity, conflicts=conflicts, start=best.robot_of,
        deadline=0.0,
    )  # fmt: skip
    assert again.objective == pytest.approx(best.objective)


def test_a_gap_closes_early_with_a_bound_that_covers_it() -> None:
    value, energy, budget, capacity, conflicts = _hard(3)
    loose = assign(value, energy_j=energy, budget_j=budget, capacity=capacity, conflicts=conflicts, gap=0.05)
    exact = assign(value, energy_j=energy, budget_j=budget, capacity=capacity, conflicts=conflicts, work_limit=20_000)
    assert loose.limit == "none"
    assert loose.bound >= exact.objective - 1e-9
    assert loose.bound - loose.objective <= 0.05 * loose.objective + 1e-9


def test_routes_are_refused_and_a_foreign_start_too() -> None:
    instance, other = random_instance(1), random_instance(2)
    with pytest.raises(UsageError, match="no routes"):
        solve_assignment(instance, SolveOptions(method="routes"))
    with pytest.raises(InputError, match="another instance"):
        solve_assignment(instance, SolveOptions(), solve_assignment(other, SolveOptions()))


def test_nobody_and_nothing() -> None:
    instance = jsonio.parse({"kind": "assignment", "name": "empty", "robots": [], "targets": [], "costs": []})
    plan = solve_assignment(instance, SolveOptions())
    assert (plan.claim.status, plan.claim.objective, plan.assigned, plan.deferred) == ("optimal", 0.0, (), ())


def test_what_is_capacity_for_one_is_a_plain_problem_even_with_energies() -> None:
    instance = random_instance(6)
    arrays = build(instance).arrays
    assert arrays.plain == bool((arrays.capacity == 1).all())
    assert solve_arrays(arrays).plain == arrays.plain


def _generalised(robots: int, targets: int, seed: int = 0) -> Any:
    """A generalised assignment problem as in the literature (type C): whole profits, knapsacks as energies."""
    rng = np.random.default_rng(seed)
    weight, cost = rng.integers(5, 26, (robots, targets)), rng.integers(10, 51, (robots, targets))
    return jsonio.parse(
        {
            "kind": "assignment",
            "name": "gap",
            "robots": [
                {"id": f"r{r}", "battery_j": float(int(0.8 * weight[r].sum() / robots)), "capacity": targets}
                for r in range(robots)
            ],
            "targets": [{"id": f"k{k}", "gain": 1000.0} for k in range(targets)],
            "costs": [
                {"robot": f"r{r}", "target": f"k{k}", "time_s": float(cost[r, k]), "energy_j": float(weight[r, k])}
                for r in range(robots)
                for k in range(targets)
            ],
            "weights": {"alpha": 1.0, "beta": 0.0, "time_ref_s": 1.0},
        }
    )


@pytest.mark.parametrize("seed", range(3))
def test_generalised_assignment_is_solved_to_the_optimum_that_another_solver_finds(seed: int) -> None:
    pytest.importorskip("ortools")
    instance = _generalised(4, 16, seed)
    own = solve_assignment(instance, SolveOptions(threads=1, explain=False))
    other = solve_assignment(instance, SolveOptions(threads=1, explain=False, solver="cp-sat"))
    assert (own.claim.status, other.claim.status) == ("optimal", "optimal")
    assert own.claim.objective == other.claim.objective


def test_the_step_of_whole_values() -> None:
    assert value_step(np.array([6.0, 9.0, 15.0])) == 3.0
    assert value_step(np.array([6.0, 9.5])) == 0.0
    assert value_step(np.array([])) == 0.0


def test_a_stopped_search_of_large_gains_is_not_called_optimal() -> None:
    # One unit of 16 000 is a relative gap of 6e-5, of a million targets it would be within any: only proofs count.
    plan = solve_assignment(_generalised(4, 16), SolveOptions(threads=1, explain=False, work_limit=1))
    assert plan.claim.bound >= plan.claim.objective
    if plan.claim.bound > plan.claim.objective:
        assert (plan.claim.status, plan.claim.limit) == ("feasible", "work")


@pytest.mark.parametrize("work_limit", [1, 40])
def test_a_work_limit_gives_the_same_plan_byte_for_byte(work_limit: int) -> None:
    texts = []
    for _ in range(2):
        plan = solve_assignment(_generalised(5, 20, 1), SolveOptions(work_limit=work_limit, threads=1, explain=False))
        texts.append(jsonio.dumps(plan.model_copy(update={"claim": plan.claim.model_copy(update={"wall_s": {}})})))
    assert texts[0] == texts[1]


def test_no_time_at_all_still_gives_an_assignment_and_a_bound() -> None:
    instance = _generalised(5, 20)
    plan = solve_assignment(instance, SolveOptions(time_limit_s=0.0, threads=1))
    assert (plan.claim.status, plan.claim.limit) == ("feasible", "time")
    assert plan.assigned
    assert plan.claim.bound >= solve_assignment(instance, SolveOptions(threads=1, explain=False)).claim.objective
    assert check_assignment(instance, plan).ok
