"""The rules of an OROS plan, one function each, listed once in :data:`RULES`: the specification of a plan.

Those that concern one robot are in :mod:`react_opt.certify_robot`, those of the fleet, the sums and the claim here.

Two readings of the design are fixed here. Robots that sense the same unexplored cell at the same instant have
all explored it: none of them senses in vain, and ``explored`` may name any of them. Of parallel arcs of as many
steps only the cheapest is worth naming, but a plan that names a dearer one can be driven: it stands, and pays
for the arc it names.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator

from react_opt import certify_robot as robot
from react_opt.certify_base import Violation, agree, agree_value, claim_rule, shown
from react_opt.certify_replay import Case
from react_opt.instance import OrosInstance
from react_opt.plan import OrosPlan

Rule = Callable[[Case], Iterator[Violation]]


def check_oros(instance: OrosInstance, plan: OrosPlan) -> tuple[tuple[Violation, ...], float | None]:
    """Check an OROS plan against the instance that it was made for.

    Parameters
    ----------
    instance, plan
        The two, valid by their schema; nothing else is taken for granted.

    Returns
    -------
    tuple of Violation, float or None
        Every broken rule in the order of :data:`RULES`, and the objective worked out from the plan (None where
        a robot's rows are missing).
    """
    case = Case(instance, plan)
    violations = tuple(violation for rule in RULES for violation in rule(case))
    return violations, _objective(case)[-1] if _has_plan(case) and case.whole else None


def _has_plan(case: Case) -> bool:
    return bool(case.plan.robots) or case.plan.claim.status in ("optimal", "feasible")


def _objective(case: Case) -> tuple[float, float, float, float]:
    """Return coverage, battery, battery_j and total."""
    coverage, left_j = case.coverage(), case.battery_left_j()
    battery = case.instance.sigma * left_j
    return coverage, battery, left_j, coverage + battery


def robots(case: Case) -> Iterator[Violation]:
    """Every robot is there exactly once, and no other."""
    known = {part.id for part in case.instance.robots}
    found = Counter(part.id for part in case.plan.robots)
    for name, times in found.items():
        if name not in known:
            yield Violation("robots", name, None, None, "expected the id of a robot of the instance")
        elif times > 1:
            yield Violation("robots", name, None, times - 1, f"expected once, found {times} times")
    if _has_plan(case):
        for missing in case.instance.robots:
            if missing.id not in found:
                yield Violation("robots", missing.id, None, None, "expected the steps of this robot, found none")


def charging_slots(case: Case) -> Iterator[Violation]:
    """At most ``slots`` robots charge at a charger in one step."""
    users = Counter((cell, row.t) for _, row, cell in case.charging() if cell in case.chargers)
    for (cell, t), count in sorted(users.items(), key=lambda item: item[0][1]):
        assert cell is not None
        slots = case.chargers[cell].slots
        if count > slots:
            text = f"{count} robots charge here, slots for {shown(slots)}"
            yield Violation("charging_slots", cell, t, float(count - slots), text)


def explored(case: Case) -> Iterator[Violation]:
    """``explored`` lists each newly explored cell once, with the first instant and a robot that sensed it then."""
    if not case.whole:
        return
    listed = Counter(row.cell for row in case.plan.explored)
    for row in case.plan.explored:
        if row.cell not in case.first_sensed:
            text = f"expected newly explored cells only: {_not_new(case, row.cell)}"
            yield Violation("explored", row.cell, row.step, None, text)
            continue
        step, names = case.first_sensed[row.cell]
        if row.step != step:
            text = f"expected the first instant at which it is sensed, t = {step}"
            yield Violation("explored", row.cell, row.step, None, text)
        elif row.robot not in names:
            text = f"expected a robot that senses there then ({', '.join(sorted(names))}), found {shown(row.robot)}"
            yield Violation("explored", row.cell, row.step, None, text)
    for cell, times in listed.items():
        if times > 1:
            yield Violation("explored", cell, None, float(times - 1), f"expected once, found {times} times")
    for cell, (step, _) in case.first_sensed.items():
        if cell not in listed:
            yield Violation("explored", cell, step, None, "is explored, but not listed")


def _not_new(case: Case, cell: str) -> str:
    if cell not in case.cells:
        return "there is no such cell"
    return "it is explored from the start" if case.cells[cell].explored else "no robot senses it"


def robots_per_cell(case: Case) -> Iterator[Violation]:
    """At t >= 1 at most ``robots_per_cell`` robots stand in a cell."""
    most = case.instance.limits.robots_per_cell
    if most is None:
        return
    standing = Counter(
        (row.t, row.cell) for walk in case.walks for row in walk.rows if row.cell is not None and row.t >= 1
    )
    for (t, cell), count in sorted(standing.items()):
        if count > most:
            text = f"{count} robots stand here, at most {shown(most)}"
            yield Violation("robots_per_cell", cell, t, float(count - most), text)


def swaps(case: Case) -> Iterator[Violation]:
    """With ``forbid_swaps`` no two robots are on i -> j and j -> i at overlapping open time intervals."""
    if not case.instance.limits.forbid_swaps:
        return
    passages: dict[tuple[str, str], list[tuple[int, int, bool, str]]] = defaultdict(list)
    for walk in case.walks:
        for row in walk.rows:
            travel = walk.travel(row) if row.arc is not None else None
            if travel is not None:
                onward = travel.from_ < travel.to
                ends = (travel.from_, travel.to) if onward else (travel.to, travel.from_)
                passages[ends].append((row.t, row.t + travel.steps, onward, walk.robot.id))
    for (one, other), drives in passages.items():
        under_way: list[tuple[int, int, bool, str]] = []
        for drive in sorted(drives):
            under_way = [earlier for earlier in under_way if earlier[1] > drive[0]]
            for earlier in under_way:
                if earlier[2] != drive[2] and earlier[3] != drive[3]:
                    text = f"meets {shown(earlier[3])}, which is between {shown(one)} and {shown(other)} the other way"
                    yield Violation("swaps", drive[3], drive[0], None, text)
            under_way.append(drive)


def sensing_robots_per_step(case: Case) -> Iterator[Violation]:
    """At most ``sensing_robots_per_step`` robots sense at one instant."""
    most = case.instance.limits.sensing_robots_per_step
    if most is None:
        return
    users = Counter(row.t for walk in case.walks for row in walk.rows if row.sensing)
    for t, count in sorted(users.items()):
        if count > most:
            text = f"{count} robots sense, at most {shown(most)}"
            yield Violation("sensing_robots_per_step", "", t, float(count - most), text)


def objective(case: Case) -> Iterator[Violation]:
    """The parts of the objective are those worked out from the plan."""
    stated = case.plan.objective
    if stated is None or not _has_plan(case):
        if (stated is not None) != _has_plan(case):
            text = "expected an objective, found none" if stated is None else "expected none without a plan"
            yield Violation("objective", "", None, None, text)
        return
    if not case.whole:
        return
    names = ("coverage", "battery", "battery_j", "total")
    for name, expected in zip(names, _objective(case), strict=True):
        found = getattr(stated, name)
        same = agree if name == "battery_j" else agree_value
        if not same(found, expected):
            text = f"{name}: expected {shown(expected)}, found {shown(found)}"
            yield Violation("objective", "", None, found - expected, text)


def claim(case: Case) -> Iterator[Violation]:
    """The claim's objective is the total, its gap follows from its bound, and its status from both."""
    sigma = case.instance.sigma
    total = _objective(case)[-1] if _has_plan(case) and case.whole else None
    size = abs(total) if total is not None and math.isfinite(total) else 0.0
    allowed = max(1e-9 * size, min(1e-6 * size, sigma) if sigma > 0 else 1e-6 * size)
    empty = not case.plan.robots and not case.plan.explored and case.plan.objective is None
    yield from claim_rule(case.plan.claim, total, allowed, empty)


RULES: tuple[Rule, ...] = (
    robots,
    robot.steps,
    robot.start,
    robot.arc,
    robot.motion,
    robot.horizon,
    robot.speed,
    robot.sensing,
    robot.useful_sensing,
    robot.battery,
    robot.reserve,
    robot.capacity,
    robot.charging_place,
    robot.charging_power,
    charging_slots,
    explored,
    robots_per_cell,
    swaps,
    sensing_robots_per_step,
    robot.return_to,
    objective,
    claim,
)
