"""CP-SAT computes in whole numbers: what it is given is exact, or refused."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_programs import charging

from react_opt.errors import UsageError
from react_opt.models.program import Program
from react_opt.solvers.lattice import common_step, rational, to_lattice
from react_opt.solvers.outcome import Request
from react_opt.solvers.registry import backend


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (8245.96, Fraction(824596, 100)),  # a decimal of the data
        (0.1 * 3, Fraction(3, 10)),  # 0.30000000000000004, the result of arithmetic
        (1.0 / (1 + 4 * 8245.96), Fraction(100, 100 + 4 * 824596)),  # the default sigma
        (-16.9 * 10, Fraction(-169)),
        (0.0, Fraction(0)),
        (1e-7, Fraction(1, 10**7)),
    ],
)
def test_a_float_is_the_number_it_looks_like(value: float, expected: Fraction) -> None:
    assert rational(value) == expected


@settings(derandomize=True, deadline=None, max_examples=300)
@given(st.floats(min_value=-1e9, max_value=1e9, allow_nan=False).filter(lambda v: abs(v) > 1e-9 or v == 0))
def test_reading_a_float_never_costs_precision(value: float) -> None:
    assert abs(rational(value) - Fraction(value)) <= 4 * Fraction(float(np.spacing(abs(value))))


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.lists(st.fractions(max_denominator=1000), min_size=1, max_size=6))
def test_the_common_step_divides_all_and_is_the_largest_to_do_so(values: list[Fraction]) -> None:
    step = common_step(values)
    wholes = [value / step for value in values]
    assert all(whole.denominator == 1 for whole in wholes)
    if any(values):
        assert math.gcd(*(int(whole) for whole in wholes)) == 1


def test_a_battery_with_a_charger_lies_on_a_lattice_of_tenths() -> None:
    lattice = to_lattice(charging())
    continuous = [step for step, whole in zip(lattice.step, charging().integer, strict=True) if not whole]
    assert set(continuous) == {Fraction(1, 10)}  # of 4, 3.1, 2.5, 1.2 and 9.3
    assert max(lattice.upper) == 93


def test_cp_sat_charges_fully_and_records_its_scaling() -> None:
    outcome = backend("cp-sat").solve(charging(), Request())
    assert outcome.status == "optimal"
    assert outcome.objective == pytest.approx(1.59, abs=1e-12)
    assert outcome.bound == pytest.approx(1.59, abs=1e-12)
    assert outcome.settings["scaling"] == {"objective": "100", "steps": ["1/10"]}


@settings(derandomize=True, deadline=None, max_examples=12)
@given(
    power=st.integers(1, 60).map(lambda v: v / 16),
    capacity=st.integers(40, 120).map(lambda v: v / 10),
)
def test_cp_sat_and_highs_agree_on_chargers(power: float, capacity: float) -> None:
    program = charging(power, capacity)
    exact = backend("cp-sat").solve(program, Request())
    assert exact.status == "optimal"
    assert exact.objective == pytest.approx(backend("highs").solve(program, Request()).objective, abs=1e-9)


def refused(program: Program) -> str:
    with pytest.raises(UsageError) as caught:
        backend("cp-sat").solve(program, Request())
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_coefficients_of_several_sizes_are_refused() -> None:
    program = Program("sizes")
    x = program.add_columns("x", [0, 1], cost=1.0, upper=1.0)
    program.add_rows("mix", [0], row=[0, 0], column=x, value=[1.0, 0.5], upper=1.0)
    assert "the row mix_0 have coefficients of several sizes" in refused(program)


def test_a_circle_of_continuous_columns_is_refused() -> None:
    """x + y <= 1, y + z <= 1, z + x <= 1 has the vertex (1/2, 1/2, 1/2), off every lattice of its data."""
    program = Program("circle")
    x = program.add_columns("x", [0, 1, 2], cost=1.0, upper=1.0)
    program.add_rows("pair", [0, 1, 2], row=[0, 0, 1, 1, 2, 2], column=[0, 1, 1, 2, 2, 0], value=1.0, upper=1.0)
    assert len(x) == 3
    assert "linked in a circle" in refused(program)
    assert backend("highs").solve(program, Request()).objective == pytest.approx(1.5)


def test_numbers_that_have_no_common_step_are_refused() -> None:
    program = Program("fine")
    rng = np.random.default_rng(0)
    take = program.add_columns("take", np.arange(6), cost=1.0, upper=1.0, integer=True)
    program.add_rows("weight", [0], row=np.zeros(6), column=take, value=rng.random(6), upper=1.0)
    assert "the row weight_0 needs whole numbers above 2**60" in refused(program)


def test_an_objective_too_fine_is_refused() -> None:
    program = Program("fine objective")
    program.add_columns("take", [0, 1], cost=[1.0, 1e-12], upper=1e9, integer=True)
    assert "the objective needs whole numbers above 2**60" in refused(program)


def test_bounds_that_no_whole_number_meets_are_infeasible() -> None:
    program = Program("between")
    program.add_columns("x", [0], cost=1.0, lower=0.25, upper=0.75, integer=True)
    assert backend("cp-sat").solve(program, Request()).status == "infeasible"


def test_missing_bounds_come_from_the_rows() -> None:
    """3 x + y <= 10 and y >= 1 with x, y whole: x ends at 3, without a bound of its own."""
    program = Program("implied")
    x = program.add_columns("x", [0], cost=1.0, integer=True)
    y = program.add_columns("y", [0], lower=1.0, integer=True)
    program.add_rows("most", [0], row=[0, 0], column=[x[0], y[0]], value=[3.0, 1.0], upper=10.0)
    outcome = backend("cp-sat").solve(program, Request())
    assert (outcome.status, outcome.objective) == ("optimal", 3.0)
