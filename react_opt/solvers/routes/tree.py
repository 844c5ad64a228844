"""Branch and bound over the instants at which cells are collected: best bound first, each part with its own prices.

Every part of the tree has a proven bound at any moment, its parent's to begin with; the largest of them bounds the
whole problem.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from react_opt.solvers.routes.budget import Standing
from react_opt.solvers.routes.finish import Finish, Finished
from react_opt.solvers.routes.generation import Generation, Multipliers
from react_opt.solvers.routes.master import MasterPoint
from react_opt.solvers.routes.region import Region, Split, collections_of, everything
from react_opt.solvers.routes.tightening import TINY, Tightening

CANDIDATES = 8
LEAST_SHARE = 0.02  # of a cell on either side of a split
ROUNDS = 3  # of tightening in one part
WORTH_IT = 0.1  # share of the gap that a round has to close for another one


@dataclass
class Part:
    """A part of the plans: an inner one has a question and two parts, a leaf a bound and the prices that prove it.

    Parameters
    ----------
    region
        The part.
    known
        Its multipliers, or those of the part that it was split from.
    bound
        Bound on its plans.
    split, yes, no
        The question by which it has been split and the parts that answer it.
    enumerated
        Multipliers and bound of an enumeration, if the part's bound rests on one.
    """

    region: Region
    known: Multipliers
    bound: float
    split: Split | None = None
    yes: Part | None = None
    no: Part | None = None
    enumerated: tuple[Multipliers, Finished] | None = None


class Tree:
    """The search.

    Parameters
    ----------
    generation, tightening, finish
        Column generation, what tightens it, and enumeration.
    standing
        The best plan so far and the limits.
    root
        Multipliers of the whole problem.
    """

    def __init__(
        self,
        generation: Generation,
        tightening: Tightening,
        finish: Finish,
        standing: Standing,
        root: Multipliers,
    ) -> None:
        self.generation, self.tightening, self.finish = generation, tightening, finish
        self.standing = standing
        problem = generation.pricer.problem
        whole = everything(len(generation.counts), problem.n_cells, problem.horizon)
        self.root = Part(whole, root, root.bound)
        self.parts = 1
        self._open = [(-root.bound, 0, self.root)]
        self._closed = -np.inf  # the largest bound of a part that is done with

    def run(self) -> None:
        """Go on until every part is done with or a limit is reached."""
        while self._open and not self.standing.done():
            part = heapq.heappop(self._open)[2]
            self._solve(part)
            if part.split is None and not self.standing.budget.over():
                self._closed = max(self._closed, part.bound)
            elif part.split is None:
                self._push(part)
            self.standing.lower_bound_to(self.bound)

    @property
    def bound(self) -> float:
        """Bound on every plan."""
        return max(self._closed, -self._open[0][0] if self._open else -np.inf)

    def _push(self, part: Part) -> None:
        self.parts += 1
        heapq.heappush(self._open, (-part.bound, self.parts, part))

    def _solve(self, part: Part) -> None:
        """Bound a part and split it if that does not close it."""
        standing, generation = self.standing, self.generation
        if standing.proven(standing.lattice.round_down(part.bound)):
            return
        generation.look_at(part.region)
        rounds = 0
        while True:
            before = part.bound
            generation.best = part.known
            solved = generation.converge(at_root=False)
            if generation.best is not None and generation.best.bound < part.bound:
                part.known, part.bound = generation.best, generation.best.bound
            if standing.proven(standing.lattice.round_down(part.bound)) or standing.budget.over() or not solved:
                return
            self._offer(generation.point)
            if self.tightening.add_limits():
                continue
            if self._enumerated(part):
                return
            gained = standing.objective is None or before - part.bound > WORTH_IT * (part.bound - standing.objective)
            if self.tightening.heavy() or rounds == ROUNDS or (rounds > 0 and not gained):
                break
            if not self.tightening.tighten():
                break
            rounds += 1
        split = self._choose(part)
        if split is None:
            self._enumerated(part, anew=True)
            return
        part.split = split
        part.yes = Part(part.region.side(split, True), part.known, part.bound, enumerated=part.enumerated)
        part.no = Part(part.region.side(split, False), part.known, part.bound, enumerated=part.enumerated)
        self._push(part.yes)
        self._push(part.no)

    def _enumerated(self, part: Part, *, anew: bool = False) -> bool:
        """Lower a part's bound by enumeration; return whether that closes it."""
        finished = self.finish.bound(part.known, anew=anew)
        if finished is None:
            return False
        if finished.bound < part.bound:
            part.bound, part.enumerated = finished.bound, (part.known, finished)
        return self.standing.proven(self.standing.lattice.round_down(part.bound))

    def notes(self) -> list[str]:
        """Return how the bound came about, in words."""
        if self.parts == 1:
            return []
        return [f"bound from a tree of {self.parts} parts, split by when cells are collected"]

    def _offer(self, point: MasterPoint | None) -> None:
        """Offer the linear programme's own plan, if it is whole."""
        if point is None or point.lacking > TINY or len(point.use) != len(self.generation.master.columns):
            return
        whole = np.round(point.use)
        if np.all(np.abs(point.use - whole) < TINY):
            columns = self.generation.master.columns
            routes = [columns[k].path for k in np.flatnonzero(whole) for _ in range(int(whole[k]))]
            self.standing.offer(sorted(routes, key=lambda route: route.robot_class))

    def _choose(self, part: Part) -> Split | None:
        """Return the question whose answers lower the bound most, by the linear programme at hand."""
        master, point = self.generation.master, self.generation.point
        if point is None or len(point.use) != len(master.columns):
            point = master.solve(self.standing.budget.left_s())
            self.standing.budget.spend()
        if point is None:
            return None
        splits = self._candidates(point)
        if len(splits) < 2:
            return splits[0] if splits else None
        best, chosen = -np.inf, splits[0]
        for split in splits:
            drops = []
            for yes in (True, False):
                master.restrict(part.region.side(split, yes))
                side = master.solve(self.standing.budget.left_s())
                self.standing.budget.spend()
                drops.append(point.value - side.value if side is not None else 0.0)
            worth = max(drops[0], TINY) * max(drops[1], TINY)
            if worth > best:
                best, chosen = worth, split
        return chosen

    def _candidates(self, point: MasterPoint) -> list[Split]:
        """Return the questions on which the linear programme is most undecided."""
        problem = self.generation.pricer.problem
        used = np.flatnonzero(point.use > TINY)
        what = collections_of([self.generation.master.columns[k] for k in used])
        share = point.use[used][what.owner]
        by = np.zeros((problem.n_cells, problem.horizon + 1))
        np.add.at(by, (what.cell, what.instant), share)
        by = np.cumsum(by, axis=1)
        undecided = np.minimum(by, 1.0 - by)
        instant = undecided.argmax(axis=1)
        doubt = undecided[np.arange(problem.n_cells), instant]
        order = np.argsort(-doubt, kind="stable")[:CANDIDATES]
        splits = [Split(int(i), by=int(instant[i])) for i in order if doubt[i] > LEAST_SHARE]
        if splits or len(problem.classes) == 1:
            return splits
        of = np.zeros((problem.n_cells, len(problem.classes)))
        np.add.at(of, (what.cell, what.group), share)
        undecided = np.minimum(of, 1.0 - of)
        group = undecided.argmax(axis=1)
        doubt = undecided[np.arange(problem.n_cells), group]
        order = np.argsort(-doubt, kind="stable")[:CANDIDATES]
        return [Split(int(i), group=int(group[i])) for i in order if doubt[i] > LEAST_SHARE]
