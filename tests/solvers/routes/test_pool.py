"""Enumerated routes, the linear programme over them and its cuts, against trying everything."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from route_brute import best_per_set, random_problem
from test_choice import _by_trying, _case
from test_tree import grid_problem

from react_opt.models.replay import value
from react_opt.route_problem import FloatArray
from react_opt.solvers.highs_model import fresh_scheduler
from react_opt.solvers.routes import engine, finish
from react_opt.solvers.routes.budget import Budget, Standing
from react_opt.solvers.routes.columns import Column, Duals
from react_opt.solvers.routes.engine import solve_routes
from react_opt.solvers.routes.enumeration import enumerate_routes
from react_opt.solvers.routes.master import Master
from react_opt.solvers.routes.memory import Memory, fewest_steps
from react_opt.solvers.routes.pool import PoolPrices, PoolProgram
from react_opt.solvers.routes.pricing import RoutePricer
from react_opt.solvers.routes.setcuts import MULTIPLIERS, SetCut, separate_sets
from react_opt.solvers.routes.setprices import coefficients_of_sets, cost_of_sets, set_prices
from react_opt.solvers.routes.tightening import Tightening


@pytest.mark.parametrize("seed", range(60))
def test_the_best_route_of_every_set_that_loses_little_is_enumerated(seed: int) -> None:
    """All sets within the gap, each with the value of its best route, and a route that has that value."""
    problem = random_problem(seed)
    rng = np.random.default_rng(seed)
    price = rng.integers(0, 12, problem.n_cells).astype(np.float64)
    pricer = RoutePricer(problem, Memory(fewest_steps(problem), int(rng.integers(1, 4))))
    none = np.zeros(0)
    for k, group in enumerate(problem.classes):
        every = best_per_set(problem, group)
        if not every:
            continue
        cells = {known: [i for i in range(problem.n_cells) if known >> i & 1] for known in every}
        reduced = {known: worth - price[cells[known]].sum() for known, worth in every.items()}
        floor = max(reduced.values()) - float(rng.integers(0, 15)) - 0.5
        duals = Duals(price, np.zeros(len(problem.classes)), none, none)
        found = enumerate_routes(pricer, k, duals, floor)
        assert found is not None
        look = found.look(set_prices(price, (), none), floor, 10_000)
        assert look.whole_above <= floor
        got = dict(zip(look.sets[:, 0].tolist(), look.value.tolist(), strict=True))
        wanted = {known: worth for known, worth in every.items() if reduced[known] >= floor}
        assert got == pytest.approx(wanted)
        for known, one in zip(look.sets[:, 0].tolist(), look.sets, strict=True):
            column = found.column(one)
            assert sorted(column.cells) == cells[known]
            assert column.value == pytest.approx(wanted[known])
        for most in (3, 10, 30):  # the beginnings end earlier or later where one side has too many labels
            again = enumerate_routes(pricer, k, duals, floor, max_labels=most, threads=2)
            if again is not None:
                look = again.look(set_prices(price, (), none), floor, 10_000)
                assert dict(zip(look.sets[:, 0].tolist(), look.value.tolist(), strict=True)) == pytest.approx(wanted)


@pytest.mark.parametrize("seed", range(40))
def test_enumerated_routes_are_found_at_other_prices(seed: int) -> None:
    """Those worth most at prices of cells and cuts, not all of them; as many threads as there are find the same."""
    problem = random_problem(seed)
    rng = np.random.default_rng(seed)
    n = problem.n_cells
    base = rng.integers(0, 6, n).astype(np.float64)
    none = np.zeros(0)
    every = best_per_set(problem, problem.classes[0])
    if not every:
        return
    floor = max(worth - _cost(known, base, (), none) for known, worth in every.items()) - 12.5
    pricer = RoutePricer(problem, Memory(fewest_steps(problem), 2))
    duals = Duals(base, np.zeros(len(problem.classes)), none, none)
    price = rng.integers(0, 8, n).astype(np.float64)
    cuts = [
        SetCut(tuple(sorted(rng.choice(n, len(times), replace=False).tolist())), times, over)
        for times, over in MULTIPLIERS
        if len(times) <= n
    ]
    paid = rng.integers(0, 4, len(cuts)).astype(np.float64)
    enumerated = [worth for worth in every.items() if worth[1] - _cost(worth[0], base, (), none) >= floor]
    worths = {known: worth - _cost(known, price, cuts, paid) for known, worth in enumerated}
    for threads in (1, 2):
        found = enumerate_routes(pricer, 0, duals, floor, threads=threads)
        assert found is not None
        for most, least in ((10_000, -np.inf), (10_000, max(worths.values()) - 5.0), (4, -1e9)):
            look = found.look(set_prices(price, cuts, paid), least, most)
            got = dict(zip(look.sets[:, 0].tolist(), look.reduced.tolist(), strict=True))
            best = {known: worth for known, worth in worths.items() if worth > max(look.whole_above, least) + 1e-9}
            assert {known: got.get(known) for known in best} == pytest.approx(best)
            # of what is drawn besides, the best way need not have been drawn
            assert all(worth <= worths[known] + 1e-9 for known, worth in got.items())
            assert look.whole_above <= least + 1e-9 or most < 2 * len(worths)
            for one, worth in zip(look.sets, look.value.tolist(), strict=True):
                assert found.column(one).value == pytest.approx(worth)


@pytest.mark.parametrize("seed", range(40))
def test_what_is_forgotten_is_in_no_route_of_interest_and_drawn_routes_are_routes(seed: int) -> None:
    """After labels were forgotten at some prices all routes worth enough there are found; others may be drawn."""
    problem = random_problem(seed)
    rng = np.random.default_rng(seed)
    n = problem.n_cells
    none = np.zeros(0)
    every = best_per_set(problem, problem.classes[0])
    if not every:
        return
    pricer = RoutePricer(problem, Memory(fewest_steps(problem), 2))
    floor = max(every.values()) - 30.0
    found = enumerate_routes(pricer, 0, Duals(np.zeros(n), np.zeros(len(problem.classes)), none, none), floor)
    assert found is not None
    enumerated = {known: worth for known, worth in every.items() if worth >= floor}
    price = rng.integers(0, 8, n).astype(np.float64)
    cuts = [SetCut(tuple(sorted(rng.choice(n, 3, replace=False).tolist())), (1, 1, 1), 2)] if n >= 3 else []
    paid = rng.integers(0, 4, len(cuts)).astype(np.float64)
    worths = {known: worth - _cost(known, price, cuts, paid) for known, worth in enumerated.items()}
    least = max(worths.values()) - 4.0
    few = found.look(set_prices(price, cuts, paid), -1e9, 4, 2)
    assert set(few.sets[:, 0].tolist()) <= set(worths)
    assert {known for known, worth in worths.items() if worth > few.whole_above + 1e-9} <= set(few.sets[:, 0].tolist())
    found.narrow(set_prices(price, cuts, paid), least)
    for _ in range(2):
        look = found.look(set_prices(price, cuts, paid), least, 10_000)
        got = dict(zip(look.sets[:, 0].tolist(), look.reduced.tolist(), strict=True))
        assert got == pytest.approx({known: worth for known, worth in worths.items() if worth >= least - 1e-12})
        for known, one in zip(look.sets[:, 0].tolist(), look.sets, strict=True):
            assert found.column(one).value == pytest.approx(every[known])


def test_sets_cost_their_cells_and_the_coefficients_of_cuts() -> None:
    """Tables, threads and single coefficients against the definition, with more cells than fit into a word."""
    rng = np.random.default_rng(5)
    n, m = 70, 60_000
    inside = (rng.random((m, n)) < 0.4).astype(np.uint8)
    sets = np.packbits(np.pad(inside, ((0, 0), (0, 58))), axis=1, bitorder="little").view(np.uint64)
    cuts = [
        SetCut(tuple(sorted(rng.choice(n, len(times), replace=False).tolist())), times, over)
        for times, over in MULTIPLIERS * 2
    ]
    cell, price = rng.random(n), rng.random(len(cuts))
    inner = np.stack([cut.coefficients((), inside) for cut in cuts], axis=1)
    assert np.array_equal(coefficients_of_sets(sets, cuts), inner)
    wanted = inside @ cell + inner @ price
    for threads in (1, 2):
        assert cost_of_sets(sets, set_prices(cell, cuts, price), threads) == pytest.approx(wanted)


def _cost(known: int, price: FloatArray, cuts: Sequence[SetCut], paid: FloatArray) -> float:
    """What a set of cells costs, by the definition of cuts."""
    cost = sum(price[i] for i in range(len(price)) if known >> i & 1)
    for cut, worth in zip(cuts, paid.tolist(), strict=True):
        times = [Fraction(t, cut.over) for cell, t in zip(cut.cells, cut.times, strict=True) if known >> cell & 1]
        cost += worth * (sum(times) // 1)
    return float(cost)


@pytest.mark.parametrize("seed", range(20))
def test_cuts_over_sets_hold_for_all_plans_and_are_broken_where_they_are_separated(seed: int) -> None:
    """Plans are routes that share no cell; the coefficient is the sum of multipliers, rounded down exactly."""
    rng = np.random.default_rng(seed)
    n = 9
    inside = (rng.random((12, n)) < 0.45).astype(np.uint8)
    share = rng.uniform(0.1, 0.5, 12)
    share /= max(1.0, float((share @ inside).max()))
    cuts = separate_sets(inside, share, set(), 500)
    assert {len(cut.cells) for cut in cuts} <= {3, 4, 5}
    for cut in cuts:
        assert share @ cut.coefficients((), inside) > cut.rhs + 0.01
        assert (tuple(sorted(cut.times, reverse=True)), cut.over) in MULTIPLIERS
        parts = [Fraction(time, cut.over) for time in cut.times]
        assert cut.rhs == sum(parts) // 1
        exact = [sum(p for cell, p in zip(cut.cells, parts, strict=True) if row[cell]) // 1 for row in inside]
        assert cut.coefficients((), inside).tolist() == exact
        for owner in product(range(3), repeat=len(cut.cells)):  # any way to share the cells among three routes
            plan = np.zeros((3, n), dtype=np.uint8)
            plan[list(owner), list(cut.cells)] = 1
            assert cut.coefficients((), plan).sum() <= cut.rhs
    if seed == 0:
        assert separate_sets(inside, share, set(cuts), 500) != cuts


def _has_plan(seed: int) -> bool:
    pool, inside, counts, _, _ = _case(seed)
    return _by_trying(pool, inside, counts) > -np.inf and len(np.unique(pool.group)) == len(counts)


@pytest.mark.parametrize("seed", [seed for seed in range(60) if _has_plan(seed)])
def test_the_programme_over_routes_bounds_the_best_choice_and_keeps_its_routes(seed: int) -> None:
    """The bound falls, never below the best choice that beats the floor, and routes of that are never dropped."""
    pool, inside, counts, price, bound = _case(seed)
    wanted = _by_trying(pool, inside, counts)
    standing = Standing(random_problem(0), Budget(None, None, None), None, None)
    standing.objective = wanted - 0.5
    none: tuple[SetCut, ...] = ()
    first = PoolPrices(np.inf, price, np.zeros(len(counts)), none, np.zeros(0))
    program = PoolProgram(pool, first, counts.tolist(), np.zeros(len(price), np.bool_), standing)
    assert program.prices.bound <= bound + 1e-9
    going, before = True, program.prices.bound
    while going:
        going = program.tighten()
        assert wanted - 1e-9 <= program.prices.bound <= before + 1e-9
        before = program.prices.bound
        rows = np.unpackbits(program.pool.sets.view(np.uint8), axis=1, bitorder="little")[:, : len(price)]
        assert _by_trying(program.pool, rows.astype(bool), counts) == pytest.approx(wanted)
        assert program.loss().min() >= -1e-9


def test_the_programme_over_routes_runs_beside_a_master_with_threads() -> None:
    """HiGHS serves one number of threads: a programme with another one than the master's would find no point."""
    pool, _, counts, price, _ = next(_case(seed) for seed in range(60) if _has_plan(seed))
    fresh_scheduler()
    master = Master(1, [1], 10.0, threads=2)
    master.add([Column(0, 1.0, (0,), None, (0,))])
    assert master.solve(None) is not None
    standing = Standing(random_problem(0), Budget(None, None, None), None, None)
    standing.objective = -1.0
    first = PoolPrices(np.inf, price + 5.0, np.zeros(len(counts)), (), np.zeros(0))
    program = PoolProgram(pool, first, counts.tolist(), np.zeros(len(price), np.bool_), standing, threads=2)
    before = program.prices.bound
    program.tighten()
    fresh_scheduler()
    assert program.prices.bound < before - 1.0


def test_optima_by_the_programme_over_routes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without cuts of the pricing or memory, choosing only after prices and cuts over the routes: the same optima."""
    rested = 0
    for seed in range(20):
        problem = grid_problem(seed)
        best = solve_routes(problem, work_limit=6000).objective
        with monkeypatch.context() as weak:
            weak.setattr(finish, "FIRST_WORK", -1)
            weak.setattr(finish, "MOST_ROUTES", 4 + 30 * (seed % 2))  # lists that lack routes, or hardly do
            weak.setattr(finish, "SOME_ROUTES", 4 + 10 * (seed % 2))
            weak.setattr(engine, "FIRST_MEMORY", 1)
            weak.setattr(Tightening, "cut", lambda self: False)
            weak.setattr(Tightening, "grow_memory", lambda self: False)
            result = solve_routes(problem, work_limit=6000)
        assert result.status == "optimal"
        assert result.objective == pytest.approx(best)
        assert result.routes is not None
        assert value(problem, result.routes) == pytest.approx(best)
        rested += "pool" in result.certificate
    assert rested >= 1
