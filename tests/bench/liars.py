"""Made-up solvers: one with a wrong plan, one with a false bound, two with false proofs."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.peers import Limits, Tell, peer
from benchmarks.peers.plans import assignment_plan, without_plan
from react_opt import solve
from react_opt.models.assignment import build


def honest(instance: Any, limits: Limits) -> Any:
    return solve(instance, time_limit_s=limits.time_s, threads=1, explain=False)


@peer("wrong_plan", ("assignment",), about="gives a target twice", package="react_opt")
def wrong_plan(instance: Any, limits: Limits, tell: Tell) -> Any:
    plan = honest(instance, limits)
    other = next(robot.id for robot in instance.robots if robot.id != plan.assigned[0].robot)
    twice = plan.assigned[0].model_copy(update={"robot": other})
    return plan.model_copy(update={"assigned": (*plan.assigned, twice)})


@peer("false_bound", ("assignment",), about="calls the empty plan optimal", package="react_opt")
def false_bound(instance: Any, limits: Limits, tell: Tell) -> Any:
    model = build(instance)
    nobody = np.full(len(model.targets), -1, dtype=np.int64)
    return assignment_plan(instance, model, nobody, 0.0, "none", "false_bound")


@peer("false_proof", ("assignment",), about="says that nothing is possible", package="react_opt")
def false_proof(instance: Any, limits: Limits, tell: Tell) -> Any:
    return without_plan(instance, "false_proof", infeasible="robot r0: energy: it has none")


@peer("false_certificate", ("oros",), about="claims less than its certificate proves", package="react_opt")
def false_certificate(instance: Any, limits: Limits, tell: Tell) -> Any:
    plan = solve(instance, time_limit_s=limits.time_s, threads=1)
    prices = {**plan.claim.certificate, "cell_price": [0.0] * len(instance.cells)}
    return plan.model_copy(update={"claim": plan.claim.model_copy(update={"certificate": prices})})
