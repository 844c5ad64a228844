"""Brute force, a second formulation, every backend and the decomposition agree on random tiny instances.

They agree by objective, never by plan: ties are anybody's. The instances use every option of the format (see
``strategies.py``), and about a quarter of them is infeasible.
"""

from __future__ import annotations

from functools import cache

import pytest
from brute import brute_force
from cvxpy_oros import optimum
from strategies import random_oros

from react_opt import check, solve
from react_opt.errors import UsageError
from react_opt.solvers import oros
from react_opt.solvers.registry import names

SEEDS = range(200)
WAYS = ["auto", "routes", *names()]
REFUSALS = {"cp-sat"}  # it computes in whole numbers


@cache
def truth(seed: int) -> float | None:
    """Return the optimum of an instance by brute force, None where it is infeasible."""
    return brute_force(random_oros(seed))


def same(found: float | None, expected: float | None) -> bool:
    """Return whether two optima are the same: 1e-6 of the objective is what counts as optimal at most."""
    if found is None or expected is None:
        return found is expected
    return abs(found - expected) <= 1e-6 * abs(expected) + 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_the_second_formulation_agrees_with_brute_force(seed: int) -> None:
    found = optimum(random_oros(seed))
    assert same(found, truth(seed)), f"expected {truth(seed)}, found {found}"


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("way", WAYS)
def test_the_product_agrees_with_brute_force(way: str, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A way may refuse what it cannot state exactly, in a line; whatever it answers is right, proven and checked."""
    monkeypatch.setattr(oros, "IMPROVE_S", 0.01)  # of primal search before the monolith, which needs no help here
    instance = random_oros(seed)
    options = {"auto": {}, "routes": {"method": "routes"}}.get(way, {"solver": way})
    try:
        plan = solve(instance, time_limit_s=20.0, threads=1, **options)
    except UsageError as refused:
        if way not in REFUSALS:
            raise
        pytest.skip(str(refused))
    certificate = check(instance, plan)
    assert certificate.violations == ()
    if way == "routes" and instance.limits.forbid_swaps and plan.claim.status in ("feasible", "no_plan"):
        # Swaps are left out of the decomposition's bound, so alone it may end without a proof; auto goes on.
        assert plan.claim.bound is not None
        assert truth(seed) is None or plan.claim.bound >= truth(seed) - 1e-6
        return
    assert plan.claim.status == ("infeasible" if truth(seed) is None else "optimal")
    assert same(certificate.objective, truth(seed)), f"expected {truth(seed)}, found {certificate.objective}"
    if truth(seed) is not None:
        assert plan.claim.bound >= truth(seed) - 1e-6 * abs(truth(seed))
