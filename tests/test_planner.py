"""``solve`` as a caller sees it: known optima, limits, options, and what it refuses."""

import time

import pytest
from strategies import random_oros

from benchmarks.families import walled_grid
from react_opt import check, loads, parse, solve
from react_opt.errors import InputError, MissingPartError, UsageError
from react_opt.jsonio import dumps
from react_opt.solvers import monolith, oros
from react_opt.solvers.outcome import Outcome, Request
from react_opt.timegraph import route_problem


def star(arms=3, horizon=4, **changes):
    """A hub with unexplored cells around it, one step and 10 J away, one robot in the hub."""
    names = [f"c{k}" for k in range(arms)]
    data = {
        "kind": "oros",
        "schema_version": 1,
        "name": "star",
        "horizon_steps": horizon,
        "step_s": 1.0,
        "cells": [{"id": "hub", "x_m": 0.0, "y_m": 0.0, "explored": True}]
        + [{"id": name, "x_m": 1.0, "y_m": float(k)} for k, name in enumerate(names)],
        "travel": [row for name in names for row in (
            {"from": "hub", "to": name, "steps": 1, "energy_j": 10.0},
            {"from": name, "to": "hub", "steps": 1, "energy_j": 10.0},
        )],
        "robots": [
            {"id": "r", "start": "hub", "battery_j": 100.0, "capacity_j": 100.0, "idle_w": 1.0, "sensing_w": 2.0}
        ],
    }  # fmt: skip
    data.update(changes)
    return parse(data)


def test_known_optimum():
    # Explored from the start: the hub earns 4. One arm at t = 1 earns 4, the next at t = 3 earns 2, then it stays:
    # 100 - 3 * 10 - 2 * 2 - 1 (one wait) = 65 J left.
    instance = star()
    plan = solve(instance)
    assert plan.claim.status == "optimal"
    assert plan.objective.coverage == 10
    assert plan.objective.battery_j == 65
    assert plan.objective.total == pytest.approx(10 + 65 / 101, abs=1e-12)
    assert plan.claim.objective == plan.objective.total
    assert [(found.step, found.robot) for found in plan.explored] == [(1, "r"), (3, "r")]


def test_weights_decide_the_order_and_deadlines_the_worth():
    cells = [
        {"id": "hub", "x_m": 0.0, "y_m": 0.0, "explored": True},
        {"id": "c0", "x_m": 1.0, "y_m": 0.0, "weight": 1.0},
        {"id": "c1", "x_m": 1.0, "y_m": 1.0, "weight": 5.0, "deadline_step": 2},
        {"id": "c2", "x_m": 1.0, "y_m": 2.0, "weight": 0.0},
    ]
    plan = solve(star(cells=cells))
    # c1 first: at t = 1 it earns 5 * (2 - 1 + 1) = 10; c0 at t = 3 earns 2; c2 is worth nothing.
    assert plan.objective.coverage == 4 + 10 + 2
    assert [found.cell for found in sorted(plan.explored, key=lambda found: found.step)] == ["c1", "c0"]


def test_infeasible_names_a_robot_and_a_rule():
    robots = [{"id": "tired", "start": "hub", "battery_j": 3.0, "capacity_j": 9.0, "idle_w": 1.0, "sensing_w": 2.0}]
    plan = solve(star(robots=robots))
    assert plan.claim.status == "infeasible"
    assert plan.claim.objective is plan.claim.bound is plan.claim.gap is None
    assert "tired" in plan.claim.reason
    assert "battery" in plan.claim.reason
    assert plan.robots == ()
    assert check(star(robots=robots), plan).ok


def test_infeasible_together_is_proven_too():
    # Two robots must both end in the one cell that holds one robot.
    robots = [
        {
            "id": name,
            "start": cell,
            "battery_j": 90.0,
            "capacity_j": 90.0,
            "idle_w": 1.0,
            "sensing_w": 2.0,
            "return_to": "hub",
        }
        for name, cell in (("p", "c0"), ("q", "c1"))
    ]
    plan = solve(star(robots=robots, limits={"robots_per_cell": 1}))
    assert plan.claim.status == "infeasible"
    assert plan.claim.reason


