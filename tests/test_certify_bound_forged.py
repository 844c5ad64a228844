"""Certificates made up to prove less than a plan is worth: each is refused, or its bound stays above the optimum."""

from __future__ import annotations

from typing import Any

import pytest

from react_opt.certify_bound import recompute_bound
from react_opt.errors import UsageError
from react_opt.instance import OrosInstance
from react_opt.solvers.routes.engine import solve_routes
from react_opt.timegraph import route_problem

N, HORIZON = 4, 10


def _complete(battery_j: float = 5000.0, weight: float = 1.0) -> OrosInstance:
    """Cells that are one step from each other, the first one of some weight, and one robot that starts there."""
    robot = {"id": "r", "start": "c0", "battery_j": battery_j, "capacity_j": battery_j, "idle_w": 2.0, "sensing_w": 9.0}
    return OrosInstance.model_validate(
        {
            "kind": "oros",
            "name": "complete",
            "horizon_steps": HORIZON,
            "step_s": 10.0,
            "cells": [{"id": f"c{i}", "x_m": 0.0, "y_m": 0.0, "weight": 1.0 if i else weight} for i in range(N)],
            "travel": [
                {"from": f"c{i}", "to": f"c{j}", "steps": 1, "energy_j": 20.0}
                for i in range(N)
                for j in range(N)
                if i != j
            ],
            "robots": [robot],
        }
    )


def _optimum(instance: OrosInstance) -> float:
    result = solve_routes(route_problem(instance), work_limit=2000)
    assert result.status == "optimal"
    assert result.objective is not None
    return result.objective


def _made_up(**changes: Any) -> dict[str, Any]:
    return {
        "kind": "lagrangian",
        "bound": 0.0,
        "memory": "all",
        "cell_price": [0.0] * N,
        "classes": [{"robots": [0], "best": -1e6}],
        "cuts": [],
        "rows": [],
        **changes,
    }


@pytest.mark.parametrize("joule_price", [0.0, 1.0])
def test_a_battery_that_no_plan_empties_limits_no_partial_route(joule_price: float) -> None:
    """With little memory partial routes sense a cell again and again; they do not displace routes and run dry then."""
    instance = _complete(20.0 * HORIZON + 90.0 * N)
    forged = _made_up(memory=[[i] for i in range(N)])
    forged["classes"][0]["joule_price"] = joule_price
    assert recompute_bound(instance, forged) >= _optimum(instance) - 1e-9


def test_cuts_over_more_than_three_cells_are_refused() -> None:
    """Of more cells a route may collect two more than once; what is said of three would not hold."""
    cut = {"cells": list(range(N)), "memory": list(range(N)), "price": 10.0}
    with pytest.raises(UsageError, match="more than three cells"):
        recompute_bound(_complete(), _made_up(cuts=[cut]))


def test_rows_of_other_rules_are_refused() -> None:
    """A rule that is off counts as a limit of 0 and would make sensing dear for nothing."""
    rows = [{"rule": "forbid_swaps", "cell": 0, "t": t, "price": 1e6} for t in range(1, HORIZON + 1)]
    with pytest.raises(UsageError, match="prices a rule that is none of"):
        recompute_bound(_complete(), _made_up(rows=rows))


@pytest.mark.parametrize("times", [[2**62, 2**62], [2**70, 0]])
def test_multipliers_that_overflow_are_refused(times: list[int]) -> None:
    """The right side of a cut over routes stays above 0."""
    pool = {"cell_price": [0.0] * N, "cuts": [{"cells": [0, 1], "times": times, "over": 1, "price": 1.0}]}
    with pytest.raises(UsageError, match="too large"):
        recompute_bound(_complete(), _made_up(enumerated=True, bound=1.0, pool=[pool]))


def test_a_price_far_below_zero_does_not_swallow_what_routes_are_worth() -> None:
    """The price of a cell that is collected in any case may be negative, but tolerances grow with it."""
    instance = _complete(weight=10.0)
    yes = _made_up(cell_price=[-1e13, *[0.0] * (N - 1)], classes=[{"robots": [0], "best": 1e13 - 3000.0}])
    question = {"cell": 0, "by": 2, "yes": 1, "no": 2}
    forged = {"kind": "tree", "bound": 0.0, "memory": "all", "tree": [question, yes, _made_up()]}
    assert recompute_bound(instance, forged) >= _optimum(instance) - 1e-9


def test_a_tree_without_parts_proves_nothing() -> None:
    """Not even where weights are no whole numbers, so that the bound is not rounded."""
    with pytest.raises(UsageError, match="proves no number"):
        recompute_bound(_complete(weight=0.5), {"kind": "tree", "bound": 0.0, "memory": "all", "tree": []})
