"""The prices from which large instances begin: the slot relaxation and the smoothed dual, against all routes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from primal_cases import all_routes
from route_brute import brute_force, random_problem

from react_opt.certify_bound import recompute_bound
from react_opt.instance import OrosInstance
from react_opt.route_problem import RouteProblem
from react_opt.solvers.routes import engine
from react_opt.solvers.routes.budget import Budget, Standing
from react_opt.solvers.routes.certificate import certificate
from react_opt.solvers.routes.columns import Duals
from react_opt.solvers.routes.dual_ascent import DualAscent
from react_opt.solvers.routes.engine import solve_routes
from react_opt.solvers.routes.generation import Generation
from react_opt.solvers.routes.master import Master
from react_opt.solvers.routes.memory import Memory, fewest_steps
from react_opt.solvers.routes.pricing import RoutePricer
from react_opt.solvers.routes.routecolumn import route_column
from react_opt.solvers.routes.slots import slot_prices
from react_opt.solvers.routes.smoothing import SmoothedDual
from react_opt.timegraph import route_problem


def rich(seed: int) -> RouteProblem:
    """A tiny problem in which no battery binds, so that every route counts."""
    problem = random_problem(seed)
    groups = tuple(replace(group, battery_j=1e5, capacity_j=1e5) for group in problem.classes)
    return replace(problem, classes=groups)


def everywhere(problem: RouteProblem) -> list[set[int]]:
    return [set(range(problem.n_cells)) for _ in range(problem.n_cells)]


@pytest.mark.parametrize("block", range(4))
def test_sum_over_all_routes(block: int) -> None:
    """With full memory it is the logarithm of the sum over all routes, listed one by one, and so is its gradient."""
    for seed in range(20 * block, 20 * block + 20):
        problem = rich(seed)
        rng = np.random.default_rng(seed)
        price = rng.uniform(0.0, 4.0, problem.n_cells)
        temperature = float(rng.choice([0.01, 0.3, 5.0]))
        value, gradient = SmoothedDual(problem, everywhere(problem)).value(price, temperature)
        expected, slope = float(price.sum()), np.ones(problem.n_cells)
        for k, group in enumerate(problem.classes):
            columns = [
                route_column(problem, route)
                for route in all_routes(problem, k)
                if all(
                    problem.reward[cell, t + group.start_step] > problem.sigma * group.sense_j
                    for t, cell in enumerate(route.cell)
                    if route.sense[t]
                )
            ]
            if not columns:
                expected = -math.inf
                break
            worth = np.array([c.value - price[list(c.cells)].sum() for c in columns])
            weight = np.exp((worth - worth.max()) / temperature)
            expected += len(group.robots) * (worth.max() + temperature * math.log(weight.sum()))
            for column, share in zip(columns, weight / weight.sum(), strict=True):
                slope[list(column.cells)] -= len(group.robots) * share
        if expected == -math.inf:
            assert value < -1e100
            continue
        rounding = 1e-6 * temperature * (problem.horizon + 1) * problem.n_robots  # single precision, step by step
        assert value == pytest.approx(expected, rel=1e-9, abs=rounding)
        assert gradient == pytest.approx(slope, abs=1e-4)


@pytest.mark.parametrize("seed", range(0, 60, 3))
def test_above_the_exact_pricing_and_near_it_when_cold(seed: int) -> None:
    """The smoothed bound is above the Lagrangian bound with the same memory, and tends to it."""
    problem = rich(seed)
    memory = Memory(fewest_steps(problem), 2)
    price = np.random.default_rng(seed).uniform(0.0, 3.0, problem.n_cells)
    duals = Duals(price, np.full(len(problem.classes), -1e9), np.zeros(0), np.zeros(0))
    best = RoutePricer(problem, memory).price(duals).best
    assert best is not None
    counts = np.array([len(group.robots) for group in problem.classes])
    bound = float(price.sum() + counts @ best)
    smooth = SmoothedDual(problem, memory.near)
    if bound < -1e6:  # some robot has no route
        return
    rounding = 1e-6 * (problem.horizon + 1) * problem.n_robots
    assert smooth.value(price, 1.0)[0] >= bound - rounding
    cold = smooth.value(price, 1e-3)[0]
    assert bound - 1e-6 <= cold <= bound + 1e-3 * problem.n_robots * 3.0 * (problem.horizon + 1)


def test_drawn_routes_have_the_average_of_the_gradient() -> None:
    """What routes collect on average is what the gradient says; none collects what it remembers."""
    problem = next(p for p in map(rich, range(100)) if p.n_cells >= 4 and p.horizon >= 6 and p.reward.any())
    memory = Memory(fewest_steps(problem), 2)
    smooth = SmoothedDual(problem, memory.near)
    _, gradient = smooth.value(np.ones(problem.n_cells), 2.0)
    rng = np.random.default_rng(0)
    collected = np.zeros(problem.n_cells)
    for k, group in enumerate(problem.classes):
        for route in smooth.draw(k, 4000, rng):
            assert memory.allows(route)
            np.add.at(collected, route.cell[route.sense], len(group.robots) / 4000)
    assert collected == pytest.approx(1.0 - gradient, abs=0.06 * problem.n_robots)


def test_growing_memory_lowers_the_sum() -> None:
    """A cycle that is remembered cannot be collected along any more: fewer routes, a smaller sum."""
    problem = next(p for p in map(rich, range(100)) if p.n_cells == 5 and p.horizon >= 6 and p.reward.any())
    smooth = SmoothedDual(problem, [{j} for j in range(problem.n_cells)])
    price = np.zeros(problem.n_cells)
    before, _ = smooth.value(price, 0.5)
    pairs = smooth.grow((cell, range(problem.n_cells)) for cell in range(problem.n_cells))
    assert len(pairs) == problem.n_cells * (problem.n_cells - 1)
    after, _ = smooth.value(price, 0.5)
    assert after < before
    assert after == pytest.approx(SmoothedDual(problem, everywhere(problem)).value(price, 0.5)[0], abs=1e-5)


@pytest.mark.parametrize("seed", range(40))
def test_slot_prices_are_prices(seed: int) -> None:
    """They are not negative, and the bound of the exact pricing at them lies above the optimum."""
    problem = random_problem(seed)
    best = brute_force(problem)
    price = slot_prices(problem)
    assert price is not None
    assert np.all(price >= 0.0)
    if best is None:
        return
    duals = Duals(price, np.full(len(problem.classes), -1e9), np.zeros(0), np.zeros(0))
    priced = RoutePricer(problem, Memory(fewest_steps(problem), 2)).price(duals).best
    assert priced is not None
    counts = np.array([len(group.robots) for group in problem.classes])
    assert price.sum() + counts @ priced >= best - 1e-9 * max(1.0, abs(best))


def test_slots_of_a_corridor() -> None:
    """Two robots at the end of a corridor of unit steps with nothing behind it: per instant one new cell is in reach,
    so the slot relaxation is exact: cells 0, 1 at t = 1, then one more each step."""
    n, horizon = 4, 5
    reward = np.array([[0.0] + [float(horizon - t + 1) for t in range(1, horizon + 1)]] * n)
    steps = [(i, j) for i in range(n) for j in (i - 1, i + 1) if 0 <= j < n]
    base = rich(0)
    group = replace(base.classes[0], robots=(0, 1), start=0, start_step=0, return_to=-1, wait_j=0.0, sense_j=0.0)
    problem = replace(
        base,
        horizon=horizon,
        n_cells=n,
        reward=reward,
        arc_from=np.array([i for i, _ in steps]),
        arc_to=np.array([j for _, j in steps]),
        arc_steps=np.ones(len(steps), dtype=np.int64),
        arc_energy_j=np.zeros(len(steps)),
        arc_travel=np.arange(len(steps)),
        out_start=np.searchsorted([i for i, _ in steps], np.arange(n + 1)).astype(np.int64),
        sigma=0.0,
        classes=(group,),
        charger_j=np.zeros(n),
        charger_slots=np.ones(n, dtype=np.int64),
    )
    price = slot_prices(problem)
    assert price is not None
    duals = Duals(price, np.full(1, -1e9), np.zeros(0), np.zeros(0))
    priced = RoutePricer(problem, Memory(fewest_steps(problem), n)).price(duals).best
    assert priced is not None
    assert price.sum() + 2 * priced[0] == pytest.approx(5 + 5 + 4 + 3)


@pytest.mark.parametrize("block", range(4))
def test_solves_from_the_smoothed_dual(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the ascent of large instances switched on for tiny ones the optimum is that of brute force, and stopped at
    any moment the bound lies above it."""
    monkeypatch.setattr(engine, "MANY_CELLS", 0)
    monkeypatch.setattr(engine, "MANY_PLACES", 0)
    for seed in range(12 * block, 12 * block + 12):
        problem = random_problem(seed)
        best = brute_force(problem)
        if best is None:
            continue
        result = solve_routes(problem, work_limit=6000)
        assert result.status == "optimal", seed
        assert result.objective == pytest.approx(best, rel=1e-6, abs=1e-6)
        for limit in (10, 60, 200):
            stopped = solve_routes(problem, work_limit=limit)
            assert stopped.bound is None or stopped.bound >= best - 1e-9 * max(1.0, abs(best))