def test_at_a_deadline_of_zero_there_is_the_greedy_plan_with_a_bound():
    instance = parse(walled_grid(4, 6, 2, 20, seed=3))
    plan = solve(instance, time_limit_s=0.0)
    assert plan.claim.limit == "time"
    assert plan.claim.status == "feasible"
    assert check(instance, plan).ok
    best = solve(instance, time_limit_s=20.0)
    assert plan.objective.total <= best.objective.total <= plan.claim.bound


def test_an_interrupt_keeps_the_plan():
    instance = parse(walled_grid(6, 8, 3, 30, seed=3))
    plan = solve(instance, time_limit_s=60.0, should_stop=lambda: True)
    assert plan.claim.limit == "interrupt"
    assert plan.robots
    assert check(instance, plan).ok


def test_progress_reports_bounds_that_hold():
    instance = parse(walled_grid(4, 5, 2, 16, seed=5))
    seen = []
    plan = solve(instance, time_limit_s=10.0, on_progress=lambda *line: seen.append(line))
    assert seen
    for _, incumbent, bound in seen:
        assert incumbent is None or incumbent <= plan.objective.total + 1e-6
        assert bound is None or bound >= plan.objective.total - 1e-6


@pytest.mark.parametrize("method", ["auto", "monolith"])
def test_same_seed_thread_and_work_limit_give_the_same_plan(method):
    instance = parse(walled_grid(3, 5, 2, 14, seed=2))
    texts = []
    for _ in range(2):
        plan = solve(instance, time_limit_s=None, work_limit=5, threads=1, seed=7, method=method)
        texts.append(dumps(plan.model_copy(update={"claim": plan.claim.model_copy(update={"wall_s": {}})})))
    assert texts[0] == texts[1]


def test_too_large_for_memory_says_so():
    data = walled_grid(2, 2, 1, 5, seed=1)
    data["horizon_steps"] = 100_000
    data["cells"] += [{"id": f"far{k}", "x_m": 0.0, "y_m": 0.0} for k in range(2000)]
    plan = solve(parse(data))
    assert plan.claim.status == "no_plan"
    assert plan.claim.limit == "memory"
    assert "cells x steps" in plan.claim.reason


def test_empty_fleets_and_horizons_of_one_step():
    assert solve(star(robots=[])).objective.total == 4  # the hub alone
    plan = solve(star(horizon=1))
    # Sensing an arm at t = 1 earns 1, the hub earns 1.
    assert plan.objective.coverage == 2


def test_a_plan_survives_its_file():
    instance = star()
    plan = solve(instance)
    assert loads(dumps(plan)) == plan


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"time_limit_s": -1}, "time limit"),
        ({"time_limit_s": float("nan")}, "time limit"),
        ({"work_limit": -1}, "work limit"),
        ({"gap": -0.1}, "gap"),
        ({"method": "magic"}, "method"),
        ({"threads": 0}, "threads"),
        ({"seed": -1}, "seed"),
        ({"solver": "nonsuch"}, "nonsuch"),
        ({"solver": "cp-sat", "method": "routes"}, "routes"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, message):
    with pytest.raises((UsageError, MissingPartError), match=message):
        solve(star(), **options)


def test_a_mission_points_to_simulate():
    with pytest.raises(InputError, match="oros, assignment or inspection"):
        solve(object())


def test_gap_stops_early_without_claiming_the_optimum_wrongly():
    instance = parse(walled_grid(3, 4, 2, 12, seed=4))
    loose, tight = solve(instance, gap=0.5), solve(instance)
    assert loose.claim.gap <= 0.5
    assert loose.objective.total <= tight.objective.total + 1e-9
    assert loose.claim.bound >= tight.objective.total - 1e-9


def test_the_clock_of_the_options_starts_with_the_call():
    from react_opt.options import SolveOptions

    options = SolveOptions(time_limit_s=5.0, begun=time.perf_counter() - 7.0)
    assert options.left_s() == 0.0
    assert SolveOptions(time_limit_s=None).left_s() is None


