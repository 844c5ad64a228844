"""The sparse program: blocks, names, and what it refuses."""

import numpy as np
import pytest

from react_opt.models.program import Program


def knapsack() -> Program:
    """max 3 x0 + 2 x1 + y  s.t.  2 x0 + 2 x1 <= 3,  y <= 0.5 x0."""
    program = Program("knapsack")
    x = program.add_columns("x", [0, 1], cost=[3.0, 2.0], upper=1.0, integer=True)
    y = program.add_columns("y", [[0, 7]], cost=1.0)
    program.add_rows("weight", [0], row=[0, 0], column=x, value=2.0, upper=3.0)
    program.add_rows("link", [0], row=[0, 0], column=[y[0], x[0]], value=[1.0, -0.5], upper=0.0)
    return program


def test_blocks_hold_their_columns_and_names() -> None:
    program = knapsack()
    assert program.n_columns == 3
    assert program.n_rows == 2
    assert program.column_labels() == ["x_0", "x_1", "y_0_7"]
    assert program.row_labels() == ["weight_0", "link_0"]
    assert program.matrix().toarray().tolist() == [[2, 2, 0], [-0.5, 0, 1]]
    assert program.integer.tolist() == [True, True, False]


def test_objective_and_violation() -> None:
    program = knapsack()
    assert program.objective(np.array([1.0, 0.0, 0.5])) == 3.5
    assert program.violation(np.array([1.0, 0.0, 0.5])) == 0.0
    assert program.violation(np.array([1.0, 1.0, 0.5])) == 1.0  # weight 4 where 3 are allowed
    assert program.violation(np.array([0.25, 0.0, 0.0])) == 0.25  # a quarter is no whole number
    assert program.violation(np.array([0.0, 0.0, 0.75])) == 0.75  # y without x0


def test_repeated_entries_add_up_and_zeros_vanish() -> None:
    program = Program("p")
    x = program.add_columns("x", [0, 1])
    program.add_rows("r", [0], row=[0, 0, 0], column=[x[0], x[0], x[1]], value=[1.0, 2.0, 0.0])
    assert program.matrix().toarray().tolist() == [[3, 0]]
    assert program.matrix().nnz == 1


def test_fixed_leaves_the_program_untouched() -> None:
    program = knapsack()
    fixed = program.fixed({1: 1.0})
    assert fixed.lower[1] == fixed.upper[1] == 1.0
    assert program.lower[1] == 0.0


@pytest.mark.parametrize(("row", "column", "message"), [(1, 0, "row number"), (0, 3, "column number")])
def test_entries_outside_are_refused(row: int, column: int, message: str) -> None:
    program = knapsack()
    with pytest.raises(ValueError, match=message):
        program.add_rows("outside", [0], row=[row], column=[column], value=1.0)


def test_a_name_is_taken_once() -> None:
    program = knapsack()
    with pytest.raises(ValueError, match="already has columns 'x'"):
        program.add_columns("x", [0])
    with pytest.raises(ValueError, match="already has rows 'link'"):
        program.add_rows("link", [0], row=[0], column=[0], value=1.0)


def test_empty_program() -> None:
    program = Program("nothing")
    assert program.matrix().shape == (0, 0)
    assert program.violation(np.empty(0)) == 0.0
