"""The paper's simple rule for the inspection: the best charged robot takes the target nearest to it."""

from __future__ import annotations

from typing import Any

from benchmarks.peers.plans import inspection_plan, without_plan
from benchmarks.peers.registry import Limits, Tell, peer
from react_opt.models.inspection import build
from react_opt.solvers.inspection import simple_rule


@peer("nearest_first", ("inspection",), about="the paper's simple rule, a baseline", package="react_opt")
def nearest_first(instance: Any, limits: Limits, tell: Tell) -> Any:
    """Apply the rule once; it takes no time worth limiting."""
    model = build(instance)
    routes = simple_rule(model.arrays)
    if routes is None:
        return without_plan(instance, "nearest_first", reason="the rule finds no way to an end")
    tell(0.0, model.arrays.worth(routes)[0], None)
    return inspection_plan(instance, model, routes, None, "none", "nearest_first")
