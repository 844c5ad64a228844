"""The numbers of the report, on cases worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from test_verdicts import CASE, run

from benchmarks import measures
from benchmarks.verdicts import exposures


def test_unsolved_runs_count_at_the_limit() -> None:
    assert measures.counted_s(run("a", 1.0, 1.0, "optimal", wall_s=2.0), set()) == 2.0
    assert measures.counted_s(run("a", 1.0, 2.0, wall_s=2.0), set()) == 10.0
    assert measures.counted_s(run("a", 1.0, 1.0, "optimal", wall_s=2.0), {("a", "i")}) == 10.0
    assert measures.counted_s(run("a", 1.0, 1.05, wall_s=2.0, gap_asked=0.1), set()) == 2.0


def test_the_shifted_geometric_mean() -> None:
    assert measures.shifted_mean([1.0, 7.0], 1.0) == pytest.approx(math.sqrt(2 * 8) - 1)


def test_the_primal_integral_is_the_area_under_the_primal_gap() -> None:
    """No plan for 2 s, then one of half the best value for 3 s, then the best: (2 + 0.5 * 3) / 10."""
    found = run("a", 10.0, None, trajectory=[(0.5, None, 50.0), (2.0, 5.0, 50.0), (5.0, 10.0, 50.0)])
    assert measures.primal_integral(found, 10.0) == pytest.approx(0.35)
    assert measures.primal_integral(run("a", None, None, "no_plan"), 10.0) == 1.0
    assert measures.primal_integral(found, None) is None


def test_the_gap_over_time_is_whole_until_plan_and_bound_are_known() -> None:
    found = run("a", 10.0, 11.0, trajectory=[(1.0, 10.0, None), (2.0, 10.0, 15.0), (4.0, 10.0, 11.0)])
    gaps = measures.gap_over_time(found, np.array([0.5, 1.5, 3.0, 5.0]), set())
    assert gaps.tolist() == [1.0, 1.0, 0.5, 0.1]


def test_profiles_compare_solvers_that_met_and_unsolved_is_never_reached() -> None:
    other = {**CASE, "seed": 2}
    runs = [
        run("a", 1.0, 1.0, "optimal", wall_s=1.0), run("b", 1.0, 1.0, "optimal", wall_s=4.0),
        {**run("a", 1.0, 1.0, "optimal", wall_s=2.0), "case": other}, {**run("b", 1.0, 2.0), "case": other},
    ]  # fmt: skip
    ratios = measures.profile(runs, set())
    assert ratios["a"].tolist() == [1.0, 1.0]
    assert ratios["b"].tolist() == [4.0, math.inf]


def test_exponents_are_fitted_on_logarithms() -> None:
    slope, factor = measures.exponent([1, 2, 4, 8], [3.0, 12.0, 48.0, 192.0]) or (0.0, 0.0)
    assert (slope, factor) == (pytest.approx(2.0), pytest.approx(3.0))
    assert measures.exponent([1, 2, 4], [1.0, 2.0, 3.0]) is None


def test_standings_count_solved_best_wrong_and_late() -> None:
    runs = [
        run("a", 10.0, 10.0, "optimal"), run("b", 10.0, 12.0, wall_s=12.0), run("liar", 8.0, 9.0),
        run("none", None, None, "time"),
    ]  # fmt: skip
    rows = {row.peer: row for row in measures.standings(runs, exposures(runs))}
    assert (rows["a"].solved, rows["a"].best, rows["a"].late) == (1, 1, 0)
    assert (rows["b"].solved, rows["b"].best, rows["b"].late) == (0, 1, 1)
    assert (rows["liar"].wrong, rows["liar"].best) == (1, 0)
    assert (rows["none"].without, rows["none"].mean_s) == (1, pytest.approx(10.0))