@pytest.mark.parametrize("seed", range(12))
def test_start_is_never_made_worse_by_any_limit(seed):
    instance = random_oros(seed)
    best = solve(instance, threads=1)
    if best.robots:
        again = solve(instance, start=best, time_limit_s=0.0, threads=1)
        assert again.objective.total >= best.objective.total - 1e-12


def test_nothing_to_explore_and_nobody_to_send():
    plan = solve(star(cells=[], travel=[], robots=[]))
    assert plan.claim.status == "optimal"
    assert plan.claim.objective == 0


@pytest.mark.parametrize(
    "options", [{"time_limit_s": float("nan")}, {"threads": 0}, {"gap": -1.0}, {"method": "magic"}, {"solver": "magic"}]
)
def test_bad_options_are_refused_before_anything_is_compiled(options, monkeypatch):
    def warm_up(kind, recipe):
        raise AssertionError("kernels were compiled for a call that is refused")

    monkeypatch.setattr("react_opt.planner.warm_up", warm_up)
    with pytest.raises(UsageError):
        solve(star(), **options)


@pytest.mark.parametrize("options", [{"method": "monolith"}, {"solver": "cp-sat"}])
def test_a_monolith_that_cannot_be_built_in_time_is_not_begun(options, monkeypatch):
    # Building it cannot be interrupted: begun with half a second left, one of a million columns took half a minute.
    monkeypatch.setattr(oros, "BUILD_S", 1.0)
    monkeypatch.setattr(oros, "solve_monolith", None)
    given_s = []

    def improve(problem, routes, *, deadline, **_):
        given_s.append(deadline - time.perf_counter())
        return routes

    monkeypatch.setattr(oros, "improve", improve)
    instance = parse(walled_grid(3, 3, 2, 8, seed=1))
    plan = solve(instance, time_limit_s=20.0, **options)
    assert (plan.claim.status, plan.claim.limit) == ("feasible", "time")
    assert plan.claim.settings["monolith"].startswith("not built")
    assert given_s[0] > 1.0  # the time is the primal search's instead
    assert check(instance, plan).ok


def test_building_the_monolith_counts_against_its_time_limit(monkeypatch):
    class Backend:
        def solve(self, program, request):
            self.limit_s = request.time_limit_s
            return Outcome(status="no_solution", limit="time", solver="none", version="0")

    backend, clock = Backend(), iter([100.0, 103.0])
    monkeypatch.setattr(monolith, "backend", lambda name: backend)
    monkeypatch.setattr(monolith, "perf_counter", lambda: next(clock))
    monolith.solve_monolith(star(), route_problem(star()), "highs", Request(time_limit_s=10.0), None)
    assert backend.limit_s == 7.0


@pytest.mark.parametrize("seed", range(60))
def test_the_relaxation_bound_holds(seed):
    from react_opt.claims import relaxation_bound
    from react_opt.models.readback import explored_value
    from react_opt.timegraph import route_problem

    instance = random_oros(seed)
    plan = solve(instance, method="monolith", threads=1)
    if plan.robots:
        assert relaxation_bound(route_problem(instance)) + explored_value(instance) >= plan.objective.total - 1e-9


def test_the_relaxation_bound_counts_places_and_sensings():
    from react_opt.claims import relaxation_bound
    from react_opt.timegraph import route_problem

    # One robot senses one cell an instant: 4 + 3 + 2 of three cells; 100 J less 4 of waiting are left at most.
    assert relaxation_bound(route_problem(star())) == pytest.approx(4 + 3 + 2 + 96 / 101)
    # 7 J less 4 of waiting hold one sensing of 2 J.
    robots = [{"id": "r", "start": "hub", "battery_j": 7.0, "capacity_j": 7.0, "idle_w": 1.0, "sensing_w": 2.0}]
    assert relaxation_bound(route_problem(star(robots=robots))) == pytest.approx(4 + 3 / 8)
