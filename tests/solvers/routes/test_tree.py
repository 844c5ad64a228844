from collections.abc import Callable

import numpy as np
import pytest

from react_opt.models.replay import value
from react_opt.route_problem import RobotClass, RouteProblem
from react_opt.solvers.routes import engine
from react_opt.solvers.routes.bounds import Lattice
from react_opt.solvers.routes.engine import solve_routes
from react_opt.solvers.routes.finish import Finish
from react_opt.solvers.routes.greedy import greedy
from react_opt.solvers.routes.region import Region, Split, collections_of, everything
from react_opt.solvers.routes.result import RoutesResult
from react_opt.solvers.routes.routecolumn import route_column
from react_opt.solvers.routes.tightening import Tightening


def grid_problem(seed: int, rows: int = 3, cols: int = 4) -> RouteProblem:
    """A grid of weighted cells for one class of robots or two; on odd seeds the batteries bind."""
    rng = np.random.default_rng(seed)
    n, horizon = rows * cols, int(rng.integers(9, 14))
    edges = [(i, i + 1) for i in range(n) if (i + 1) % cols] + [(i, i + cols) for i in range(n - cols)]
    edges = [edge for edge in edges if rng.random() < 0.9]
    arcs = sorted((i, j) for edge in edges for i, j in (edge, edge[::-1]))
    weight = rng.integers(1, 4, n).astype(np.float64)
    reward = np.maximum(0.0, weight[:, None] * (horizon + 1.0 - np.arange(horizon + 1.0)[None, :]))
    reward[:, 0] = 0.0
    battery = horizon * 239.0 * (0.5 if seed % 2 else 1.0)
    counts = [(1,), (2,), (3,), (1, 1), (1, 2)][seed % 5]
    robot = iter(range(10))
    classes = tuple(
        RobotClass(tuple(next(robot) for _ in range(count)), start, 0, battery, battery, 0.0, 20.0, 169.0)
        for count, start in zip(counts, (0, n - 1), strict=False)
    )
    arc_from = np.array([i for i, _ in arcs], dtype=np.int64)
    return RouteProblem(
        horizon=horizon,
        n_cells=n,
        reward=reward,
        arc_from=arc_from,
        arc_to=np.array([j for _, j in arcs], dtype=np.int64),
        arc_steps=np.ones(len(arcs), dtype=np.int64),
        arc_energy_j=np.full(len(arcs), 70.0),
        arc_travel=np.arange(len(arcs), dtype=np.int64),
        out_start=np.searchsorted(arc_from, np.arange(n + 1)).astype(np.int64),
        sigma=1.0 / (1.0 + sum(counts) * battery),
        classes=classes,
        charger_j=np.zeros(n),
        charger_slots=np.zeros(n, dtype=np.int64),
    )


def by_branching_alone(
    problem: RouteProblem,
    patch: pytest.MonkeyPatch,
    work_limit: int = 6000,
    should_stop: Callable[[], bool] | None = None,
) -> RoutesResult:
    """Solve with a weak linear programme (no cuts, no growing memory) and without enumeration."""
    with patch.context() as weak:
        weak.setattr(engine, "FIRST_MEMORY", 2)
        weak.setattr(Tightening, "cut", lambda self: False)
        weak.setattr(Tightening, "grow_memory", lambda self: False)
        weak.setattr(Finish, "bound", lambda self, *_, **__: None)
        return solve_routes(problem, work_limit=work_limit, should_stop=should_stop)


@pytest.mark.parametrize("seed", [0, 6, 8, 9, 10, 11, 15, 18, 26, 27, 29])
def test_branching_alone_finds_the_same_optimum(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tree over a weak relaxation and the tight relaxation prove the same value, batteries binding or not."""
    problem = grid_problem(seed)
    tight = solve_routes(problem, work_limit=6000)
    weak = by_branching_alone(problem, monkeypatch)
    assert tight.status == weak.status == "optimal"
    assert weak.objective == pytest.approx(tight.objective, rel=1e-8)


def test_the_bound_holds_wherever_the_tree_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped after any amount of work, the bound is above the optimum and never rises."""
    problem = grid_problem(6)
    best = solve_routes(problem, work_limit=6000).objective
    assert best is not None
    assert "tree of" in by_branching_alone(problem, monkeypatch).notes[-1]
    bounds = [by_branching_alone(problem, monkeypatch, work).bound for work in range(60, 440, 40)]
    assert all(bound is not None and bound >= best - 1e-8 * best for bound in bounds)
    assert bounds == sorted(bounds, reverse=True)


def test_interrupted_anywhere_a_bound_and_a_plan_as_good_as_greedy_are_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupted at any question for the limits: the plan is no worse than greedy, the bound above the optimum, and
    what the bound rests on is in the claim."""
    problem = grid_problem(8)
    best = solve_routes(problem, work_limit=6000).objective
    first = greedy(problem, None, 0).routes
    assert best is not None
    assert first is not None
    floor = value(problem, first)
    for asked in range(2, 400, 23):
        left = iter(range(asked))
        result = by_branching_alone(problem, monkeypatch, 6000, lambda left=left: next(left, None) is None)
        assert result.objective is not None
        assert result.bound is None or result.bound >= best - 1e-8 * best
        assert floor - 1e-9 <= result.objective <= best + 1e-8 * best
        assert result.limit == "interrupt" or result.status == "optimal"
        if result.bound is not None:  # the claim's bound is the next value that a plan can have
            assert Lattice(problem).round_down(result.certificate["bound"]) <= result.bound * (1 + 1e-7) + 1e-7


@pytest.mark.parametrize("split", [Split(5, by=4), Split(5, by=9), Split(5, group=1)])
def test_every_plan_answers_a_question_with_yes_or_no(split: Split) -> None:
    """The two sides of a split cover every plan: whatever its routes collect, one side allows all of them."""
    problem = grid_problem(3)
    whole = everything(2, problem.n_cells, problem.horizon)
    sides = [whole.side(split, yes) for yes in (True, False)]
    for work in range(1, 30, 4):
        routes = solve_routes(problem, work_limit=work).routes
        assert routes is not None
        columns = [route_column(problem, route) for route in routes]
        assert any(allows(side, columns) for side in sides)


def allows(side: Region, columns: list) -> bool:
    """Return whether a plan lies in a region."""
    collected = np.isin(np.arange(len(side.must)), collections_of(columns).cell)
    return bool(side.allowed(columns).all() and collected[side.must].all())
