"""``check(instance, plan)``: the independent checker, which trusts no solver.

It reads the instance and the plan alone and imports no solver, no model, no time graph and not the energy law.
"""

from __future__ import annotations

from collections.abc import Callable

from react_opt.certify_base import Certificate, Violation, instance_rule, shown, slack
from react_opt.errors import ReactError, UsageError
from react_opt.instance import AssignmentInstance, InspectionInstance, Instance, OrosInstance
from react_opt.plan import AssignmentPlan, InspectionPlan, OrosPlan, Plan

__all__ = ["Certificate", "Violation", "check"]


def check(
    instance: Instance, plan: Plan, bound: bool = False, on_progress: Callable[[float], None] | None = None
) -> Certificate:
    """Check a plan against its instance.

    Parameters
    ----------
    instance
        An ``oros``, ``assignment`` or ``inspection`` instance.
    plan
        A plan, of this or of any instance.
    bound
        Whether to recompute the bound from the claim's certificate too (OROS only).
    on_progress
        Called while the bound is recomputed with the share that is done, from 0 to 1.

    Returns
    -------
    Certificate
        ``ok`` where no rule is broken, else every violation. It never raises because of what is in the plan.

    Raises
    ------
    UsageError
        Where ``instance`` is not one that has plans, or the bound of such a plan cannot be recomputed.
    """
    if not isinstance(instance, OrosInstance | AssignmentInstance | InspectionInstance):
        raise UsageError(f"there are no plans of kind {instance.kind!r} to check")
    foreign = tuple(instance_rule(instance, plan))
    if foreign:  # whatever else is said of a plan of another instance would be noise
        return Certificate(foreign)
    if isinstance(instance, OrosInstance) and isinstance(plan, OrosPlan):
        from react_opt.certify_oros import check_oros

        violations, objective = check_oros(instance, plan)
        if not bound:
            return Certificate(violations, objective)
        broken, value = _check_bound(instance, plan, on_progress or (lambda share: None))
        return Certificate(violations + broken, objective, value)
    if bound:
        raise UsageError(f"--bound: plans of kind {plan.kind!r} carry no certificate of their bound")
    if isinstance(instance, AssignmentInstance) and isinstance(plan, AssignmentPlan):
        from react_opt.certify_assignment import check_assignment

        return check_assignment(instance, plan)
    from react_opt.certify_inspection import check_inspection

    assert isinstance(instance, InspectionInstance)
    assert isinstance(plan, InspectionPlan)
    return check_inspection(instance, plan)


def _check_bound(
    instance: OrosInstance, plan: OrosPlan, tell: Callable[[float], None]
) -> tuple[tuple[Violation, ...], float | None]:
    """Recompute the bound: it may lie below the claimed bound, but not above it."""
    claim = plan.claim
    if claim.bound is None:
        return (), None
    if claim.certificate is None:
        text = "the claim carries no certificate, so its bound cannot be recomputed"
        return (Violation("bound", "", None, None, text),), None
    from react_opt.certify_bound import recompute_bound

    try:
        value = recompute_bound(instance, claim.certificate, tell)
    except ReactError as error:
        return (Violation("bound", "", None, None, str(error)),), None
    if value > claim.bound + slack(value, claim.bound):
        text = f"the certificate proves {shown(value)}, the claim says {shown(claim.bound)}"
        return (Violation("bound", "", None, value - claim.bound, text),), value
    return (), value
