"""Independent checker of assignment plans: the written specification of what an assignment must keep.

It reads the instance and the plan alone and works out every value again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from react_opt.certify_base import Certificate, Violation, claim_rule, instance_rule, shown, slack
from react_opt.instance import AssignmentCost, AssignmentInstance
from react_opt.plan import AssignmentPlan

OPTIMAL_GAP = 1e-6  # relative
Costs = dict[tuple[str, str], AssignmentCost]  # by robot and target


def check_assignment(instance: AssignmentInstance, plan: AssignmentPlan) -> Certificate:
    """Check an assignment plan against every rule; never raises on a plan that follows the schema."""
    found = list(instance_rule(instance, plan))
    costs = _costs(instance)
    for rule in _RULES:
        found.extend(rule(instance, plan, costs))
    empty = plan.claim.status in ("infeasible", "no_plan") and not (plan.assigned or plan.deferred)
    objective = None if empty else _objective(instance, plan, costs)
    gap = OPTIMAL_GAP * abs(objective or 0.0)
    found.extend(claim_rule(plan.claim, objective, gap, empty))
    if plan.claim.status == "infeasible":
        text = "the empty assignment always keeps every limit, so no assignment is infeasible"
        found.append(Violation("claim", "", None, None, text))
    return Certificate(tuple(found), objective)


def objective_of(instance: AssignmentInstance, plan: AssignmentPlan) -> float:
    """Return sum of ``gain - alpha time / time_ref - beta energy / battery`` over pairs that have a cost row."""
    return _objective(instance, plan, _costs(instance))


def _costs(instance: AssignmentInstance) -> Costs:
    return {(cost.robot, cost.target): cost for cost in instance.costs}


def _objective(instance: AssignmentInstance, plan: AssignmentPlan, costs: Costs) -> float:
    weights = instance.weights
    gain = {target.id: target.gain for target in instance.targets}
    battery = {robot.id: robot.battery_j for robot in instance.robots}
    total = 0.0
    for pair in plan.assigned:
        cost = costs.get((pair.robot, pair.target))
        if cost is not None and battery[pair.robot] > 0:
            total += gain[pair.target] - weights.alpha * cost.time_s / weights.time_ref_s
            total -= weights.beta * cost.energy_j / battery[pair.robot]
    return total


def _names(instance: AssignmentInstance, plan: AssignmentPlan, costs: Costs) -> Iterator[Violation]:
    """Robots and targets exist, and every target is assigned or deferred, once."""
    robots = {robot.id for robot in instance.robots}
    targets = {target.id for target in instance.targets}
    for pair in plan.assigned:
        if pair.robot not in robots:
            yield Violation("robot", pair.robot, None, None, "expected a robot of the instance")
    listed = Counter([pair.target for pair in plan.assigned] + [row.target for row in plan.deferred])
    for name, count in listed.items():
        if name not in targets:
            yield Violation("target", name, None, None, "expected a target of the instance")
        elif count > 1:
            text = f"expected once in assigned and deferred together, found {count} times"
            yield Violation("target", name, None, float(count - 1), text)
    if plan.claim.status in ("optimal", "feasible"):
        for target in instance.targets:
            if target.id not in listed:
                yield Violation("target", target.id, None, None, "expected in assigned or deferred")


def _pairs(instance: AssignmentInstance, plan: AssignmentPlan, costs: Costs) -> Iterator[Violation]:
    """A robot takes only what it reaches, what lies in its zone, and nothing with an empty battery."""
    robots = {robot.id: robot for robot in instance.robots}
    for pair in plan.assigned:
        robot = robots.get(pair.robot)
        if robot is None:
            continue
        if (pair.robot, pair.target) not in costs:
            yield Violation("reach", pair.robot, None, None, f"target {shown(pair.target)} is unreachable")
        if robot.zone is not None and pair.target not in robot.zone:
            yield Violation("zone", pair.robot, None, None, f"target {shown(pair.target)} is outside its zone")
        if robot.battery_j <= 0:
            yield Violation("energy", pair.robot, None, None, f"target {shown(pair.target)} with an empty battery")


def _capacity(instance: AssignmentInstance, plan: AssignmentPlan, costs: Costs) -> Iterator[Violation]:
    """A robot takes at most ``capacity`` targets."""
    load = Counter(pair.robot for pair in plan.assigned)
    for robot in instance.robots:
        if load[robot.id] > robot.capacity:
            text = f"expected at most {shown(robot.capacity)} targets, found {load[robot.id]}"
            yield Violation("capacity", robot.id, None, float(load[robot.id] - min(robot.capacity, 2**53)), text)


def _energy(instance: AssignmentInstance, plan: AssignmentPlan, costs: Costs) -> Iterator[Violation]:
    """The energies of a robot's targets add up to at most ``battery - reserve``."""
    spent: Counter[str] = Counter()
    for pair in plan.assigned:
        cost = costs.get((pair.robot, pair.target))
        spent[pair.robot] += 0.0 if cost is None else cost.energy_j  # type: ignore[assignment]
    for robot in instance.robots:
        budget, used = robot.battery_j - robot.reserve_j, float(spent[robot.id])
        if used > budget + slack(used, robot.battery_j):
            text = f"expected at most battery - reserve = {shown(budget)} J, found {shown(used)} J"
            yield Violation("energy", robot.id, None, used - budget, text)


