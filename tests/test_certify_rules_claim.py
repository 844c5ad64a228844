"""A good OROS plan broken in its objective and its claim: exactly the broken rules are named."""

from __future__ import annotations

import pytest
from broken_rules import Breaks, expect
from good_plan import Break, Data
from test_certify_rules_battery import breaks as of_batteries
from test_certify_rules_motion import breaks as of_motion

from react_opt.certify_oros import RULES

breaks = Breaks()


# --- objective and claim ---


@breaks("objective")
def a_coverage_misstated(case: Data, plan: Data) -> None:
    plan["objective"]["coverage"] += 1.0


@breaks("objective")
def a_battery_term_misstated(case: Data, plan: Data) -> None:
    plan["objective"]["battery"] *= 1.0001


@breaks("objective")
def the_joules_left_misstated(case: Data, plan: Data) -> None:
    plan["objective"]["battery_j"] += 0.1


@breaks("objective")
def a_total_misstated(case: Data, plan: Data) -> None:
    plan["objective"]["total"] += 0.001


@breaks("objective")
def no_objective(case: Data, plan: Data) -> None:
    plan["objective"] = None


@breaks("claim")
def another_objective_claimed(case: Data, plan: Data) -> None:
    plan["claim"] |= {"objective": 30.91, "gap": 0.09 / 30.91}


@breaks("claim")
def no_objective_claimed(case: Data, plan: Data) -> None:
    plan["claim"] |= {"objective": None, "gap": None}


@breaks("claim")
def a_gap_misstated(case: Data, plan: Data) -> None:
    plan["claim"]["gap"] = 0.001


@breaks("claim")
def no_gap_where_it_is_known(case: Data, plan: Data) -> None:
    plan["claim"]["gap"] = None


@breaks("claim")
def a_gap_without_a_bound(case: Data, plan: Data) -> None:
    plan["claim"]["bound"] = None


@breaks("claim")
def a_bound_below_the_objective(case: Data, plan: Data) -> None:
    plan["claim"] |= {"bound": 30.8, "gap": 0.1 / 30.9}


@breaks("claim")
def optimal_without_a_bound(case: Data, plan: Data) -> None:
    plan["claim"] |= {"status": "optimal", "bound": None, "gap": None}


@breaks("claim")
def optimal_with_a_gap(case: Data, plan: Data) -> None:
    """1e-6 of 30.9 is allowed (less than sigma * 1 J = 0.01); this is twice as much."""
    plan["claim"] |= {"status": "optimal", "bound": 30.9 + 6.2e-5, "gap": 6.2e-5 / 30.9}


@breaks("claim")
def no_plan_with_a_plan(case: Data, plan: Data) -> None:
    plan["claim"] = {"status": "no_plan"}


@breaks("claim")
def infeasible_with_a_plan(case: Data, plan: Data) -> None:
    plan["claim"] = {"status": "infeasible", "reason": "robot r1: battery"}


@breaks("claim", "robots", "objective")
def feasible_without_a_plan(case: Data, plan: Data) -> None:
    plan |= {"robots": [], "explored": [], "objective": None}


@breaks("claim")
def infeasible_without_a_reason(case: Data, plan: Data) -> None:
    plan |= {"robots": [], "explored": [], "objective": None, "claim": {"status": "infeasible"}}


@pytest.mark.parametrize(("rules", "change"), breaks.parameters())
def test_every_broken_rule_is_named(rules: set[str], change: Break) -> None:
    expect(rules, change)


def test_every_rule_is_broken_at_least_once() -> None:
    broken = of_motion.rules | of_batteries.rules | breaks.rules
    assert broken == {rule.__name__ for rule in RULES} | {"instance"}
