"""Independent checker of inspection plans: the written specification of a deferred-priority inspection.

It reads the instance and the plan alone, drives every route again over the listed rows, and works out times,
batteries and both objectives.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from react_opt.certify_base import Certificate, Violation, agree, claim_rule, instance_rule, shown, slack
from react_opt.instance import InspectionInstance, InspectionRobot
from react_opt.plan import InspectionPlan, InspectionRoute

OPTIMAL_GAP = 1e-6  # relative

Rows = dict[tuple[str, str, str | None], tuple[float, float]]


def check_inspection(instance: InspectionInstance, plan: InspectionPlan) -> Certificate:
    """Check an inspection plan against every rule; never raises on a plan that follows the schema."""
    found = list(instance_rule(instance, plan))
    empty = not (plan.routes or plan.skipped)
    missing = empty and plan.claim.status in ("infeasible", "no_plan")
    if not missing:
        for rule in (_listed, _routes, _completion, _skipped):
            found.extend(rule(instance, plan))
    values = {target.id: target.value for target in instance.targets}
    visited = {stop.target for route in plan.routes for stop in route.stops}
    objective = None if missing else sum(values.get(name, 0.0) for name in sorted(visited))
    gap = OPTIMAL_GAP * abs(objective or 0.0)
    found.extend(claim_rule(plan.claim, objective, gap, missing))
    found.extend(_secondary(instance, plan, missing))
    return Certificate(tuple(found), objective)


def drive(rows: Rows, robot: InspectionRobot, start: str, end: str) -> tuple[float, float] | None:
    """Return time (s) and energy (J) from one place to another; None where no row lists it.

    A row for this robot overrides the general one, and who stands at a place needs no drive to it.
    """
    if start == end:
        return 0.0, 0.0
    return rows.get((start, end, robot.id)) or rows.get((start, end, None))


def rows_of(instance: InspectionInstance) -> Rows:
    """Return the drives by from, to and robot."""
    return {(row.from_, row.to, row.robot): (row.time_s, row.energy_j) for row in instance.travel}


def _listed(instance: InspectionInstance, plan: InspectionPlan) -> Iterator[Violation]:
    """Every robot has one route; every target is visited once or skipped once; names are the instance's."""
    for what, known, named in (
        ("robot", [robot.id for robot in instance.robots], [route.robot for route in plan.routes]),
        (
            "target",
            [target.id for target in instance.targets],
            [stop.target for route in plan.routes for stop in route.stops] + [row.target for row in plan.skipped],
        ),
    ):
        count, ids = Counter(named), set(known)
        for name in known:
            if count[name] != 1:
                text = f"expected once in the plan, found {count[name]} times"
                yield Violation(what, name, None, float(abs(count[name] - 1)), text)
        for name in count:
            if name not in ids:
                yield Violation(what, name, None, None, f"expected a {what} of the instance")


def _routes(instance: InspectionInstance, plan: InspectionPlan) -> Iterator[Violation]:
    """Each route drives listed rows, tells its times and batteries truly, and keeps both budgets."""
    rows = rows_of(instance)
    robots = {robot.id: robot for robot in instance.robots}
    for route in plan.routes:
        if route.robot in robots:
            yield from _route(instance, rows, robots[route.robot], route)


