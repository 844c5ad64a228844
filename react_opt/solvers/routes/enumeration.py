"""Route enumeration: every route that a better plan can contain.

If a plan is worth more than ``floor`` in the master, each of its routes has a reduced value of at least the
incumbent minus the Lagrangian bound (Baldacci, Christofides and Mingozzi 2008). Of routes that collect the same
cells only the best is needed, so labels carry the exact set of cells collected and two labels of the same cell,
instant and set are compared by value (and energy, where the battery can bind). Beginnings are enumerated up to the
middle of the horizon and rests from there on: both together are few beside all routes. They are put together when
routes are looked for, which may be at other prices, and then only those that are worth most at these. Not valid where
limits between robots make a worse route with the same cells useful.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.columns import Column, Duals, Rank1Cut
from react_opt.solvers.routes.halves import Half, Seam, promising, rests_of_cells
from react_opt.solvers.routes.labelstore import NEVER, ORIGIN, Labels, MaskArray
from react_opt.solvers.routes.pricing import NO_SIDE_PRICES, RoutePricer, SidePrices
from react_opt.solvers.routes.setjoin import best_of_each, join_sets
from react_opt.solvers.routes.setlabels import grow_sets
from react_opt.solvers.routes.setprices import SetPrices, cost_of_sets, set_prices, sums_of_sets

PROBE = 20  # part of the labels that are allowed, to find out where beginnings and rests should meet
FIRST_DRAWN = 2.0**-12  # share of the beginnings whose routes are looked at to see how many there are


class Look(NamedTuple):
    """Routes of a class that are worth most at some prices, the best one for each set of cells.

    Parameters
    ----------
    sets
        ``(m, words)`` cells collected.
    value
        ``(m,)`` value in the objective, to rounding.
    reduced
        ``(m,)`` value minus prices, the group's multiplier not deducted.
    whole_above
        No route of the enumeration is missing that is worth more than this after prices.
    """

    sets: MaskArray
    value: FloatArray
    reduced: FloatArray
    whole_above: float


class Joined(NamedTuple):
    """What :func:`join_sets` returns."""

    sets: MaskArray
    gross: FloatArray
    value: FloatArray
    parts: IntArray
    above: float


class Enumeration:
    """All routes of a class that lose little, as beginnings and rests.

    Parameters
    ----------
    pricer, group
        The pricer and the class.
    beginnings, rests
        Labels of both directions and their sets; those that cannot be put together with others are left out, and
        rests in nodes before ``first``.
    first
        Node of kernel time.
    paid
        Prices of cuts that beginnings and rests have paid.
    cell
        Prices of cells with which they were enumerated.
    seam
        How they are put together.
    floor, cutoff
        Least value minus these prices of a route, and of a beginning and its rest.
    threads
        Threads to use.
    """

    def __init__(
        self,
        pricer: RoutePricer,
        group: int,
        beginnings: tuple[Labels, MaskArray, FloatArray],
        rests: tuple[Labels, MaskArray, FloatArray],
        first: int,
        cell: FloatArray,
        seam: Seam,
        floor: float,
        cutoff: float,
        threads: int,
    ) -> None:
        self.pricer, self.group = pricer, group
        self._constant, self._cutoff, self._threads = floor - cutoff, cutoff, min(2, max(1, threads))
        self._labels = beginnings[0], rests[0]
        self._seam = seam
        none = set_prices(cell, (), np.zeros(0))
        ahead, behind = (
            Half(
                labels.start, sets, labels.value + cost_of_sets(sets, none), labels.value - paid, labels.value - paid,
                labels.cuts, labels.fuel, labels.sensed | (labels.arc == ORIGIN),
            )
            for labels, sets, paid in (beginnings, rests)
        )  # fmt: skip
        n, node = len(cell), _nodes(ahead.start)
        late = node // n > (len(ahead.start) - 1) // n - 1 - seam.arc_steps.max(initial=1)
        whole = ahead.last & (ahead.base + seam.idle_end.ravel()[node] >= cutoff)
        self._ahead, self._ahead_kept = _only(ahead, late | whole)
        self._behind, self._behind_kept = _only(behind, _nodes(behind.start) >= first)
        self._found: list[tuple[MaskArray, IntArray]] = []

    def narrow(self, prices: SetPrices, least: float) -> None:
        """Forget for good what cannot be part of a route that is worth enough at some prices.

        Parameters
        ----------
        prices
            Prices of cells and cuts.
        least
            Least value minus prices, the group's multiplier not deducted.
        """
        (self._ahead, self._behind), kept = self._promising(prices, least - self._constant)
        self._ahead_kept, self._behind_kept = self._ahead_kept[kept[0]], self._behind_kept[kept[1]]

    def look(self, prices: SetPrices, least: float, most: int, some: int | None = None) -> Look:
        """Return all routes that are worth enough at some prices, or the best of them and others drawn at random.

        Parameters
        ----------
        prices
            Prices of cells and cuts.
        least
            Least value minus prices of interest, the group's multiplier not deducted.
        most
            About as many routes are returned at most.
        some
            Where there are more than ``most``, about so many of the best, and as many others; ``most`` by default.
        """
        some, cutoff = most if some is None else min(some, most), least - self._constant
        (ahead, behind), kept = self._promising(prices, cutoff)
        order = np.lexsort((-behind.value, _nodes(behind.start)))
        behind = _taken(behind, order)
        found, share = self._draw(ahead, behind, prices, cutoff, some)
        above = found.above
        if share < 1.0 and above < np.inf:
            below = len(found.value) - max(1, int(some * share))
            if len(found.value) > most * share and below > 0:
                cutoff = float(np.partition(found.value, below)[below])
            best = self._joined(ahead, behind, prices, cutoff, 2 * most, 1.0)
            found, above = _united(best, found), best.above
        beginning, rest = self._ahead_kept[kept[0]][found.parts[:, 0]], np.full(len(found.parts), -1)
        joined = found.parts[:, 2] >= 0
        rest[joined] = self._behind_kept[kept[1][order]][found.parts[joined, 2]]
        self._found.append((found.sets, np.stack((beginning, found.parts[:, 1], rest), axis=1)))
        return Look(found.sets, found.gross + self._constant, found.value + self._constant, above + self._constant)

    def _draw(self, ahead: Half, behind: Half, prices: SetPrices, least: float, some: int) -> tuple[Joined, float]:
        """Return about so many routes drawn at random, and the share of the beginnings that was looked at for it."""
        share = FIRST_DRAWN
        while True:
            drawn = self._joined(ahead, behind, prices, least, 4 * some, share)
            if share == 1.0 or 2 * len(drawn.value) > some or drawn.above == np.inf:
                return drawn, share
            share = min(1.0, share * max(2.0, min(64.0, some / (len(drawn.value) + 1))))

    def _promising(self, prices: SetPrices, least: float) -> tuple[tuple[Half, Half], tuple[IntArray, IntArray]]:
        """Return the labels that can be part of a route worth enough, with their value at some prices, and which."""
        halves = self._ahead, self._behind
        with ThreadPoolExecutor(self._threads) as executor:
            costs = list(executor.map(lambda half: cost_of_sets(half.sets, prices), halves))
        ahead, behind = (half._replace(value=half.gross - cost) for half, cost in zip(halves, costs, strict=True))
        here, there = promising(ahead, behind, self._seam, least)
        (ahead, first), (behind, second) = _only(ahead, here), _only(behind, there)
        return (ahead, behind), (first, second)

    def _joined(self, ahead: Half, behind: Half, prices: SetPrices, cutoff: float, most: int, drawn: float) -> Joined:
        """Return routes put together from labels, see :func:`join_sets`."""
        sums, rests = sums_of_sets(behind.sets, prices), rests_of_cells(behind.start, behind.sets)
        with ThreadPoolExecutor(self._threads) as executor:
            jobs = [
                executor.submit(
                    join_sets, ahead, behind, rests, sums, self._seam, prices, self._cutoff, cutoff, most, drawn,
                    (part, self._threads), self.pricer.stop,
                )
                for part in range(self._threads)
            ]  # fmt: skip
            parts = [Joined(*job.result()) for job in jobs]
        found = parts[0]
        for part in parts[1:]:
            found = _united(found, part)
        # what one of them has left out may be a better way to a set that another has found
        kept = found.value >= found.above
        return Joined(found.sets[kept], found.gross[kept], found.value[kept], found.parts[kept], found.above)

    def column(self, sets: MaskArray) -> Column:
        """Return a route that was found when it was looked for.

        Parameters
        ----------
        sets
            ``(words,)`` the set that it collects.
        """
        for known, parts in reversed(self._found):
            places = np.flatnonzero(np.all(known == sets, axis=1))
            if len(places):
                beginning, arc, rest = parts[places[0]].tolist()
                ahead, behind = self._labels
                return self.pricer.column(self.group, ahead, beginning, None if rest < 0 else (arc, behind, rest))
        raise LookupError("no route with this set has been found")


def enumerate_routes(
    pricer: RoutePricer,
    group: int,
    duals: Duals,
    floor: float,
    side: SidePrices = NO_SIDE_PRICES,
    cuts: Sequence[Rank1Cut] = (),
    *,
    max_labels: int = 500_000,
    threads: int = 1,
) -> Enumeration | None:
    """Return the best route for every set of cells whose value minus prices reaches ``floor``.

    None if there are more labels than allowed.

    Parameters
    ----------
    pricer
        The pricer with its ng-sets.
    group
        Class of robots.
    duals, side, cuts
        Prices; ``side`` may forbid but not price standing or sensing.
    floor
        Least value minus prices, the group's multiplier not deducted.
    max_labels
        Labels in each direction beyond which the enumeration is given up.
    threads
        Threads to use, two at most.
    """
    problem = pricer.problem
    ends = pricer.endings(group, duals, floor, side, cuts)
    if ends is None:
        return None
    data, (ahead, back), (fuel, spent), (bound, past) = problem.classes[group], ends.prices, ends.fuel, ends.bound
    idle_end = np.ascontiguousarray(pricer.rests.last[group][::-1])
    never = np.full_like(idle_end, NEVER)
    forward = (pricer.forward, ahead, fuel, pricer.rests.begin[group], False, idle_end, bound, ends.rests)
    backward = (pricer.backward, back, spent, pricer.rests.last[group], True, never, past, ends.beginnings)
    first, beyond = data.start_step, problem.horizon
    # a part of the labels tells how fast they become more in both directions, and where these should meet
    few = max_labels // PROBE
    probe = _grow(((*forward, beyond), (*backward, beyond - first)), (ends.cutoff, few, pricer.stop), threads)
    reach = _reach([half[0] for half in probe], problem.n_cells, few)
    middle = first + (beyond - first) * reach[0] // max(1, sum(reach))
    sides = (*forward, middle), (*backward, beyond - middle - 1)
    found = _grow(sides, (ends.cutoff, max_labels, pricer.stop), threads)
    if not all(half[3] for half in found):
        return None
    seam = Seam(
        problem.out_start, problem.arc_to, problem.arc_steps, ahead.arc_cost, ahead.wait_cost, fuel.arc, fuel.wait,
        fuel.budget, ahead.cut_price, idle_end,
    )  # fmt: skip
    longest = int(problem.arc_steps.max(initial=1))
    late = max(0, beyond - middle - longest) * problem.n_cells
    beginnings, rests = (half[:3] for half in found)
    return Enumeration(pricer, group, beginnings, rests, late, duals.cell, seam, floor, ends.cutoff, threads)


def _grow(
    sides: tuple[tuple[Any, ...], ...], limits: tuple[float, int, NDArray[np.uint8]], threads: int
) -> list[tuple[Labels, MaskArray, FloatArray, bool]]:
    """Return the labels of both directions, see :func:`grow_sets`."""
    with ThreadPoolExecutor(2 if threads > 1 else 1) as executor:
        jobs = [executor.submit(grow_sets, *(*side, *limits)) for side in sides]
        return [job.result() for job in jobs]


def _reach(labels: list[Labels], n_cells: int, most: int) -> list[int]:
    """Return how many instants each direction goes through with the same number of labels."""
    upto = [one.start[n_cells::n_cells] for one in labels]
    same = min(most, *(int(one[-1]) for one in upto))
    return [int(np.searchsorted(one, same)) for one in upto]


def _united(one: Joined, other: Joined) -> Joined:
    """Return the routes of both, the best one for each set."""
    sets, gross = np.concatenate((one.sets, other.sets)), np.concatenate((one.gross, other.gross))
    value, parts = np.concatenate((one.value, other.value)), np.concatenate((one.parts, other.parts))
    kept = best_of_each(sets, gross)
    return Joined(sets[kept], gross[kept], value[kept], parts[kept], max(one.above, other.above))


def _taken(half: Half, places: IntArray) -> Half:
    """Return some of the labels of one direction."""
    return Half(
        half.start, half.sets[places], half.gross[places], half.base[places], half.value[places], half.cuts[places],
        half.fuel[places], half.last[places],
    )  # fmt: skip


def _nodes(start: IntArray) -> IntArray:
    """Return the node of each label."""
    return np.repeat(np.arange(len(start) - 1), np.diff(start))


def _only(half: Half, needed: NDArray[np.bool_]) -> tuple[Half, IntArray]:
    """Return the labels of one direction that are needed, and which these are."""
    kept = np.flatnonzero(needed)
    start = np.concatenate(([0], np.cumsum(needed)))[half.start]
    return _taken(half, kept)._replace(start=start), kept
