"""The restricted master: which columns to use, as a linear programme that grows in HiGHS.

    max  sum_r v_r x_r
    s.t. sum_r a_ir x_r <= 1        each cell earns once          (price pi_i >= 0)
         sum_{r of k} x_r  = n_k    one route per robot           (multiplier mu_k)
         cuts and side rows  <= rhs                               (prices >= 0)
         x >= 0

with a_ir how often column r collects cell i. In a region of branching the row of a cell that has to be collected
is an equation, and columns that leave the region's windows are held at 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import highspy
import numpy as np

from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.columns import Column, Duals, Rank1Cut, coefficients, counted
from react_opt.solvers.routes.region import Region

DUAL_SIMPLEX, PRIMAL_SIMPLEX = 1, 4  # as HiGHS numbers them


@dataclass(frozen=True)
class MasterPoint:
    """An optimum of the restricted master.

    Parameters
    ----------
    value
        Its objective.
    use
        ``(n_columns,)`` how much each column is used.
    duals
        Multipliers, clipped to their sign.
    lacking
        How much of the robots and of the cells to collect could not be given a column.
    reduced
        ``(n_columns,)`` value minus prices of each column.
    """

    value: float
    use: FloatArray
    duals: Duals
    lacking: float
    reduced: FloatArray


class Master:
    """The restricted master problem.

    Parameters
    ----------
    n_cells
        Number of cells.
    counts
        Number of robots of each group.
    penalty
        What leaving a robot without a column, or a cell uncollected that has to be collected, costs; larger than any
        plan's value.
    threads
        Threads for HiGHS.
    """

    def __init__(self, n_cells: int, counts: Sequence[int], penalty: float, threads: int = 1) -> None:
        self.n_cells = n_cells
        self.counts = tuple(counts)
        self.columns: list[Column] = []
        self._known: set[tuple[int, bytes, bytes]] = set()
        self.cuts: list[Rank1Cut] = []
        self.rows: list[Rank1Cut] = []
        self._cut_rows: list[int] = []
        self._side_rows: list[int] = []
        self._penalty = penalty
        self._threads = threads
        self._new_rows = True
        self._extra = len(self.counts) + n_cells  # artificial columns
        self.region: Region | None = None
        self._start()

    def _start(self) -> None:
        """Make an empty model with cell and group rows and one artificial column for each."""
        self._lp = highspy.Highs()
        self._lp.setOptionValue("output_flag", False)
        self._lp.setOptionValue("threads", self._threads)
        self._lp.setOptionValue("presolve", "off")
        self._lp.setOptionValue("primal_feasibility_tolerance", 1e-9)
        self._lp.setOptionValue("dual_feasibility_tolerance", 1e-9)
        none_int, none = np.zeros(0, dtype=np.int32), np.zeros(0)
        inf = highspy.kHighsInf
        upper = np.concatenate((np.ones(self.n_cells), np.array(self.counts, dtype=np.float64)))
        lower = np.concatenate((np.full(self.n_cells, -inf), np.array(self.counts, dtype=np.float64)))
        starts = np.zeros(len(upper), dtype=np.int32)
        self._lp.addRows(len(upper), lower, upper, 0, starts, none_int, none)
        extra = self._extra
        self._lp.addCols(
            extra,
            np.full(extra, self._penalty),
            np.zeros(extra),
            np.concatenate((np.zeros(self.n_cells), np.full(extra - self.n_cells, inf))),
            extra,
            np.arange(extra, dtype=np.int32),
            np.arange(extra, dtype=np.int32),
            np.ones(extra),
        )

    def add(self, columns: Iterable[Column]) -> int:
        """Add columns that are not there yet; return how many were added."""
        fresh = []
        for column in columns:
            key = _key(column)
            if key not in self._known:
                self._known.add(key)
                fresh.append(column)
        if not fresh:
            return 0
        extra = coefficients(self.cuts + self.rows, fresh, self.n_cells)
        extra_rows = np.array(self._cut_rows + self._side_rows, dtype=np.int64)
        entries = [self._entries(column, extra_rows, extra[:, k]) for k, column in enumerate(fresh)]
        index, value = [rows for rows, _ in entries], [times for _, times in entries]
        starts = np.cumsum([0] + [len(rows) for rows in index[:-1]])
        indices = np.concatenate(index).astype(np.int32)
        self._lp.addCols(
            len(fresh),
            -np.array([column.value for column in fresh]),
            np.zeros(len(fresh)),
            self._most(fresh),
            len(indices),
            np.array(starts, dtype=np.int32),
            indices,
            np.concatenate(value),
        )
        self.columns += fresh
        return len(fresh)

    def _entries(self, column: Column, extra_rows: IntArray, extra: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the rows of a column and its coefficients there; ``extra`` are those in cuts and side rows."""
        rows, times = counted(column.cells)
        in_extra = np.flatnonzero(extra)
        return (
            np.concatenate((rows, [self.n_cells + column.group], extra_rows[in_extra])),
            np.concatenate((times, [1.0], extra[in_extra])),
        )

    def drop(self, unwanted: Callable[[Column], bool]) -> None:
        """Remove all columns that a test picks out."""
        self._drop([k for k, column in enumerate(self.columns) if unwanted(column)])

    def keep_best(self, point: MasterPoint, most: int) -> None:
        """Remove the columns of least reduced value, so that so many are left; those in use stay.

        Parameters
        ----------
        point
            The optimum of the columns held.
        most
            How many stay.
        """
        order = np.argsort(np.where(point.use > 0.0, np.inf, point.reduced), kind="stable")
        self._drop(sorted(order[: max(0, len(order) - most)].tolist()))

    def _drop(self, gone: Sequence[int]) -> None:
        if not gone:
            return
        index = np.array(gone, dtype=np.int32) + self._extra
        self._lp.deleteCols(len(index), index)
        for k in reversed(gone):
            self._known.discard(_key(self.columns[k]))
            del self.columns[k]

    def restrict(self, region: Region) -> None:
        """Look at the plans of a region from now on.

        Parameters
        ----------
        region
            The region.
        """
        self.region = region
        n, inf = self.n_cells, highspy.kHighsInf
        index = np.concatenate((np.arange(n), np.arange(len(self.columns)) + self._extra)).astype(np.int32)
        upper = np.concatenate((np.where(region.must, inf, 0.0), self._most(self.columns)))
        self._lp.changeColsBounds(len(index), index, np.zeros(len(index)), upper)
        self._new_rows = True
        for cell in range(n):
            self._lp.changeRowBounds(cell, 1.0 if region.must[cell] else -inf, 1.0)

    def _most(self, columns: Sequence[Column]) -> FloatArray:
        """Return how much of each column may be used."""
        region = self.region
        if region is None:
            return np.full(len(columns), highspy.kHighsInf)
        return np.where(region.allowed(columns), highspy.kHighsInf, 0.0)

    def drop_cuts(self, unwanted: Callable[[Rank1Cut], bool]) -> None:
        """Remove all cuts that a test picks out."""
        gone = [k for k, cut in enumerate(self.cuts) if unwanted(cut)]
        if not gone:
            return
        rows = np.array(sorted(self._cut_rows[k] for k in gone), dtype=np.int32)
        self._lp.deleteRows(len(rows), rows)
        for k in reversed(gone):
            del self.cuts[k], self._cut_rows[k]
        self._cut_rows = [row - int(np.searchsorted(rows, row)) for row in self._cut_rows]
        self._side_rows = [row - int(np.searchsorted(rows, row)) for row in self._side_rows]

    def add_cuts(self, cuts: Sequence[Rank1Cut]) -> None:
        """Add cuts (priced through ``Duals.cut``)."""
        self._cut_rows += self._add_to_model(cuts)
        self.cuts += cuts

    def add_rows(self, rows: Sequence[Rank1Cut]) -> None:
        """Add side rows (priced through ``Duals.row``)."""
        self._side_rows += self._add_to_model(rows)
        self.rows += rows

    def _add_to_model(self, rows: Sequence[Rank1Cut]) -> list[int]:
        """Add rows to the model; return which they are there."""
        first = int(self._lp.getNumRow())
        self._new_rows |= len(rows) > 0
        for row, inside in zip(rows, coefficients(rows, self.columns, self.n_cells), strict=True):
            index = np.flatnonzero(inside)
            place = (index + self._extra).astype(np.int32)
            self._lp.addRow(-highspy.kHighsInf, row.rhs, len(index), place, inside[index])
        return list(range(first, first + len(rows)))

    def solve(self, time_limit_s: float | None = None) -> MasterPoint | None:
        """Return the optimum of the linear programme; None if the time did not suffice.

        Parameters
        ----------
        time_limit_s
            Wall-clock limit of this solve; None is unlimited.
        """
        if time_limit_s is not None:
            self._lp.setOptionValue("time_limit", float(self._lp.getRunTime()) + max(0.01, time_limit_s))
        # new columns leave the last basis primal feasible, new rows dual feasible
        self._lp.setOptionValue("simplex_strategy", DUAL_SIMPLEX if self._new_rows else PRIMAL_SIMPLEX)
        self._new_rows = False
        self._lp.run()
        if self._lp.getModelStatus() != highspy.HighsModelStatus.kOptimal:
            self._lp.clearSolver()
            self._lp.run()
            if self._lp.getModelStatus() != highspy.HighsModelStatus.kOptimal:
                return None
        solution = self._lp.getSolution()
        price = -np.array(solution.row_dual)
        use = np.array(solution.col_value)
        groups, n = len(self.counts), self.n_cells
        cell = np.maximum(price[:n], 0.0)
        duals = Duals(
            cell if self.region is None else np.where(self.region.must, price[:n], cell),
            price[n : n + groups],
            np.maximum(price[self._cut_rows], 0.0) if self._cut_rows else np.zeros(0),
            np.maximum(price[self._side_rows], 0.0) if self._side_rows else np.zeros(0),
        )
        value = -float(self._lp.getInfo().objective_function_value)
        reduced = -np.array(solution.col_dual)[self._extra :]
        return MasterPoint(value, use[self._extra :], duals, float(use[: self._extra].sum()), reduced)

    def reduced_values(self, duals: Duals) -> FloatArray:
        """Return value minus prices of every column held."""
        reduced = np.empty(len(self.columns))
        for k, column in enumerate(self.columns):
            rows, times = counted(column.cells)
            reduced[k] = column.value - duals.group[column.group] - float(times @ duals.cell[rows])
        price = np.concatenate((duals.cut, duals.row))
        paid = np.flatnonzero(price > 0.0)
        rows_paid = [(self.cuts + self.rows)[k] for k in paid.tolist()]
        return reduced - price[paid] @ coefficients(rows_paid, self.columns, self.n_cells)


def _key(column: Column) -> tuple[int, bytes, bytes]:
    """Return what tells a column from others: its group, and its path (what it charges, too) or else its cells."""
    path = column.path
    if path is None:
        return column.group, np.array(column.cells).tobytes(), b""
    return column.group, path.cell.tobytes(), path.sense.tobytes() + np.round(path.charge_j, 6).tobytes()