def _route(
    instance: InspectionInstance, rows: Rows, robot: InspectionRobot, route: InspectionRoute
) -> Iterator[Violation]:
    targets = {target.id: target for target in instance.targets}
    now_s, spent_j, at = 0.0, 0.0, robot.at

    def broken(rule: str, amount: float | None, text: str) -> Violation:
        return Violation(rule, robot.id, None, amount, text)

    if route.end != robot.end:
        yield broken("end", None, f"expected to end at {shown(robot.end)}, found {shown(route.end)}")
    for stop in route.stops:
        leg = drive(rows, robot, at, stop.target)
        if leg is None:
            yield broken("drive", None, f"no row leads from {shown(at)} to {shown(stop.target)}")
            return
        if stop.target not in targets:
            return
        target = targets[stop.target]
        now_s, spent_j, at = now_s + leg[0], spent_j + leg[1], stop.target
        if not agree(stop.arrive_s, now_s):
            text = f"arrival at {shown(at)}: expected {shown(now_s)}, found {shown(stop.arrive_s)}"
            yield broken("time", stop.arrive_s - now_s, text)
        now_s, spent_j = now_s + target.service_s, spent_j + target.service_energy_j
        if not agree(stop.leave_s, now_s):
            text = f"departure from {shown(at)}: expected {shown(now_s)}, found {shown(stop.leave_s)}"
            yield broken("time", stop.leave_s - now_s, text)
        left_j = robot.battery_j - spent_j
        if not _same_charge(stop.battery_j, left_j, robot):
            text = f"battery on leaving {shown(at)}: expected {shown(left_j)}, found {shown(stop.battery_j)}"
            yield broken("battery", stop.battery_j - left_j, text)
    if robot.end is not None:
        leg = drive(rows, robot, at, robot.end)
        if leg is None:
            yield broken("drive", None, f"no row leads from {shown(at)} to the end {shown(robot.end)}")
            return
        now_s, spent_j = now_s + leg[0], spent_j + leg[1]
    left_j = robot.battery_j - spent_j
    if not agree(route.finish_s, now_s):
        text = f"finish: expected {shown(now_s)}, found {shown(route.finish_s)}"
        yield broken("time", route.finish_s - now_s, text)
    if not _same_charge(route.finish_battery_j, left_j, robot):
        text = f"battery on completion: expected {shown(left_j)}, found {shown(route.finish_battery_j)}"
        yield broken("battery", route.finish_battery_j - left_j, text)
    if now_s > instance.time_left_s + slack(now_s, instance.time_left_s):
        text = f"expected to finish within {shown(instance.time_left_s)} s, found {shown(now_s)} s"
        yield broken("time_left", now_s - instance.time_left_s, text)
    if left_j < robot.reserve_j - slack(robot.battery_j, spent_j):
        text = f"expected at least the reserve {shown(robot.reserve_j)} J, found {shown(left_j)} J"
        yield broken("reserve", robot.reserve_j - left_j, text)


def _same_charge(found: float, expected: float, robot: InspectionRobot) -> bool:
    return abs(found - expected) <= slack(found, expected, robot.battery_j)


def _completion(instance: InspectionInstance, plan: InspectionPlan) -> Iterator[Violation]:
    """``t_dpi_s`` is the last finish."""
    last = max((route.finish_s for route in plan.routes), default=0.0)
    if plan.t_dpi_s is None or not agree(plan.t_dpi_s, last):
        text = f"t_dpi_s: expected the last finish {shown(last)}, found {shown(plan.t_dpi_s)}"
        yield Violation("t_dpi", "", None, None, text)


def _skipped(instance: InspectionInstance, plan: InspectionPlan) -> Iterator[Violation]:
    """A target is called unreachable exactly where no chain of rows leads over it to a robot's end.

    It is called outbid only where some robot's least time and least energy allow it; ``time`` and ``battery``
    say what the least of either does not allow, or where both would do, that they do not together.
    """
    if not plan.skipped:
        return
    targets = [target.id for target in instance.targets]
    true: dict[str, set[str]] = {name: set() for name in targets}
    place, general = _shared(instance)
    for robot in instance.robots:
        reach, in_time, in_energy = _fits(instance, robot, place, general)
        for k, name in enumerate(targets):
            if reach[k]:
                true[name] |= {"outbid"} if in_time[k] and in_energy[k] else set()
                true[name] |= set() if in_time[k] else {"time"}
                true[name] |= set() if in_energy[k] else {"battery"}
    for row in plan.skipped:
        if row.target not in true:
            continue
        expected = true[row.target] or {"unreachable"}
        if "outbid" in expected:
            expected = {"time", "battery", "outbid"}
        if row.reason not in expected:
            text = f"expected {' or '.join(sorted(expected))}, found {row.reason}"
            yield Violation("reason", row.target, None, None, text)
        rounding = slack(row.loss or 0.0, plan.claim.objective or 0.0)
        if row.loss is not None and row.loss < -rounding and plan.claim.status == "optimal":
            text = "forcing a target in cannot gain where the plan is optimal"
            yield Violation("reason", row.target, None, -row.loss, text)


