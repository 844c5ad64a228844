"""Neighbourhood memory (ng-sets): which cells a route still remembers having collected, and as which bits.

Standing in cell j a label remembers the collected cells of ``near[j]`` only; what it forgets it may collect
again, which makes the pricing a relaxation that gets tighter as the sets grow (Baldacci, Mingozzi and Roberti
2011). With at most 64 cells a cell is its own bit. With more, cells are coloured so that no two cells
remembered at the same place share a colour: the colour is the bit, and one machine word serves any number of
cells.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import IntArray, Route, RouteProblem
from react_opt.solvers.routes.labelstore import MaskArray, SmallInts

WORD_BITS = 64


@kernel
def _fewest_steps(out_start: IntArray, arc_to: IntArray, arc_steps: IntArray, cap: int) -> NDArray[np.int32]:
    """Return ``(n, n)`` fewest steps between cells, ``cap`` where it takes as many or more."""
    n = len(out_start) - 1
    distance = np.full((n, n), cap, np.int32)
    queue = np.empty(n, np.int64)
    queued = np.zeros(n, np.bool_)
    for source in range(n):
        distance[source, source] = 0
        queue[0] = source
        queued[source] = True
        head, waiting = 0, 1
        while waiting > 0:
            i = queue[head]
            head = (head + 1) % n
            waiting -= 1
            queued[i] = False
            for a in range(out_start[i], out_start[i + 1]):
                j = arc_to[a]
                there = distance[source, i] + arc_steps[a]
                if there < distance[source, j]:
                    distance[source, j] = there
                    if not queued[j]:
                        queue[(head + waiting) % n] = j
                        queued[j] = True
                        waiting += 1
    return distance


def fewest_steps(problem: RouteProblem) -> NDArray[np.int32]:
    """Return ``(n, n)``: fewest steps from cell to cell, ``horizon + 1`` where it takes more than the horizon."""
    return _fewest_steps(problem.out_start, problem.arc_to, problem.arc_steps, problem.horizon + 1)


class Memory:
    """The ng-sets of all cells and their colours.

    Parameters
    ----------
    steps
        ``(n, n)`` fewest steps between cells.
    size
        Cells remembered at each place at first, the place itself included: those with the shortest round trip.
    """

    def __init__(self, steps: NDArray[np.int32], size: int) -> None:
        n = len(steps)
        self.steps = steps
        round_trip = steps + steps.T
        size = min(size, n)
        nearest = np.argsort(round_trip, axis=1, kind="stable")[:, :size]
        self.near: list[set[int]] = [{int(c) for c in nearest[j]} | {j} for j in range(n)]
        colours = self._colours(self.near)
        if colours is None:
            raise ValueError(f"ng-sets of {size} cells cannot be coloured with {WORD_BITS} bits")
        self.colour = colours

    @property
    def complete(self) -> bool:
        """Whether everything is remembered everywhere (elementary routes)."""
        return all(len(cells) == len(self.near) for cells in self.near)

    def grow(self, pairs: Iterable[tuple[int, int]]) -> int:
        """Remember cell c at place j for the given pairs ``(j, c)``; return how many pairs were added.

        A pair whose colours cannot be accommodated in a word is left out.
        """
        added, full = 0, False
        for place, cell in pairs:
            near = self.near[place]
            if cell in near or len(near) >= WORD_BITS:
                continue
            clash = any(self.colour[other] == self.colour[cell] for other in near)
            near.add(cell)
            if clash and not self._recolour(cell):
                colours = None if full else self._colours(self.near)
                if colours is None:
                    full = True  # all cells anew is slow, and would fail again
                    near.discard(cell)
                    continue
                self.colour = colours
            added += 1
        return added

    def allows(self, route: Route) -> bool:
        """Return whether a route collects a cell again only after forgetting it."""
        remembered: set[int] = set()
        for cell, senses in zip(route.cell.tolist(), route.sense.tolist(), strict=True):
            if cell < 0:
                continue
            remembered &= self.near[cell]
            if senses:
                if cell in remembered:
                    return False
                remembered.add(cell)
        return True

    def bits(self) -> MaskArray:
        """Return the bit of each cell."""
        return np.left_shift(np.uint64(1), self.colour.astype(np.uint64))

    def kept(self, arc_from: IntArray, arc_to: IntArray, most: int | None = None) -> MaskArray:
        """Return for each arc the bits of the cells remembered at both of its ends.

        With ``most`` each end remembers only so many of its cells, those with the shortest round trip.
        """
        near = self.near
        if most is not None:
            trip = self.steps + self.steps.T
            near = [
                set(sorted(cells, key=lambda c, j=j: (int(trip[j, c]), c))[:most])  # type: ignore[misc]
                for j, cells in enumerate(near)
            ]
        bits = [int(b) for b in self.bits()]
        keep = np.empty(len(arc_from), dtype=np.uint64)
        known: dict[tuple[int, int], int] = {}
        for a, (i, j) in enumerate(zip(arc_from.tolist(), arc_to.tolist(), strict=True)):
            if (i, j) not in known:
                known[i, j] = known[j, i] = sum(bits[c] for c in near[i] & near[j])
            keep[a] = known[i, j]
        return keep

    def cell_of(self) -> SmallInts:
        """Return ``(n, 64)``: the cell that each colour means in each place, -1 where it means none."""
        cells = np.full((len(self.near), WORD_BITS), -1, dtype=np.int32)
        for place, near in enumerate(self.near):
            for cell in near:
                cells[place, self.colour[cell]] = cell
        return cells

    def _recolour(self, cell: int) -> bool:
        """Give one cell a colour that none of those remembered beside it has; return whether there is one."""
        rivals: set[int] = set().union(*(near for near in self.near if cell in near)) - {cell}
        taken = {int(self.colour[rival]) for rival in rivals}
        free = next((k for k in range(WORD_BITS) if k not in taken), None)
        if free is not None:
            self.colour[cell] = free
        return free is not None

    def _colours(self, near: list[set[int]]) -> IntArray | None:
        """Return a colour per cell, different wherever two cells are remembered together; None if none fits."""
        n = len(near)
        if n <= WORD_BITS:
            return np.arange(n, dtype=np.int64)
        places: list[list[int]] = [[] for _ in range(n)]
        for place, cells in enumerate(near):
            for cell in cells:
                places[cell].append(place)
        colour = np.full(n, -1, dtype=np.int64)
        for cell in range(n):
            rivals: set[int] = set().union(*(near[place] for place in places[cell]))
            taken = {int(colour[c]) for c in rivals}
            free = next((k for k in range(WORD_BITS) if k not in taken), None)
            if free is None:
                return None
            colour[cell] = free
        return colour
