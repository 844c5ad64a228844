"""Pricing of robots' routes: the best route for given prices, by labels over the time-expanded graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from react_opt.errors import UsageError
from react_opt.route_problem import FloatArray, Route, RouteProblem
from react_opt.solvers.routes.columns import Column, Duals, Priced, Rank1Cut
from react_opt.solvers.routes.cuts import SubsetRow
from react_opt.solvers.routes.labels import flat_values, grow_labels, trace
from react_opt.solvers.routes.labelstore import NEVER, Fuel, Graph, Labels, Prices, no_labels
from react_opt.solvers.routes.linesearch import lowest_point
from react_opt.solvers.routes.memory import Memory
from react_opt.solvers.routes.recharge import recharging
from react_opt.solvers.routes.region import Region
from react_opt.solvers.routes.routecolumn import route_column

MAX_LABELS = 20_000_000
COARSE_SIZE = 8
BACKWARD_LABELS = 100_000


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
        n, horizon = problem.n_cells, problem.horizon
        by_target = np.lexsort((problem.arc_from, problem.arc_to))
        self._in_arcs = by_target.astype(np.int64)
        self._in_start = np.searchsorted(problem.arc_to[by_target], np.arange(n + 1)).astype(np.int64)
        self._out_arcs = np.arange(problem.n_arcs, dtype=np.int64)
        self._no_labels = no_labels()
        self._no_stand = np.zeros((1, 1))
        self.remember()
        self._origin = []
        self._finish = []
        self._rate = [0.0] * len(problem.classes)
        self._fuel: list[tuple[Fuel, Fuel]] = []
        self._charging = recharging(problem)
        no_gain = np.zeros((horizon + 1, n))
        for group in problem.classes:
            origin = np.full(n, NEVER)
            origin[group.start] = 0.0
            finish = np.zeros(n) if group.return_to < 0 else np.full(n, NEVER)
            if group.return_to >= 0:
                finish[group.return_to] = 0.0
            self._origin.append(origin)
            self._finish.append(finish)
            costs = self._prices(no_gain, self._no_stand, -problem.arc_energy_j, -group.wait_j, (), ())
            most = flat_values(self.forward, costs, origin, group.start_step, False).max(initial=NEVER)
            budget = group.battery_j - group.reserve_j
            collectable = int(np.count_nonzero(problem.reward.max(axis=1, initial=0.0) > 0))
            most += group.sense_j * min(collectable, horizon - max(1, group.start_step) + 1)
            binds = most > budget * (1 + 1e-12)
            slack = budget + 1e-9 * max(1.0, budget) if binds else np.inf
            costs = self._prices(no_gain, self._no_stand, problem.arc_energy_j, group.wait_j, (), ())
            ahead = -flat_values(self.forward, costs, origin, group.start_step, False)
            behind = -flat_values(self.backward, costs, finish, 0, False)
            self._fuel.append(
                (
                    Fuel(slack, problem.arc_energy_j, group.wait_j, group.sense_j, behind[::-1].copy(), np.zeros(1)),
                    Fuel(slack, problem.arc_energy_j, group.wait_j, group.sense_j, ahead[::-1].copy(), np.zeros(1)),
                )
            )

    def remember(self) -> None:
        """Take over ng-sets that have grown."""
        problem, memory = self.problem, self.memory
        keep = memory.kept(problem.arc_from, problem.arc_to)
        bits, cell_of = memory.bits(), memory.cell_of()
        place = np.arange(problem.n_cells)[:, None]
        there = np.where(cell_of >= 0, memory.steps[place, cell_of], 0).astype(np.int32)
        back = np.where(cell_of >= 0, memory.steps[cell_of, place], 0).astype(np.int32)
        into, out = self._in_arcs, self._out_arcs
        coarse = keep & memory.kept(problem.arc_from, problem.arc_to, COARSE_SIZE)
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
        return group in self._charging or bool(np.isfinite(self._fuel[group][0].budget))

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
        stand = self._no_stand if side.stand is None else side.stand
        arc_cost, wait_cost = problem.sigma * problem.arc_energy_j, problem.sigma * data.wait_j
        priced = tuple(duals.cut)
        ahead = self._prices(gain, stand, arc_cost, wait_cost, cuts, priced)
        back = self._prices(gain[::-1], stand[::-1], arc_cost, wait_cost, cuts, priced)
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
            data = self.problem.classes[group]
            cutoff = float(floor[group]) - self._constant(group)
            most = MAX_LABELS if width is None else width
            if group in self._charging:
                labels, complete = self._charging[group].grow(
                    self.forward, ahead, side.charge, self._origin[group], cutoff, most, max_labels, self.stop
                )
            else:
                fuel, bound = self._rest(group, back, onwards=True)
                labels, complete = grow_labels(
                    self.forward,
                    ahead,
                    fuel,
                    self._origin[group],
                    data.start_step,
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
            found += [self.column(group, labels, label, cell) for label, cell in chosen]
            exact &= complete
            best[group] = max(cutoff, top) + self._constant(group)
            tops[group] = top + self._constant(group) if chosen else -np.inf
        return Priced(found, best if exact else None, tops)

    def completions(
        self,
        group: int,
        duals: Duals,
        floor: float,
        side: SidePrices,
        cuts: Sequence[Rank1Cut],
    ) -> tuple[Prices, Fuel, FloatArray, Labels | None, float]:
        """Return what bounds every single label of a class.

        Prices, battery, flat bound, labels from the horizon and cutoff.

        The labels are None if there are too many.

        Parameters
        ----------
        group, duals, side, cuts
            The class and its prices.
        floor
            Least value minus prices of interest, the group's multiplier not deducted.
        """
        ahead, back = self.prices(group, duals, side, cuts)
        cutoff = floor - self._constant(group)
        fuel, bound = self._rest(group, back, onwards=True)
        spent, past = self._rest(group, ahead, onwards=False)
        for prices in (back, back._replace(cut_of=np.zeros_like(back.cut_of))):
            # without the cuts the labels from the horizon are fewer and bound less sharply
            labels, complete = grow_labels(
                self.backward,
                prices,
                spent,
                self._finish[group],
                0,
                past,
                self._no_labels,
                cutoff,
                MAX_LABELS,
                BACKWARD_LABELS,
                False,
                self.stop,
            )
            if complete:
                return ahead, fuel, bound, labels, cutoff
        return ahead, fuel, bound, None, cutoff

    @property
    def joule_prices(self) -> list[float]:
        """Price of a joule for each class, from the last call; 0 where the battery cannot bind."""
        return [self._charging[k].rate if k in self._charging else rate for k, rate in enumerate(self._rate)]

    def _rest(self, group: int, prices: Prices, *, onwards: bool) -> tuple[Fuel, FloatArray]:
        """Return the battery with the prices of a joule, and the bound on the rest of a route at each of them.

        The rest is worth at most ``bound[k, tau, i] + rate[k] * (battery left)``. ``prices`` are those of the
        direction in which the rest is walked: backwards in time for labels that grow ``onwards``.
        """
        data = self.problem.classes[group]
        fuel = self._fuel[group][0 if onwards else 1]
        graph = self.backward if onwards else self.forward
        origin, begin = (self._finish[group], 0) if onwards else (self._origin[group], data.start_step)

        def at_rate(rate: float) -> FloatArray:
            dearer = prices
            if rate > 0.0:
                dearer = prices._replace(
                    gain=prices.gain - rate * data.sense_j,
                    arc_cost=prices.arc_cost + rate * fuel.arc,
                    wait_cost=prices.wait_cost + rate * data.wait_j,
                )
            bound = flat_values(graph, dearer, origin, begin, True)[::-1]
            if len(prices.stand) > 1:
                bound = np.where(bound > NEVER, bound + prices.stand[::-1], bound)
            return np.ascontiguousarray(bound)

        if not np.isfinite(fuel.budget):
            return fuel, at_rate(0.0)[None]
        here = (data.start_step, data.start) if onwards else None

        def worth(rate: float) -> float:
            bound = at_rate(rate)
            top = bound[here] if here is not None else bound[0][origin_end].max(initial=NEVER)
            return float(top) + rate * fuel.budget

        origin_end = np.flatnonzero(self._finish[group] > NEVER)
        best = lowest_point(worth, self._rate[group], float(prices.gain.max(initial=0.0)) / max(data.sense_j, 1.0))
        self._rate[group] = best
        rates = np.array([0.0, 0.4 * best, 0.75 * best, best, 1.3 * best, 2.0 * best]) if best > 0 else np.zeros(1)
        return fuel._replace(rate=rates), np.stack([at_rate(float(rate)) for rate in rates])

    def column(self, group: int, labels: Labels, label: int, cell: int) -> Column:
        """Return the route of a label that stands in ``cell`` at the horizon."""
        problem, data = self.problem, self.problem.classes[group]
        cells, arcs, senses = trace(labels, problem.arc_from, problem.arc_steps, label, cell, problem.horizon)
        begin, charging = data.start_step, self._charging.get(group)
        charge_j = np.zeros(len(cells) - begin) if charging is None else charging.credits(labels, label)
        return route_column(problem, Route(group, cells[begin:], arcs[begin:], senses[begin:], charge_j))

    def allowed_end(self, group: int, labels: Labels) -> NDArray[np.bool_]:
        """Return for each label at the horizon whether the class may end there."""
        last = labels.start[self.problem.horizon * self.problem.n_cells :]
        cell = np.searchsorted(last, np.arange(last[0], last[-1]), side="right") - 1
        allowed: NDArray[np.bool_] = self._finish[group][cell] > NEVER
        return allowed

    def _constant(self, group: int) -> float:
        """Return what the labels leave out: the weighted battery at the start."""
        return self.problem.sigma * self.problem.classes[group].battery_j

    def _finals(self, labels: Labels, group: int, count: int) -> tuple[list[tuple[int, int]], float]:
        """Return (label, cell) of the best labels at the horizon, and the best value."""
        n, horizon = self.problem.n_cells, self.problem.horizon
        first, beyond = int(labels.start[horizon * n]), int(labels.start[(horizon + 1) * n])
        cell = np.searchsorted(labels.start[horizon * n :], np.arange(first, beyond), side="right") - 1
        allowed = self.allowed_end(group, labels)
        label, cell = np.arange(first, beyond)[allowed], cell[allowed]
        if len(label) == 0:
            return [], NEVER
        order = np.argsort(-labels.value[label], kind="stable")[:count]
        return [(int(label[k]), int(cell[k])) for k in order], float(labels.value[label[order[0]]])

    def _prices(
        self,
        gain: FloatArray,
        stand: FloatArray,
        arc_cost: FloatArray,
        wait_cost: float,
        cuts: Sequence[Rank1Cut],
        cut_price: Sequence[float],
    ) -> Prices:
        """Return prices in kernel time."""
        n = self.problem.n_cells
        best_gain = np.zeros((len(gain) + 1, n))
        best_gain[:-1] = np.maximum.accumulate(np.maximum(gain, 0.0)[::-1])[::-1]
        cut_of = np.zeros(n, dtype=np.uint64)
        cut_keep = np.full(n, 0, dtype=np.uint64)
        for k, cut in enumerate(cuts):
            if not isinstance(cut, SubsetRow):
                raise UsageError("routes can be priced with subset-row cuts only")
            bit = np.uint64(1) << np.uint64(k)
            cut_of[list(cut.cells)] |= bit
            cut_keep[list(cut.memory)] |= bit
        price = np.zeros(64)
        price[: len(cut_price)] = cut_price
        return Prices(
            np.ascontiguousarray(gain),
            best_gain,
            np.ascontiguousarray(stand),
            arc_cost,
            float(wait_cost),
            cut_of,
            cut_keep,
            price,
        )
