"""The decomposition: the recipe from a route problem to a plan, its bound and the proof."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from react_opt.route_problem import Route, RouteProblem
from react_opt.solvers.highs_model import fresh_scheduler
from react_opt.solvers.routes.alone import fits, proven_alone
from react_opt.solvers.routes.background import beside
from react_opt.solvers.routes.budget import Budget, OnProgress, Standing, stopping
from react_opt.solvers.routes.certificate import certificate, tree_certificate
from react_opt.solvers.routes.dual_ascent import BRIEF, WHOLE, DualAscent
from react_opt.solvers.routes.finish import Finish
from react_opt.solvers.routes.generation import Generation
from react_opt.solvers.routes.greedy import greedy
from react_opt.solvers.routes.master import Master
from react_opt.solvers.routes.memory import Memory, fewest_steps
from react_opt.solvers.routes.pricing import RoutePricer
from react_opt.solvers.routes.result import RoutesResult, Status
from react_opt.solvers.routes.routecolumn import route_column
from react_opt.solvers.routes.search import improve
from react_opt.solvers.routes.tightening import Tightening
from react_opt.solvers.routes.tree import Tree

FIRST_MEMORY = 8
SOME_CELLS, SOME_PLACES = 30, 1_000  # cells, cells times instants from which on prices are smoothed briefly first
MANY_CELLS, MANY_PLACES = 45, 4_000  # and from which on until it does not pay any more
PRIMAL_SHARE = 0.05
WORTH_IT, PATIENCE = 0.05, 2  # share of the gap that tightening has to close, and how often it may fail to
FIRST_SEARCH_S = 0.002  # per cell
FIRST_SEARCH_WORK = 20


def solve_routes(
    problem: RouteProblem,
    *,
    deadline: float | None = None,
    work_limit: int | None = None,
    gap: float | None = None,
    threads: int = 1,
    seed: int = 0,
    start: Sequence[Route] | None = None,
    on_progress: OnProgress | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> RoutesResult:
    """Solve a route problem by branch-price-and-cut.

    Parameters
    ----------
    problem
        The route problem.
    deadline
        ``time.perf_counter()`` value at which to return.
    work_limit
        Units of work (pricings, linear programmes, iterations of the primal search); with it, one thread and no
        deadline the result is reproducible.
    gap
        Relative gap at which to stop; None for proven optimality.
    threads
        Threads to use.
    seed
        Seed of all randomness.
    start
        A feasible plan to start from, one route per robot, classes in order.
    on_progress
        Called with elapsed seconds, incumbent and bound.
    should_stop
        Polled; True stops as an interrupt.
    """
    budget = Budget(deadline, work_limit, should_stop)
    standing = Standing(problem, budget, gap, on_progress)
    if start is not None:
        standing.offer(start)
    if standing.routes is None:
        first = greedy(problem, deadline, seed)
        if first.routes is not None:
            standing.offer(first.routes)
        elif first.reason is not None and not isinstance(first.reason, str):
            return RoutesResult(None, None, None, "infeasible", "none", notes=(first.reason.text,))
    fresh_scheduler()
    search = _Proof(problem, standing, threads, seed)
    with stopping(deadline, search.pricer.stop), beside(standing, threads, seed):
        search.run()
    return search.result()


class _Proof:
    """The state of one solve."""

    def __init__(self, problem: RouteProblem, standing: Standing, threads: int, seed: int) -> None:
        self.problem, self.standing, self.threads, self.seed = problem, standing, threads, seed
        self.counts = [len(group.robots) for group in problem.classes]
        self.memory = Memory(fewest_steps(problem), FIRST_MEMORY)
        self.pricer = RoutePricer(problem, self.memory)
        most = float(problem.reward.max(axis=1, initial=0.0).sum()) + standing.lattice.battery_j * problem.sigma
        self.master = Master(problem.n_cells, self.counts, 2.0 * most + 1.0, threads)
        self.generation = Generation(self.master, self.pricer, standing)
        self.tightening = Tightening(self.generation, self.memory)
        self.finish = Finish(self.generation, standing, threads)
        self.notes: list[str] = []
        self.proof: dict[str, Any] = {}
        self._searches = 0

    def run(self) -> None:
        """Go on until the plan is proven or a limit is reached."""
        budget = self.standing.budget
        if fits(self.problem):
            self.proof = proven_alone(self.problem, self.standing) or {}
            if self.standing.done():
                return
        many = self.problem.n_cells >= MANY_CELLS and self.problem.reward.size >= MANY_PLACES
        some = self.problem.n_cells >= SOME_CELLS and self.problem.reward.size >= SOME_PLACES
        some = many or (some and self.problem.n_robots > 1)  # for one robot column generation hardly needs it
        ascent = DualAscent(self.generation, self.memory, self.seed, self.threads, WHOLE if many else BRIEF)
        if many:  # a bound first; what searches beside the proof has time enough
            ascent.slots()
            self._keep_certificate()
        if self.standing.routes is not None and (not many or budget.work_limit is not None):
            wait_s = FIRST_SEARCH_S * self.problem.n_cells
            if budget.deadline is not None:
                wait_s = min(wait_s, 0.05 * max(0.0, budget.deadline - budget.begun))
            self._improve_until(time.perf_counter() + wait_s, FIRST_SEARCH_WORK)
        if self.standing.routes is not None:
            self.master.add([route_column(self.problem, route) for route in self.standing.routes])
        if self.standing.done():
            return
        if not many:
            ascent.slots()
        if some:
            ascent.smooth()
        self._keep_certificate()
        if self._tighten():
            self._branch()
        if not self.standing.done() and self.standing.budget.limit == "none":
            self._search_on()

    def _tighten(self) -> bool:
        """Tighten the linear programme of the whole problem as long as it pays; return whether to branch then."""
        standing, stalled, before = self.standing, 0, np.inf
        while not standing.done():
            self._forget_columns()
            solved = self.generation.converge(at_root=True)
            self._keep_certificate()
            if standing.done() or not solved:
                return False
            if self.tightening.add_limits():
                continue
            self._improve()
            assert self.generation.best is not None
            bound = self.generation.best.bound
            if standing.done() or self._finished():
                return False
            gap = np.inf if standing.objective is None else bound - standing.objective
            stalled = 0 if before - bound > WORTH_IT * gap else stalled + 1
            if self.tightening.heavy() or stalled == PATIENCE or not self.tightening.tighten():
                return True
            before = bound
        return False

    def _finished(self) -> bool:
        """Enumerate the routes that a better plan can contain; return whether that ends the search."""
        best = self.generation.best
        assert best is not None
        finished = self.finish.bound(best)
        if finished is not None and self.standing.lower_bound_to(finished.bound):
            self.proof = certificate(self.problem, self.memory, best, self.pricer.joule_prices, finished)
        return self.standing.done()

    def _branch(self) -> None:
        """Search the tree."""
        assert self.generation.best is not None
        tree = Tree(self.generation, self.tightening, self.finish, self.standing, self.generation.best)
        tree.run()
        proof = tree_certificate(self.problem, self.memory, tree.root, self.pricer.joule_prices)
        if proof["bound"] < self.proof["bound"]:
            self.proof = proof
        self.notes += tree.notes()

    def result(self) -> RoutesResult:
        """Return what is known."""
        standing = self.standing
        proven = standing.proven()
        if self.finish.routes:
            self.notes.append(f"bound rests on the enumeration of {self.finish.routes} routes")
        status: Status = "optimal" if proven else "feasible" if standing.routes is not None else "no_plan"
        return RoutesResult(
            standing.routes,
            standing.objective,
            standing.bound,
            status,
            "none" if proven else standing.budget.limit,
            self.proof,
            standing.budget.work,
            tuple(self.notes),
        )

    def _keep_certificate(self) -> None:
        best = self.generation.best
        if best is not None and (not self.proof or best.bound < self.proof["bound"]):
            self.proof = certificate(self.problem, self.memory, best, self.pricer.joule_prices)

    def _forget_columns(self) -> None:
        """Drop columns that no better plan can contain: their reduced value is below incumbent minus bound."""
        best, objective = self.generation.best, self.standing.objective
        if best is None or objective is None or self.standing.bound is None or len(self.master.columns) < 500:
            return
        reduced = dict(
            zip(
                map(id, self.master.columns),
                self.master.reduced_values(self.generation.extended(best)),
                strict=True,
            )
        )
        floor = objective - best.bound - 1e-6 * max(1.0, abs(objective))
        self.master.drop(lambda column: reduced[id(column)] < floor)

    def _improve(self) -> None:
        """Look for better plans: the linear programme's own, if it is whole, then a short primal search."""
        point = self.generation.point
        if point is not None and np.all((point.use < 1e-6) | (np.abs(point.use - np.round(point.use)) < 1e-6)):
            whole = [
                column.path
                for k in np.flatnonzero(point.use > 0.5)
                for column in [self.master.columns[k]] * round(float(point.use[k]))
            ]
            if len(whole) == self.problem.n_robots:
                self.standing.offer(sorted(whole, key=lambda route: route.robot_class))
                if self.standing.done():
                    return
        self._search(PRIMAL_SHARE)

    def _search(self, share: float) -> None:
        """Spend a share of the time so far on the primal search (of the work so far under a work limit)."""
        standing, budget = self.standing, self.standing.budget
        if standing.routes is None:
            return
        spent = time.perf_counter() - budget.begun
        deadline = time.perf_counter() + share * spent
        if budget.deadline is not None:
            deadline = min(deadline, budget.deadline)
        self._improve_until(deadline, round(share * budget.work))

    def _search_on(self) -> None:
        """Spend what is left on the primal search."""
        budget = self.standing.budget
        if budget.deadline is None and budget.work_limit is None:
            return
        self._improve_until(budget.deadline, 0 if budget.work_limit is None else budget.work_limit - budget.work)

    def _improve_until(self, deadline: float | None, work: int) -> None:
        """Run the primal search up to a time, or for some work where work is limited."""
        standing, budget = self.standing, self.standing.budget
        if standing.routes is None:
            return
        counted = budget.work_limit is not None
        if counted:
            assert budget.work_limit is not None
            work = max(1, min(work, budget.work_limit - budget.work))
            budget.spend(work)
            deadline = budget.deadline
        self._searches += 1
        better = improve(
            self.problem,
            standing.routes,
            deadline=deadline,
            work_limit=work if counted else None,
            seed=self.seed + self._searches,
            should_stop=(lambda: False) if counted and deadline is None else standing.done,
            on_improve=lambda routes, _: self._take(routes),
        )
        self._take(better)

    def _take(self, routes: Sequence[Route]) -> None:
        """Offer a plan, and its routes to the master."""
        if self.standing.offer(routes):
            self.master.add([route_column(self.problem, route) for route in routes])
