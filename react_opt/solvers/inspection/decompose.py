"""The inspection by route decomposition: column generation, then every route that could matter, then a choice.

Stage 1 maximises the value, stage 2 minimises the second objective among plans of that value. Each stage
prices routes until the linear program is optimal, which bounds every plan (the bound of Lagrange holds at any
prices); where the best plan known does not meet the bound, all routes whose reduced profit lies within the gap
are enumerated, and an integer program over them is exact.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from react_opt.models.inspection import FloatArray, InspectionArrays, Routes
from react_opt.solvers.inspection.answer import Answer, grid_of, rounded
from react_opt.solvers.inspection.closing import Closing
from react_opt.solvers.inspection.control import Control
from react_opt.solvers.inspection.labels import ENUMERATE, EXACT, HEURISTIC
from react_opt.solvers.inspection.master import Column, Duals, Master
from react_opt.solvers.inspection.pricing import ELEMENTARY_UP_TO, Cuts, Pricer, classes_of, simple_bound
from react_opt.solvers.inspection.primal import PORTION, PrimalSearch

VALUE_TOLERANCE = 1e-7  # relative: plans whose values agree within it are worth the same
COST_TOLERANCE = 1e-7
HEURISTIC_LABELS, EXACT_LABELS, ENUMERATED_LABELS = 60_000, 3_000_000, 400_000
MOST_COLUMNS = 40_000  # of the integer program over enumerated routes
FEW_LABELS, FEW_COLUMNS = 20_000, 2500  # of an enumeration that is worth trying before cuts
MOST_CUTS = 60
MORE_PORTIONS = 3  # of local search where the first enumeration would be too large
KNOWN_S = 0.5  # of the integer program over the routes known
FIRST_PORTION = 400  # iterations of local search
COLUMNS = 120  # added per pricing, over all classes
LATE = 0.5  # share of the time left below which pricing is exact
FAR = 0.01  # of the value: a gap that no enumeration closes where targets are many
SMOOTHING = 0.5  # share of the best prices so far in those that are tried (Wentges 1997)
MIP_NODES = 2000  # of an integer program under a work limit
MOST_POOLED = 6000  # columns, above which routes of local search are no longer added
SMALL = 20  # targets; up to here a search beside the proof is not worth its thread


class Decomposition:
    """The two stages on one instance.

    Parameters
    ----------
    arrays
        The problem.
    control
        When to stop.
    threads, seed
        With two or more threads, and no work limit, local search runs beside the proof.
    gap
        Relative gap of the value at which to stop; 0 to prove.
    routes
        Feasible routes known; None for none.
    on_bound
        Called with value and bound when either improves; None for never.
    """

    def __init__(
        self,
        arrays: InspectionArrays,
        control: Control,
        *,
        threads: int = 1,
        seed: int = 0,
        gap: float = 0.0,
        routes: Routes | None = None,
        on_bound: Callable[[float | None, float], None] | None = None,
    ) -> None:
        self.arrays, self.control, self.seed, self.gap, self.on_bound = arrays, control, seed, gap, on_bound
        self.robots, self.sizes, self.group = classes_of(arrays)
        self.pricers = [Pricer(arrays, c, robot) for c, robot in enumerate(self.robots)]
        self.elementary = len(arrays.value) <= ELEMENTARY_UP_TO
        self.master = Master(arrays, self.sizes)
        self.answer = Answer()
        self.columns = max(30, COLUMNS // max(1, len(self.sizes)))
        self.grid = grid_of(arrays.value)
        self.beside = threads > 1 and control.work_limit is None and len(arrays.value) > SMALL
        self.notes = self.answer.notes
        self.primal = PrimalSearch(arrays, control, self.answer, seed, not self.elementary, self.offer, self._pool)
        self._begun = time.perf_counter()
        empty: Routes = [[] for _ in arrays.time_s]
        for start in (routes, empty):
            if start is not None and arrays.is_feasible(start):
                self.offer(start)

    def run(self, second: bool = True) -> Answer:
        """Solve as far as the control lets it, the first stage alone where not ``second``; see :class:`Answer`."""
        answer = self.answer
        answer.value_bound = simple_bound(self.arrays, self.pricers, self.grid)
        self.primal.run(FIRST_PORTION)
        if self.beside:
            self.primal.start_beside()
        proven = self._value_proven() or self._stage(second=False)
        if proven and not answer.infeasible and answer.routes is not None:
            if self.gap == 0.0:
                answer.value_bound = answer.value
            proven = not second or self._stage(second=True)
            if proven and second:
                answer.cost_bound = answer.cost
        if not proven and not answer.infeasible:
            self.primal.run_out()
        self.control.flag[0] = 1
        self.primal.end_beside()
        self.notes.update(columns=len(self.master.columns), work=self.control.work)
        return answer

    def offer(self, routes: Routes) -> bool:
        """Keep routes where they are better; True where they were."""
        value, cost = self.arrays.worth(routes)
        answer = self.answer
        rounding = VALUE_TOLERANCE * max(1.0, abs(value)) * 0.01
        better = value > answer.value + rounding
        cheaper = value > answer.value - rounding and cost < answer.cost - 1e-9 * max(1.0, cost)
        if answer.routes is not None and not better and not cheaper:
            return False
        answer.routes, answer.value, answer.cost = [list(route) for route in routes], value, cost
        self.master.add(self._columns(routes))
        if better and self.on_bound is not None:
            self.on_bound(value, answer.value_bound)
        return True

    def _columns(self, routes: Routes) -> list[Column]:
        return [self.pricers[self.group[r]].column(tuple(route)) for r, route in enumerate(routes)]

    def _routes(self, chosen: list[Column]) -> Routes:
        waiting: list[list[tuple[int, ...]]] = [[] for _ in self.sizes]
        for column in chosen:
            waiting[column.group].append(column.stops)
        return [list(waiting[c].pop()) for c in self.group.tolist()]

    def _pool(self, routes: list[tuple[int, tuple[int, ...]]]) -> None:
        """Give the linear program the routes that a local search has come across."""
        if len(self.master.columns) < MOST_POOLED:
            self.master.add([self.pricers[self.group[r]].column(stops) for r, stops in routes])

    def _value_slack(self) -> float:
        value = self.answer.value
        return max(VALUE_TOLERANCE * abs(value), self.gap * abs(value))

    def _value_proven(self) -> bool:
        answer = self.answer
        return answer.routes is not None and answer.value_bound <= answer.value + self._value_slack()

    def _cost_proven(self) -> bool:
        answer = self.answer
        bound = answer.cost_bound
        return bound is not None and bound >= answer.cost - COST_TOLERANCE * max(1.0, answer.cost)

    def _bound(self, duals: Duals, best: list[float], second: bool) -> float:
        """Tighten the bound by what these prices prove, and return that, to be minimised.

        ``best`` is the largest profit per class.
        """
        answer = self.answer
        earned = sum(size * profit for size, profit in zip(self.sizes, best, strict=True))
        if second:
            bound = (
                duals.value * (self.master.least_value or 0.0) + float(duals.target.sum() + duals.cuts.sum()) - earned
            )
            answer.cost_bound = max(bound, answer.cost_bound or 0.0)
            return bound
        proven = earned - float(duals.target.sum()) - float(duals.cuts.sum())
        bound = rounded(proven, self.grid)
        if bound < answer.value_bound:
            answer.value_bound = max(bound, answer.value)
            if self.on_bound is not None:
                self.on_bound(answer.value if answer.routes is not None else None, answer.value_bound)
        return -proven

    def _stage(self, second: bool) -> bool:
        """Solve one stage; True where its objective is proven."""
        if second:
            value = self.answer.value
            slack = self.grid / 2 if self.grid > 0 else VALUE_TOLERANCE * max(1.0, abs(value))
            self.master.second_stage(value - slack)
        done = self._cost_proven if second else self._value_proven
        duals = self._generate(second)
        if self.answer.infeasible or done():
            return True
        if duals is None:
            if not self.elementary and not self.control.stopped():
                self._choose_known(second)
            return done()
        self.primal.run(min(PORTION, 50 * len(self.arrays.value)))
        if done() or self._enumerate(duals, second, FEW_LABELS, FEW_COLUMNS):
            return True
        self._choose_known(second)
        for _ in range(MORE_PORTIONS):
            self.primal.run(PORTION)
        if done() or self._enumerate(duals, second, FEW_LABELS, FEW_COLUMNS):
            return True
        while not done() and (self.master.cut(MOST_CUTS) if self.elementary else self._grow()):
            duals = self._generate(second)
            if duals is None:
                return done()
            if self._enumerate(duals, second, FEW_LABELS, FEW_COLUMNS):
                return True
        return done() or self._enumerate(duals, second, ENUMERATED_LABELS, MOST_COLUMNS, last=True) or done()

    def _generate(self, second: bool) -> Duals | None:
        """Price until no route improves the linear program; its duals, None where it was stopped."""
        done = self._cost_proven if second else self._value_proven
        rate = 1.0 if second else 0.0
        if not self.elementary and not second:
            self.primal.warm_up()
            if done():
                return None
        centre: Duals | None = None
        most, share = -np.inf, 0.0 if self.elementary else SMOOTHING
        while not self.control.stopped():
            duals = self.master.solve()
            if duals is None:
                return None
            self._integral(second)
            if done():
                return None
            eps = 1e-7 * max(1.0, abs(duals.objective))
            used = duals.towards(centre, share)
            prize = used.value * self.arrays.value + used.target
            threshold = [-float(price) + eps for price in used.group]
            late = self._late()  # then a bound matters more than a perfect linear program
            if not self.elementary and not late and self._price(used, prize, rate, threshold, second):
                self.primal.collect()
                continue
            best = self._price_exactly(prize, rate, threshold, self._cuts(used))
            if best is None:
                return None
            if duals.stand_in < 1e-6:
                profits = [max(profit, t) for profit, t in zip(best[0], threshold, strict=True)]
                bound = self._bound(used, profits, second)
                if bound > most:
                    most, centre = bound, used
            if done() or (late and not self.elementary and self._bound_stands(duals, second)):
                return None
            if best[1]:
                share = 0.0 if self.elementary else SMOOTHING
            elif used is not duals:
                share = 0.0  # nothing at the smoothed prices: try those of the linear program
            elif duals.stand_in > 1e-6:
                self.answer.infeasible = True
                return None
            else:
                return duals
        return None

    def _grow(self) -> bool:
        """Forbid the cycles of the routes in use, and the columns with them; False where there are none."""
        columns, used = self.master.columns, np.flatnonzero(self.master.x > 1e-6).tolist()
        cycles = [p for p in used if len(set(columns[p].stops)) < len(columns[p].stops)]
        grown = [self.pricers[columns[p].group].grow(columns[p].stops) for p in cycles]
        self.master.ban([p for p, column in enumerate(columns) if not self.pricers[column.group].allows(column.stops)])
        return any(grown)

    def _late(self) -> bool:
        left_s, deadline = self.control.left_s(), self.control.deadline
        if left_s is None or deadline is None or self.control.work_limit is not None:
            return False
        return left_s < LATE * (deadline - self._begun)

    def _bound_stands(self, duals: Duals, second: bool) -> bool:
        """Whether more pricing cannot tighten the bound's last digit, and it is too far off to be met by a choice."""
        answer = self.answer
        if second or self.grid == 0.0 or answer.routes is None or duals.stand_in > 1e-6:
            return False
        far = answer.value_bound - answer.value > max(FAR * abs(answer.value), 1.5 * self.grid)
        return far and answer.value_bound <= rounded(-duals.objective, self.grid) + self.grid / 2

    def _price(self, duals: Duals, prize: FloatArray, rate: float, threshold: list[float], second: bool) -> bool:
        """Price heuristically; True where routes were found. Bounds by the completion tables on the way."""
        added, bounds = 0, []
        for pricer, least in zip(self.pricers, threshold, strict=True):
            found = pricer.price(prize, rate, least, HEURISTIC, HEURISTIC_LABELS, self.columns, self.control.flag)
            self.control.count(found.labels)
            added += self.master.add(found.columns)
            bounds.append(found.bound)
        if duals.stand_in < 1e-6 and np.isfinite(bounds).all():
            self._bound(duals, bounds, second)
        return added > 0

    def _price_exactly(
        self, prize: FloatArray, rate: float, threshold: list[float], cuts: Cuts | None
    ) -> tuple[list[float], int] | None:
        """Return the largest profits and the number of new columns, None where labels or time ran out."""
        best, added, whole = [], 0, True
        for pricer, least in zip(self.pricers, threshold, strict=True):
            most = self.control.affordable(EXACT_LABELS)
            found = pricer.price(prize, rate, least, EXACT, most, self.columns, self.control.flag, cuts)
            self.control.count(found.labels)
            added += self.master.add(found.columns)
            if found.best is None:
                whole = False
                break
            best.append(found.best)
        if whole:
            return best, added
        self.answer.stuck = self.answer.stuck or self.control.flag[0] == 0
        return None

    def _choose_known(self, second: bool) -> None:
        """Look for a better plan among the routes that the linear program has used."""
        answer = self.answer
        columns = [column for column in self.master.columns if len(set(column.stops)) == len(column.stops)]
        left_s = self.control.left_s()
        limit_s = KNOWN_S if left_s is None else min(KNOWN_S, 0.2 * left_s)
        timed = self.control.work_limit is None
        cutoff = answer.cost if second else -answer.value
        cutoff -= COST_TOLERANCE * max(1.0, abs(cutoff))
        closing = Closing(self.arrays, self.sizes, columns, self.master.least_value, cutoff, self.master.cuts)
        found = closing.run(limit_s if timed else None, None if timed else MIP_NODES // 10, self.seed)
        if found.chosen is not None:
            self.offer(self._routes(found.chosen))

    def _cuts(self, duals: Duals) -> Cuts | None:
        if not self.master.cuts:
            return None
        bits, penalty = np.zeros(len(self.arrays.value), np.uint64), np.zeros(64)
        for q, triple in enumerate(self.master.cuts):
            penalty[q] = -duals.cuts[q]
            for k in triple:
                bits[k] |= np.uint64(1) << np.uint64(q)
        return Cuts(bits, penalty)

    def _integral(self, second: bool) -> None:
        """Keep the solution of the linear program where it happens to be whole."""
        x = self.master.x
        used = np.flatnonzero(x > 1e-6)
        if np.abs(x[used] - np.round(x[used])).max(initial=0.0) > 1e-6:
            return
        chosen = [self.master.columns[p] for p in used.tolist() for _ in range(round(float(x[p])))]
        if len(chosen) == len(self.group):
            routes = self._routes(chosen)
            if self.arrays.is_feasible(routes):
                self.offer(routes)

    def _enumerate(self, duals: Duals, second: bool, most_labels: int, most_columns: int, last: bool = False) -> bool:
        """Enumerate what lies within the gap and choose; True where that proves the stage.

        Where the routes are too many nothing is done, but in the ``last`` try, which chooses among those known.
        """
        answer = self.answer
        rate = 1.0 if second else 0.0
        prize = duals.value * self.arrays.value + duals.target
        least = answer.value + max(self.grid, self._value_slack()) if answer.routes is not None else 0.0
        gap = answer.cost - (answer.cost_bound or 0.0) if second else -duals.objective - least
        gap += 1e-6 * max(1.0, abs(duals.objective))
        columns: list[Column] = []
        whole, cuts = True, self._cuts(duals)
        for pricer, price in zip(self.pricers, duals.group.tolist(), strict=True):
            most = self.control.affordable(most_labels)
            found = pricer.price(prize, rate, -price - gap, ENUMERATE, most, most_columns, self.control.flag, cuts)
            self.control.count(found.labels)
            whole = whole and found.best is not None and len(found.columns) < most_columns
            columns += found.columns
            if not whole and not last:
                return False
        self.notes["enumerated"] = self.notes.get("enumerated", 0) + len(columns)
        if not whole or len(columns) > most_columns:
            if not last:
                return False
            whole = False
            answer.stuck = answer.stuck or self.control.flag[0] == 0
            columns = [column for column in self.master.columns if len(set(column.stops)) == len(column.stops)]
        left_s = self.control.left_s()
        if not whole and left_s is not None:
            left_s *= 0.3
        nodes = MIP_NODES if self.control.work_limit is not None or (not whole and left_s is None) else None
        if second:
            cutoff = answer.cost - COST_TOLERANCE * max(1.0, answer.cost)
        else:
            cutoff = -least + 1e-6 * max(self.grid, self._value_slack())
        closing = Closing(self.arrays, self.sizes, columns, self.master.least_value, cutoff, self.master.cuts)
        found_mip = closing.run(left_s, nodes, self.seed)
        if found_mip.chosen is not None:
            self.offer(self._routes(found_mip.chosen))
        return whole and found_mip.complete
