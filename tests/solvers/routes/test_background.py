from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np
import pytest
from primal_cases import random_problem

from react_opt.models.replay import feasible, value
from react_opt.solvers.routes import background
from react_opt.solvers.routes.background import beside
from react_opt.solvers.routes.budget import Budget, Standing
from react_opt.solvers.routes.greedy import greedy
from react_opt.solvers.routes.search import improve


def _standing(budget: Budget) -> tuple[Standing, float]:
    """A plan that can be improved, offered to a standing, and its value."""
    for seed in range(100):
        problem = random_problem(
            np.random.default_rng(seed), cells=4, horizon=7, robots=3, chargers=False, coupled=False
        )
        routes = greedy(problem).routes
        if routes is None:
            continue
        best = value(problem, improve(problem, routes, work_limit=40))
        if best > value(problem, routes) + 1.0:
            standing = Standing(problem, budget, None, None)
            standing.offer(routes)
            return standing, best
    raise AssertionError("no case")


@pytest.mark.parametrize("threads", [1, 2])
def test_better_plans_come_while_the_budget_is_asked_for(threads: int) -> None:
    budget = Budget(time.perf_counter() + 30.0, None, None)
    standing, best = _standing(budget)
    with beside(standing, threads, seed=1):
        while not budget.over():
            assert standing.objective is not None
            if standing.objective >= best - 1e-9:
                break
    assert budget.limit == "none"
    assert budget.aside is None
    assert standing.routes is not None
    assert not feasible(standing.problem, standing.routes)


def test_the_thread_waits_where_the_proof_needs_both_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = threading.Event()

    def endless(*_: object, should_stop: Callable[[], bool], **__: object) -> None:
        while not should_stop():
            asked.set()

    monkeypatch.setattr(background, "improve", endless)
    standing, _ = _standing(Budget(time.perf_counter() + 600.0, None, None))
    with beside(standing, 2, seed=1):
        assert asked.wait(300.0)
        with standing.budget.alone():
            settled = threading.Event()
            for _ in range(1000):  # it may be within an iteration still
                asked.clear()
                if not asked.wait(0.05):
                    settled.set()
                    break
            assert settled.is_set()
        assert asked.wait(300.0)
    with standing.budget.alone():
        pass


def test_nothing_runs_beside_counted_work() -> None:
    standing, _ = _standing(Budget(None, 10, None))
    with beside(standing, 2, seed=1):
        assert standing.budget.aside is None


def test_a_fault_of_the_thread_is_raised_where_news_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ArithmeticError("broken")

    budget = Budget(time.perf_counter() + 30.0, None, None)
    standing, _ = _standing(budget)
    monkeypatch.setattr(background, "improve", broken)
    with pytest.raises(ArithmeticError, match="broken"):
        _search_until_over(standing)


def _search_until_over(standing: Standing) -> None:
    with beside(standing, 2, seed=1):
        while not standing.budget.over():
            pass
