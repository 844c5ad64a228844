"""The last step of a stage: the best choice among all routes that could still matter.

The routes are explicit, so cuts cost nothing in pricing: subset-row cuts (Jepsen et al. 2008: of any three
targets, routes through two of them can be chosen once) tighten the linear program, reduced costs thin the
routes out, and what little is left is an integer program for HiGHS.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import highspy
import numpy as np

from react_opt.kernels import kernel
from react_opt.models.inspection import FloatArray, InspectionArrays
from react_opt.solvers.inspection.master import CUTS_PER_ROUND, Column, broken_triples, matrix_of, quiet

ROUNDS = 25
MOST_STEPS = 3_000_000


@kernel(nogil=True)
def combine(
    level: Any, starts: Any, rows: Any, masks: Any, value: Any, cost: Any, reduced: Any, objective: float,
    least: float, cutoff: float, most: int,
) -> Any:  # fmt: skip
    """Find the cheapest choice of one column per robot, depth first.

    Parameters
    ----------
    level
        ``(R,)`` class of each robot, robots of a class in a row.
    starts, rows
        Columns of each class, by rising reduced cost.
    masks, value, cost, reduced
        Per column: targets as bits, value, cost and reduced cost.
    objective
        Bound of the linear program: a choice costs at least this plus its reduced costs.
    least, cutoff
        Least value and largest cost of a choice that matters.
    most
        Steps at most.

    Returns
    -------
    chosen, steps
        ``(R,)`` columns (-1 where there is no choice), and the steps done; more than ``most`` where they did
        not suffice.
    """
    depth_end, words = len(level), masks.shape[1]
    best = np.full(depth_end, -1, np.int64)
    at = np.zeros(depth_end + 1, np.int64)
    taken = np.zeros((depth_end + 1, words), np.uint64)
    worth, spent, over = np.zeros(depth_end + 1), np.zeros(depth_end + 1), np.zeros(depth_end + 1)
    rest_value, rest_reduced = np.zeros(depth_end + 1), np.zeros(depth_end + 1)
    for d in range(depth_end - 1, -1, -1):
        top, low = -np.inf, np.inf
        for x in range(starts[level[d]], starts[level[d] + 1]):
            top, low = max(top, value[rows[x]]), min(low, reduced[rows[x]])
        rest_value[d], rest_reduced[d] = rest_value[d + 1] + top, rest_reduced[d + 1] + low
    steps, d = 0, 0
    if depth_end == 0:
        return best, 0
    at[0] = starts[level[0]]
    while d >= 0:
        if at[d] >= starts[level[d] + 1]:
            d -= 1
            continue
        p = rows[at[d]]
        at[d] += 1
        steps += 1
        if steps > most:
            return best, steps
        if objective + over[d] + reduced[p] + rest_reduced[d + 1] > cutoff + 1e-9 * (1.0 + abs(cutoff)):
            d -= 1  # the others of this class cost even more
            continue
        if worth[d] + value[p] + rest_value[d + 1] < least:
            continue
        free = True
        for w in range(words):
            free = free and (masks[p, w] & taken[d, w]) == np.uint64(0)
        if not free:
            continue
        best_path = at[d] - 1
        if d + 1 == depth_end:
            if spent[d] + cost[p] <= cutoff:
                cutoff = spent[d] + cost[p] - 1e-9 * (1.0 + abs(cutoff))
                for e in range(depth_end):
                    best[e] = rows[at[e] - 1]
            continue
        for w in range(words):
            taken[d + 1, w] = taken[d, w] | masks[p, w]
        worth[d + 1], spent[d + 1], over[d + 1] = worth[d] + value[p], spent[d] + cost[p], over[d] + reduced[p]
        at[d + 1] = best_path if level[d + 1] == level[d] else starts[level[d + 1]]
        d += 1
    return best, steps


@dataclass(frozen=True)
class Choice:
    """What was found: columns that meet the cutoff (None: none), and whether the answer is proven."""

    chosen: list[Column] | None
    complete: bool


class Closing:
    """A choice among explicit routes.

    Parameters
    ----------
    arrays, sizes, columns
        The problem, robots per class, and the routes to choose from; those that visit a target twice must not
        be among them.
    least_value
        None in stage 1 (``-value`` is minimised), else the value that stage 2 keeps (cost is minimised).
    cutoff
        Only choices with an objective of at most this matter.
    cuts
        Subset-row cuts to begin with.
    """

    def __init__(
        self,
        arrays: InspectionArrays,
        sizes: list[int],
        columns: list[Column],
        least_value: float | None,
        cutoff: float,
        cuts: Sequence[tuple[int, int, int]] = (),
    ) -> None:
        self.sizes, self.columns, self.least_value, self.cutoff = sizes, columns, least_value, cutoff
        self._n = len(arrays.value)
        self._visits = np.zeros((self._n, len(columns)), np.bool_)
        for p, column in enumerate(columns):
            self._visits[list(column.stops), p] = True
        self._cuts = list(cuts)
        self._left = np.arange(len(columns))
        self._gone = np.zeros(len(columns), np.bool_)
        self._model = quiet()

    def run(self, time_limit_s: float | None, node_limit: int | None, seed: int) -> Choice:
        """Choose; see :class:`Choice`.

        Parameters
        ----------
        time_limit_s, node_limit
            Limits of it all, and of the integer program; None for none.
        seed
            Seed of the solver.
        """
        deadline = None if time_limit_s is None else time.perf_counter() + time_limit_s
        if not self.columns:
            return Choice(None, True)
        self._model.passModel(self._program())
        for triple in self._cuts:
            self._add(triple)
        rounding = 1e-9 * max(1.0, abs(self.cutoff))
        for _ in range(ROUNDS):
            if deadline is not None and time.perf_counter() >= deadline:
                return Choice(None, False)
            self._model.run()
            if self._model.getModelStatus() == highspy.HighsModelStatus.kInfeasible:
                return Choice(None, True)
            if self._model.getModelStatus() != highspy.HighsModelStatus.kOptimal:
                break
            objective = float(self._model.getInfo().objective_function_value)
            if objective > self.cutoff + rounding:
                return Choice(None, True)
            solution = self._model.getSolution()
            x = np.array(solution.col_value)
            if np.abs(x - np.round(x)).max() < 1e-7:
                return Choice(self._chosen(x), True)
            reduced = np.array(solution.col_dual)
            self._thin(reduced, objective, rounding)
            if not self._cut(x):
                known = self._combine(reduced, objective)
                if known is not None:
                    return known
                break
        return self._whole(deadline, node_limit, seed)

    def _combine(self, reduced: FloatArray, objective: float) -> Choice | None:
        """Try all combinations whose reduced costs stay within the gap; None where they are too many."""
        left = np.flatnonzero(~self._gone)
        left = left[np.argsort(reduced[left], kind="stable")]
        group = np.array([self.columns[p].group for p in left.tolist()], dtype=np.int64)
        by_class = [np.flatnonzero(group == c) for c in range(len(self.sizes))]
        order = sorted(range(len(self.sizes)), key=lambda c: len(by_class[c]))
        level = np.array([c for c in order for _ in range(self.sizes[c])], dtype=np.int64)
        value = np.array([self.columns[p].value for p in left.tolist()])
        cost = -value if self.least_value is None else np.array([self.columns[p].cost for p in left.tolist()])
        words = max(1, (self._n + 63) // 64)
        flags = np.zeros((len(left), 64 * words), np.uint8)
        flags[:, : self._n] = self._visits[:, left].T
        masks = np.packbits(flags, axis=1, bitorder="little").view("<u8").astype(np.uint64)
        starts = np.cumsum([0, *(len(rows) for rows in by_class)])
        rows = np.concatenate([*by_class, np.empty(0, np.int64)])
        least = -np.inf if self.least_value is None else self.least_value
        chosen, steps = combine(
            level, starts, rows.astype(np.int64), masks, value, cost, np.maximum(reduced[left], 0.0), objective, least,
            self.cutoff, MOST_STEPS,
        )  # fmt: skip
        if steps > MOST_STEPS:
            return None
        if len(chosen) == 0 or chosen[0] < 0:
            return Choice(None, True)
        return Choice([self.columns[left[p]] for p in chosen.tolist()], True)

    def _program(self) -> highspy.HighsLp:
        """Return the linear program over the columns left, with the cuts found."""
        columns, n, m = [self.columns[p] for p in self._left.tolist()], self._n, len(self._left)
        cost, starts, index, value = matrix_of(columns, n, len(self.sizes), self.least_value is not None)
        size, inf = np.array(self.sizes, dtype=np.float64), highspy.kHighsInf
        lp = highspy.HighsLp()
        lp.num_col_, lp.num_row_ = m, n + len(size) + 1
        # An empty route may be chosen by every robot of its class; every other column visits something, once.
        upper = [1.0 if column.stops else float(self.sizes[column.group]) for column in columns]
        lp.col_cost_, lp.col_lower_, lp.col_upper_ = cost, np.zeros(m), np.array(upper)
        least = -inf if self.least_value is None else self.least_value
        lp.row_lower_ = np.concatenate([np.full(n, -inf), size, [least]])
        lp.row_upper_ = np.concatenate([np.ones(n), size, [inf]])
        lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
        lp.a_matrix_.start_ = np.append(starts, len(index))
        lp.a_matrix_.index_, lp.a_matrix_.value_ = index, value
        return lp

    def _chosen(self, x: FloatArray) -> list[Column]:
        count = np.round(x).astype(int)
        return [self.columns[self._left[p]] for p in np.flatnonzero(count).tolist() for _ in range(count[p])]

    def _thin(self, reduced: FloatArray, objective: float, rounding: float) -> None:
        """Take out the columns that no choice within the cutoff contains."""
        out = np.flatnonzero(reduced > self.cutoff - objective + rounding).astype(np.int32)
        if len(out):
            zero = np.zeros(len(out))
            self._model.changeColsBounds(len(out), out, zero, zero)
            self._gone[out] = True

    def _cut(self, x: FloatArray) -> bool:
        """Add the most violated subset-row cuts; False where there is none."""
        used = np.flatnonzero(x > 1e-9)
        found = broken_triples(self._visits[:, self._left[used]], x[used], CUTS_PER_ROUND)
        for triple in found:
            self._cuts.append(triple)
            self._add(triple)
        return len(found) > 0

    def _add(self, triple: tuple[int, int, int]) -> None:
        index = np.flatnonzero(self._visits[list(triple)][:, self._left].sum(axis=0) >= 2).astype(np.int32)
        self._model.addRow(-highspy.kHighsInf, 1.0, len(index), index, np.ones(len(index)))

    def _whole(self, deadline: float | None, node_limit: int | None, seed: int) -> Choice:
        """Solve the integer program over what is left."""
        self._left = np.flatnonzero(~self._gone)
        if not len(self._left):
            return Choice(None, True)
        self._model = quiet()
        lp = self._program()
        lp.integrality_ = [highspy.HighsVarType.kInteger] * len(self._left)
        self._model.passModel(lp)
        for triple in self._cuts:
            self._add(triple)
        set_option = self._model.setOptionValue
        set_option("mip_rel_gap", 1e-9)
        set_option("mip_abs_gap", 1e-9)
        set_option("random_seed", seed % (2**31 - 1))
        if deadline is not None:
            set_option("time_limit", max(0.0, deadline - time.perf_counter()))
        if node_limit is not None:
            set_option("mip_max_nodes", node_limit)
        self._model.run()
        status, done = self._model.getModelStatus(), highspy.HighsModelStatus
        if status == done.kInfeasible:
            return Choice(None, True)
        complete = status == done.kOptimal
        if self._model.getInfo().primal_solution_status != 2:
            return Choice(None, complete)
        return Choice(self._chosen(np.array(self._model.getSolution().col_value)), complete)
