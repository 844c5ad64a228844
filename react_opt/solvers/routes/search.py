"""Improve a plan until told to stop: annealing over sequences, and best responses of a few robots to the rest."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from react_opt.models.replay import coupling_faults, feasible, tidy, value
from react_opt.route_problem import FloatArray, Route, RouteProblem
from react_opt.solvers.routes.anneal import anneal
from react_opt.solvers.routes.beam import affordable_width, battery_can_bind, best_response
from react_opt.solvers.routes.greedy import route_classes
from react_opt.solvers.routes.moves import Tables
from react_opt.solvers.routes.sequences import SequenceModel, applies, decode, encode, sequence_model

_DEFAULT_WORK = 100
_MOST_CELLS = 6000  # above this the square table of fastest ways is not built
_HOT, _WARM, _COLD = 0.2, 0.08, 0.015  # temperatures as shares of what a cell earns at best, on average
_FIRST_CYCLE = 4  # annealing chunks of the first cycle; every cycle is four times as long as the one before
_REHEATS = 4  # annealings from warm, each half as long as the one from hot before them
_WIDTHS = (64, 256, 1024)
_EXPANSIONS = 400_000  # labels times arcs that one best response may look at, some tenths of a second


class _Search:
    """The best plan so far, the clock and the counter that a search shares with its parts."""

    def __init__(
        self,
        problem: RouteProblem,
        routes: Sequence[Route],
        deadline: float | None,
        work_limit: int | None,
        seed: int,
        should_stop: Callable[[], bool] | None,
        on_improve: Callable[[list[Route], float], None] | None,
    ) -> None:
        self.problem = problem
        self.classes = route_classes(problem)
        self.rng = np.random.default_rng(seed)
        self.given = list(routes)
        self.routes = self.given
        self.worth = value(problem, routes)
        self.begin = time.perf_counter()
        self.deadline, self.should_stop, self.on_improve = deadline, should_stop, on_improve
        endless = deadline is None and should_stop is None
        self.work_limit = _DEFAULT_WORK if work_limit is None and endless else work_limit
        self.work = 0
        self.chunk_share = 0.0  # of the time or work, by one chunk of annealing
        self.prices: dict[int, FloatArray] = {}

    def offer(self, routes: Sequence[Route]) -> bool:
        """Take a plan if it is better and keeps every limit."""
        better = tidy(self.problem, routes)
        worth = value(self.problem, better)
        if worth <= self.worth + 1e-9 * max(1.0, abs(self.worth)) or feasible(self.problem, better):
            return False
        self.routes, self.worth = better, worth
        if self.on_improve is not None:
            self.on_improve(list(better), worth)
        return True

    def over(self) -> bool:
        """Whether the search has to end."""
        return (
            (self.work_limit is not None and self.work >= self.work_limit)
            or (self.deadline is not None and time.perf_counter() >= self.deadline)
            or (self.should_stop is not None and self.should_stop())
        )

    def left(self) -> float:
        """Share of the time or work that is left, 1 where neither is limited."""
        share = 1.0
        if self.work_limit is not None:
            share = min(share, 1.0 - self.work / max(1, self.work_limit))
        if self.deadline is not None:
            total = max(1e-9, self.deadline - self.begin)
            share = min(share, (self.deadline - time.perf_counter()) / total)
        return max(0.0, share)

    def answer(self, number: int, fixed: Sequence[Route], width: int, floor: float, noisy: bool) -> Route | None:
        """Best response of one robot to fixed routes; counts as one iteration."""
        self.work += 1
        width = affordable_width(self.problem, width, _EXPANSIONS)
        noise = np.exp(self.rng.normal(0.0, 0.3, self.problem.n_cells)) if noisy else None
        response = best_response(
            self.problem,
            self.classes[number],
            fixed,
            width=width,
            floor=floor,
            prices=self.prices.get(number),
            noise=noise,
        )
        self.prices[number] = response.prices
        return response.route


def improve(
    problem: RouteProblem,
    routes: Sequence[Route],
    *,
    deadline: float | None = None,
    work_limit: int | None = None,
    seed: int = 0,
    should_stop: Callable[[], bool] | None = None,
    on_improve: Callable[[list[Route], float], None] | None = None,
) -> list[Route]:
    """Return a plan that keeps every limit and is worth at least as much as the one given.

    Cycles of growing length: annealing over sequences of cells (which knows nothing of the limits between robots
    and of chargers; its plans are repaired), then best responses of single robots and groups of robots.

    Parameters
    ----------
    problem
        The problem.
    routes
        A plan that keeps every limit, one route per robot, classes in order.
    deadline
        ``time.perf_counter()`` at which to end.
    work_limit
        Iterations: one best response, or one chunk of annealing moves, each. With it and no deadline the result
        depends on the seed alone. Without any limit or ``should_stop`` it is 100.
    seed
        Seed of all random choices.
    should_stop
        Asked between iterations.
    on_improve
        Called with each better plan and its value.
    """
    search = _Search(problem, routes, deadline, work_limit, seed, should_stop, on_improve)
    search.offer(search.given)
    if not search.classes:
        return search.routes
    model = None
    if problem.n_cells <= _MOST_CELLS and not search.over():
        model = sequence_model(problem)
        if not applies(problem, model):
            model = None
    cycle = 0
    while not search.over():
        if model is not None:
            _anneal(search, model, cycle)
        _respond(search, _WIDTHS[min(cycle, len(_WIDTHS) - 1)], groups=model is None or _hindered(problem))
        cycle += 1
    return search.routes


def _hindered(problem: RouteProblem) -> bool:
    """Whether something binds that the annealing does not see."""
    robots = problem.n_robots
    return (
        (problem.robots_per_cell is not None and problem.robots_per_cell < robots)
        or (problem.sensing_robots_per_step is not None and problem.sensing_robots_per_step < robots)
        or (problem.forbid_swaps and robots > 1)
        or bool(problem.charger_j.any())
    )


def _anneal(search: _Search, model: SequenceModel, cycle: int) -> None:
    """One cycle of annealing: from hot, where little of the plan is kept, then several times from warm.

    Each of the latter begins with the best sequences of the cycle.
    """
    problem = search.problem
    ruin_share = min(0.06, max(0.001, 1.5 / problem.n_cells))  # one costs as much as many segment moves
    if any(battery_can_bind(problem, group) for group in problem.classes):
        ruin_share = max(ruin_share, 0.02)  # segment moves do not see what they cost in battery
    moves = min(10_000, int(100.0 / ruin_share))
    order, lengths = encode(problem, search.routes)
    best_order, best_lengths = order.copy(), lengths.copy()
    reward = np.maximum(problem.reward, 0.0)
    tables = Tables(
        problem.horizon, problem.sigma, reward, model.steps, np.ascontiguousarray(model.steps.T), model.energy_j,
        model.near, model.whole, model.joules,
    )  # fmt: skip
    random = np.array([search.rng.integers(1, 1 << 62)], dtype=np.uint64)
    scale = float(np.mean(reward.max(axis=1)[reward.max(axis=1) > 0.0])) if reward.any() else 1.0
    chunks = (1 + _REHEATS / 2) * (_FIRST_CYCLE << min(2 * cycle, 40))
    begin, left = search.work, search.left()
    stretched = chunks * search.chunk_share > 0.25 * left  # the last cycle takes all that is left
    worth, phase = -np.inf, 0
    while not search.over():
        share = 1.0 - (search.left() - 0.03) / left if stretched else (search.work - begin) / chunks
        if share >= 1.0:
            break
        stage, share = divmod(share * (2 + _REHEATS), 1.0)  # the first two are the annealing from hot
        if stage >= 2 and stage != phase:
            order[:], lengths[:] = best_order, best_lengths
        phase = int(stage)
        hot = _WARM if stage >= 2 else _HOT
        heat = scale * hot * (_COLD / hot) ** (share if stage >= 2 else 0.5 * (stage + share))
        search.work += 1
        found = anneal(order, lengths, best_order, best_lengths, worth, heat, moves, ruin_share, random, tables)
        if found > worth and not _hindered(problem):
            search.offer(decode(problem, model, best_order, best_lengths))
        worth = found
    search.chunk_share = (left - search.left()) / max(1, search.work - begin)
    if _hindered(problem):
        _repair(search, decode(problem, model, best_order, best_lengths))


def _repair(search: _Search, wished: Sequence[Route]) -> None:
    """Offer a plan that may break limits between robots: those in the way of others answer the rest."""
    if search.offer(wished):
        return
    kept: dict[int, Route] = {}
    order = [int(number) for number in search.rng.permutation(len(wished))]
    for number in order:
        if not coupling_faults(search.problem, [*kept.values(), wished[number]]):
            kept[number] = wished[number]
    for number in order:
        if number not in kept:
            if search.over():
                return
            route = search.answer(number, list(kept.values()), _WIDTHS[0], -np.inf, noisy=False)
            if route is None:
                return
            kept[number] = route
    search.offer([kept[number] for number in range(len(wished))])


def _respond(search: _Search, width: int, *, groups: bool) -> None:
    """Best responses: each robot alone until none improves, then (if ``groups``) random groups of them."""
    robots = len(search.classes)
    idle = 0
    order = search.rng.permutation(robots)
    while idle < robots:
        for number in order:
            if search.over():
                return
            rest = [route for other, route in enumerate(search.routes) if other != number]
            floor = search.worth - value(search.problem, rest)
            route = search.answer(int(number), rest, width, floor, noisy=False)
            better = route is not None and search.offer(_with(search.routes, {int(number): route}))
            idle = 0 if better else idle + 1
            if idle >= robots:
                break
    if not groups or robots == 1:
        return
    for _ in range(4 * robots):
        if search.over():
            return
        size = int(search.rng.integers(2, min(robots, 4) + 1))
        again = [int(number) for number in search.rng.choice(robots, size, replace=False)]
        plan: dict[int, Route] = {n: route for n, route in enumerate(search.routes) if n not in again}
        for number in again:
            route = search.answer(number, list(plan.values()), width // 4, -np.inf, noisy=True)
            if route is None:
                break
            plan[number] = route
        else:
            search.offer([plan[number] for number in range(robots)])


def _with(routes: Sequence[Route], changed: dict[int, Route]) -> list[Route]:
    return [changed.get(number, route) for number, route in enumerate(routes)]