def _shared(instance: InspectionInstance) -> tuple[dict[str, int], NDArray[np.float64]]:
    """Return the number of each place, targets first, and time and energy of the rows for every robot."""
    place = {target.id: index for index, target in enumerate(instance.targets)}
    for row in instance.travel:
        place.setdefault(row.from_, len(place))
        place.setdefault(row.to, len(place))
    for robot in instance.robots:
        place.setdefault(robot.at, len(place))
        place.setdefault(robot.end or robot.at, len(place))
    general = np.full((2, len(place), len(place)), np.inf)
    rows = [row for row in instance.travel if row.robot is None and row.from_ != row.to]
    if rows:
        at, to = [place[row.from_] for row in rows], [place[row.to] for row in rows]
        general[:, at, to] = np.array([(row.time_s, row.energy_j) for row in rows]).T
    return place, general


def _fits(
    instance: InspectionInstance, robot: InspectionRobot, place: dict[str, int], general: NDArray[np.float64]
) -> tuple[list[bool], list[bool], list[bool]]:
    """Return per target whether chains of rows lead over it, and whether the least time and energy are there."""
    start = place[robot.at]
    end = None if robot.end is None else place[robot.end]
    legs = general.copy()
    for row in instance.travel:
        if row.robot == robot.id and row.from_ != row.to:
            legs[:, place[row.from_], place[row.to]] = row.time_s, row.energy_j
    n = len(instance.targets)
    service = np.zeros((2, len(place)))
    service[:, :n] = np.array([(t.service_s, t.service_energy_j) for t in instance.targets]).reshape(-1, 2).T
    limits = (instance.time_left_s, robot.battery_j - robot.reserve_j)
    fits = []
    for which in (0, 1):
        legs[which] += service[which]  # a row to a target and the service there
        out = _least(legs[which], start, n)
        if start < n:  # it stands at this target: no drive, but the service
            out[start] = service[which, start]
            out = np.minimum(out, out[start] + _least(legs[which], start, n))
        back = np.zeros(n) if end is None else _least(legs[which].T, end, n)
        if end is not None and end < n:  # the service at the end's own target is not asked for twice
            back = back - service[which, end]
            back[end] = 0.0
        fits.append(out[:n] + back[:n])
    reach = np.isfinite(fits[0])
    within = [fit <= limit + slack(limit, robot.battery_j) for fit, limit in zip(fits, limits, strict=True)]
    return reach.tolist(), within[0].tolist(), within[1].tolist()


def _least(legs: NDArray[np.float64], source: int, n: int) -> NDArray[np.float64]:
    """Return ``(n,)`` the least sums of rows from a place to each target, over targets alone (Dijkstra)."""
    known = legs[source, :n].copy()
    if source < n:
        known[source] = np.inf
    waiting = np.ones(n, dtype=np.bool_)
    for _ in range(n):
        k = int(np.argmin(np.where(waiting, known, np.inf)))
        if not waiting[k] or not np.isfinite(known[k]):
            break
        waiting[k] = False
        np.minimum(known, known[k] + legs[k, :n], out=known)
    return known


def _secondary(instance: InspectionInstance, plan: InspectionPlan, missing: bool) -> Iterator[Violation]:
    """The second objective is that of the routes, and its bound lies below it."""
    second = plan.claim.secondary

    def broken(amount: float | None, text: str) -> Violation:
        return Violation("secondary", "", None, amount, text)

    if second is None or missing:
        return
    if second.status in ("infeasible", "no_plan") or second.objective is None:
        yield broken(None, "a plan goes with a second objective and status optimal or feasible")
        return
    battery = {robot.id: robot.battery_j for robot in instance.robots}
    if instance.minimise == "time":
        total = sum(route.finish_s for route in plan.routes)
    else:
        total = sum(battery.get(route.robot, 0.0) - route.finish_battery_j for route in plan.routes)
    rounding = slack(total, *battery.values(), second.objective)
    if abs(second.objective - total) > rounding * max(1, len(battery)):
        text = f"expected {shown(total)}, found {shown(second.objective)}"
        yield broken(second.objective - total, text)
    if second.bound is not None and second.bound > total + rounding * max(1, len(battery)):
        yield broken(second.bound - total, f"bound {shown(second.bound)} is above the objective {shown(total)}")
    if second.status == "optimal":
        if second.bound is None or total - second.bound > OPTIMAL_GAP * max(1.0, total) + rounding:
            yield broken(None, f"status optimal: expected a bound at {shown(total)}, found {shown(second.bound)}")
        if plan.claim.status != "optimal":
            yield broken(None, "the second objective is optimal only among plans of optimal value")
