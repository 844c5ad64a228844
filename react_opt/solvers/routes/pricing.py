"""Pricing of robots' routes: the best route for given prices, by labels over the time-expanded graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from react_opt.errors import UsageError
from react_opt.route_problem import FloatArray, Route, RouteProblem
from react_opt.solvers.routes.columns import Column, Duals, Priced, Rank1Cut
from react_opt.solvers.routes.cuts import SubsetRow
from react_opt.solvers.routes.labels import grow_labels, trace
from react_opt.solvers.routes.labelstore import NEVER, Fuel, Graph, Labels, MaskArray, Prices, no_labels
from react_opt.solvers.routes.memory import Memory
from react_opt.solvers.routes.recharge import recharging
from react_opt.solvers.routes.region import Region
from react_opt.solvers.routes.rest import Rests, price_table
from react_opt.solvers.routes.routecolumn import route_column

MAX_LABELS = 20_000_000
COARSE_SIZE = 8
SHORT_LABELS = 1_000_000


@dataclass(frozen=True)
class SidePrices:
    """Prices of standing, charging and sensing at an instant, and the region that branching looks at.

    Parameters
    ----------
    stand
        ``(T + 1, n)`` price of standing, infinite where it is forbidden; None if there is none.
    sense
        ``(T + 1,)`` price of sensing; None if there is none.
    charge
        ``(T + 1, n)`` price of charging; None if there is none.
    region
        When each class may collect each cell; None if always.
    """

    stand: FloatArray | None = None
    sense: FloatArray | None = None
    charge: FloatArray | None = None
    region: Region | None = None


NO_SIDE_PRICES = SidePrices()


@dataclass(frozen=True)
class Endings:
    """What bounds the beginnings and the rests of the routes of a class, the former first in each pair.

    Parameters
    ----------
    prices, fuel, bound
        Prices, battery, and flat bound on what is missing to a whole route.
    beginnings, rests
        Labels of both directions with little memory: rests bound beginnings, and the other way round.
    cutoff
        Least value of interest.
    """

    prices: tuple[Prices, Prices]
    fuel: tuple[Fuel, Fuel]
    bound: tuple[FloatArray, FloatArray]
    beginnings: Labels
    rests: Labels
    cutoff: float


class RoutePricer:
    """Finds routes of positive reduced value.

    Parameters
    ----------
    problem
        The route problem.
    memory
        The ng-sets; :meth:`remember` has to be called when they have grown.
    """

    def __init__(self, problem: RouteProblem, memory: Memory) -> None:
        self.problem = problem
        self.memory = memory
        self.labels = self.calls = 0  # of exact passes so far
        self.stop = np.zeros(1, np.uint8)  # not 0: labelling passes are given up at once
        n = problem.n_cells
        by_target = np.lexsort((problem.arc_from, problem.arc_to))
        self._in_arcs = by_target.astype(np.int64)
        self._in_start = np.searchsorted(problem.arc_to[by_target], np.arange(n + 1)).astype(np.int64)
        self._out_arcs = np.arange(problem.n_arcs, dtype=np.int64)
        self._no_labels = no_labels()
        self.remember()
        self.rests = Rests(problem, self.forward, self.backward)
        self._charging = recharging(problem)

    def remember(self) -> None:
        """Take over ng-sets that have grown."""
        problem, memory = self.problem, self.memory
        keep = memory.kept(problem.arc_from, problem.arc_to)
        bits, cell_of = memory.bits(), memory.cell_of()
        place = np.arange(problem.n_cells)[:, None]
        there = np.where(cell_of >= 0, memory.steps[place, cell_of], 0).astype(np.int32)
        back = np.where(cell_of >= 0, memory.steps[cell_of, place], 0).astype(np.int32)
        into, out = self._in_arcs, self._out_arcs
        self._coarse = coarse = keep & memory.kept(problem.arc_from, problem.arc_to, COARSE_SIZE)
        self.forward = Graph(
            self._in_start,
            problem.arc_from[into],
            problem.arc_steps[into],
            into,
            keep[into],
            bits,
            cell_of,
            there,
        )
        self.backward = Graph(
            problem.out_start, problem.arc_to[out], problem.arc_steps[out], out, coarse, bits, cell_of, back
        )

    def binds(self, group: int) -> bool:
        """Return whether the battery of a class can bind, so that labels carry it."""
        return group in self._charging or bool(np.isfinite(self.rests.fuel[group][0].budget))

    def prices(self, group: int, duals: Duals, side: SidePrices, cuts: Sequence[Rank1Cut]) -> tuple[Prices, Prices]:
        """Return the prices of one class in both directions of time."""
        problem, data = self.problem, self.problem.classes[group]
        gain = problem.reward.T - (problem.sigma * data.sense_j + duals.cell)[None, :]
        if side.sense is not None:
            gain = gain - side.sense[:, None]
        if side.region is not None:
            first, last = side.region.first[group], side.region.last[group]
            instant = np.arange(problem.horizon + 1)[:, None]
            gain = np.where((instant < first) | (instant > last), NEVER, gain)
        gain[: max(1, data.start_step)] = NEVER
        costs = 0.0 if group in self._charging else problem.sigma * data.sense_j  # a charger may give it back
        gain[costs >= problem.reward.T] = NEVER
        arc_cost, wait_cost = problem.sigma * problem.arc_energy_j, problem.sigma * data.wait_j
        ahead = price_table(gain, arc_cost, wait_cost, side.stand)
        back = price_table(gain[::-1], arc_cost, wait_cost, None if side.stand is None else side.stand[::-1])
        cut_of, cut_keep, price = self._cuts(cuts, tuple(duals.cut))
        ahead, back = (one._replace(cut_of=cut_of, cut_keep=cut_keep, cut_price=price) for one in (ahead, back))
        return ahead, back

    def price(
        self,
        duals: Duals,
        side: SidePrices = NO_SIDE_PRICES,
        cuts: Sequence[Rank1Cut] = (),
        *,
        width: int | None = None,
        columns: int = 10,
        groups: Sequence[int] | None = None,
        floor: FloatArray | None = None,
        max_labels: int = MAX_LABELS,
    ) -> Priced:
        """Return routes whose value exceeds their prices.

        Parameters
        ----------
        duals
            Multipliers of the master.
        side
            Prices of coupling limits, and the region that branching looks at.
        cuts
            The cuts that ``duals.cut`` prices.
        width
            Labels kept per cell and instant: a heuristic call. None prices exactly.
        columns
            Most columns returned per class.
        groups
            Classes to price, all by default.
        floor
            ``(n_classes,)`` values minus prices below which nothing is of interest; the group multipliers by
            default.
        max_labels
            Labels per class beyond which an exact call is given up.
        """
        found: list[Column] = []
        exact = width is None
        best = np.full(len(self.problem.classes), np.inf)
        tops = np.full(len(self.problem.classes), -np.inf)
        floor = duals.group if floor is None else floor
        for group in range(len(self.problem.classes)) if groups is None else groups:
            ahead, back = self.prices(group, duals, side, cuts)
            cutoff = float(floor[group]) - self._constant(group)
            most = MAX_LABELS if width is None else width
            if group in self._charging:
                origin = self.rests.begin[group][self.problem.classes[group].start_step]
                labels, complete = self._charging[group].grow(
                    self.forward, ahead, side.charge, origin, cutoff, most, max_labels, self.stop
                )
            else:
                fuel, bound = self.rests.bound(group, back, onwards=True)
                labels, complete = grow_labels(
                    self.forward,
                    ahead,
                    fuel,
                    self.rests.begin[group],
                    False,
                    bound,
                    self._no_labels,
                    cutoff,
                    most,
                    max_labels,
                    True,
                    self.stop,
                )
            if width is None:
                self.labels += len(labels.value)
                self.calls += 1
            chosen, top = self._finals(labels, group, columns)
            found += [self.column(group, labels, label) for label in chosen]
            exact &= complete
            best[group] = max(cutoff, top) + self._constant(group)
            tops[group] = top + self._constant(group) if chosen else -np.inf
        return Priced(found, best if exact else None, tops)

    def endings(
        self, group: int, duals: Duals, floor: float, side: SidePrices, cuts: Sequence[Rank1Cut]
    ) -> Endings | None:
        """Return what bounds every single label of a class that collects something more; None if that is too much.

        Parameters
        ----------
        group, duals, side, cuts
            The class and its prices.
        floor
            Least value minus prices of interest, the group's multiplier not deducted.
        """
        ahead, back = self.prices(group, duals, side, cuts)
        cutoff = floor - self._constant(group)
        fuel, bound = self.rests.bound(group, back, onwards=True, collects=True)
        spent, past = self.rests.bound(group, ahead, onwards=False)
        rests = self._short(self.backward, back, spent, self.rests.last[group], True, past, cutoff)
        coarse = self.forward._replace(in_keep=self._coarse[self._in_arcs])
        beginnings = self._short(coarse, ahead, fuel, self.rests.begin[group], False, bound, cutoff)
        if rests is None or beginnings is None:
            return None
        return Endings((ahead, back), (fuel, spent), (bound, past), beginnings, rests, cutoff)

    def _short(
        self,
        graph: Graph,
        prices: Prices,
        fuel: Fuel,
        origin: FloatArray,
        collects_first: bool,
        completion: FloatArray,
        cutoff: float,
    ) -> Labels | None:
        """Return labels of one direction that remember little; without the cuts if they are too many with them."""
        for priced in (prices, prices._replace(cut_of=np.zeros_like(prices.cut_of))):
            # without the cuts the labels are fewer and bound less sharply
            labels, complete = grow_labels(
                graph, priced, fuel, origin, collects_first, completion, self._no_labels, cutoff, MAX_LABELS,
                SHORT_LABELS, False, self.stop,
            )  # fmt: skip
            if complete:
                return labels
        return None

    @property
    def joule_prices(self) -> list[float]:
        """Price of a joule for each class, from the last call; 0 where the battery cannot bind."""
        return [self._charging[k].rate if k in self._charging else p for k, p in enumerate(self.rests.joule_prices)]

    def column(self, group: int, labels: Labels, label: int, rest: tuple[int, Labels, int] | None = None) -> Column:
        """Return the route of a label, which after its last collection ends with the least energy.

        Parameters
        ----------
        group, labels, label
            Its class and the label.
        rest
            How it goes on: the arc taken from the label, labels that grow backwards, and which of them.
        """
        problem, data = self.problem, self.problem.classes[group]
        tau, cell = _node(labels, label, problem.n_cells)
        whole = trace(labels, problem.arc_from, problem.arc_steps, label, cell, tau)
        cells, arcs, senses = (np.concatenate((part, np.zeros(problem.horizon - tau, part.dtype))) for part in whole)
        cells[tau + 1 :], arcs[tau + 1 :] = -1, -1
        if rest is not None:
            arcs[tau], back, label = rest
            past, cell = _node(back, label, problem.n_cells)
            back_cells, back_arcs, back_senses = trace(back, problem.arc_to, problem.arc_steps, label, cell, past)
            at = np.flatnonzero(back_cells >= 0)
            cells[problem.horizon - at], senses[problem.horizon - at] = back_cells[at], back_senses[at]
            taken = back_arcs[at[:-1]]  # from there on the arcs lead forwards again
            arcs[problem.horizon - at[1:]] = taken
            tau, cell = problem.horizon - int(at[0]), int(back_cells[at[0]])
        least = self.rests.fuel[group][0].least
        while tau < problem.horizon:
            ways = [(least[tau + 1, cell] + data.wait_j, tau + 1, cell, -1)]
            for arc in range(problem.out_start[cell], problem.out_start[cell + 1]):
                then, there = tau + int(problem.arc_steps[arc]), int(problem.arc_to[arc])
                if then <= problem.horizon:
                    ways.append((least[then, there] + problem.arc_energy_j[arc], then, there, arc))
            _, then, cell, arcs[tau] = min(ways)
            cells[then] = cell
            tau = then
        begin, charging = data.start_step, self._charging.get(group)
        charge_j = np.zeros(len(cells) - begin) if charging is None else charging.credits(labels, label)
        return route_column(problem, Route(group, cells[begin:], arcs[begin:], senses[begin:], charge_j))

    def _constant(self, group: int) -> float:
        """Return what the labels leave out: the weighted battery at the start."""
        return self.problem.sigma * self.problem.classes[group].battery_j

    def _finals(self, labels: Labels, group: int, count: int) -> tuple[list[int], float]:
        """Return the best labels at the horizon, and the best value."""
        last = labels.start[self.problem.horizon * self.problem.n_cells :]
        label = np.arange(last[0], last[-1])
        cell = np.searchsorted(last, label, side="right") - 1
        label = label[self.rests.end[group][0, cell] > NEVER]
        if len(label) == 0:
            return [], NEVER
        order = np.argsort(-labels.value[label], kind="stable")[:count]
        return label[order].tolist(), float(labels.value[label[order[0]]])

    def _cuts(self, cuts: Sequence[Rank1Cut], cut_price: Sequence[float]) -> tuple[MaskArray, MaskArray, FloatArray]:
        """Return the cuts that each cell belongs to, those that it remembers, and their prices."""
        cut_of = np.zeros(self.problem.n_cells, dtype=np.uint64)
        cut_keep = np.zeros(self.problem.n_cells, dtype=np.uint64)
        for k, cut in enumerate(cuts):
            if not isinstance(cut, SubsetRow):
                raise UsageError("routes can be priced with subset-row cuts only")
            bit = np.uint64(1) << np.uint64(k)
            cut_of[list(cut.cells)] |= bit
            cut_keep[list(cut.memory)] |= bit
        price = np.zeros(64)
        price[: len(cut_price)] = cut_price
        return cut_of, cut_keep, price


def _node(labels: Labels, label: int, n_cells: int) -> tuple[int, int]:
    """Return instant and cell of a label in kernel time."""
    return divmod(int(np.searchsorted(labels.start, label, side="right")) - 1, n_cells)
