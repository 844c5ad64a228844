"""Every backend on small programs whose optimum is known, and on what goes wrong; expected values in words."""

from __future__ import annotations

import sys
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest
from small_programs import battery, hard, knapsack

from react_opt.errors import MissingPartError, UsageError
from react_opt.models.program import Program
from react_opt.solvers.backend import Backend
from react_opt.solvers.outcome import Outcome, Request
from react_opt.solvers.registry import backend, installed, names

NAMES = ["highs", "cp-sat", "scip", "cvxpy:SCIP", "cvxpy:HIGHS", "cvxpy:SCIPY"]


@pytest.fixture(params=NAMES)
def solver(request: pytest.FixtureRequest) -> Backend:
    return backend(request.param)


def believable(program: Program, outcome: Outcome) -> None:
    assert outcome.x is not None
    assert program.violation(outcome.x) <= 1e-6
    assert outcome.objective == program.objective(outcome.x)
    if outcome.bound is not None:
        assert outcome.bound >= outcome.objective if program.maximise else outcome.bound <= outcome.objective


def test_the_best_two_items_fit_together(solver: Backend) -> None:
    outcome = solver.solve(knapsack(), Request())
    assert (outcome.status, outcome.limit) == ("optimal", "none")
    assert outcome.objective == pytest.approx(20.0, abs=1e-9)
    assert outcome.bound == pytest.approx(20.0, abs=1e-6)
    assert outcome.x is not None
    assert outcome.x.tolist() == [0.0, 1.0, 1.0]
    assert outcome.solver == solver.name
    assert outcome.version == solver.version


def test_a_minimum_has_its_bound_below(solver: Backend) -> None:
    program = knapsack(maximise=False)
    outcome = solver.solve(program, Request())
    assert outcome.status == "optimal"
    assert outcome.objective == pytest.approx(-20.0, abs=1e-9)
    believable(program, outcome)


def test_what_is_left_in_the_battery_counts(solver: Backend) -> None:
    outcome = solver.solve(battery(), Request())
    assert outcome.status == "optimal"
    assert outcome.objective == pytest.approx(1.015, abs=1e-9)
    believable(battery(), outcome)


def test_a_proven_contradiction_is_infeasible(solver: Backend) -> None:
    program = knapsack()
    program.add_rows("two", [0], row=[0, 0], column=[0, 1], value=1.0, lower=2.0)
    outcome = solver.solve(program, Request())
    assert (outcome.status, outcome.limit) == ("infeasible", "none")
    assert (outcome.x, outcome.objective, outcome.bound) == (None, None, None)


def test_an_endless_objective_is_neither_infeasible_nor_bounded(solver: Backend) -> None:
    program = Program("endless")
    column = program.add_columns("x", [0], cost=1.0, integer=True)
    program.add_rows("least", [0], row=[0], column=column, value=2.0, lower=7.0)
    if solver.abilities.integer_only:
        with pytest.raises(UsageError, match="x_0 has no finite bounds"):
            solver.solve(program, Request())
        return
    outcome = solver.solve(program, Request())
    assert outcome.status in ("feasible", "no_solution")
    assert outcome.bound is None
    notes = " ".join(outcome.settings["notes"])
    assert "unbounded" in notes or "failed" in notes  # scipy's HiGHS only says that it failed


def test_a_contradiction_under_an_endless_objective_is_infeasible(solver: Backend) -> None:
    """Presolve may only find that a program is unbounded or infeasible; which of the two has to be found out."""
    program = Program("both")
    column = program.add_columns("x", [0, 1], cost=[1.0, 0.0], upper=[1e6 if _whole(solver) else np.inf, 9.0])
    whole = program.add_columns("n", [0], upper=9.0, integer=True)
    program.add_rows("half", [0, 1], row=[0, 1, 1], column=[whole[0], whole[0], column[1]], value=[2.0, 1.0, 1.0],
                     lower=[3.0, 0.0], upper=[3.0, 1.0])  # fmt: skip
    assert solver.solve(program, Request()).status == "infeasible"


def _whole(solver: Backend) -> bool:
    return solver.abilities.integer_only


def test_neither_rows_nor_columns_are_needed(solver: Backend) -> None:
    outcome = solver.solve(Program("nothing"), Request())
    assert (outcome.status, outcome.objective, outcome.bound) == ("optimal", 0.0, 0.0)
    program = Program("no rows")
    program.add_columns("x", [0, 1], cost=[1.0, -1.0], upper=3.5, integer=True)
    program.add_columns("none", np.empty((0, 1)))
    outcome = solver.solve(program, Request())
    assert outcome.status == "optimal"
    assert outcome.objective == pytest.approx(3.0, abs=1e-9)
    assert solver.solve(_impossible_without_columns(), Request()).status == "infeasible"


def _impossible_without_columns() -> Program:
    program = Program("nothing is not enough")
    program.add_rows("least", [0], row=[], column=[], value=1.0, lower=1.0)
    return program


def test_rows_with_two_sides_and_whole_columns_below_zero(solver: Backend) -> None:
    """-7 <= 2 x + y <= -4 with x in -3..3 whole and y in 0..1: least 3 x is at x = -3, where 2 x + y <= -5 holds."""
    program = Program("sides", maximise=False)
    x = program.add_columns("x", [0], cost=3.0, lower=-3.0, upper=3.0, integer=True)
    y = program.add_columns("y", [0], cost=0.5, upper=1.0)
    program.add_rows("sides", [0], row=[0, 0], column=[x[0], y[0]], value=[2.0, 1.0], lower=-7.0, upper=-4.0)
    outcome = solver.solve(program, Request())
    assert outcome.status == "optimal"
    assert outcome.objective == pytest.approx(-9.0, abs=1e-9)


