"""What the rest of a route can still be worth: bounds without memory, and the battery as a resource of labels."""

from __future__ import annotations

import numpy as np

from react_opt.route_problem import FloatArray, RouteProblem
from react_opt.solvers.routes.labels import flat_values
from react_opt.solvers.routes.labelstore import NEVER, Fuel, Graph, Prices
from react_opt.solvers.routes.linesearch import lowest_point

_NO_STAND = np.zeros((1, 1))


def price_table(gain: FloatArray, arc_cost: FloatArray, wait_cost: float, stand: FloatArray | None = None) -> Prices:
    """Return prices in kernel time, without cuts.

    Parameters
    ----------
    gain, arc_cost, wait_cost, stand
        See `Prices`; None is no price of standing.
    """
    n = gain.shape[1]
    best_gain = np.zeros((len(gain) + 1, n))
    best_gain[:-1] = np.maximum.accumulate(np.maximum(gain, 0.0)[::-1])[::-1]
    return Prices(
        np.ascontiguousarray(gain),
        best_gain,
        _NO_STAND if stand is None else np.ascontiguousarray(stand),
        arc_cost,
        float(wait_cost),
        np.zeros(n, dtype=np.uint64),
        np.zeros(n, dtype=np.uint64),
        np.zeros(64),
    )


class Rests:
    """For each class of robots: where its routes begin and end, its battery, and bounds on the rest of a route.

    Everything is in kernel time, so that of two tables the first is for labels that grow onwards, the second for
    labels that grow backwards in time.

    Parameters
    ----------
    problem
        The route problem.
    forward, backward
        Its arcs in both directions; memory is of no consequence here.
    """

    def __init__(self, problem: RouteProblem, forward: Graph, backward: Graph) -> None:
        self.problem = problem
        self._forward, self._backward = forward, backward
        self.joule_prices = [0.0] * len(problem.classes)
        self.begin: list[FloatArray] = []
        self.end: list[FloatArray] = []
        self.last: list[FloatArray] = []
        self.fuel: list[tuple[Fuel, Fuel]] = []
        n, horizon = problem.n_cells, problem.horizon
        no_gain = np.zeros((horizon + 1, n))
        for group in problem.classes:
            begin, end = np.full((horizon + 1, n), NEVER), np.full((horizon + 1, n), NEVER)
            begin[group.start_step, group.start] = 0.0
            end[0, slice(None) if group.return_to < 0 else group.return_to] = 0.0
            dear = price_table(no_gain, -problem.arc_energy_j, -group.wait_j)
            most = flat_values(forward, dear, begin, False, False).max(initial=NEVER)
            budget = group.battery_j - group.reserve_j
            collectable = int(np.count_nonzero(problem.reward.max(axis=1, initial=0.0) > 0))
            most += group.sense_j * min(collectable, horizon - max(1, group.start_step) + 1)
            binds = most > budget * (1 + 1e-12)
            slack = budget + 1e-9 * max(1.0, budget) if binds else np.inf
            costs = price_table(no_gain, problem.arc_energy_j, group.wait_j)
            ahead = -flat_values(forward, costs, begin, False, False)
            behind = -flat_values(backward, costs, end, False, False)
            data = (slack, problem.arc_energy_j, group.wait_j, group.sense_j)
            self.begin.append(begin)
            self.end.append(end)
            self.last.append(np.where(behind < -NEVER, -problem.sigma * behind, NEVER))
            self.fuel.append(
                (
                    Fuel(*data, behind[::-1].copy(), ahead, np.zeros(1)),
                    Fuel(*data, ahead[::-1].copy(), behind, np.zeros(1)),
                )
            )

    def bound(self, group: int, prices: Prices, *, onwards: bool, collects: bool = False) -> tuple[Fuel, FloatArray]:
        """Return the battery with the prices of a joule, and the bound on the rest of a route at each of them.

        The rest is worth at most ``bound[k, tau, i] + rate[k] * (battery left)``.

        Parameters
        ----------
        group
            The class.
        prices
            Those of the direction in which the rest is walked: backwards in time for labels that grow onwards.
        onwards
            The direction in which the labels grow.
        collects
            Only rests that collect something, here at the earliest; for labels that grow onwards.
        """
        data = self.problem.classes[group]
        fuel = self.fuel[group][0 if onwards else 1]
        graph = self._backward if onwards else self._forward
        origin = (self.last if collects else self.end)[group] if onwards else self.begin[group]
        spent = self.fuel[group][1].spent

        def at_rate(rate: float) -> FloatArray:
            dearer, start = prices, origin
            if rate > 0.0:
                dearer = prices._replace(
                    gain=prices.gain - rate * data.sense_j,
                    arc_cost=prices.arc_cost + rate * fuel.arc,
                    wait_cost=prices.wait_cost + rate * data.wait_j,
                )
                if collects:
                    start = np.where(origin > NEVER, origin - rate * spent, NEVER)
            bound = flat_values(graph, dearer, start, True, collects)[::-1]
            if len(prices.stand) > 1:
                bound = np.where(bound > NEVER, bound + prices.stand[::-1], bound)
            return np.ascontiguousarray(bound)

        if not np.isfinite(fuel.budget):
            return fuel, at_rate(0.0)[None]
        here = (data.start_step, data.start) if onwards else None
        ends = np.flatnonzero(self.end[group][0] > NEVER)

        def worth(rate: float) -> float:
            bound = at_rate(rate)
            top = bound[here] if here is not None else bound[0][ends].max(initial=NEVER)
            return float(top) + rate * fuel.budget

        top = float(prices.gain.max(initial=0.0)) / max(data.sense_j, 1.0)
        best = lowest_point(worth, self.joule_prices[group], top)
        self.joule_prices[group] = best
        rates = np.array([0.0, 0.4 * best, 0.75 * best, best, 1.3 * best, 2.0 * best]) if best > 0 else np.zeros(1)
        return fuel._replace(rate=rates), np.stack([at_rate(float(rate)) for rate in rates])
