"""The monolithic model, family by family: fix what robots do and see whether the rows allow it."""

from typing import Any

import numpy as np
import pytest
from strategies import random_oros

from react_opt import parse
from react_opt.instance import OrosInstance
from react_opt.models.oros import OrosModel, column_count, opposite_pairs, oros_model
from react_opt.models.readback import routes_of
from react_opt.models.replay import tidy, value
from react_opt.planner import solve
from react_opt.route_problem import Route
from react_opt.solvers.outcome import Request
from react_opt.solvers.registry import backend


def corridor(**changes: Any) -> OrosInstance:
    """Two robots at the ends of a corridor of three cells, one step and 10 J between neighbours."""
    data: dict[str, Any] = {
        "kind": "oros",
        "schema_version": 1,
        "name": "corridor",
        "horizon_steps": 3,
        "step_s": 1.0,
        "cells": [{"id": c, "x_m": float(k), "y_m": 0.0} for k, c in enumerate("abc")],
        "travel": [
            {"from": i, "to": j, "steps": 1, "energy_j": 10.0}
            for i, j in (("a", "b"), ("b", "a"), ("b", "c"), ("c", "b"))
        ],
        "robots": [
            {"id": name, "start": cell, "battery_j": 100.0, "capacity_j": 100.0, "idle_w": 1.0, "sensing_w": 2.0}
            for name, cell in (("p", "a"), ("q", "c"))
        ],
    }
    data.update(changes)
    return parse(data)


def route(
    model: OrosModel, robot: int, cells: list[int], sense: list[int], charge: dict[int, float] | None = None
) -> Route:
    """Return the route through ``cells`` (index per instant, -1 under way) that senses at the instants ``sense``."""
    problem = model.problem
    arcs = []
    for k, cell in enumerate(cells):
        later = next((j for j in range(k + 1, len(cells)) if cells[j] >= 0), None)
        arc = -1
        if cell >= 0 and later is not None and cells[later] != cell:
            match = (problem.arc_from == cell) & (problem.arc_to == cells[later]) & (problem.arc_steps == later - k)
            arc = int(np.flatnonzero(match)[0])
        arcs.append(arc)
    credited = np.array([(charge or {}).get(k, 0.0) for k in range(len(cells))])
    sensing = np.isin(np.arange(len(cells)), sense)
    return Route(model.robots[robot].robot_class, np.array(cells), np.array(arcs), sensing, credited)


def violation(model: OrosModel, routes: list[Route]) -> float:
    """Return how far the rows and bounds are from allowing the routes."""
    return model.program.violation(model.vector(routes))


def test_a_plan_satisfies_every_row_and_has_its_value() -> None:
    model = oros_model(corridor())
    routes = [route(model, 0, [0, 1, 0, 0], [1]), route(model, 1, [2, 2, 2, 2], [1])]
    x = model.vector(routes)
    assert model.program.violation(x) == 0.0
    # b at t = 1..3 and c at t = 1..3 are explored: 6; batteries 100 - 2*10 - 1 - 2 and 100 - 3 - 2
    assert model.program.objective(x) == pytest.approx(6 + corridor().sigma * (77 + 95), abs=1e-12)
    assert value(model.problem, routes) == pytest.approx(model.program.objective(x), abs=1e-12)


def test_read_back_is_the_way_forth_reversed() -> None:
    model = oros_model(corridor())
    routes = [route(model, 0, [0, 1, 2, 2], [1, 2]), route(model, 1, [2, 2, 1, 0], [1, 3])]
    back = model.routes(model.vector(routes))
    for given, read in zip(routes, back, strict=True):
        assert given.cell.tolist() == read.cell.tolist()
        assert given.arc.tolist() == read.arc.tolist()
        assert given.sense.tolist() == read.sense.tolist()


def test_a_vector_that_is_no_route_is_refused() -> None:
    model = oros_model(corridor())
    with pytest.raises(ValueError, match="no route for robot 0"):
        model.routes(np.zeros(model.program.n_columns))


