"""Interrupted at any moment a solve of a large instance holds a valid bound and a plan no worse than the greedy one."""

from __future__ import annotations

import pytest

from benchmarks.families import metric_complete, walled_grid
from react_opt import parse
from react_opt.models.replay import feasible, value
from react_opt.route_problem import RouteProblem
from react_opt.solvers.routes.engine import solve_routes
from react_opt.solvers.routes.greedy import greedy
from react_opt.solvers.routes.memory import Memory, fewest_steps
from react_opt.solvers.routes.search import improve
from react_opt.timegraph import route_problem

GRID = route_problem(parse(walled_grid(8, 9, 2, 60, seed=3)))
METRIC = route_problem(parse(metric_complete(45, 2, seed=1)))
CASES = [*(("grid", polls) for polls in (0, 1, 2, 4, 8, 16, 60)), *(("metric", polls) for polls in (0, 1, 2, 4, 12))]


def known(problem: RouteProblem) -> tuple[float, float]:
    """What the greedy plan and a long search are worth: less than the optimum, so no bound may lie below it."""
    first = greedy(problem).routes
    assert first is not None
    return value(problem, first), value(problem, improve(problem, first, work_limit=60))


@pytest.fixture(scope="module")
def worth() -> dict[int, tuple[float, float]]:
    return {id(problem): known(problem) for problem in (GRID, METRIC)}


@pytest.mark.parametrize(("family", "polls"), CASES)
def test_interrupted_at_any_moment(family: str, polls: int, worth: dict[int, tuple[float, float]]) -> None:
    """The interrupt comes when it is asked for the given number of times; a work limit keeps the run countable."""
    problem = GRID if family == "grid" else METRIC
    asked = 0

    def should_stop() -> bool:
        nonlocal asked
        asked += 1
        return asked > polls

    result = solve_routes(problem, work_limit=100_000, should_stop=should_stop)
    first, best = worth[id(problem)]
    assert result.limit == "interrupt"
    assert result.routes is not None
    assert result.objective is not None
    assert not feasible(problem, result.routes)
    assert result.objective == pytest.approx(value(problem, result.routes))
    assert result.objective >= first - 1e-9 * first
    assert result.bound is not None
    assert result.bound >= max(best, result.objective) - 1e-9 * best
    assert result.certificate["bound"] >= result.bound - 1e-9 * best


def test_memory_grows_without_two_cells_of_one_colour() -> None:
    """Cells remembered at one place have different bits, also after growing pair by pair beyond 64 cells."""
    memory = Memory(fewest_steps(GRID), 8)
    far = [(place, (place + 31) % GRID.n_cells) for place in range(GRID.n_cells)]
    everything = [(0, cell) for cell in range(GRID.n_cells)]
    before = sum(map(len, memory.near))
    added = memory.grow([*far, *everything])
    assert sum(map(len, memory.near)) == before + added
    assert len(memory.near[0]) == 64  # as many as a word has bits
    for near in memory.near:
        assert len({int(memory.colour[cell]) for cell in near}) == len(near)
