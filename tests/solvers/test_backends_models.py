"""Programs handed out: as files that other solvers read, and as models of other libraries."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import highspy
import numpy as np
import pytest
from small_programs import motley

from react_opt.errors import ReactError, UsageError
from react_opt.models.program import Program
from react_opt.solvers.cvxpy_ import to_cvxpy
from react_opt.solvers.highs_ import to_highs, write_model
from react_opt.solvers.highs_model import feasibility_tolerance
from react_opt.solvers.outcome import Request
from react_opt.solvers.registry import backend


@pytest.fixture(params=[False, True], ids=["minimise", "maximise"])
def program(request: pytest.FixtureRequest) -> Program:
    return motley(maximise=request.param)


@pytest.fixture
def optimum(program: Program) -> float:
    outcome = backend("highs").solve(program, Request())
    assert outcome.status == "optimal"
    assert outcome.objective is not None
    return outcome.objective


@pytest.mark.parametrize("suffix", ["mps", "lp"])
def test_scip_reads_the_file_and_finds_the_same(program: Program, optimum: float, suffix: str, tmp_path: Path) -> None:
    scip = pytest.importorskip("pyscipopt")
    path = tmp_path / f"model.{suffix}"
    write_model(program, path)
    model = scip.Model()
    model.hideOutput()
    model.readProblem(str(path))
    maximise = program.maximise and suffix == "lp"  # MPS files minimise, the negated objective where they must
    assert model.getObjectiveSense() == ("maximize" if maximise else "minimize")
    assert {variable.name for variable in model.getVars()} == set(program.column_labels())
    kinds = {variable.name: variable.vtype() for variable in model.getVars()}
    assert [kinds[name] == "INTEGER" for name in program.column_labels()] == program.integer.tolist()
    model.setParam("limits/gap", 1e-9)
    model.optimize()
    assert model.getObjVal() == pytest.approx(optimum if maximise == program.maximise else -optimum, rel=1e-9)


def test_the_mps_file_holds_the_program_to_fifteen_digits(program: Program, tmp_path: Path) -> None:
    path = tmp_path / "model.mps"
    write_model(program, path)
    highs = highspy.Highs()
    highs.setOptionValue("output_flag", False)
    highs.readModel(str(path))
    lp = highs.getLp()
    assert list(lp.col_names_) == program.column_labels()
    assert list(lp.row_names_) == program.row_labels()
    for read, written in (
        (lp.col_cost_, -program.cost if program.maximise else program.cost),
        (lp.col_lower_, program.lower),
        (lp.col_upper_, program.upper),
        (lp.row_lower_, program.row_lower),
        (lp.row_upper_, program.row_upper),
        (lp.a_matrix_.value_, program.matrix().tocsc().data),
    ):
        assert np.allclose(read, written, rtol=1e-14, atol=0.0)


def test_what_cannot_be_written_is_said(program: Program, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"model\.txt: a model is written as \.mps or \.lp"):
        write_model(program, tmp_path / "model.txt")
    with pytest.raises(ReactError, match="there is no directory"):
        write_model(program, tmp_path / "none" / "model.mps")
    program.add_columns("a b", [0])
    with pytest.raises(UsageError, match="the column name 'a b_0' cannot be written"):
        write_model(program, tmp_path / "model.mps")


def test_the_highs_model_has_names_and_sense(program: Program, optimum: float) -> None:
    highs = to_highs(program)
    lp = highs.getLp()
    assert list(lp.col_names_) == program.column_labels()
    assert (lp.sense_ == highspy.ObjSense.kMaximize) == program.maximise
    highs.setOptionValue("mip_rel_gap", 0.0)
    highs.run()
    assert highs.getInfo().objective_function_value == pytest.approx(optimum, rel=1e-6)


def test_the_cvxpy_problem_has_a_variable_per_block(program: Program, optimum: float) -> None:
    problem, variables = to_cvxpy(program)
    assert list(variables) == ["x", "y"]
    assert variables["y"].attributes["integer"]
    problem.solve(solver="HIGHS", mip_rel_gap=0.0)
    assert problem.value == pytest.approx(optimum, rel=1e-6)


FRESH = """
import sys
from pathlib import Path
sys.path.insert(0, {here!r})
from small_programs import charging, motley
"""


def fresh(code: str) -> str:
    """Run code in a process of its own: OR-tools and the highspy of this one need not get along."""
    full = FRESH.format(here=str(Path(__file__).parent)) + code
    done = subprocess.run([sys.executable, "-c", full], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_highspy_and_or_tools_live_in_one_process() -> None:
    """Where they do not (highspy 1.15 and later), models cannot be handed out side by side."""
    printed = fresh(
        "from react_opt.solvers.highs_ import to_highs\n"
        "from react_opt.solvers.ortools_ import to_mathopt\n"
        "program = motley(maximise=True)\n"
        "to_highs(program).run()\n"
        "print(to_mathopt(program).name)\n"
    )
    assert printed == "motley"


def test_the_mathopt_model_is_the_program() -> None:
    printed = fresh(
        "from ortools.math_opt.python import mathopt\n"
        "from react_opt.solvers.ortools_ import to_mathopt\n"
        "for maximise in (False, True):\n"
        "    program = motley(maximise=maximise)\n"
        "    model = to_mathopt(program)\n"
        "    assert [v.name for v in model.variables()] == program.column_labels()\n"
        "    assert [c.name for c in model.linear_constraints()] == program.row_labels()\n"
        "    assert model.objective.is_maximize == maximise\n"
        "    print(mathopt.solve(model, mathopt.SolverType.GSCIP).objective_value())\n"
    ).split()
    least = backend("highs").solve(motley(maximise=False), Request()).objective
    assert least is not None
    assert [float(value) for value in printed] == pytest.approx([least, -least], rel=1e-9)


def test_the_cp_sat_model_is_the_program_in_whole_numbers() -> None:
    printed = fresh(
        "from ortools.sat.python import cp_model\n"
        "from react_opt.solvers.cp_sat_ import to_cp_sat\n"
        "program = charging()\n"
        "handed = to_cp_sat(program)\n"
        "assert [v.name for v in handed.variables] == program.column_labels()\n"
        "solver = cp_model.CpSolver()\n"
        "assert solver.solve(handed.model) == cp_model.OPTIMAL\n"
        "x = handed.scaling.x([solver.value(v) for v in handed.variables])\n"
        "assert program.violation(x) < 1e-12\n"
        "print(program.objective(x), solver.objective_value / float(handed.scaling.objective_scale))\n"
    ).split()
    assert [float(value) for value in printed] == pytest.approx([1.59, 1.59], abs=1e-12)


@pytest.mark.parametrize("largest", [1.0, 984.0, 5e4, 1e9])
def test_highs_tolerates_the_rounding_of_a_sum_of_a_hundred_of_the_largest_costs(largest: float) -> None:
    # With 1e-9 whatever the costs, HiGHS cut off the optimum 98584 of a generalised assignment of 100 targets.
    program = Program("large", maximise=True)
    program.add_columns("x", np.arange(100), cost=largest, upper=1.0, integer=True)
    tolerance = feasibility_tolerance(program)
    assert 1e-9 <= tolerance <= 1e-6
    assert tolerance >= min(1e-6, 4 * float(np.spacing(100 * largest)))