@pytest.mark.parametrize(("limit", "allowed"), [(None, True), (2, True), (1, False)])
def test_robots_per_cell(limit: int | None, allowed: bool) -> None:
    model = oros_model(corridor(limits={"robots_per_cell": limit}))
    meeting = [route(model, 0, [0, 1, 1, 1], []), route(model, 1, [2, 1, 1, 1], [])]
    assert (violation(model, meeting) == 0) is allowed


@pytest.mark.parametrize(("limit", "allowed"), [(None, True), (2, True), (1, False), (0, False)])
def test_sensing_robots_per_step(limit: int | None, allowed: bool) -> None:
    model = oros_model(corridor(limits={"sensing_robots_per_step": limit}))
    both = [route(model, 0, [0, 0, 0, 0], [1]), route(model, 1, [2, 2, 2, 2], [1])]
    assert (violation(model, both) == 0) is allowed


@pytest.mark.parametrize("forbidden", [False, True])
def test_swaps(forbidden: bool) -> None:
    model = oros_model(corridor(limits={"forbid_swaps": forbidden}))
    swap = [route(model, 0, [0, 1, 2, 2], []), route(model, 1, [2, 2, 1, 1], [])]  # both between b and c from 1 to 2
    follow = [route(model, 0, [0, 1, 2, 2], []), route(model, 1, [2, 1, 0, 0], [])]  # they meet in b, at instant 1
    assert (violation(model, swap) == 0) is not forbidden
    assert violation(model, follow) == 0.0
    assert len(opposite_pairs(model.problem)) == 2


def test_arcs_of_several_steps_swap_where_their_open_intervals_overlap() -> None:
    travel = [
        {"from": "a", "to": "b", "steps": 2, "energy_j": 1.0},
        {"from": "b", "to": "a", "steps": 2, "energy_j": 1.0},
    ]
    robots = [
        {"id": name, "start": cell, "battery_j": 9.0, "capacity_j": 9.0, "idle_w": 1.0, "sensing_w": 2.0}
        for name, cell in (("p", "a"), ("q", "b"))
    ]
    model = oros_model(corridor(travel=travel, robots=robots, horizon_steps=4, limits={"forbid_swaps": True}))
    overlap = [route(model, 0, [0, -1, 1, 1, 1], []), route(model, 1, [1, 1, -1, 0, 0], [])]
    touch = [route(model, 0, [0, -1, 1, 1, 1], []), route(model, 1, [1, 1, 1, -1, 0], [])]
    assert violation(model, overlap) > 0.5
    assert violation(model, touch) == 0.0


def test_reserve_and_capacity_hold_at_every_instant() -> None:
    robots = [
        {
            "id": "p",
            "start": "a",
            "battery_j": 20.0,
            "capacity_j": 20.0,
            "reserve_j": 5.0,
            "idle_w": 1.0,
            "sensing_w": 2.0,
        }
    ]
    chargers = [{"cell": "a", "power_w": 8.0}]
    model = oros_model(corridor(robots=robots, chargers=chargers))
    assert violation(model, [route(model, 0, [0, 1, 1, 1], [1])]) == 0.0  # 20 - 10 - 2 - 1 - 1 = 6
    assert violation(model, [route(model, 0, [0, 1, 1, 1], [1, 2])]) == 1.0  # 4 left, 5 in reserve
    assert violation(model, [route(model, 0, [0, 1, 0, 0], [])]) == 6.0  # 20 - 20 - 1, six below reserve
    assert violation(model, [route(model, 0, [0, 0, 0, 0], [], {1: 1.0, 2: 1.0, 3: 1.0})]) == 0.0
    assert violation(model, [route(model, 0, [0, 0, 0, 0], [], {1: 3.0})]) == 2.0  # 20 - 1 + 3 above capacity 20
    assert violation(model, [route(model, 0, [0, 0, 0, 0], [], {1: 9.0})]) == 8.0  # 9 J in a step of 8 J