def test_no_time_at_all_is_an_answer(solver: Backend) -> None:
    outcome = solver.solve(hard(), Request(time_limit_s=0.0))
    assert (outcome.status, outcome.limit, outcome.bound) == ("no_solution", "time", None)


def test_a_deadline_leaves_the_best_known(solver: Backend) -> None:
    program = hard()
    outcome = solver.solve(program, Request(time_limit_s=0.5, start=np.zeros(program.n_columns)))
    assert (outcome.status, outcome.limit) == ("feasible", "time")
    believable(program, outcome)


def test_a_start_is_never_lost(solver: Backend) -> None:
    """Stopped at once, every solver answers at least as well as the solution it was given."""
    program = hard()
    start = np.zeros(program.n_columns)
    for column in np.argsort(-program.cost):  # greedy: the dearest first, as long as they fit
        start[column] = 1.0
        start[column] = float(program.violation(start) == 0.0)
    stopped = solver.solve(program, Request(start=start, should_stop=lambda: True))
    assert stopped.limit == "interrupt"
    assert stopped.objective is not None
    assert stopped.objective >= program.objective(start) > 0.0


def test_a_start_that_breaks_a_row_is_not_believed(solver: Backend) -> None:
    outcome = solver.solve(knapsack(), Request(start=np.ones(3), should_stop=lambda: True))
    assert outcome.objective is None or outcome.objective <= 20.0
    if outcome.x is None:
        assert any("the start violates" in note for note in outcome.settings["notes"])


def test_a_start_of_another_program_is_a_mistake(solver: Backend) -> None:
    with pytest.raises(UsageError, match=r"shape \(2,\)"):
        solver.solve(knapsack(), Request(start=np.zeros(2)))


def test_an_interrupt_ends_the_solve(solver: Backend) -> None:
    polls = count()
    outcome = solver.solve(hard(), Request(time_limit_s=30.0, should_stop=lambda: next(polls) > 5))
    assert outcome.limit == "interrupt"
    assert outcome.wall_s < 15.0


def test_ctrl_c_ends_the_solve_with_what_is_known(solver: Backend) -> None:
    polls = count()

    def pressed() -> bool:
        if next(polls) == 5:
            raise KeyboardInterrupt
        return False

    program = hard()
    start = np.zeros(program.n_columns)
    outcome = solver.solve(program, Request(time_limit_s=30.0, should_stop=pressed, start=start))
    assert outcome.limit == "interrupt"
    assert outcome.objective is not None
    assert outcome.objective >= 0.0


def test_progress_tells_time_incumbent_and_bound(solver: Backend) -> None:
    told: list[tuple[float, float | None, float | None]] = []
    solver.solve(hard(), Request(time_limit_s=0.6, on_progress=lambda *state: told.append(state)))
    assert told
    assert [state[0] for state in told] == sorted(state[0] for state in told)
    for _, incumbent, bound in told:
        assert incumbent is None or bound is None or incumbent <= bound + 1e-6


def test_counted_work_is_reproducible(solver: Backend) -> None:
    request = Request(work_limit=3, seed=7)
    if solver.abilities.work_unit is None:
        with pytest.raises(UsageError, match="no reproducible work limit"):
            solver.solve(hard(), request)
        return
    program = hard(60, 6)
    one, two = solver.solve(program, request), solver.solve(program, request)
    assert one.limit == two.limit == "work"
    assert (one.objective, one.bound) == (two.objective, two.bound)
    assert one.x is two.x is None or np.array_equal(one.x, two.x)  # type: ignore[arg-type]


def test_unknown_names_are_refused_with_the_known_ones() -> None:
    with pytest.raises(UsageError, match="no solver 'simplex'; there are highs, cp-sat, scip, cvxpy"):
        backend("simplex")
    with pytest.raises(UsageError, match="no solver 'highs:fast'"):
        backend("highs:fast")
    with pytest.raises(UsageError, match="cvxpy knows no mixed-integer solver 'GUESS'"):
        backend("cvxpy:GUESS")


@pytest.mark.parametrize(
    ("name", "library", "install"),
    [
        ("highs", "highspy", "pip install highspy"),
        ("cp-sat", "ortools", "pip install ortools"),
        ("scip", "ortools", "pip install ortools"),
        ("cvxpy", "cvxpy", "pip install cvxpy"),
    ],
)
def test_a_missing_library_is_named(name: str, library: str, install: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingPartError, match=install):
        backend(name)
    missing = {line.name: line for line in installed() if line.version is None}
    assert install in missing[name].missing


def test_a_solver_that_cvxpy_does_not_find_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import react_opt.solvers.cvxpy_ as module

    monkeypatch.setattr(module, "mip_solvers", lambda: ["HIGHS"])
    with pytest.raises(MissingPartError, match="CBC: pip install cylp"):
        backend("cvxpy:CBC")
    assert backend("cvxpy").name == "cvxpy:HIGHS"  # the first one found, by its own name


def test_a_library_that_does_not_load_is_not_called_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    import react_opt.solvers.registry as module

    def broken(name: str) -> SimpleNamespace:
        raise ImportError("undefined symbol")

    monkeypatch.setattr(module, "import_module", broken)
    with pytest.raises(MissingPartError, match=r"does not load.*undefined symbol"):
        backend("highs")


def test_every_solver_is_listed_with_what_it_can_do() -> None:
    listed = {line.name: line for line in installed()}
    assert set(names()) <= set(listed)
    assert {name for name in listed if name.startswith("cvxpy:")} >= {"cvxpy:HIGHS", "cvxpy:SCIPY"}
    for line in listed.values():
        assert line.version
        assert line.abilities is not None
        assert line.missing == ""
