"""Route enumeration: every route that a better plan can contain.

If a plan is worth more than ``floor`` in the master, each of its routes has a reduced value of at least the
incumbent minus the Lagrangian bound (Baldacci, Christofides and Mingozzi 2008). Of routes that collect the same
cells only the best is needed, so labels carry the exact set of cells collected and two labels of the same cell,
instant and set are compared by value (and energy, where the battery can bind). Beginnings are enumerated up to the
middle of the horizon, rests from there on, and then put together: both together are few beside all beginnings of all
lengths. Not valid where limits between robots make a worse route with the same cells useful.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.columns import Column, Duals, Rank1Cut
from react_opt.solvers.routes.labelstore import NEVER, MaskArray
from react_opt.solvers.routes.pricing import NO_SIDE_PRICES, RoutePricer, SidePrices
from react_opt.solvers.routes.setjoin import Half, Seam, join_sets
from react_opt.solvers.routes.setlabels import grow_sets
from react_opt.solvers.routes.setprices import price_of_sets


@dataclass(frozen=True)
class Enumerated:
    """The best route of a class for each set of cells.

    Parameters
    ----------
    ahead, behind
        Beginnings of routes and rests of routes.
    parts
        ``(m, 3)`` of each route its beginning, the arc taken from there and its rest (-1: there is none).
    reduced
        ``(m,)`` value minus prices, the group's multiplier not deducted.
    value
        ``(m,)`` value in the objective, to rounding.
    sets
        ``(m, words)`` cells collected.
    """

    ahead: Half
    behind: Half
    parts: IntArray
    reduced: FloatArray
    value: FloatArray
    sets: MaskArray

    def column(self, pricer: RoutePricer, group: int, sets: MaskArray) -> Column:
        """Return the route of a class that collects a set.

        Parameters
        ----------
        pricer, group
            As enumerated.
        sets
            ``(words,)`` the set.
        """
        beginning, arc, rest = self.parts[np.flatnonzero(np.all(self.sets == sets, axis=1))[0]].tolist()
        return pricer.column(group, self.ahead.labels, beginning, None if rest < 0 else (arc, self.behind.labels, rest))


def enumerate_routes(
    pricer: RoutePricer,
    group: int,
    duals: Duals,
    floor: float,
    side: SidePrices = NO_SIDE_PRICES,
    cuts: Sequence[Rank1Cut] = (),
    *,
    max_labels: int = 500_000,
    max_routes: int = 500_000,
    threads: int = 1,
) -> Enumerated | None:
    """Return the best route for every set of cells whose value minus prices reaches ``floor``.

    None if there are more labels or routes than allowed.

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
    max_labels, max_routes
        Limits, of labels in each direction, beyond which the enumeration is given up.
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
    middle, found = data.start_step + span // 2, None
    for attempt in range(2):
        sides = ((*forward, middle, *limits), (*backward, problem.horizon - middle - 1, *limits))
        with ThreadPoolExecutor(2 if threads > 1 else 1) as pool:
            halves = [half.result() for half in [pool.submit(grow_sets, *side) for side in sides]]
        whole = [half[3] for half in halves]
        if all(whole):
            found = [Half(labels, sets, paid) for labels, sets, paid, _ in halves]
        if attempt > 0 or all(whole) or not any(whole) or pricer.stop[0]:
            break
        # where the rests are too many the beginnings go on to the end; otherwise they end earlier
        middle = problem.horizon if whole[0] else data.start_step + span // 4
    if found is None:
        return None
    beginnings, rests = found
    seam = Seam(
        problem.out_start, problem.arc_to, problem.arc_steps, ahead.arc_cost, ahead.wait_cost, fuel.arc, fuel.wait,
        fuel.budget, ahead.cut_price, idle_end,
    )  # fmt: skip
    longest = int(problem.arc_steps.max(initial=1))
    order = _by_worth(rests, max(0, problem.horizon - middle - longest) * problem.n_cells)
    sets, value, paid, parts, complete = join_sets(beginnings, rests, order, seam, ends.cutoff, max_routes, pricer.stop)
    if not complete:
        return None
    worth = value + (floor - ends.cutoff)
    return Enumerated(beginnings, rests, parts, worth - paid, worth + price_of_sets(sets, duals.cell), sets)


def _by_worth(half: Half, first: int) -> IntArray:
    """Return the labels from a node on, those of each node by falling value after prices."""
    start = half.labels.start
    first = min(first, len(start) - 1)
    node = np.repeat(np.arange(first, len(start) - 1), np.diff(start[first:]))
    worth = half.labels.value[start[first] :] - half.paid[start[first] :]
    order: IntArray = start[first] + np.lexsort((-worth, node))
    return order
