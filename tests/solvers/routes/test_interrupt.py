"""Stopped at any moment a valid bound and a plan no worse than greedy are there; HiGHS's threads are no obstacle."""

from collections.abc import Iterator

import numpy as np
import pytest
from test_tree import grid_problem

from benchmarks.families import walled_grid
from react_opt import check, solve
from react_opt.jsonio import parse
from react_opt.models.replay import feasible, tidy, value
from react_opt.solvers.highs_model import fresh_scheduler
from react_opt.solvers.routes.engine import solve_routes
from react_opt.solvers.routes.greedy import greedy
from react_opt.solvers.routes.master import Master
from react_opt.solvers.routes.routecolumn import route_column
from react_opt.solvers.routes.slots import slot_prices


@pytest.mark.parametrize("seed", [0, 6, 11, 18])
def test_interrupted_at_any_question_bound_and_plan_are_there(seed: int) -> None:
    """The limits are asked for a counted number of times before they say stop."""
    problem = grid_problem(seed)
    first = greedy(problem, None, 0).routes
    assert first is not None
    floor, best = value(problem, first), solve_routes(problem, work_limit=6000).objective
    assert best is not None
    for questions in np.random.default_rng(seed).integers(0, 120, 8).tolist():
        left = iter(range(questions))
        result = solve_routes(problem, work_limit=6000, should_stop=lambda left=left: next(left, None) is None)
        assert result.routes is not None
        assert not feasible(problem, result.routes)
        assert floor - 1e-9 <= result.objective <= best + 1e-8 * best
        assert result.bound is None or result.bound >= best - 1e-9 * best
        assert result.limit == ("none" if result.status == "optimal" else "interrupt")


@pytest.fixture
def scheduler() -> Iterator[None]:
    """HiGHS's threads are one scheduler for the whole process: leave it as tests without threads expect it."""
    fresh_scheduler()
    yield
    fresh_scheduler()


@pytest.mark.usefixtures("scheduler")
def test_two_threads_solve_the_master_after_the_slots() -> None:
    """The slot relaxation takes one thread; a programme with two after it is solved to optimality all the same."""
    problem = grid_problem(6)
    first = greedy(problem, None, 0).routes
    assert first is not None
    routes = tidy(problem, first)  # no cell is sensed twice
    assert slot_prices(problem) is not None
    master = Master(problem.n_cells, [len(group.robots) for group in problem.classes], 1e6, threads=2)
    master.add([route_column(problem, route) for route in routes])
    point = master.solve()
    assert point is not None
    assert point.value == pytest.approx(value(problem, routes))
    assert point.lacking == pytest.approx(0.0)


@pytest.mark.usefixtures("scheduler")
@pytest.mark.parametrize("method", ["routes", "monolith"])
def test_solves_with_other_numbers_of_threads_follow_each_other(method: str) -> None:
    """With one thread, two, one again: HiGHS refuses a programme whose threads are not those of its scheduler."""
    instance = parse(walled_grid(2, 4, 2, 6, seed=3))
    totals = []
    for threads in (1, 2, 1, 2):
        plan = solve(instance, method=method, threads=threads, time_limit_s=60.0)
        assert plan.claim.status == "optimal"
        assert check(instance, plan).ok
        totals.append(plan.claim.objective)
    assert totals == pytest.approx([totals[0]] * 4, rel=1e-6)