def test_threads_change_nothing() -> None:
    """Classes summed at once give what they give one after the other."""
    problem = next(p for p in map(rich, range(100)) if len(p.classes) == 2 and p.reward.any())
    price = np.linspace(0.0, 2.0, problem.n_cells)
    alone = SmoothedDual(problem, everywhere(problem)).value(price, 0.5)
    together = SmoothedDual(problem, everywhere(problem), threads=2).value(price, 0.5)
    assert together[0] == alone[0]
    assert np.array_equal(together[1], alone[1])


def test_the_certificate_holds() -> None:
    """The independent checker finds the bound of smoothed prices and grown memory again, on a grid with two starts."""
    side, steps = 5, [(0, 1), (1, 0), (0, -1), (-1, 0)]
    travel = [
        {"from": f"c{x}{y}", "to": f"c{x + dx}{y + dy}", "steps": 1, "energy_j": 70.0}
        for x in range(side)
        for y in range(side)
        for dx, dy in steps
        if 0 <= x + dx < side and 0 <= y + dy < side and (x + y + dx) % 4 != 1
    ]
    robot = {"battery_j": 9000.0, "capacity_j": 9000.0, "idle_w": 2.0, "sensing_w": 16.9}
    instance = OrosInstance.model_validate(
        {
            "kind": "oros",
            "name": "grid",
            "horizon_steps": 12,
            "step_s": 10.0,
            "cells": [{"id": f"c{x}{y}", "x_m": 10.0 * x, "y_m": 10.0 * y} for x in range(side) for y in range(side)],
            "travel": travel,
            "robots": [{"id": f"r{k}", "start": start, **robot} for k, start in enumerate(("c00", "c00", "c44"))],
        }
    )
    problem = route_problem(instance)
    standing = Standing(problem, Budget(None, 2_000, None), None, None)
    memory = Memory(fewest_steps(problem), 3)
    pricer = RoutePricer(problem, memory)
    master = Master(problem.n_cells, [len(group.robots) for group in problem.classes], 1e6)
    ascent = DualAscent(Generation(master, pricer, standing), memory, seed=0)
    ascent.slots()
    assert ascent.best is not None
    first = ascent.best.bound
    ascent.smooth()
    assert ascent.best.bound < first - 1e-3 * first
    proof = certificate(problem, memory, ascent.best, pricer.joule_prices)
    again = recompute_bound(instance, proof)
    assert again <= ascent.best.bound * (1.0 + 1e-9)
    assert again >= ascent.best.bound - 0.02 * abs(ascent.best.bound)
    plan = solve_routes(problem, work_limit=300)
    assert plan.objective is not None
    assert again >= plan.objective - 1e-9 * plan.objective
