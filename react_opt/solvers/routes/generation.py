"""Column generation: the linear programme over all routes, with a proven bound at every exact pricing.

For any multipliers pi, prices >= 0 of cuts and rows, and the best reduced value of each class,

    bound = sum_i pi_i + sum_c price_c rhs_c + sum_k n_k max_r (v_r - prices of r)

is above every plan (Lagrangian relaxation). Prices are smoothed towards those of the best bound (Wentges 1997).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from react_opt.route_problem import FloatArray
from react_opt.solvers.routes.budget import Standing
from react_opt.solvers.routes.columns import Column, Duals, Priced, Rank1Cut
from react_opt.solvers.routes.master import Master, MasterPoint
from react_opt.solvers.routes.pricing import RoutePricer, SidePrices
from react_opt.solvers.routes.region import Region
from react_opt.solvers.routes.rows import side_prices

SMOOTHING = 0.8
BEAM = 2
COLUMNS = 16
EARLY = 0.03  # part of the gap to the incumbent
MOST_COLUMNS = 25  # per row of the master; then half of them are dropped
TAKEN = 1e9


@dataclass(frozen=True)
class Multipliers:
    """Prices and the bound they prove.

    Parameters
    ----------
    bound
        The Lagrangian bound.
    duals
        The prices; ``duals.group`` holds the best reduced value of each class, so that the bound is
        ``sum(cell) + sum(price * rhs) + sum(n_k * group_k)``.
    cuts, rows
        The cuts and rows that ``duals.cut`` and ``duals.row`` price.
    """

    bound: float
    duals: Duals
    cuts: tuple[Rank1Cut, ...] = ()
    rows: tuple[Rank1Cut, ...] = ()


class Generation:
    """Column generation on one master.

    Parameters
    ----------
    master, pricer
        The restricted master and the pricer.
    standing
        Best plan and bound, and the limits.
    """

    def __init__(self, master: Master, pricer: RoutePricer, standing: Standing) -> None:
        self.master, self.pricer, self.standing = master, pricer, standing
        self.counts = np.array(master.counts, dtype=np.float64)
        self.best: Multipliers | None = None
        self.point: MasterPoint | None = None
        self.side = SidePrices()

    def look_at(self, region: Region) -> None:
        """Look at the plans of a region from now on."""
        self.master.restrict(region)
        self.side = SidePrices(region=region)

    def converge(self, *, at_root: bool) -> bool:
        """Generate columns until the linear programme is solved; return whether it is.

        It counts as solved when its value is known to a small part of what it lies above the incumbent: to know
        more does not help, the programme has to be tightened. Stops early (returning False) at a limit, or when the
        bound proves the incumbent.

        Parameters
        ----------
        at_root
            Whether a bound found here holds for the whole problem.
        """
        centre = None if self.best is None else self.extended(self.best)
        self.best = None
        smoothing = SMOOTHING
        while not self.standing.budget.over():
            point = self.master.solve(self.standing.budget.left_s())
            self.standing.budget.spend()
            if point is None:
                return False
            self.point = point
            if len(self.master.columns) > MOST_COLUMNS * (len(self.master.cuts) + self.master.n_cells):
                self.master.keep_best(point, len(self.master.columns) // 2)
                point = self.master.solve(self.standing.budget.left_s())
                if point is None:
                    return False
                self.point = point
            duals = point.duals if centre is None else _between(point.duals, centre, smoothing)
            columns, priced = self._price(duals)
            if priced.best is not None:
                bound = self.bound(duals, priced.best)
                if self.best is None or bound < self.best.bound:
                    self.best = Multipliers(
                        bound, replace(duals, group=priced.best), tuple(self.master.cuts), tuple(self.master.rows)
                    )
                    centre = duals
                if at_root:
                    self.standing.lower_bound_to(bound)
                if self.standing.proven(self.standing.lattice.round_down(self.best.bound)):
                    return False
            elif centre is None:
                centre = duals
            gap = np.inf if self.best is None else self.best.bound - point.value
            above = 0.0 if self.standing.objective is None else point.value - self.standing.objective
            if gap <= max(1e-8 * max(1.0, abs(point.value)), EARLY * above):
                return True
            if self.master.add(columns) == 0:
                if smoothing == 0.0 and priced.best is not None:
                    return True
                smoothing = 0.0
            else:
                smoothing = SMOOTHING if gap > 1e-5 * abs(point.value) else 0.5 * SMOOTHING
        return False

    def bound(self, duals: Duals, best: FloatArray) -> float:
        """Return the Lagrangian bound of some prices.

        Parameters
        ----------
        duals
            Prices, of which ``group`` is not used.
        best
            ``(n_groups,)`` bound on value minus prices of every column of each class.
        """
        total = float(duals.cell.sum()) + float(self.counts @ best)
        total += sum(price * cut.rhs for price, cut in zip(duals.cut, self.master.cuts, strict=True))
        total += sum(price * row.rhs for price, row in zip(duals.row, self.master.rows, strict=True))
        return float(total)

    def extended(self, known: Multipliers) -> Duals:
        """Return multipliers for the region, cuts and rows that are there now; zero where they are new.

        Parameters
        ----------
        known
            Multipliers of an earlier master.
        """
        price = dict(zip(known.cuts, known.duals.cut.tolist(), strict=True))
        price |= dict(zip(known.rows, known.duals.row.tolist(), strict=True))
        cut = np.array([price.get(one, 0.0) for one in self.master.cuts])
        row = np.array([price.get(one, 0.0) for one in self.master.rows])
        cell, region = known.duals.cell, self.master.region
        must = np.zeros(len(cell), np.bool_) if region is None else region.must
        return replace(known.duals, cell=np.where(must, cell, np.maximum(cell, 0.0)), cut=cut, row=row)

    def _price(self, duals: Duals) -> tuple[list[Column], Priced]:
        """Return columns and the exact pricing that found the first of them; the others complement these."""
        side = side_prices(self.side, self.master.rows, duals.row, self.pricer.problem)
        exact = self.pricer.price(duals, side, self.master.cuts, columns=COLUMNS)
        self.standing.budget.spend()
        return exact.columns + self._complements(duals, side, exact.columns), exact

    def _complements(self, duals: Duals, side: SidePrices, columns: list[Column]) -> list[Column]:
        """Return columns that avoid each other's cells: together a plan at the given prices."""
        if not columns:
            return []
        best: dict[int, Column] = {}
        for column in columns:
            best.setdefault(column.group, column)
        first = max(best)
        chosen = [best[first]]
        cell = duals.cell.copy()
        cell[list(chosen[0].cells)] = TAKEN
        found: list[Column] = []
        self.standing.budget.spend()
        for group in np.repeat(np.arange(len(self.counts)), self.master.counts):
            if group == first:
                first = -1
                continue
            priced = self.pricer.price(
                replace(duals, cell=cell),
                side,
                self.master.cuts,
                width=BEAM,
                columns=2,
                groups=[int(group)],
                floor=np.full(len(self.counts), -TAKEN),
            )
            if not priced.columns:
                return found
            found += priced.columns
            chosen.append(priced.columns[0])
            cell[list(priced.columns[0].cells)] = TAKEN
        self.standing.offer([c.path for c in sorted(chosen, key=lambda c: c.group)])
        return found


def _between(duals: Duals, centre: Duals, share: float) -> Duals:
    """Return multipliers between two, ``share`` of the way to the centre."""
    if len(duals.cut) != len(centre.cut) or len(duals.row) != len(centre.row):
        return duals
    return Duals(
        *(
            share * c + (1.0 - share) * d
            for c, d in zip(
                (centre.cell, centre.group, centre.cut, centre.row),
                (duals.cell, duals.group, duals.cut, duals.row),
                strict=True,
            )
        )
    )
