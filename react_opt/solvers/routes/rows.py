"""Side rows of the master: limits between robots and branching, all additive over standing and sensing.

A row is a sum over cells and instants, so its price is a price of standing (or sensing) there and then, and the
pricing needs no further state. Limits between robots are added when the linear programme violates them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from react_opt.route_problem import FloatArray, RouteProblem
from react_opt.solvers.routes.columns import Column, Rank1Cut
from react_opt.solvers.routes.pricing import SidePrices

VIOLATION = 1e-6


@dataclass(frozen=True)
class StandRow:
    """At most ``rhs`` robots stand in a cell at an instant; with ``sign`` -1 at least ``-rhs`` do.

    Parameters
    ----------
    cell, from_end
        Where, and how many instants before the horizon.
    rhs, sign
        ``sign * sum <= rhs``.
    """

    cell: int
    from_end: int
    rhs: float
    sign: int = 1

    def coefficients(self, columns: Sequence[Column], counts: FloatArray) -> FloatArray:
        """Return the row's coefficient in each column, see `Rank1Cut`."""
        return np.array([self._coefficient(column) for column in columns], dtype=np.float64)

    def _coefficient(self, column: Column) -> float:
        """Return 1 (times the sign) if the column's route stands there then."""
        cells = column.path.cell
        position = len(cells) - 1 - self.from_end
        return float(self.sign) if position >= 0 and cells[position] == self.cell else 0.0


@dataclass(frozen=True)
class SenseRow:
    """At most ``rhs`` robots sense ``from_end`` instants before the horizon."""

    from_end: int
    rhs: float

    def coefficients(self, columns: Sequence[Column], counts: FloatArray) -> FloatArray:
        """Return the row's coefficient in each column, see `Rank1Cut`."""
        return np.array([self._coefficient(column) for column in columns], dtype=np.float64)

    def _coefficient(self, column: Column) -> float:
        """Return 1 if the column's route senses then."""
        senses = column.path.sense
        position = len(senses) - 1 - self.from_end
        return float(position >= 0 and bool(senses[position]))


@dataclass(frozen=True)
class ChargeRow:
    """At most ``rhs`` robots charge in a cell ``from_end`` instants before the horizon."""

    cell: int
    from_end: int
    rhs: float

    def coefficients(self, columns: Sequence[Column], counts: FloatArray) -> FloatArray:
        """Return the row's coefficient in each column, see `Rank1Cut`."""
        return np.array([self._coefficient(column) for column in columns], dtype=np.float64)

    def _coefficient(self, column: Column) -> float:
        """Return 1 if the column's route charges there then."""
        path = column.path
        position = len(path.cell) - 1 - self.from_end
        charges = position >= 0 and path.charge_j[position] > 0.0 and path.cell[position] == self.cell
        return float(charges)


def side_prices(base: SidePrices, rows: Sequence[Rank1Cut], price: FloatArray, problem: RouteProblem) -> SidePrices:
    """Return prices of standing, sensing and charging: what branching forbids, and the prices of all rows.

    Parameters
    ----------
    base
        What is forbidden.
    rows, price
        Rows of the master and their prices.
    problem
        The route problem.
    """
    stand, sense, charge = base.stand, base.sense, base.charge
    for row, worth in zip(rows, price, strict=True):
        if worth == 0.0:
            continue
        if isinstance(row, StandRow):
            if stand is base.stand:
                empty = np.zeros((problem.horizon + 1, problem.n_cells))
                stand = empty if base.stand is None else base.stand.copy()
            assert stand is not None
            stand[problem.horizon - row.from_end, row.cell] += worth * row.sign
        elif isinstance(row, SenseRow):
            if sense is base.sense:
                sense = np.zeros(problem.horizon + 1) if base.sense is None else base.sense.copy()
            assert sense is not None
            sense[problem.horizon - row.from_end] += worth
        elif isinstance(row, ChargeRow):
            if charge is base.charge:
                empty = np.zeros((problem.horizon + 1, problem.n_cells))
                charge = empty if base.charge is None else base.charge.copy()
            assert charge is not None
            charge[problem.horizon - row.from_end, row.cell] += worth
    return replace(base, stand=stand, sense=sense, charge=charge)


def violated_limits(
    problem: RouteProblem, columns: Sequence[Column], use: FloatArray
) -> list[StandRow | SenseRow | ChargeRow]:
    """Return the limits between robots that a solution of the master breaks.

    Parameters
    ----------
    problem
        The route problem.
    columns, use
        The master's columns and how much each is used.
    """
    rows: list[StandRow | SenseRow | ChargeRow] = []
    used = np.flatnonzero(use > 1e-9)
    if problem.robots_per_cell is not None:
        standing = np.zeros((problem.horizon + 1, problem.n_cells))
        for k in used.tolist():
            cells = columns[k].path.cell
            at = np.flatnonzero(cells >= 0)
            np.add.at(standing, (at + problem.horizon + 1 - len(cells), cells[at]), use[k])
        standing[0] = 0.0
        for instant, cell in np.argwhere(standing > problem.robots_per_cell + VIOLATION):
            rows.append(StandRow(int(cell), problem.horizon - int(instant), float(problem.robots_per_cell)))
    if problem.sensing_robots_per_step is not None:
        sensing = np.zeros(problem.horizon + 1)
        for k in used.tolist():
            senses = columns[k].path.sense
            sensing[problem.horizon + 1 - len(senses) :] += use[k] * senses
        for instant in np.flatnonzero(sensing > problem.sensing_robots_per_step + VIOLATION):
            rows.append(SenseRow(problem.horizon - int(instant), float(problem.sensing_robots_per_step)))
    if problem.charger_j.any():
        charging = np.zeros((problem.horizon + 1, problem.n_cells))
        for k in used.tolist():
            path = columns[k].path
            at = np.flatnonzero(path.charge_j > 0.0)
            np.add.at(charging, (at + problem.horizon + 1 - len(path.cell), path.cell[at]), use[k])
        for instant, cell in np.argwhere(charging > problem.charger_slots[None, :] + VIOLATION):
            slots = float(problem.charger_slots[cell])
            rows.append(ChargeRow(int(cell), problem.horizon - int(instant), slots))
    return rows
