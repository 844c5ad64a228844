"""Prices of cells from the simplest relaxation: every robot collects one cell per instant, wherever it is.

    max  sum_{i,t} reward_it y_it     y_it = 0 before the first instant at which some robot can be in cell i
    s.t. sum_t y_it <= 1              for every cell i        price pi_i
         sum_i y_it <= robots         for every instant t

is a transportation problem whose bound counts how far the robots can have got, and its prices prove the same bound
for the route problem: a route collects at most one cell per instant. Cells with equal rewards that are first reached
at the same instant are one row.
"""

from __future__ import annotations

import highspy
import numpy as np

from react_opt.route_problem import FloatArray, RouteProblem
from react_opt.solvers.highs_model import fresh_scheduler


def slot_prices(problem: RouteProblem, time_limit_s: float | None = None) -> FloatArray | None:
    """Return the prices of the cells, ``(n_cells,)``, or None if they were not found in time.

    Parameters
    ----------
    problem
        The route problem.
    time_limit_s
        Wall-clock limit; None is unlimited.
    """
    horizon, n = problem.horizon, problem.n_cells
    earliest = np.full(n, horizon + 1)
    for start, start_step in {(group.start, group.start_step) for group in problem.classes}:
        earliest = np.minimum(earliest, _first_arrival(problem, start, start_step))
    worth = problem.reward - problem.sigma * min((group.sense_j for group in problem.classes), default=0.0)
    worth[problem.reward <= 0.0] = 0.0
    instants = np.arange(horizon + 1)
    worth[instants[None, :] < np.maximum(1, earliest)[:, None]] = 0.0
    rows, member = np.unique(np.maximum(worth, 0.0), axis=0, return_inverse=True)
    member = member.reshape(-1)
    kind, instant = np.nonzero(rows)
    count = len(kind)
    limits = np.concatenate((np.bincount(member, minlength=len(rows)), np.full(horizon + 1, problem.n_robots)))
    lp = highspy.Highs()
    lp.setOptionValue("output_flag", False)
    lp.setOptionValue("threads", 1)
    if time_limit_s is not None:
        lp.setOptionValue("time_limit", max(0.01, time_limit_s))
    total = len(limits)
    lp.addRows(
        total, np.full(total, -highspy.kHighsInf), limits.astype(np.float64), 0, np.zeros(total, np.int32),
        np.zeros(0, np.int32), np.zeros(0),
    )  # fmt: skip
    index = np.column_stack((kind, len(rows) + instant)).astype(np.int32).reshape(-1)
    lp.addCols(
        count, -rows[kind, instant], np.zeros(count), np.full(count, highspy.kHighsInf), 2 * count,
        np.arange(0, 2 * count, 2, dtype=np.int32), index, np.ones(2 * count),
    )  # fmt: skip
    fresh_scheduler()
    lp.run()
    fresh_scheduler()  # the programmes that follow may ask for another number of threads
    if lp.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return None
    prices: FloatArray = np.maximum(0.0, -np.array(lp.getSolution().row_dual)[: len(rows)])[member]
    return prices


def _first_arrival(problem: RouteProblem, start: int, start_step: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return the first instant at which each cell can be reached, beyond the horizon where none is."""
    first = np.full(problem.n_cells, problem.horizon + 1, dtype=np.int64)
    layers: list[list[int]] = [[] for _ in range(problem.horizon + 2)]
    first[start] = start_step
    layers[start_step].append(start)
    for t in range(start_step, problem.horizon + 1):
        for i in layers[t]:
            if first[i] < t:
                continue
            for a in range(problem.out_start[i], problem.out_start[i + 1]):
                j, arrival = problem.arc_to[a], t + int(problem.arc_steps[a])
                if arrival <= problem.horizon and arrival < first[j]:
                    first[j] = arrival
                    layers[arrival].append(int(j))
    return first
