"""From what is known of an OROS instance to its plan: the best candidate that the checker accepts, and its claim."""

from __future__ import annotations

import time
from typing import Any

from react_opt.certify import check
from react_opt.claims import instance_ref, optimality_tolerance, relaxation_bound, versions
from react_opt.errors import ReactError
from react_opt.instance import OrosInstance
from react_opt.models.readback import fill_plan
from react_opt.options import SolveOptions
from react_opt.plan import Claim, OrosPlan, gap_of
from react_opt.solvers.oros_search import Search


def answer(search: Search) -> OrosPlan:
    """Return the best candidate that the checker accepts."""
    begun = time.perf_counter()
    options = search.options
    rejected: list[str] = []
    for worth, routes in sorted(search.candidates, key=lambda candidate: -candidate[0]):
        plan = fill_plan(search.instance, search.problem, routes, _shell(search, worth, rejected))
        found = check(search.instance, plan)
        if found.ok:
            wall_s = {**search.wall_s, "check": time.perf_counter() - begun}
            return plan.model_copy(update={"claim": plan.claim.model_copy(update={"wall_s": wall_s})})
        rejected.append(str(found.violations[0]))
    if rejected:
        raise ReactError(f"no plan passed the checker; please report this: {rejected[0]}")
    if search.infeasible is not None:
        claim = Claim(status="infeasible", reason=search.infeasible)
    else:
        limit = "interrupt" if options.stopped() else search.limit
        claim = Claim(status="no_plan", limit=limit, bound=search.bound + search.constant)  # type: ignore[arg-type]
    return without_plan(search.instance, options, claim.model_copy(update={"method": search.method, **_common(search)}))


def _shell(search: Search, worth: float, rejected: list[str]) -> OrosPlan:
    """Return a plan with its claim and no robots yet."""
    objective = worth + search.constant
    bound = max(search.bound + search.constant, objective)  # a bound within rounding of the objective
    slack = optimality_tolerance(objective, search.problem.sigma)
    false_bound = search.bound + search.constant < objective - max(slack, 1e-9)
    if false_bound:  # proven wrong by this plan: nothing is known but the relaxation
        bound = relaxation_bound(search.problem) + search.constant
        rejected = [*rejected, f"the bound {search.bound + search.constant} is below a checked plan"]
    optimal = not rejected and bound - objective <= slack
    common = _common(search)
    if rejected:
        common["settings"] = {**common["settings"], "rejected": rejected}
    if search.options.stopped() and not optimal:
        common["limit"] = "interrupt"
    elif not optimal:
        common["limit"] = search.limit
    claim = Claim(
        status="optimal" if optimal else "feasible",
        objective=objective,
        bound=bound,
        gap=gap_of(objective, bound),
        method=search.method or "greedy: its value meets the relaxation bound",
        **common,
    )
    return OrosPlan(instance=instance_ref(search.instance), claim=claim)


def _common(search: Search) -> dict[str, Any]:
    options = search.options
    return {
        "solver": search.solver,
        "versions": versions(*search.packages),
        "seed": options.seed,
        "threads": options.threads,
        "settings": {
            "time_limit_s": options.time_limit_s,
            "work_limit": options.work_limit,
            "gap": options.gap,
            **({} if search.at_step is None else {"kept_steps": search.at_step}),
            **search.settings,
        },
        "certificate": search.certificate,
        "wall_s": dict(search.wall_s),
    }


def without_plan(instance: OrosInstance, options: SolveOptions, claim: Claim) -> OrosPlan:
    """Return a plan that holds its claim alone."""
    update = {"seed": options.seed, "threads": options.threads, "versions": claim.versions or versions()}
    return OrosPlan(instance=instance_ref(instance), claim=claim.model_copy(update=update))
