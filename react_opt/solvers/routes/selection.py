"""The master with whole columns: the best plan that can be put together from routes at hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import highspy
import numpy as np

from react_opt.solvers.routes.columns import Column, counted


@dataclass(frozen=True)
class Selection:
    """Outcome of choosing whole columns.

    Parameters
    ----------
    columns
        One column per robot, groups in order; None if none were found.
    bound
        Bound on every choice from these columns; None if unknown.
    solved
        Whether the choice is proven best within the tolerance asked for.
    """

    columns: list[Column] | None
    bound: float | None
    solved: bool


def select(
    columns: Sequence[Column],
    n_cells: int,
    counts: Sequence[int],
    *,
    gap: float,
    floor: float | None,
    time_limit_s: float | None,
    node_limit: int | None,
    seed: int,
    threads: int = 1,
) -> Selection:
    """Choose one column per robot so that no cell is collected twice and the value is largest (MILP).

    Parameters
    ----------
    columns
        Elementary columns.
    n_cells, counts
        Number of cells, and of robots of each group.
    gap
        Absolute gap at which the choice counts as solved.
    floor
        Only values above this are of interest, None for any.
    time_limit_s, node_limit
        Limits of HiGHS.
    seed, threads
        Seed and threads of HiGHS.
    """
    mip = highspy.Highs()
    options = {
        "output_flag": False,
        "threads": threads,
        "random_seed": seed,
        "mip_abs_gap": gap,
        "mip_rel_gap": 0.0,
        "mip_feasibility_tolerance": 1e-9,
    }
    if time_limit_s is not None:
        options["time_limit"] = max(0.01, time_limit_s)
    if node_limit is not None:
        options["mip_max_nodes"] = node_limit
    if floor is not None:
        options["objective_bound"] = -floor
    for name, option in options.items():
        mip.setOptionValue(name, option)
    inf = highspy.kHighsInf
    rows = n_cells + len(counts)
    sizes = np.array(counts, dtype=np.float64)
    mip.addRows(
        rows,
        np.concatenate((np.full(n_cells, -inf), sizes)),
        np.concatenate((np.ones(n_cells), sizes)),
        0,
        np.zeros(rows, dtype=np.int32),
        np.zeros(0, dtype=np.int32),
        np.zeros(0),
    )
    index = [np.concatenate((counted(c.cells)[0], [n_cells + c.group])) for c in columns]
    starts = np.cumsum([0] + [len(part) for part in index[:-1]]).astype(np.int32)
    indices = np.concatenate(index).astype(np.int32)
    # a column without cells may serve several robots
    upper = np.array([1.0 if c.cells else float(counts[c.group]) for c in columns])
    mip.addCols(
        len(columns),
        -np.array([c.value for c in columns]),
        np.zeros(len(columns)),
        upper,
        len(indices),
        starts,
        indices,
        np.ones(len(indices)),
    )
    every = np.arange(len(columns), dtype=np.int32)
    mip.changeColsIntegrality(len(columns), every, np.full(len(columns), highspy.HighsVarType.kInteger))
    mip.run()
    status, info = mip.getModelStatus(), mip.getInfo()
    if status == highspy.HighsModelStatus.kInfeasible:
        return Selection(None, -np.inf, True)
    solved = status in (highspy.HighsModelStatus.kOptimal, highspy.HighsModelStatus.kObjectiveBound)
    bound = -float(info.mip_dual_bound)
    if info.primal_solution_status != highspy.SolutionStatus.kSolutionStatusFeasible:
        return Selection(None, bound if np.isfinite(bound) else None, solved)
    use = np.array(mip.getSolution().col_value)
    chosen: list[Column] = []
    for k in np.flatnonzero(use > 0.5).tolist():
        chosen += [columns[k]] * round(float(use[k]))
    return Selection(sorted(chosen, key=lambda c: c.group), bound if np.isfinite(bound) else None, solved)
