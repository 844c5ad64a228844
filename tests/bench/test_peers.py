"""Every solver of the benchmark that is free for all, on tiny instances: what it finds, proves and says on the way."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest
from extras import need

from benchmarks import runner
from benchmarks.families import FAMILIES
from benchmarks.peers import PEERS, Limits
from benchmarks.suites import COMMERCIAL, Suite, of_family
from react_opt import check, jsonio, solve
from react_opt.errors import UsageError
from react_opt.solvers.warm import tiny_instances

FREE = [name for name in PEERS if name not in COMMERCIAL]
MODULES = {"pyvrp": "pyvrp", "glpk": "cvxopt", "cbc": "cylp"}  # of the extra ``peers``
MEETINGS = [
    pytest.param(name, kind, marks=pytest.mark.extras if name in MODULES else ())
    for name in FREE
    for kind in PEERS[name].kinds
]


@cache
def cases(kind: str) -> list[Any]:
    """The smallest instances there are: what solvers warm up with, and the smallest of every family."""
    made = [
        family.make(seed=1, **family.sizes["tiny"]) for family in FAMILIES.values() if family.kind == kind != "oros"
    ]
    return [*tiny_instances(kind), *map(jsonio.parse, made)]


@cache
def optimum(kind: str, number: int) -> float:
    plan = solve(cases(kind)[number], threads=1, explain=False)
    assert plan.claim.status == "optimal"
    return float(plan.claim.objective)


@pytest.mark.parametrize(("name", "kind"), MEETINGS)
def test_a_solver_answers_rightly_and_proves_what_it_can(name: str, kind: str) -> None:
    if name in MODULES:
        need(MODULES[name], "peers")
    peer = PEERS[name]
    assert peer.missing() is None
    met = 0
    for number, instance in enumerate(cases(kind)):
        if not peer.takes(instance):
            continue
        best = optimum(kind, number)
        slack = 1e-6 * abs(best) + 1e-6
        told: list[tuple[float | None, float | None]] = []

        def tell(at_s: float, value: float | None, bound: float | None, told: Any = told) -> None:
            told.append((value, bound))

        try:
            plan = peer.solve(instance, Limits(0.3 if peer.endless else 60.0), tell)
        except UsageError:  # it says that it cannot state this one without loss
            assert name == "cp-sat"
            continue
        met += 1
        assert check(instance, plan).violations == ()
        assert plan.claim.objective is None or plan.claim.objective <= best + slack
        for value, bound in (*told, (plan.claim.objective, plan.claim.bound)):
            assert value is None or value <= best + slack
            assert bound is None or bound >= best - slack
        if not peer.endless and name != "nearest_first":
            assert plan.claim.status == "optimal"
            assert plan.claim.objective == pytest.approx(best, rel=1e-6)
    assert met > 0


@pytest.mark.extras
def test_a_suite_on_a_ray_cluster_has_the_answers_of_one_without(tmp_path: Any) -> None:
    need("ray", "ray")
    suite = Suite("trial", "", 20.0, tuple(of_family("conflicts", "tiny", [1], ("react_opt", "highs"))))
    answers = []
    for cluster in (None, "local"):
        settings = runner.Settings(cluster=cluster, workers=2)
        jobs = runner.jobs_of(suite, settings)
        runs = runner.runs_of(runner.run(suite, settings, str(tmp_path / f"{cluster}.jsonl"), jobs))
        answers.append([(run["key"], run["status"], run["objective"], run["bound"], run["violations"]) for run in runs])
    assert answers[0] == answers[1]
    assert [status for _, status, *_ in answers[0]] == ["optimal", "optimal"]
