"""What makes the linear programme tighter once it is solved: limits between robots, larger memory, cuts."""

from __future__ import annotations

import numpy as np

from react_opt.route_problem import Route
from react_opt.solvers.routes.columns import Rank1Cut
from react_opt.solvers.routes.cuts import SubsetRow, separate
from react_opt.solvers.routes.generation import Generation
from react_opt.solvers.routes.memory import Memory
from react_opt.solvers.routes.rows import violated_limits

MOST_CUTS = 64
MOST_CUTS_AT_ONCE = 25
TINY = 1e-6
HEAVY = 6.0  # times the labels of the first pricings


class Tightening:
    """Tightens the master of a column generation at its last point.

    Parameters
    ----------
    generation
        The column generation.
    memory
        The ng-sets of its pricer.
    """

    def __init__(self, generation: Generation, memory: Memory) -> None:
        self.generation, self.memory = generation, memory
        self.master, self.pricer = generation.master, generation.pricer
        self.problem = self.pricer.problem
        self._first_effort = 0.0
        self._counted = (0, 0)

    def add_limits(self) -> bool:
        """Add limits between robots that the linear programme breaks; return whether there were any."""
        point = self.generation.point
        if point is None:
            return False
        rows = violated_limits(self.problem, self.master.columns, point.use)
        self.master.add_rows(rows)
        return bool(rows)

    def tighten(self) -> bool:
        """Add cuts and let the memory grow; return whether anything changed."""
        added = self.cut()
        return self.grow_memory() or added

    def heavy(self) -> bool:
        """Return whether the pricing since the last call took many times the labels that it took at first."""
        labels, calls = self.pricer.labels - self._counted[0], self.pricer.calls - self._counted[1]
        self._counted = (self.pricer.labels, self.pricer.calls)
        effort = labels / max(1, calls)
        if self._first_effort == 0.0:
            self._first_effort = effort
        return effort > HEAVY * self._first_effort

    def grow_memory(self) -> bool:
        """Remember cells along the cycles of routes in use; return whether anything was added."""
        point = self.generation.point
        if point is None:
            return False
        pairs: list[tuple[int, int]] = []
        for k in np.flatnonzero(point.use > TINY):
            column = self.master.columns[k]
            if not column.elementary:
                pairs += _cycles(column.path)
        if not self.memory.grow(pairs):
            return False
        self.pricer.remember()
        self.master.drop(lambda column: not column.elementary and not self.memory.allows(column.path))
        return True

    def cut(self) -> bool:
        """Add violated subset-row cuts, in place of those without a price; return whether there were any."""
        point, master = self.generation.point, self.master
        if point is None or len(point.use) != len(master.columns):
            return False
        cuts = separate(master.columns, point.use, self.problem.n_cells, master.cuts, MOST_CUTS_AT_ONCE)
        if not cuts:
            return False
        stronger = {cut.cells for cut in cuts}
        priced = dict(zip(master.cuts, point.duals.cut.tolist(), strict=True))
        room = MOST_CUTS - len(master.cuts)
        idle = [cut for cut in master.cuts if priced[cut] <= TINY]
        worse: set[Rank1Cut] = {cut for cut in master.cuts if isinstance(cut, SubsetRow) and cut.cells in stronger}
        worse |= set(idle if room + len(worse) < len(cuts) else [])
        master.drop_cuts(lambda cut: cut in worse)
        cuts = cuts[: MOST_CUTS - len(master.cuts)]
        master.add_cuts(cuts)
        return bool(cuts)


def _cycles(route: Route) -> list[tuple[int, int]]:
    """Return the pairs (place, cell) that would have kept a route from collecting a cell twice."""
    pairs: list[tuple[int, int]] = []
    last: dict[int, int] = {}
    for position in np.flatnonzero(route.sense):
        cell = int(route.cell[position])
        if cell in last:
            pairs += [(int(place), cell) for place in route.cell[last[cell] : position] if place >= 0]
        last[cell] = int(position)
    return pairs
