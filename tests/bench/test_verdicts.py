"""Wrong answers are exposed, right ones are not."""

from __future__ import annotations

from typing import Any

import pytest

from benchmarks.compare import compare
from benchmarks.report import Results
from benchmarks.verdicts import confirmation, exposures, meetings, truth_of

CASE = {"family": "f", "parameters": {}, "seed": 1}


def run(peer: str, objective: float | None, bound: float | None, status: str = "feasible", **more: Any) -> Any:
    return {
        "what": "solve", "instance": "i", "case": CASE, "gap_asked": 0.0, "peer": peer, "status": status,
        "objective": objective, "bound": bound, "violations": [], "tolerance": None, "wall_s": 1.0, "limit_s": 10.0,
        "trajectory": [], **more,
    }  # fmt: skip


def faults(*runs: Any) -> list[tuple[str, str]]:
    return [(item.peer, item.fault) for item in exposures(runs)]


def test_answers_that_agree_are_all_right() -> None:
    runs = [run("a", 10.0, 10.0, "optimal"), run("b", 10.0, 10.0 + 1e-7, "optimal"), run("c", 8.0, None)]
    assert faults(*runs, run("d", None, None, "no_plan")) == []
    truth = truth_of(runs)
    assert (truth.best, truth.optimal, truth.infeasible) == (10.0, True, False)


def test_a_plan_that_breaks_a_rule_is_exposed_and_proves_nothing() -> None:
    liar = run("liar", 99.0, None, violations=["battery: robot r0 at t 3"])
    assert faults(run("a", 10.0, 11.0), liar) == [("liar", "plan")]


def test_a_bound_that_a_checked_plan_beats_is_exposed() -> None:
    assert faults(run("a", 10.0, None), run("liar", 8.0, 9.0)) == [("liar", "bound")]
    assert faults(run("a", 10.0, None), run("liar", None, 9.0, "no_plan")) == [("liar", "bound")]


def test_a_bound_that_was_false_only_on_the_way_is_exposed() -> None:
    assert faults(run("liar", 10.0, 12.0, trajectory=[(0.1, 5.0, 9.0), (0.2, 10.0, 12.0)])) == [("liar", "bound")]


def test_of_two_proven_optima_that_differ_the_worse_is_exposed() -> None:
    assert faults(run("a", 10.0, 10.0, "optimal"), run("liar", 9.0, 9.0, "optimal")) == [("liar", "bound")]
    assert faults(run("a", 10.0, 10.0, "optimal"), run("liar", 9.0, None, "optimal")) == [("liar", "optimal")]


def test_a_false_proof_that_no_plan_exists_is_exposed_and_a_true_one_is_not() -> None:
    liar = run("liar", None, None, "infeasible")
    assert faults(run("a", 10.0, None), liar) == [("liar", "infeasible")]
    assert faults(liar, run("b", None, None, "no_plan")) == []
    assert truth_of([liar]).infeasible


@pytest.mark.parametrize(
    ("certified", "notes", "expected", "exposed"),
    [
        (None, [], "none", False),
        ({"bound": 12.0, "why": ""}, [], "confirmed", False),
        ({"bound": 11.0, "why": ""}, [], "confirmed", False),
        ({"bound": 13.0, "why": ""}, [], "refuted", True),
        ({"bound": 13.0, "why": ""}, ["bound from the enumeration of 7 routes"], "partly", False),
        ({"bound": None, "why": "the certificate is of an unknown kind"}, [], "refuted", True),
        ({"bound": None, "why": "killed after 60 s"}, [], "not recomputed", False),
    ],
)
def test_a_bound_is_held_against_its_certificate(
    certified: Any, notes: list[str], expected: str, exposed: bool
) -> None:
    told = run("a", 10.0, 12.0, certified=certified, notes=notes)
    assert confirmation(told) == expected
    assert bool(exposures([told])) is exposed


def test_the_joule_settles_when_two_values_agree() -> None:
    """With 1e-4 a joule, values of 1000 that differ by 2e-4 differ by two joules: the bound is beaten."""
    a, b = run("a", 1000.0002, None, tolerance=1e-4), run("b", 1000.0, 1000.0, "optimal", tolerance=1e-4)
    assert faults(a, b) == [("b", "bound")]
    assert faults(run("a", 1000.00005, None, tolerance=1e-4), b) == []


def test_a_second_objective_that_is_undercut_is_exposed() -> None:
    proven = {"objective": 50.0, "bound": 50.0, "status": "optimal"}
    better = {"objective": 40.0, "bound": None, "status": "feasible"}
    runs = [run("liar", 10.0, 10.0, "optimal", secondary=proven), run("a", 10.0, None, secondary=better)]
    assert faults(*runs) == [("liar", "second objective")]
    runs[1] = run("a", 9.0, None, secondary=better)
    assert faults(*runs) == []


def test_runs_of_other_instances_say_nothing() -> None:
    other = {**run("liar", 5.0, 5.0, "optimal"), "case": {**CASE, "seed": 2}}
    assert faults(run("a", 10.0, None), other) == []


def test_what_was_found_under_other_limits_is_held_against_an_answer() -> None:
    longer = {**run("a", 10.0, None), "limit_s": 100.0}
    assert faults(longer, run("liar", 8.0, 9.0)) == [("liar", "bound")]
    assert len(meetings([longer, run("liar", 8.0, 9.0), run("b", 7.0, None)])) == 2


def of_machine(*runs: Any) -> Results:
    return Results((), tuple({"sha256": "1", **one} for one in runs), ())


def test_cut_off_runs_may_differ_between_machines_but_not_contradict_each_other() -> None:
    """A slower machine has a worse plan and a worse bound; below another's checked plan no bound may lie."""
    fast, slow = of_machine(run("a", 10.0, 12.0)), of_machine(run("a", 7.0, 14.0))
    assert (compare(fast, slow).differences, compare(fast, slow).contradictions) == ([], [])
    false = of_machine(run("a", 7.0, 9.0))
    for found in (compare(fast, false), compare(false, fast)):
        assert (found.solved, found.differences, len(found.contradictions)) == (0, [], 1)
        assert "9 is beaten by a checked plan of a: 10" in found.contradictions[0]
    renamed = of_machine(run("a", 7.0, 9.0, sha256="2"))
    assert compare(fast, renamed).contradictions == []
    assert "another instance" in compare(fast, renamed).differences[0]


def test_what_a_file_refutes_by_itself_is_in_its_own_report() -> None:
    exposed = of_machine(run("a", 10.0, 12.0), run("liar", 8.0, 9.0))
    assert compare(exposed, of_machine(run("a", 10.0, 12.0))).contradictions == []
    proofs = compare(of_machine(run("a", 10.0, 12.0)), of_machine(run("a", None, None, "infeasible")))
    assert len(proofs.contradictions) == 1
