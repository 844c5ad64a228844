"""REACT as the paper describes it (algorithm 1), with this engine's own models.

The algorithm's lines, as they are named in the comments below:

     1  initialise e, plan areas (OROS), send each robot to its first one
     2  repeat at every map update
     3      merge the maps of the robots                                  (the belief has done it)
     4      find the local targets of each robot's area; set priorities, postpone the low ones
     5      assign local targets to robots (assignment ILP)
     6      move towards them
     7      until c[a,b] >= delta, or no accessible target of the area is left that is not postponed
     8      update e, and call OROS for the next areas
     9  until no robot can explore another cell
    10  if time and battery allow (equation 2): deferred-priority inspection of the postponed targets
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from react_opt.instance import (
    AssignmentCost,
    AssignmentInstance,
    AssignmentRobot,
    AssignmentTarget,
    AssignmentWeights,
)
from react_opt.models.priorities import is_postponed
from react_opt.orchestrator.belief import AreaView, Belief, LocalTarget, RobotView
from react_opt.orchestrator.deferred import Inspection
from react_opt.orchestrator.highlevel import Place, area_at, goal_of, high_level
from react_opt.orchestrator.local_targets import LocalTargets
from react_opt.orchestrator.orders import Driver, able, distance_m
from react_opt.orchestrator.priority import priorities
from react_opt.orchestrator.strategy import Decision, Note, Order, StrategyOptions
from react_opt.orchestrator.survey import Survey
from react_opt.plan import AssignmentPlan
from react_opt.planner import solve

ARRIVED_M = 1.0
TIME_REF_S = 30.0  # driving so long costs as much as the largest gain of one term
KEEP_S = 2.0  # turning away from a target that is already approached costs about so long
MOVED_M = 1.0  # a goal that moves further calls for a new way
SEEN_M = 0.5  # a target that is still unknown from here will stay so
ASSIGN_WORK = 2000
TRIES = 8


@dataclass
class RobotState:
    """What REACT remembers of a robot: its area, whether it has been inside, and where it was last sent."""

    area: str | None = None
    entered: bool = False
    goal: str | None = None


class React:
    """The paper's algorithm 1 (see this module)."""

    postpones = True  # whether low priorities are put off to the inspection
    ends_at_delta = True  # whether an area is left as soon as c >= delta

    def __init__(self, options: StrategyOptions) -> None:
        self.options = options
        self.explored: set[str] = set()
        self.abandoned: dict[str, tuple[float, float] | None] = {}
        self.postponed: set[str] = set()
        self.state: dict[str, RobotState] = {}
        self.inspection: Inspection | None = None
        self.driver = Driver()
        self.survey: Survey | None = None
        self.local: LocalTargets | None = None
        self.looked: list[tuple[float, float]] = []
        self.targets: tuple[LocalTarget, ...] = ()
        self.begun = False

    def decide(self, belief: Belief) -> Decision:
        """Return what changes now; called at every map update (line 2)."""
        notes: list[Note] = []
        if self.survey is None or self.local is None:
            self.local = LocalTargets(min(robot.profile.lidar_range_m for robot in belief.robots))
            self.survey = Survey([robot.profile for robot in belief.robots])
        self.survey.update(belief.map, belief.version)
        areas = {area.id: area for area in belief.areas}
        robots = able(belief)
        lost = [name for name in self.state if name not in {robot.id for robot in robots}]
        for name in lost:
            del self.state[name]
        for robot in robots:
            self.state.setdefault(robot.id, RobotState())
        self.targets = self.local.find(belief, self.survey, robots, self.looked)
        self._abandon(robots, notes)
        changed = bool(lost) or not self.begun
        orders: list[Order] = []
        for _ in range(TRIES):  # a goal without a way is given up, and all is decided anew without it
            open_targets = self._targets(belief, robots, notes)  # line 4
            costs = {robot.id: self._costs(belief, robot, open_targets) for robot in robots}
            for area in belief.areas:
                changed |= self._close_area(area, robots, open_targets, costs, notes)  # lines 7 and 8
            if changed:
                self.begun = True
                self._call_oros(belief, robots, areas, open_targets, costs, notes)  # lines 1 and 8
            active = [robot for robot in robots if self.state[robot.id].area is not None]
            if not active:  # line 9
                return self._inspect(belief, robots, notes)  # line 10
            self.inspection = None
            chosen = self._assign(active, open_targets, costs, notes)  # line 5
            answers = {robot.id: self._move(belief, robot, areas, chosen, notes) for robot in robots}  # line 6
            orders += [order for answer in answers.values() for order in answer or ()]
            lost_way = [robot for robot in robots if answers[robot.id] is None]
            if not lost_way:
                break
            orders += [order for robot in lost_way for order in self.driver.stop(robot)]
            changed = False
        return Decision(_latest(orders), notes)

    # --- targets ---

    def _abandon(self, robots: list[RobotView], notes: list[Note]) -> None:
        """Give up targets whose robot is stuck, or that stay unknown though a robot stood where they should be seen."""
        known = {target.id: target for target in self.targets}
        self.abandoned = {name: at for name, at in self.abandoned.items() if name in known}
        for name, at in list(self.abandoned.items()):
            stand_m = known[name].stand_m
            if at is not None and stand_m is not None and np.hypot(at[0] - stand_m[0], at[1] - stand_m[1]) > MOVED_M:
                del self.abandoned[name]  # it is to be seen from elsewhere now: promoted again
        for robot in robots:
            state = self.state[robot.id]
            if state.goal is None or state.goal not in known:
                continue
            goal_m = self.driver.goal(robot)
            there = robot.state == "idle" and goal_m is not None and distance_m(robot, goal_m) <= SEEN_M
            if there or robot.state == "stuck":
                why = "still unknown from where it should be seen" if there else "no progress"
                notes.append(Note("target_abandoned", robot=robot.id, target=state.goal, reason=why))
                self.abandoned[state.goal] = known[state.goal].stand_m
                if there and goal_m is not None:
                    self.looked.append(goal_m)
                state.goal = None

    def _targets(self, belief: Belief, robots: list[RobotView], notes: list[Note]) -> list[tuple[LocalTarget, float]]:
        """Return the targets that are not postponed, with their priorities (line 4)."""
        points = np.array([target.stand_m or (target.x_m, target.y_m) for target in self.targets]).reshape(-1, 2)
        values = priorities(self.targets, belief.soonest_s(robots, points) if robots else None)
        low = is_postponed(values, self.options.postpone_below) if self.postpones else np.zeros(len(values), bool)
        kept: list[tuple[LocalTarget, float]] = []
        postponed = set()
        for target, value, is_low in zip(self.targets, values.tolist(), low.tolist(), strict=True):
            if is_low or target.id in self.abandoned:
                postponed.add(target.id)
                if target.id not in self.postponed:
                    why = f"priority {value:.2f}" if is_low else "abandoned"
                    notes.append(
                        Note("target_postponed", target=target.id, reason=why, x_m=target.x_m, y_m=target.y_m,
                             size_m2=target.size_m2)
                    )  # fmt: skip
            else:
                kept.append((target, value))
        self.postponed = postponed
        return kept

    def _costs(
        self, belief: Belief, robot: RobotView, targets: list[tuple[LocalTarget, float]]
    ) -> dict[str, tuple[float, float]]:
        """Return s and J to the targets of a robot's area that it can reach over known-free space."""
        area = self.state[robot.id].area
        mine = [target for target, _ in targets if target.area == area]
        if area is None or not mine:
            return {}
        points = np.array([target.stand_m for target in mine], dtype=np.float64)
        time_s, energy_j = belief.costs(robot, points)
        return {
            target.id: (float(t), float(e))
            for target, t, e in zip(mine, time_s, energy_j, strict=True)
            if np.isfinite(t)
        }

    # --- areas ---

    def _close_area(
        self,
        area: AreaView,
        robots: list[RobotView],
        targets: list[tuple[LocalTarget, float]],
        costs: dict[str, dict[str, tuple[float, float]]],
        notes: list[Note],
    ) -> bool:
        """Free the robots of an area that is done (line 7) and update e (line 8); return whether anything changed."""
        full = area.known_share >= self.options.delta and self.ends_at_delta
        if full and area.id not in self.explored:
            self.explored.add(area.id)
            notes.append(
                Note("area_explored", target=area.id, reason=f"c = {area.known_share:.3f}", x_m=area.x_m, y_m=area.y_m)
            )
        freed = False
        for robot in robots:
            state = self.state[robot.id]
            if state.area != area.id:
                continue
            assert self.survey is not None
            arrived = distance_m(robot, goal_of(self.survey.map, area)) <= ARRIVED_M
            state.entered |= arrived
            ended = state.entered or (robot.state in ("idle", "stuck") and robot.target == area.id)
            nothing = ended and not costs[robot.id]
            if not (full or area.unreachable or nothing):
                continue
            if area.id not in self.explored and not full:
                why = "unreachable" if area.unreachable else "no accessible target is left"
                notes.append(Note("area_explored", robot=robot.id, target=area.id, reason=why))
            self.explored.add(area.id)
            state.area, state.entered, state.goal, freed = None, False, None, True
        return freed

    def _call_oros(
        self,
        belief: Belief,
        robots: list[RobotView],
        areas: dict[str, AreaView],
        targets: list[tuple[LocalTarget, float]],
        costs: dict[str, dict[str, tuple[float, float]]],
        notes: list[Note],
    ) -> None:
        """Plan areas anew and send the free robots to their next ones; busy robots keep theirs."""
        assert self.survey is not None
        places = []
        for robot in robots:
            area = self.state[robot.id].area
            if area is None:
                places.append(Place(robot, area_at(belief, (robot.x_m, robot.y_m)).id))
                continue
            reached = list(costs[robot.id].values())
            time_s, _ = belief.costs(robot, np.array([areas[area].stand_m]), optimistic=True)
            until_s = 0.0 if np.isnan(time_s[0]) or self.state[robot.id].entered else float(time_s[0])
            places.append(Place(robot, area, max([until_s, *(t for t, _ in reached)])))
        plan = high_level(belief, self.survey, self.options, places, frozenset(self.explored))
        notes.append(plan.note)
        for place in places:
            name = place.robot.id
            state = self.state[name]
            if state.area is not None:
                continue
            here = (place.area,) if plan.explored_by.get(place.area) == name else ()
            mine = [a for a in (*here, *plan.routes.get(name, ())) if plan.explored_by.get(a) == name]
            if mine:
                state.area, state.entered, state.goal = mine[0], False, None
                notes.append(Note("order", robot=name, target=mine[0], reason="next area of the plan"))

    # --- assignment and motion ---

    def _assign(
        self,
        robots: list[RobotView],
        targets: list[tuple[LocalTarget, float]],
        costs: dict[str, dict[str, tuple[float, float]]],
        notes: list[Note],
    ) -> dict[str, LocalTarget]:
        """Assign local targets to the robots of their areas (line 5)."""
        wanted = {name for robot in robots for name in costs[robot.id]}
        known = {target.id: (target, value) for target, value in targets if target.id in wanted}
        if not known:
            return {}
        rows = []
        for robot in robots:
            for name, (time_s, energy_j) in costs[robot.id].items():
                kept = KEEP_S if self.state[robot.id].goal == name else 0.0
                rows.append(
                    AssignmentCost(robot=robot.id, target=name, time_s=max(0.0, time_s - kept), energy_j=energy_j)
                )
        floor = 2.0 + max(row.time_s for row in rows) / TIME_REF_S
        instance = AssignmentInstance(
            name="local targets",
            robots=tuple(
                AssignmentRobot(
                    id=robot.id, battery_j=max(0.0, robot.battery_j),
                    reserve_j=max(0.0, min(robot.profile.reserve_j, robot.battery_j)), zone=tuple(costs[robot.id]),
                )
                for robot in robots
            ),
            # the floor makes every accessible target worth its way: the priorities decide which, not whether
            targets=tuple(AssignmentTarget(id=name, gain=floor + value) for name, (_, value) in known.items()),
            costs=tuple(rows),
            weights=AssignmentWeights(alpha=1.0, beta=1.0, time_ref_s=TIME_REF_S),
        )  # fmt: skip
        plan: AssignmentPlan = solve(
            instance, time_limit_s=None, work_limit=ASSIGN_WORK, threads=1, seed=0, explain=False
        )
        chosen = {row.robot: known[row.target][0] for row in plan.assigned}
        for robot in robots:
            taken = chosen.get(robot.id)
            if taken is not None and self.state[robot.id].goal != taken.id:
                notes.append(
                    Note("target_taken", robot=robot.id, target=taken.id, x_m=taken.x_m, y_m=taken.y_m,
                         size_m2=taken.size_m2)
                )  # fmt: skip
        return chosen

    def _move(
        self,
        belief: Belief,
        robot: RobotView,
        areas: dict[str, AreaView],
        chosen: dict[str, LocalTarget],
        notes: list[Note],
    ) -> list[Order] | None:
        """Send a robot to its local target, or to its area while it has none (line 6).

        None where there is no way: the target is abandoned; an area counts as entered, for the robot gets no nearer.
        """
        assert self.survey is not None
        state = self.state[robot.id]
        if state.area is None:
            state.goal = None
            return self.driver.stop(robot)
        target = chosen.get(robot.id)
        if target is not None and target.stand_m is not None:
            state.goal, goal_m = target.id, target.stand_m
        else:
            state.goal, goal_m = state.area, goal_of(self.survey.map, areas[state.area])
        orders = self.driver.go(belief, self.survey, robot, goal_m, state.goal)
        if orders is not None:
            return orders
        if target is not None:
            notes.append(Note("target_abandoned", robot=robot.id, target=target.id, reason="no way"))
            self.abandoned[target.id] = target.stand_m
        elif state.entered:
            return self.driver.stop(robot)  # it waits for the targets of its area that others are assigned to
        state.entered |= target is None
        return None

    # --- the deferred-priority inspection ---

    def _inspect(self, belief: Belief, robots: list[RobotView], notes: list[Note]) -> Decision:
        if self.inspection is None:
            self.inspection = Inspection(self.options, self.driver)
        assert self.survey is not None
        orders, done = self.inspection.step(belief, self.survey, robots, self.targets, self.looked, notes)
        return Decision(orders, notes, done)


def _latest(orders: list[Order]) -> list[Order]:
    """Return the last order of each robot."""
    return list({order.robot: order for order in orders}.values())
