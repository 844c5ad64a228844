import itertools
import time

import numpy as np
import pytest
from route_brute import brute_force, random_problem

from react_opt.models.replay import feasible, value
from react_opt.solvers.routes.bounds import Lattice, tolerance
from react_opt.solvers.routes.engine import solve_routes
from react_opt.solvers.routes.memory import Memory, fewest_steps


@pytest.mark.parametrize("block", range(8))
def test_agrees_with_brute_force(block: int) -> None:
    """Every route and every split of the cells is tried on tiny problems with binding batteries, late starts,
    deadlines, weights, several-step arcs, return places and two classes of robots."""
    for seed in range(30 * block, 30 * block + 30):
        problem = random_problem(seed)
        best = brute_force(problem)
        result = solve_routes(problem, work_limit=2000)
        if best is None:
            assert result.routes is None
            continue
        assert result.status == "optimal", seed
        assert result.routes is not None
        assert not feasible(problem, result.routes)
        assert result.objective == pytest.approx(value(problem, result.routes), abs=1e-9)
        assert result.objective == pytest.approx(best, abs=1e-9 + tolerance(best, problem.sigma))
        assert result.bound is not None
        assert result.bound >= best - 1e-9 * max(1.0, abs(best))


def test_bound_is_valid_at_any_interruption() -> None:
    """Stopped after any number of iterations, the bound lies above the optimum and the plan below it."""
    problem = random_problem(3)
    best = brute_force(problem)
    assert best is not None
    for limit in range(1, 40, 3):
        result = solve_routes(problem, work_limit=limit)
        if result.bound is not None:
            assert result.bound >= best - 1e-9 * max(1.0, abs(best))
        if result.objective is not None:
            assert result.objective <= best + 1e-9


def test_the_same_run_twice() -> None:
    """With a work limit and one thread the result is the same to the last bit."""
    problem = random_problem(11)
    first, second = (solve_routes(problem, work_limit=30, seed=5) for _ in range(2))
    assert (first.objective, first.bound, first.iterations) == (second.objective, second.bound, second.iterations)
    assert first.certificate == second.certificate


def test_never_worse_than_the_start() -> None:
    """A given plan is returned or improved, even when there is no time at all."""
    problem = random_problem(7)
    good = solve_routes(problem, work_limit=2000)
    assert good.routes is not None
    again = solve_routes(problem, deadline=time.perf_counter(), start=good.routes)
    assert again.objective is not None
    assert good.objective is not None
    assert again.objective >= good.objective - 1e-12


def test_lattice_rounds_down_to_a_value_that_a_plan_can_have() -> None:
    """Rounding a bound never cuts off a combination of whole rewards and whole joules."""
    problem = next(p for p in map(random_problem, itertools.count()) if Lattice(p).reward_unit and p.sigma > 0)
    lattice = Lattice(problem)
    spent = lattice.energy_unit or 1.0
    for level, joules in itertools.product(range(4), range(4)):
        reachable = lattice.reward_unit * level + problem.sigma * (lattice.battery_j - spent * joules)
        assert lattice.round_down(reachable) >= reachable - 1e-12
        assert lattice.round_down(reachable + 0.3 * problem.sigma) >= reachable - 1e-12


def test_colours_are_unique_where_cells_are_remembered_together() -> None:
    """In a grid of 400 cells the bits of one word suffice, and no two cells of an ng-set share a bit."""
    side = 20
    cells = np.arange(side * side)
    steps = np.abs(cells[:, None] // side - cells[None] // side) + np.abs(cells[:, None] % side - cells[None] % side)
    memory = Memory(steps.astype(np.int32), 9)
    for near in memory.near:
        assert len({int(memory.colour[c]) for c in near}) == len(near)


def test_fewest_steps_counts_steps_of_long_arcs() -> None:
    """Two arcs of 1 step beat one of 3; a cell that cannot be reached counts as beyond the horizon."""
    problem = random_problem(0)
    steps = fewest_steps(problem)
    assert np.all(np.diag(steps) == 0)
    for i, j, d in zip(problem.arc_from, problem.arc_to, problem.arc_steps, strict=True):
        assert steps[i, j] <= min(d, problem.horizon + 1)
