"""What every checker says and the rules that all kinds of plans share: whose plan it is, and the claim's arithmetic.

The checkers are the written specification of a plan. They read the instance and the plan alone, believe no
number in the plan that they can work out, and report instead of raising.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from react_opt.instance import Document
from react_opt.jsonio import sha256
from react_opt.plan import Claim, PlanDocument, gap_of

# The only tolerances of the checkers. Two numbers agree within ABSOLUTE (1e-6 J, s or objective units: a
# millionth of what the format's units mean) plus RELATIVE times the larger of the two, which leaves room for
# the rounding of sums over 100 000 steps. Limits may be exceeded by as much. Nothing compounds: a checker
# adds up what the plan did, not what the plan says of its sums.
ABSOLUTE = 1e-6
RELATIVE = 1e-9


@dataclass(frozen=True)
class Violation:
    """One broken rule.

    Parameters
    ----------
    rule
        Name of the rule, for instance ``battery``.
    place
        Id of the robot, or where no one robot is to blame of the cell or target; empty for the plan as a whole.
    step
        Instant at which the rule is broken, None where it has no instant.
    amount
        By how much, in the unit of the rule (J, robots, objective units); None where it has no amount.
    message
        What was expected and what was found.
    """

    rule: str
    place: str
    step: int | None
    amount: float | None
    message: str

    def __str__(self) -> str:
        where = [self.place] if self.place else []
        where += [f"step {shown(self.step)}"] if self.step is not None else []
        by = f" (by {shown(self.amount)})" if self.amount is not None else ""
        return ": ".join([self.rule, *([", ".join(where)] if where else []), self.message]) + by


@dataclass(frozen=True)
class Certificate:
    """What the checker found.

    Parameters
    ----------
    violations
        Every broken rule, in the order in which the rules are listed.
    objective
        The objective as the checker works it out, None where the plan holds nothing to work it out from.
    bound
        The bound recomputed from the claim's certificate, None where that was not asked for or not possible.
    """

    violations: tuple[Violation, ...]
    objective: float | None = None
    bound: float | None = None

    @property
    def ok(self) -> bool:
        """True where no rule is broken."""
        return not self.violations


def agree(found: float, expected: float) -> bool:
    """Return whether two numbers are the same within the tolerances of this module."""
    return found == expected or abs(found - expected) <= slack(found, expected)


def agree_value(found: float, expected: float) -> bool:
    """Return whether two values of an objective are the same.

    Weights come in any unit, so this is relative: 1e-9 of the larger, and 1e-9 around zero.
    """
    return math.isclose(found, expected, rel_tol=RELATIVE, abs_tol=RELATIVE)


def slack(*values: float) -> float:
    """Return the tolerance for numbers of this size: ``ABSOLUTE + RELATIVE * max |value|``."""
    return ABSOLUTE + RELATIVE * max(map(abs, values))


def shown(value: object) -> str:
    """Return a value as text for a message; never raises, however large a number is."""
    if isinstance(value, float):
        return f"{value:.9g}"
    try:
        text = str(value) if isinstance(value, int) else repr(value)
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a huge number"
    return text if len(text) <= 60 else f"{text[:57]}..."


def instance_rule(instance: Document, plan: PlanDocument) -> Iterator[Violation]:
    """The plan was made for this instance: same kind, same SHA-256 of the canonical JSON, same name."""
    if plan.kind != f"{instance.kind}_plan":
        text = f"expected a plan of kind '{instance.kind}_plan', found {shown(plan.kind)}"
        yield Violation("instance", "", None, None, text)
        return
    expected = sha256(instance)
    if plan.instance.sha256 != expected:
        text = f"a plan of another instance: expected sha256 {expected}, found {shown(plan.instance.sha256)}"
        yield Violation("instance", "", None, None, text)
    elif plan.instance.name != instance.name:
        text = f"expected the instance's name {shown(instance.name)}, found {shown(plan.instance.name)}"
        yield Violation("instance", "", None, None, text)


def claim_rule(claim: Claim, objective: float | None, optimal_gap: float, empty: bool) -> Iterator[Violation]:
    """The claim's arithmetic, and its status in the light of the objective that the checker worked out.

    Parameters
    ----------
    claim
        What the solver says; all kinds of plans maximise.
    objective
        The objective worked out from the plan, None where there is no plan to work it out from.
    optimal_gap
        How far the bound of an ``optimal`` claim may lie above its objective.
    empty
        Whether the plan holds nothing at all: what ``infeasible`` and ``no_plan`` require.
    """

    def broken(amount: float | None, text: str) -> Violation:
        return Violation("claim", "", None, amount, text)

    if claim.status in ("infeasible", "no_plan"):
        if not empty:
            yield broken(None, f"status {claim.status} goes with an empty plan")
        if claim.objective is not None:
            yield broken(None, f"status {claim.status} has no objective, found {shown(claim.objective)}")
        if claim.status == "infeasible" and not claim.reason:
            yield broken(None, "status infeasible names a robot and a rule in its reason, found none")
        if claim.status == "infeasible" and claim.bound is not None:
            yield broken(None, f"status infeasible has no bound, found {shown(claim.bound)}")
    else:
        if empty:
            yield broken(None, f"status {claim.status} goes with a plan, found none")
        if claim.objective is None:
            yield broken(None, f"status {claim.status} goes with an objective, found none")
    if claim.objective is not None and objective is not None and not agree_value(claim.objective, objective):
        off = claim.objective - objective
        yield broken(off, f"objective: expected {shown(objective)}, found {shown(claim.objective)}")
    yield from _gap_rule(claim)
    if claim.bound is None:
        if claim.status == "optimal":
            yield broken(None, "status optimal goes with a bound, found none")
        return
    value = objective if objective is not None else claim.objective
    if value is None or claim.status == "infeasible":
        return
    if claim.bound < value - slack(claim.bound, value):
        yield broken(value - claim.bound, f"bound {shown(claim.bound)} is below the objective {shown(value)}")
    # The allowance beyond optimal_gap is rounding: the objective was worked out anew, in another order.
    if claim.status == "optimal" and claim.bound - value > optimal_gap + RELATIVE * max(abs(value), 1.0):
        text = f"status optimal allows bound - objective <= {shown(optimal_gap)}"
        yield broken(claim.bound - value, text)


def _gap_rule(claim: Claim) -> Iterator[Violation]:
    expected = gap_of(claim.objective, claim.bound)
    if expected is None or claim.gap is None:
        if expected is not None or claim.gap is not None:
            text = f"gap: expected {shown(expected)}, found {shown(claim.gap)}"
            yield Violation("claim", "", None, None, text)
    elif not math.isclose(claim.gap, expected, rel_tol=1e-6, abs_tol=RELATIVE) and claim.gap != expected:
        text = f"gap: expected {shown(expected)}, found {shown(claim.gap)}"
        yield Violation("claim", "", None, claim.gap - expected, text)
