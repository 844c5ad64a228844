"""The restricted master of the inspection: which routes, as a linear program and as a small integer program.

    stage 1   max sum value_p x_p       stage 2   min sum cost_p x_p,  sum value_p x_p >= value*
    s.t.      sum_p a_kp x_p <= 1 per target,     sum_p in class c x_p = robots of class c,     x_p >= 0

HiGHS minimises, so stage 1 minimises ``-value``. A column of large cost stands in for a class without a route.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import highspy
import numpy as np
from numpy.typing import NDArray

from react_opt.models.inspection import FloatArray, InspectionArrays

CUTS_PER_ROUND = 20
LEAST_VIOLATION = 0.02
STAND_IN = 1e7  # relative to the largest coefficient


@dataclass(frozen=True)
class Column:
    """A route of a class of robots: its stops, value and second objective (s or J)."""

    group: int
    stops: tuple[int, ...]
    value: float
    cost: float


@dataclass(frozen=True)
class Duals:
    """Prices of the restricted master in its present stage.

    Parameters
    ----------
    target
        ``(N,)`` reduced cost per visit, <= 0.
    group
        ``(C,)`` reduced cost per route of a class.
    value
        Worth of one unit of value: 1 in stage 1, the price of the value row in stage 2.
    objective
        Value of the linear program, minimised.
    stand_in
        Routes that stand-ins take.
    cuts
        Reduced cost of each subset-row cut, <= 0.
    """

    target: FloatArray
    group: FloatArray
    value: float
    objective: float
    stand_in: float
    cuts: FloatArray

    def towards(self, centre: Duals | None, share: float) -> Duals:
        """Return prices that go a share of the way to others (Wentges 1997); ``stand_in`` stays."""
        if centre is None or share == 0.0 or len(centre.cuts) != len(self.cuts):
            return self
        mine = 1.0 - share
        return Duals(
            share * centre.target + mine * self.target, share * centre.group + mine * self.group,
            share * centre.value + mine * self.value, self.objective, self.stand_in,
            share * centre.cuts + mine * self.cuts,
        )  # fmt: skip


class Master:
    """The restricted master with its columns.

    Parameters
    ----------
    arrays
        The problem.
    sizes
        ``(C,)`` robots per class.
    """

    def __init__(self, arrays: InspectionArrays, sizes: list[int]) -> None:
        self.arrays, self.sizes = arrays, sizes
        self.columns: list[Column] = []
        self.least_value: float | None = None
        self.cuts: list[tuple[int, int, int]] = []
        self._known: set[tuple[int, tuple[int, ...]]] = set()
        self._n = len(arrays.value)
        self._solver = quiet()
        n, groups = self._n, len(sizes)
        inf = highspy.kHighsInf
        lower = np.concatenate([np.full(n, -inf), np.array(sizes, dtype=np.float64), [-inf]])
        upper = np.concatenate([np.ones(n), np.array(sizes, dtype=np.float64), [inf]])
        empty = np.empty(0, dtype=np.int32)
        self._solver.addRows(n + groups + 1, lower, upper, 0, np.zeros(n + groups + 1, np.int32), empty, np.empty(0))
        self._stand_in = STAND_IN * max(1.0, float(arrays.value.sum()))
        for c in range(groups):
            self._solver.addCol(self._stand_in, 0.0, inf, 1, np.array([n + c], np.int32), np.ones(1))

    def add(self, columns: list[Column]) -> int:
        """Add columns that are not there yet; return how many were new."""
        new = []
        for column in columns:
            key = (column.group, column.stops)
            if key not in self._known:
                self._known.add(key)
                new.append(column)
        if new:
            cost, start, index, value = matrix_of(
                new, self._n, len(self.sizes), self.least_value is not None, self.cuts
            )
            m = len(new)
            self._solver.addCols(m, cost, np.zeros(m), np.full(m, highspy.kHighsInf), len(index), start, index, value)
            self.columns += new
        return len(new)

    def cut(self, most: int) -> int:
        """Add the subset-row cuts that the last solution breaks most; return how many.

        Of any three targets, routes through two of them can be chosen once (Jepsen et al. 2008).

        Parameters
        ----------
        most
            Cuts to have at most.
        """
        used = np.flatnonzero(self.x > 1e-9)
        visits = np.zeros((self._n, len(used)), np.bool_)
        for at, p in enumerate(used.tolist()):
            visits[list(self.columns[p].stops), at] = True
        found = broken_triples(visits, self.x[used], min(CUTS_PER_ROUND, most - len(self.cuts)))
        for triple in found:
            inside = set(triple)
            index = [p for p, column in enumerate(self.columns) if len(inside.intersection(column.stops)) >= 2]
            self.cuts.append(triple)
            columns = np.array(index, np.int32) + np.int32(len(self.sizes))
            self._solver.addRow(-highspy.kHighsInf, 1.0, len(index), columns, np.ones(len(index)))
        return len(found)

    def ban(self, index: list[int]) -> None:
        """Let columns, by number, be used no more."""
        at = np.array(index, np.int32) + np.int32(len(self.sizes))
        self._solver.changeColsBounds(len(at), at, np.zeros(len(at)), np.zeros(len(at)))

    def second_stage(self, least_value: float) -> None:
        """Minimise the second objective over plans of at least this value."""
        self.least_value = least_value
        groups, m = len(self.sizes), len(self.columns)
        self._solver.changeRowBounds(self._n + groups, least_value, highspy.kHighsInf)
        index = np.arange(groups, groups + m, dtype=np.int32)
        self._solver.changeColsCost(m, index, np.array([column.cost for column in self.columns]))
        largest = max((column.cost for column in self.columns), default=1.0)
        stand_in = np.full(groups, STAND_IN * max(1.0, largest))
        self._solver.changeColsCost(groups, np.arange(groups, dtype=np.int32), stand_in)

    def solve(self) -> Duals | None:
        """Solve the linear program; None where the solver gives no optimum."""
        if not self._optimal():
            return None
        solution = self._solver.getSolution()
        dual = np.array(solution.row_dual)
        n, groups = self._n, len(self.sizes)
        self.x = np.array(solution.col_value)[groups:]
        worth = 1.0 if self.least_value is None else max(0.0, float(dual[n + groups]))
        objective = float(self._solver.getInfo().objective_function_value)
        stand_in = float(np.array(solution.col_value)[:groups].sum())
        cuts = np.minimum(dual[n + groups + 1 :], 0.0)
        return Duals(np.minimum(dual[:n], 0.0), dual[n : n + groups], worth, objective, stand_in, cuts)

    def _optimal(self) -> bool:
        """Run the simplex method; once more from scratch where it gives up: stand-ins make the first programs stiff."""
        for again in (False, True):
            if again:
                self._solver.clearSolver()
            self._solver.run()
            if self._solver.getModelStatus() == highspy.HighsModelStatus.kOptimal:
                return True
        return False


def broken_triples(visits: NDArray[np.bool_], x: FloatArray, most: int) -> list[tuple[int, int, int]]:
    """Return the triples of targets whose subset-row cut is broken most, worst first.

    Parameters
    ----------
    visits, x
        ``(N, m)`` which targets the routes in use visit, and ``(m,)`` how much of each route is used.
    most
        Triples at most.
    """
    busy = np.flatnonzero(visits @ x > 1e-6)
    if len(busy) < 3 or most <= 0:
        return []
    triples = np.array(list(itertools.combinations(busy.tolist(), 3)), dtype=np.int64)
    part = visits.astype(np.int8)
    twice = part[triples[:, 0]] + part[triples[:, 1]] + part[triples[:, 2]] >= 2
    violation = twice @ x - 1.0
    worst = np.argsort(-violation, kind="stable")[:most]
    return [(int(a), int(b), int(c)) for a, b, c in triples[worst[violation[worst] > LEAST_VIOLATION]]]


def quiet() -> highspy.Highs:
    """Return a HiGHS that is silent and runs on one thread."""
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("threads", 1)
    solver.setOptionValue("primal_feasibility_tolerance", 1e-9)
    solver.setOptionValue("dual_feasibility_tolerance", 1e-9)
    return solver


def matrix_of(
    columns: list[Column], n: int, groups: int, second: bool, cuts: Sequence[tuple[int, int, int]] = ()
) -> tuple[FloatArray, NDArray[np.int32], NDArray[np.int32], FloatArray]:
    """Return costs, and the columns of the matrix by starts, rows and values."""
    cost = np.array([column.cost if second else -column.value for column in columns])
    start: list[int] = []
    index: list[int] = []
    value: list[float] = []
    for column in columns:
        start.append(len(index))
        seen: dict[int, float] = {}
        for k in column.stops:
            seen[k] = seen.get(k, 0.0) + 1.0
        hit = [n + groups + 1 + q for q, cut in enumerate(cuts) if sum(k in seen for k in cut) >= 2]
        index += [*seen, n + column.group, n + groups, *hit]
        value += [*seen.values(), 1.0, column.value, *(1.0 for _ in hit)]
    return cost, np.array(start, np.int32), np.array(index, np.int32), np.array(value, np.float64)
