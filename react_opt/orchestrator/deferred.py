"""The deferred-priority inspection in the loop: routes through the postponed targets, gated and followed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from react_opt.instance import InspectionInstance, InspectionRobot, InspectionTarget, InspectionTravel
from react_opt.orchestrator.belief import Belief, LocalTarget, RobotView
from react_opt.orchestrator.orders import Driver, distance_m
from react_opt.orchestrator.strategy import Note, Order, Point, StrategyOptions
from react_opt.orchestrator.survey import Survey
from react_opt.plan import InspectionPlan
from react_opt.planner import solve
from react_opt.solvers.inspection import gate

SEEN_M = 0.5  # a target that is still unknown from here will stay so
MOST_TARGETS = 24  # of one inspection, by value: the others wait for the next one
WORK_LIMIT = 20


class Inspection:
    """Follows inspection plans until no target is left that pays.

    It plans anew when a robot is free and targets are left that no route holds, and leaves out targets that
    vanish (seen in passing).
    """

    def __init__(self, options: StrategyOptions, driver: Driver) -> None:
        self.options = options
        self.driver = driver
        self.routes: dict[str, list[str]] = {}
        self.goals: dict[str, str] = {}
        self.given_up: set[str] = set()

    def step(
        self,
        belief: Belief,
        survey: Survey,
        robots: list[RobotView],
        targets: Sequence[LocalTarget],
        looked: list[Point],
        notes: list[Note],
    ) -> tuple[list[Order], bool]:
        """Return the orders that change, and whether the inspection is over."""
        known = {target.id: target for target in targets if target.stand_m is not None}
        for robot in robots:
            goal = self.goals.get(robot.id)
            at_goal = goal in known and robot.state in ("idle", "stuck")
            if at_goal and goal is not None:
                goal_m = self.driver.goal(robot)
                near = goal_m is not None and distance_m(robot, goal_m) <= SEEN_M
                why = "still unknown from where it should be seen" if near else "no progress"
                notes.append(Note("target_abandoned", robot=robot.id, target=goal, reason=why))
                self.given_up.add(goal)
                if near and goal_m is not None:
                    looked.append(goal_m)
            if goal is not None and (goal not in known or goal in self.given_up):
                del self.goals[robot.id]
        left = {name: target for name, target in known.items() if name not in self.given_up}
        for name, route in self.routes.items():
            self.routes[name] = [target for target in route if target in left]
        planned = {target for route in self.routes.values() for target in route} | set(self.goals.values())
        free = [robot for robot in robots if robot.id not in self.goals and not self.routes.get(robot.id)]
        if free and set(left) - planned:
            self._plan(belief, robots, left, notes)
        orders = [order for robot in robots for order in self._follow(belief, survey, robot, left)]
        over = not self.goals and not any(self.routes.values())
        return orders, over

    def _follow(self, belief: Belief, survey: Survey, robot: RobotView, left: dict[str, LocalTarget]) -> list[Order]:
        route = self.routes.get(robot.id, [])
        while robot.id in self.goals or route:
            target = left[self.goals[robot.id] if robot.id in self.goals else route.pop(0)]
            assert target.stand_m is not None
            orders = self.driver.go(belief, survey, robot, target.stand_m, target.id)
            if orders is not None:
                self.goals[robot.id] = target.id
                return orders
            self.given_up.add(target.id)
            self.goals.pop(robot.id, None)
        return self.driver.stop(robot)

    def _plan(
        self,
        belief: Belief,
        robots: list[RobotView],
        left: dict[str, LocalTarget],
        notes: list[Note],
    ) -> None:
        targets = sorted(left.values(), key=lambda target: (-target.size_m2, target.id))[:MOST_TARGETS]
        time_left_s = max(0.0, self.options.horizon_s - belief.t_s)
        plan = solve_inspection_now(belief, robots, targets, time_left_s)
        finish = [route.finish_battery_j for route in plan.routes]
        reserve = [robot.profile.reserve_j for robot in robots]
        cells_left = 0  # the caller has made sure: no robot can explore another area
        verdict = gate(cells_left, plan.t_dpi_s or 0.0, time_left_s, finish, reserve) if plan.routes else None
        visits = sum(len(route.stops) for route in plan.routes)
        go = verdict is not None and verdict.go and visits > 0
        reason = "no plan" if verdict is None else verdict.reason or f"{visits} of {len(targets)} postponed targets fit"
        notes.append(Note("inspection_gate", reason=("entered: " if go else "not entered: ") + reason))
        claim = plan.claim.model_copy(update={"certificate": None, "wall_s": {}})
        notes.append(Note("replan", reason=f"inspection: {len(targets)} targets", claim=claim))
        self.goals.clear()
        self.routes = {route.robot: [stop.target for stop in route.stops] for route in plan.routes} if go else {}
        served = {target for route in self.routes.values() for target in route}
        self.given_up |= {target.id for target in targets if target.id not in served}


def solve_inspection_now(
    belief: Belief, robots: list[RobotView], targets: list[LocalTarget], time_left_s: float
) -> InspectionPlan:
    """Return an inspection of targets, with their sizes as values, from where the robots are."""
    points = np.array([target.stand_m for target in targets], dtype=np.float64).reshape(-1, 2)
    travel = []
    tables = {}
    for robot in robots:
        if robot.profile not in tables:
            tables[robot.profile] = belief.table(robot.profile, points)
    one_type = len(tables) == 1
    for robot in robots if not one_type else robots[:1]:
        time_s, energy_j = tables[robot.profile]
        travel += [
            _row(targets[i].id, targets[j].id, time_s[i, j], energy_j[i, j], robot, None if one_type else robot.id)
            for i, j in np.argwhere(np.isfinite(time_s)).tolist()
            if i != j
        ]
    for robot in robots:
        time_s, energy_j = belief.costs(robot, points)
        travel += [
            _row(f"at {robot.id}", targets[k].id, time_s[k], energy_j[k], robot, robot.id)
            for k in np.flatnonzero(np.isfinite(time_s)).tolist()
        ]
    instance = InspectionInstance(
        name="postponed targets",
        time_left_s=time_left_s,
        robots=tuple(
            InspectionRobot(
                id=robot.id,
                at=f"at {robot.id}",
                battery_j=max(0.0, robot.battery_j),
                reserve_j=max(0.0, min(robot.profile.reserve_j, robot.battery_j)),
            )
            for robot in robots
        ),
        targets=tuple(InspectionTarget(id=target.id, value=target.size_m2) for target in targets),
        travel=tuple(travel),
    )
    plan: InspectionPlan = solve(instance, time_limit_s=None, work_limit=WORK_LIMIT, threads=1, seed=0, explain=False)
    return plan


def _row(start: str, end: str, time_s: float, energy_j: float, robot: RobotView, name: str | None) -> InspectionTravel:
    """Return a drive with the sensors on: its energy is what the robot will have spent."""
    spent_j = float(energy_j) + robot.profile.sensing_w * float(time_s)
    return InspectionTravel.model_validate(
        {"from": start, "to": end, "time_s": float(time_s), "energy_j": spent_j, "robot": name}
    )
