"""The local searches of one solve: one that goes on from the best plan, beside the proof, and fresh ones."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from react_opt.models.inspection import InspectionArrays, Routes
from react_opt.solvers.inspection.answer import Answer
from react_opt.solvers.inspection.control import Control
from react_opt.solvers.inspection.local import Searcher

PORTION = 2000  # iterations
LAST_PORTIONS = 300  # where nothing proves the plan and nothing limits the search
WARM_SHARE, WARM_PORTIONS = 0.3, 15  # of fresh searches before the first linear program: of the time left, and in all
FRESH_EVERY = 5  # portions of a fresh search
DOUBLINGS, LONG_HEAT, LONG_ROOM = 5, 1.0, 1.0  # of the portions where there are many targets


class PrimalSearch:
    """Improves the plan of an answer.

    Parameters
    ----------
    arrays, control, answer, seed
        The problem, when to stop, what is known, and the seed.
    many
        Whether targets are many: then portions are long, and searches begin anew.
    offer
        Called with routes found; keeps them in ``answer`` where they are better.
    on_routes
        Called with the robots and stops of routes that a search came across.
    """

    def __init__(
        self,
        arrays: InspectionArrays,
        control: Control,
        answer: Answer,
        seed: int,
        many: bool,
        offer: Callable[[Routes], bool],
        on_routes: Callable[[list[tuple[int, tuple[int, ...]]]], None],
    ) -> None:
        self.arrays, self.control, self.answer, self.seed, self.many = arrays, control, answer, seed, many
        self.offer, self.on_routes = offer, on_routes
        self._searcher: Searcher | None = None
        self._fresh: Searcher | None = None
        self._turn = 0
        self._thread: threading.Thread | None = None

    def run(self, iterations: int) -> None:
        """Go on for a portion, or collect what the search beside has found."""
        if self._thread is not None:
            self._thread.join(0.02)
            self.collect()
            return
        known = self.answer.routes
        if known is None or not len(self.arrays.value):
            return
        if self._searcher is None:
            self._searcher = Searcher(self.arrays, known, self.seed, self.control.flag)
        self.control.work += 1
        if known is not self._searcher.routes:
            self._searcher.offer(known)
        self.offer(self._searcher.run(iterations))

    def start_beside(self) -> None:
        """Go on in a thread of its own until the control's flag is set."""
        self._thread = threading.Thread(target=self._run_on, daemon=True)
        self._thread.start()

    def end_beside(self) -> None:
        """Wait for that thread, which the control's flag ends, and keep what it has found."""
        if self._thread is not None:
            self._thread.join()
            self._thread = None
            self.collect()

    def _run_on(self) -> None:
        turn = 0
        while self.control.flag[0] == 0 and self._searcher is not None:
            self._portion(self._searcher, turn)
            turn += 1

    def _portion(self, searcher: Searcher, turn: int) -> Routes:
        """Run a portion; where targets are many they grow and cool slowly, the time left being short or long."""
        if not self.many:
            return searcher.run(PORTION)
        return searcher.run(PORTION << min(turn, DOUBLINGS), LONG_HEAT, LONG_ROOM)

    def collect(self) -> None:
        """Keep what the search beside has found so far."""
        if self._thread is not None and self._searcher is not None:
            self.offer(self._searcher.routes)

    def warm_up(self) -> None:
        """Search anew from a few starts, since one search gets stuck, and hand on the routes that came up."""
        left_s = self.control.left_s()
        timed = left_s is not None and self.control.work_limit is None
        until = time.perf_counter() + WARM_SHARE * left_s if timed and left_s is not None else None
        for _ in range(WARM_PORTIONS):
            if (until is not None and time.perf_counter() >= until) or not self.run_anew():
                break
        self.collect()
        if self._searcher is not None:
            self.on_routes(sorted(self._searcher.seen.copy()))

    def run_anew(self) -> bool:
        """Run a portion of a search that began from nothing, or begin another; False where it cannot."""
        empty: Routes = [[] for _ in self.arrays.time_s]
        begin = empty if self.arrays.is_feasible(empty) else self.answer.routes
        if begin is None or not len(self.arrays.value) or self.control.stopped():
            return False
        turn = self._turn % FRESH_EVERY
        if self._fresh is None or turn == 0:
            self._fresh = Searcher(self.arrays, begin, self.seed + 1 + self._turn, self.control.flag)
        self._turn += 1
        self.control.work += 1
        self.offer(self._portion(self._fresh, turn))
        self.on_routes(sorted(self._fresh.seen))
        return True

    def run_out(self) -> None:
        """Search until the control stops, or for many portions where nothing limits the search."""
        portions = 0
        while not self.control.stopped() and self.answer.routes is not None:
            portions += 1
            if self.control.deadline is None and portions > LAST_PORTIONS:
                break
            if not self.many:
                self.run(PORTION)
            elif not self.run_anew():
                break