def _conflicts(instance: AssignmentInstance, plan: AssignmentPlan, costs: Costs) -> Iterator[Violation]:
    """Of two targets in conflict at most one is taken."""
    taken = {pair.target for pair in plan.assigned}
    for first, second in instance.conflicts:
        if first in taken and second in taken:
            yield Violation("conflict", first, None, None, f"taken together with {shown(second)}")


def _reasons(instance: AssignmentInstance, plan: AssignmentPlan, costs: Costs) -> Iterator[Violation]:
    """A reason that bars a target is true: unreachable, zone, energy and no_gain follow from the instance."""
    weights = instance.weights
    robots = {robot.id: robot for robot in instance.robots}
    gain = {target.id: target.gain for target in instance.targets}
    zones = {robot.id: None if robot.zone is None else set(robot.zone) for robot in instance.robots}
    # Per target: 0 no robot reaches it, 1 none in its zone, 2 none has the energy, 3 none gains by it,
    # 4 the best gain is zero within rounding, 5 some robot gains by it.
    near: dict[str, int] = {}
    deferred = {row.target for row in plan.deferred}
    for cost in instance.costs:
        if cost.target not in deferred or near.get(cost.target) == 5:
            continue
        robot, zone = robots[cost.robot], zones[cost.robot]
        value = gain[cost.target] - weights.alpha * cost.time_s / weights.time_ref_s
        if robot.capacity == 0:
            level = 0
        elif zone is not None and cost.target not in zone:
            level = 1
        elif robot.battery_j <= 0 or cost.energy_j > robot.battery_j - robot.reserve_j + slack(robot.battery_j):
            level = 2
        else:
            value -= weights.beta * cost.energy_j / robot.battery_j
            rounding = slack(gain[cost.target], value)
            level = 4 if abs(value) <= rounding else 5 if value > 0 else 3
        near[cost.target] = max(level, near.get(cost.target, 0))
    fits = {
        "unreachable": (0,), "zone": (1,), "energy": (2, 4, 5), "no_gain": (3, 4), "conflict": (4, 5), "outbid": (4, 5),
    }  # fmt: skip
    conflicting = {target for pair in instance.conflicts for target in pair}
    for row in plan.deferred:
        level = near.get(row.target, 0)
        if row.target in gain and level not in fits[row.reason]:
            true = _TRUE_REASONS[level]
            yield Violation("reason", row.target, None, None, f"expected {true}, found {row.reason}")
        elif row.reason == "conflict" and row.target not in conflicting:
            yield Violation("reason", row.target, None, None, "found conflict, but no conflict pair names it")
        negative = row.loss is not None and row.loss < -slack(row.loss, plan.claim.objective or 0.0)
        if negative and plan.claim.status == "optimal":
            text = "forcing a target in cannot gain where the plan is optimal"
            yield Violation("reason", row.target, None, -(row.loss or 0.0), text)


_TRUE_REASONS = ("unreachable", "zone", "energy", "no_gain", "no_gain or outbid", "conflict, outbid or energy")
_RULES = (_names, _pairs, _capacity, _energy, _conflicts, _reasons)
