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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.columns import Column, Duals, Rank1Cut
from react_opt.solvers.routes.labelstore import NEVER, ORIGIN, Labels, MaskArray
from react_opt.solvers.routes.pricing import NO_SIDE_PRICES, RoutePricer, SidePrices
from react_opt.solvers.routes.setjoin import Half, Seam, best_of_each, join_sets
from react_opt.solvers.routes.setlabels import grow_sets
from react_opt.solvers.routes.setprices import SetPrices, cost_of_sets, set_prices


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
        self._constant, self._cutoff, self._threads = floor - cutoff, cutoff, threads
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
        self._behind_node = _nodes(self._behind.start)
        self._found: list[tuple[MaskArray, IntArray]] = []

    def look(self, prices: SetPrices, least: float, most: int) -> Look:
        """Return the routes of all enumerated ones that are worth most at some prices.

        Parameters
        ----------
        prices
            Prices of cells and cuts.
        least
            Least value minus prices of interest, the group's multiplier not deducted.
        most
            About as many routes are returned at most.
        """
        ahead = self._ahead._replace(value=self._ahead.gross - cost_of_sets(self._ahead.sets, prices))
        behind = self._behind._replace(value=self._behind.gross - cost_of_sets(self._behind.sets, prices))
        order = np.lexsort((-behind.value, self._behind_node))
        behind = _taken(behind, order)
        many = 2 if self._threads > 1 else 1
        with ThreadPoolExecutor(many) as executor:
            jobs = [
                executor.submit(
                    join_sets, ahead, behind, self._behind_kept[order], self._seam, prices, self._cutoff,
                    least - self._constant, most, (part, many), self.pricer.stop,
                )
                for part in range(many)
            ]  # fmt: skip
            found = [job.result() for job in jobs]
        sets, gross, value, parts = (np.concatenate([one[k] for one in found]) for k in range(4))
        parts[:, 0] = self._ahead_kept[parts[:, 0]]
        above = max(one[4] for one in found)
        if many > 1:  # what one of them has left out may be a better way to a set that another has found
            kept = np.flatnonzero(value >= above)
            kept = kept[best_of_each(sets[kept], gross[kept])]
            sets, gross, value, parts = sets[kept], gross[kept], value[kept], parts[kept]
        self._found.append((sets, parts))
        return Look(sets, gross + self._constant, value + self._constant, above + self._constant)

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
    limits = (ends.cutoff, max_labels, pricer.stop)
    span = problem.horizon - data.start_step
    middle = data.start_step + span // 2
    found: list[tuple[Labels, MaskArray, FloatArray]] | None = None
    for attempt in range(2):
        sides = ((*forward, middle, *limits), (*backward, problem.horizon - middle - 1, *limits))
        with ThreadPoolExecutor(2 if threads > 1 else 1) as pool:
            halves = [half.result() for half in [pool.submit(grow_sets, *side) for side in sides]]
        whole = [half[3] for half in halves]
        if all(whole):
            found = [half[:3] for half in halves]
        if attempt > 0 or all(whole) or not any(whole) or pricer.stop[0]:
            break
        # where the rests are too many the beginnings go on to the end; otherwise they end earlier
        middle = problem.horizon if whole[0] else data.start_step + span // 4
    if found is None:
        return None
    seam = Seam(
        problem.out_start, problem.arc_to, problem.arc_steps, ahead.arc_cost, ahead.wait_cost, fuel.arc, fuel.wait,
        fuel.budget, ahead.cut_price, idle_end,
    )  # fmt: skip
    longest = int(problem.arc_steps.max(initial=1))
    first = max(0, problem.horizon - middle - longest) * problem.n_cells
    return Enumeration(pricer, group, found[0], found[1], first, duals.cell, seam, floor, ends.cutoff, threads)


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