def test_charger_slots() -> None:
    robots = [
        {"id": name, "start": "a", "battery_j": 20.0, "capacity_j": 90.0, "idle_w": 1.0, "sensing_w": 2.0}
        for name in "pq"
    ]
    for slots, allowed in ((1, False), (2, True)):
        model = oros_model(corridor(robots=robots, chargers=[{"cell": "a", "power_w": 8.0, "slots": slots}]))
        both = [route(model, k, [0, 0, 0, 0], [], {1: 5.0}) for k in (0, 1)]
        turns = [route(model, k, [0, 0, 0, 0], [], {1 + k: 5.0}) for k in (0, 1)]
        assert (violation(model, both) == 0) is allowed
        assert violation(model, turns) == 0.0


def test_only_reachable_nodes_have_columns() -> None:
    model = oros_model(corridor())
    first = model.robots[0]
    assert (first.y[:, 0] >= 0).tolist() == [True, False, False]
    assert (first.y[:, 1] >= 0).tolist() == [True, True, False]
    robots = [
        {
            "id": "p",
            "start": "a",
            "battery_j": 9.0,
            "capacity_j": 9.0,
            "idle_w": 1.0,
            "sensing_w": 2.0,
            "return_to": "c",
        }
    ]
    back = oros_model(corridor(robots=robots)).robots[0]
    assert (back.y >= 0).sum(axis=0).tolist() == [1, 2, 2, 1]  # a; a or b; b or c; c


def test_start_after_the_return_can_be_reached_is_infeasible_not_an_error() -> None:
    robots = [
        {"id": "p", "start": "a", "start_step": 2, "battery_j": 9.0, "capacity_j": 9.0, "idle_w": 1.0, "sensing_w": 2.0,
         "return_to": "c"}
    ]  # fmt: skip
    model = oros_model(corridor(robots=robots))
    outcome = backend("highs").solve(model.program, Request())
    assert outcome.status == "infeasible"


@pytest.mark.parametrize("seed", range(20))
def test_plans_fit_the_model_and_the_count_is_a_bound(seed: int) -> None:
    instance = random_oros(seed)
    plan = solve(instance, method="monolith", threads=1)
    model = oros_model(instance)
    assert model.program.n_columns <= column_count(model.problem)
    if plan.robots:
        x = model.vector(routes_of(instance, model.problem, plan))
        assert model.program.violation(x) < 1e-6
        assert model.program.objective(x) == pytest.approx(plan.objective.total, abs=1e-9)


def test_tidy_drops_sensing_that_earns_nothing() -> None:
    model = oros_model(corridor())
    twice = [route(model, 0, [0, 1, 1, 1], [1, 2]), route(model, 1, [2, 1, 1, 1], [1, 3])]
    first, second = tidy(model.problem, twice)
    assert first.sense.tolist() == [False, True, False, False]
    assert not second.sense.any()
    assert value(model.problem, [first, second]) > value(model.problem, twice)


@pytest.mark.parametrize("seed", range(0, 200, 5))
def test_tidy_never_lowers_the_value_of_an_optimum(seed: int) -> None:
    model = oros_model(random_oros(seed))
    outcome = backend("highs").solve(model.program, Request())
    if outcome.x is not None:
        routes = model.routes(outcome.x)
        assert value(model.problem, tidy(model.problem, routes)) >= value(model.problem, routes) - 1e-9


def test_sensing_that_a_charger_refills_is_kept() -> None:
    # Sensing costs 1 J worth 10 and earns 3, but the battery is full again either way: the charger gives 8 J a step.
    robots = [{"id": "p", "start": "a", "battery_j": 9.0, "capacity_j": 9.0, "idle_w": 1.0, "sensing_w": 1.0}]
    instance = corridor(robots=robots, chargers=[{"cell": "a", "power_w": 8.0}], objective={"sigma": 10.0})
    plan = solve(instance, method="monolith")
    assert plan.objective.total == 3 + 90
