"""The primal search beside the proof: in a thread of its own, or in slices between the steps of the proof."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext

from react_opt.route_problem import Route, RouteProblem
from react_opt.solvers.routes.budget import Standing
from react_opt.solvers.routes.search import improve

SHARE = 0.3  # of the time, where the primal search has no thread of its own
USED_AT_ONCE = 2  # threads of the proof where it uses several
_PATIENCE_S = 0.05  # how long the end of a solve waits for the thread; it ends soon after by itself


@contextmanager
def beside(standing: Standing, threads: int, seed: int) -> Iterator[None]:
    """Search for better plans while a proof runs: in a thread if there is one to spare, in slices otherwise.

    Nothing is done under a work limit, where the order of all steps has to be reproducible, nor without a plan.

    Parameters
    ----------
    standing
        The best plan so far; better ones are offered to it whenever its budget is asked for.
    threads
        Threads to use.
    seed
        Seed of the search.
    """
    budget = standing.budget
    if standing.routes is None or budget.work_limit is not None:
        yield
        return
    if threads < 2:
        budget.aside = Slices(standing, SHARE, seed)
        try:
            yield
        finally:
            budget.aside = None
        return
    search = Background(standing.problem, standing.routes, budget.deadline, seed)

    def take() -> None:
        news = search.news()
        if news is not None:
            standing.offer(news)

    budget.aside = take
    if threads == USED_AT_ONCE:
        budget.alone = search.paused
    try:
        yield
    finally:
        budget.aside, budget.alone = None, nullcontext
        search.stop()
    take()


class Background:
    """`improve` in a thread; its kernels release the interpreter, so it runs while the proof does.

    Parameters
    ----------
    problem
        The problem.
    routes
        A plan to begin with that keeps every limit.
    deadline
        ``time.perf_counter()`` at which the search ends by itself; None to search until `stop`.
    seed
        Seed of the search.
    """

    def __init__(self, problem: RouteProblem, routes: Sequence[Route], deadline: float | None, seed: int) -> None:
        self._problem, self._begin, self._deadline, self._seed = problem, list(routes), deadline, seed
        self._lock = threading.Lock()
        self._news: list[Route] | None = None
        self._ended, self._going = threading.Event(), threading.Event()
        self._going.set()
        self._fault: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="primal search", daemon=True)
        self._thread.start()

    def news(self) -> list[Route] | None:
        """Best plan found since the last call, None if there is none; raises what ended the search, if anything."""
        if self._fault is not None:
            raise self._fault
        with self._lock:
            news, self._news = self._news, None
        return news

    def stop(self) -> None:
        """End the search; its thread follows within one iteration, which is not waited for very long."""
        self._ended.set()
        self._going.set()
        self._thread.join(_PATIENCE_S)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Let the thread wait, from its next iteration on, as long as this lasts."""
        self._going.clear()
        try:
            yield
        finally:
            self._going.set()

    def _over(self) -> bool:
        self._going.wait()
        return self._ended.is_set()

    def _run(self) -> None:
        try:
            improve(
                self._problem,
                self._begin,
                deadline=self._deadline,
                seed=self._seed,
                should_stop=self._over,
                on_improve=self._tell,
            )
        except BaseException as fault:  # handed to the thread that asks
            self._fault = fault

    def _tell(self, routes: list[Route], worth: float) -> None:
        with self._lock:
            self._news = routes


class Slices:
    """The primal search in slices that take a given share of the time since it began; each is longer.

    Parameters
    ----------
    standing
        The plan to improve and its budget.
    share
        Share of the time that the slices may take together.
    seed
        Seed of the search.
    """

    def __init__(self, standing: Standing, share: float, seed: int) -> None:
        self._standing, self._share, self._seed = standing, share, seed
        self._begin = time.perf_counter()
        self._spent = 0.0
        self._inside = False

    def __call__(self) -> None:
        """Run a slice if one is due."""
        now = time.perf_counter()
        due = self._share * (now - self._begin) - self._spent
        routes = self._standing.routes
        if self._inside or routes is None or due < 0.25 * self._spent + 0.02:
            return
        self._inside = True
        self._seed += 1
        end = now + due / (1.0 - self._share)
        deadline = self._standing.budget.deadline
        try:
            better = improve(
                self._standing.problem,
                routes,
                deadline=end if deadline is None else min(end, deadline),
                seed=self._seed,
            )
            self._standing.offer(better)
        finally:
            self._spent += time.perf_counter() - now
            self._inside = False
