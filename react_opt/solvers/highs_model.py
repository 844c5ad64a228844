"""A program as a HiGHS model, in memory and as MPS or LP files."""

from __future__ import annotations

import re
from pathlib import Path
from time import perf_counter
from typing import Any

import highspy
import numpy as np
from numpy.typing import NDArray

from react_opt.errors import ReactError, UsageError
from react_opt.models.program import Program

FloatArray = NDArray[np.float64]
TOLERANCE = 1e-9
"""Feasibility tolerance that HiGHS is given; its default 1e-6 lets a joule's worth of objective slip."""
ROUNDING = 1e-10
"""Rounding of sums of a hundred terms or so, relative to the largest."""
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.]*")


def feasibility_tolerance(program: Program) -> float:
    """Return the feasibility tolerance with which HiGHS solves a mixed-integer program right.

    HiGHS cuts nodes off at "best + one unit + tolerance": below the rounding of large objectives it cuts off optima.
    """
    largest = float(np.abs(program.cost).max(initial=0.0))
    return min(1e-6, max(TOLERANCE, ROUNDING * largest))


def to_highs(program: Program, *, names: bool = True) -> highspy.Highs:
    """Hand out a program as a HiGHS model, silent, with the program's own sense.

    Parameters
    ----------
    program
        The program.
    names
        Whether columns and rows get their names, which costs time on large programs.

    Returns
    -------
    highspy.Highs
        Columns and rows in the program's order.
    """
    matrix = program.matrix()
    lp = highspy.HighsLp()
    lp.model_name_ = program.name
    lp.num_col_, lp.num_row_ = program.n_columns, program.n_rows
    lp.sense_ = highspy.ObjSense.kMaximize if program.maximise else highspy.ObjSense.kMinimize
    lp.col_cost_, lp.col_lower_, lp.col_upper_ = program.cost, program.lower, program.upper
    lp.row_lower_, lp.row_upper_ = program.row_lower, program.row_upper
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    lp.a_matrix_.num_col_, lp.a_matrix_.num_row_ = program.n_columns, program.n_rows
    lp.a_matrix_.start_ = matrix.indptr.astype(np.int32)
    lp.a_matrix_.index_ = matrix.indices.astype(np.int32)
    lp.a_matrix_.value_ = matrix.data
    integer = program.integer
    if integer.any():
        kinds = (highspy.HighsVarType.kContinuous, highspy.HighsVarType.kInteger)
        lp.integrality_ = [kinds[flag] for flag in integer.tolist()]
    if names:
        lp.col_names_, lp.row_names_ = program.column_labels(), program.row_labels()
    highs = highspy.Highs()
    highs.setOptionValue("output_flag", False)
    # The default drops coefficients below 1e-9 without a word that reaches the caller.
    highs.setOptionValue("small_matrix_value", 1e-12)
    if highs.passModel(lp) == highspy.HighsStatus.kError:
        raise ReactError(f"HiGHS does not take the program {program.name!r}: bounds or coefficients are out of range")
    return highs


def write_model(program: Program, path: str | Path) -> None:
    """Write a program as an MPS or LP file that other solvers read: names and integrality survive.

    An MPS file is always a minimisation: of a program that maximises, the negated objective. Its sense would stand in a
    section that some readers skip (CBC's, with a remark), and they then solve another problem. An LP file states it.

    Parameters
    ----------
    program
        The program.
    path
        Where to; it ends in ``.mps`` or ``.lp``.

    Raises
    ------
    UsageError
        Where the path ends otherwise, or a name cannot be written in these formats.
    ReactError
        Where the file cannot be written.
    """
    path = Path(path)
    if path.suffix not in (".mps", ".lp"):
        raise UsageError(f"{path}: a model is written as .mps or .lp")
    for names, what in ((program.column_labels(), "column"), (program.row_labels(), "row")):
        bad = next((name for name in names if not _NAME.fullmatch(name)), None)
        if bad is not None:
            raise UsageError(f"{path}: the {what} name {bad!r} cannot be written in MPS and LP files")
    if not path.parent.is_dir():
        raise ReactError(f"{path}: there is no directory {path.parent}")
    highs = to_highs(program)
    if path.suffix == ".mps" and program.maximise:
        highs.changeColsCost(program.n_columns, np.arange(program.n_columns, dtype=np.int32), -program.cost)
        highs.changeObjectiveSense(highspy.ObjSense.kMinimize)
    if highs.writeModel(str(path)) == highspy.HighsStatus.kError or not path.is_file():
        raise ReactError(f"{path}: the model could not be written")


def completed(program: Program, x: FloatArray, deadline: float | None = None) -> FloatArray | None:
    """Return the best solution that has the integers of ``x``, by linear programming; None where there is none.

    Parameters
    ----------
    program
        The program.
    x
        Its integer columns count, rounded.
    deadline
        ``perf_counter()`` at which to give up; None for none.
    """
    integer = np.flatnonzero(program.integer)
    fixed = program.fixed(dict(zip(integer.tolist(), np.round(x[integer]).tolist(), strict=True)))
    highs = to_highs(fixed, names=False)
    lp_options: dict[str, Any] = {"solve_relaxation": True, "primal_feasibility_tolerance": TOLERANCE}
    if deadline is not None:
        lp_options["time_limit"] = max(0.0, deadline - perf_counter())
    for name, value in lp_options.items():
        highs.setOptionValue(name, value)
    highs.run()
    if highs.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return None
    solution = np.array(highs.getSolution().col_value, dtype=np.float64)
    return np.where(program.integer, np.round(solution), solution)


def fresh_scheduler() -> None:
    """Let HiGHS start its scheduler anew in this thread.

    The first run in a thread fixes its number of threads; a later model that asks for another number would fail.
    """
    highspy.Highs.resetGlobalScheduler(True)
