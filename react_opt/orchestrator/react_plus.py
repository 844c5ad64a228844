"""``react_plus``, this engine's own strategy: the whole fleet's tours through all that is unexplored, always anew.

It differs from REACT (:mod:`react_opt.orchestrator.react`) in what is decided together: there is no area to finish
before the next one.

* Pieces of the frontier and whole unexplored areas are targets alike, each with the free area that it is expected to
  reveal (:mod:`react_opt.orchestrator.regions`) and the nearest place from which enough of it can be seen. A region
  stays the same one as long as its hidden ground does, wherever its frontier moves.
* The tours of all robots through all targets are planned together (:mod:`react_opt.orchestrator.tours`), so that
  coverage grows early and the end comes soon: a small region is taken along where coming back for it would cost more,
  or where it is worth the time at a price per m^2 that is the same in each decision; an area that has been seen in
  passing is no target any more. Crumbs are left until nothing else is.
* What is seen of other regions on a way counts (:mod:`react_opt.orchestrator.passing`): a region that will have been
  seen in passing is not driven to, and ways that show more are preferred.
* Robots are led through the next few places of their tours on ways that are quick to drive
  (:mod:`react_opt.orchestrator.guide`, :mod:`react_opt.orchestrator.smooth`).
* The regions of a robot that does not get on go to the others (:mod:`react_opt.orchestrator.setbacks`).

The plan is made anew whenever a target has been seen, a robot stands, and every few seconds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.orchestrator.belief import Belief, FloatArray, RobotView
from react_opt.orchestrator.guide import Guide
from react_opt.orchestrator.orders import able
from react_opt.orchestrator.passing import in_passing
from react_opt.orchestrator.regions import HiddenSpace, Region, Regions
from react_opt.orchestrator.setbacks import Setbacks
from react_opt.orchestrator.strategy import Decision, Note, Order, StrategyOptions
from react_opt.orchestrator.survey import COARSE, Block, Survey
from react_opt.orchestrator.survey_drives import ways_out
from react_opt.orchestrator.survey_kernels import OPEN
from react_opt.orchestrator.tours import Tasks, better_tours, insert_all
from react_opt.orchestrator.views import count_seen

REPLAN_S = 3.0
TRIES = 8
SHARES = np.array([0.7, 0.8, 0.9, 0.95, 0.97])
WEIGHTS = np.array([0.3, 0.3, 0.6, 0.6, 3.0])
"""Shares of the expected whole whose times count, and how much."""
SWEEPS = 16.0
"""A m^2 is left behind if seeing it takes the fleet so many times what sweeping an open hall would take."""
CRUMB_M2 = 0.5
"""Regions that are worth less are left until there are no others."""
HIDDEN_SPACE = HiddenSpace(free_share=0.7, mean_free_m=6.0, most_per_m=7.0)
"""A room behind a door is worth most of what is hidden there: at a price, no closet is overrated."""
HIDDEN_SLOWER = 1.5
"""Ways through hidden space take so much longer, if there are any: most walls have another side."""
KEEP_S = 2.0
"""What turning away from the present target costs, s: new plans must be better than that."""
BETTER_S = 12.0
"""New tours must cost so much less than the last ones with what is new put in, s (as of :func:`better_tours`)."""
SERVICE_S = 1.0
"""What looking into a region takes beyond the drive, s: braking, turning, driving off."""
MOST_TARGETS = 40
WORK = 8_000
FAR_S = 1e4
AHEAD_S, NEAR_M = 1.5, 0.4
"""Which way a robot sets out is seen so far ahead; what lies nearer than that has no direction."""
SHARP_RAD = 0.8
"""A robot slows down for a sharper turn."""
FIELD_S = 6.0
"""Drive times from a place are worked out again after so long, s."""
SAME_M = 2.5
"""A region whose frontier moved less is the same one."""
GONE = 0.25
"""A region of which no more than this share is still hidden has been seen."""
SEEN_M, PASSED_M = 0.6, 0.25
STOPS = 3
"""An order leads through so many regions at most."""


class ReactPlus:
    """The strategy of this module."""

    def __init__(self, options: StrategyOptions) -> None:
        self.options = options
        self.guide = Guide()
        self.survey: Survey | None = None
        self.regions: Regions | None = None
        self.goals: dict[str, Region] = {}
        self.then: dict[str, list[Region]] = {}
        self.was_at: dict[str, tuple[float, float]] = {}
        self.names: dict[str, str] = {}
        self.tours: list[list[tuple[float, float]]] = []
        self.setbacks = Setbacks()
        self.looked: list[tuple[float, float]] = []
        self.fields: dict[Block, tuple[float, FloatArray]] = {}
        self.serial = 0
        self.planned_s = -np.inf
        self.over = False

    def decide(self, belief: Belief) -> Decision:
        """Return what changes now."""
        robots = able(belief)
        if self.survey is None or self.regions is None:
            self.survey = Survey([robot.profile for robot in belief.robots], HIDDEN_SLOWER)
            self.regions = Regions(min(robot.profile.lidar_range_m for robot in belief.robots), HIDDEN_SPACE)
        self.survey.update(belief.map, belief.version)
        notes: list[Note] = []
        if not robots:
            return Decision(done=True)
        due = belief.t_s >= self.planned_s + REPLAN_S or len(self.goals) < len(robots)
        for robot in robots:
            due |= self._settle(belief, robot, notes)
        self.was_at = {robot.id: (robot.x_m, robot.y_m) for robot in robots}
        orders: list[Order] = []
        for _ in range(TRIES):  # a goal without a way is given up, and the others are planned without it
            if due:
                self._plan(belief, robots, notes)
            answers = {robot.id: self._orders(belief, robot) for robot in robots}
            orders += [order for answer in answers.values() for order in answer or ()]
            due = any(answer is None for answer in answers.values())
            if not due:
                break
        return Decision(orders, notes, done=self.over)

    def _settle(self, belief: Belief, robot: RobotView, notes: list[Note]) -> bool:
        """Look at a robot's goal: seen, reached in vain, or still to be driven to. Return whether to plan anew."""
        assert self.survey is not None
        assert self.regions is not None
        goal = self.goals.get(robot.id)
        if goal is None:
            return False
        name = self.names[robot.id]
        still = robot.state in ("idle", "stuck")
        passed_m = _passed_m(self.was_at.get(robot.id, (robot.x_m, robot.y_m)), robot, goal.view_m)
        near = passed_m <= (SEEN_M if still else PASSED_M)
        if still or near:
            if near or robot.state == "stuck":
                if near:
                    self.looked.append(goal.view_m)
                else:
                    self.setbacks.give_up(robot, goal.at_m, belief.t_s)
                    self.setbacks.stuck(robot)
                why = "looked at; what is left is seen from elsewhere" if near else "no progress"
                notes.append(Note("target_abandoned", robot=robot.id, target=name, reason=why))
            return True
        if len(goal.blocks):
            rows, cols = goal.blocks[:, 0], goal.blocks[:, 1]
            shape = self.survey.hidden.shape
            inside = (rows < shape[0]) & (cols < shape[1])
            hidden = goal.blocks[inside][self.survey.hidden[rows[inside], cols[inside]] > 0]
            reach = self.regions.range_m / self.survey.block_m
            # what is hidden still but not in sight from the place to look from is no reason to go there
            seen = count_seen(self.survey.blocks, self.survey.solids, *goal.view, hidden, COARSE, reach, 0.0)
            if seen <= GONE * len(rows):
                notes.append(Note("target_inspected", robot=robot.id, target=name))
                return True
        return False

    # --- planning ---

    def _plan(self, belief: Belief, robots: list[RobotView], notes: list[Note]) -> None:
        assert self.survey is not None
        assert self.regions is not None
        self.planned_s = belief.t_s
        fields = np.array([self.survey.times_from(robot.x_m, robot.y_m, optimistic=True) for robot in robots])
        self.setbacks.forget(robots, belief.t_s)
        found = self.regions.find(self.survey, belief.areas, fields.min(axis=0), self.looked)
        out = self.setbacks.out_of_reach(robots, [region.at_m for region in found])
        found = [region for k, region in enumerate(found) if not out[:, k].all()]
        found = [region for region in found if region.value_m2 >= CRUMB_M2] or found
        found = sorted(found, key=lambda region: -region.value_m2)[:MOST_TARGETS]
        self.over = not found
        if not found:
            self.goals, self.tours = {}, []
            return
        start_s = self._starts(robots, fields, found) + SERVICE_S + self.setbacks.delay_s(robots)[:, None]
        out = self.setbacks.out_of_reach(robots, [region.at_m for region in found])
        start_s[out | ~np.isfinite(start_s)] = FAR_S
        between_s, between = self._between(belief.t_s, found)
        value = np.array([region.value_m2 for region in found])
        known_m2 = float(np.count_nonzero(self.survey.blocks == OPEN)) * self.survey.block_m**2
        first = np.array([self._same(self.goals.get(robot.id), found) for robot in robots], dtype=np.int64)
        left_s = max(1.0, self.options.horizon_s - belief.t_s)
        sweep_m2_s = sum(robot.profile.lidar_range_m * robot.profile.speed_max_m_s for robot in robots)
        price_s = SWEEPS / sweep_m2_s
        at_first, on_way = in_passing(self.survey, self.regions, found, (fields, between))
        tasks = Tasks(
            start_s, between_s, at_first, on_way, value, known_m2, SHARES, WEIGHTS, price_s, left_s, first, KEEP_S
        )
        kept = insert_all(*self._begin(found, len(robots)), tasks)
        tours = better_tours(kept, tasks, WORK, BETTER_S)
        self.tours = [[found[k].at_m for k in tour] for tour in tours]
        for n, (robot, tour) in enumerate(zip(robots, tours, strict=True)):
            self.then[robot.id] = [found[k] for k in tour[1:STOPS]]
            self._take(robot, found[tour[0]] if tour and not out[n, tour[0]] else None, notes)
        self.goals = {name: goal for name, goal in self.goals.items() if name in {robot.id for robot in robots}}

    def _starts(self, robots: list[RobotView], fields: FloatArray, found: list[Region]) -> FloatArray:
        """Return ``(R, K)`` s from robots to regions: the drive, and the turn onto the way there with its braking.

        Without the turn a plan that sends a robot back the way it came looks as good as one that goes on.
        """
        assert self.survey is not None
        views = np.array([region.view for region in found], dtype=np.int64)
        rows = []
        for robot, field in zip(robots, fields, strict=True):
            ahead = ways_out(field, views, AHEAD_S)
            x, y = self.survey.to_blocks((robot.x_m, robot.y_m)) / COARSE
            dx, dy = ahead[:, 1] + 0.5 - x, ahead[:, 0] + 0.5 - y
            heading = robot.yaw_rad - self.survey.map.origin_yaw_rad
            turn = np.abs((np.arctan2(dy, dx) - heading + np.pi) % (2 * np.pi) - np.pi)
            turn[np.hypot(dx, dy) * self.survey.coarse_m < NEAR_M] = 0.0
            profile = robot.profile
            brakes_s = np.where(turn > SHARP_RAD, profile.speed_max_m_s / profile.accel_m_s2, 0.0)
            rows.append(field[views[:, 0], views[:, 1]] + profile.turn_time_s(turn) + brakes_s)
        return np.array(rows)

    def _between(self, now_s: float, found: list[Region]) -> tuple[FloatArray, FloatArray]:
        """Return s between the places of regions, and s from each of them to everywhere, a few seconds old perhaps."""
        assert self.survey is not None
        fields = np.array([self._field(now_s, region.view) for region in found])
        self.fields = {block: row for block, row in self.fields.items() if now_s <= row[0] + FIELD_S}
        views = np.array([region.view for region in found], dtype=np.int64)
        between = fields[:, views[:, 0], views[:, 1]] + SERVICE_S
        between[~np.isfinite(between)] = FAR_S
        return between, fields

    def _field(self, now_s: float, block: Block) -> FloatArray:
        """Return drive times from a block, a few seconds old perhaps."""
        assert self.survey is not None
        made_s, field = self.fields.get(block, (-np.inf, np.zeros((0, 0))))
        if now_s > made_s + FIELD_S or field.shape != self.survey.hidden.shape:
            field = self.survey.times_from(*self.survey.point_of(block), optimistic=True)
            self.fields[block] = (now_s, field)
        return field

    def _same(self, goal: Region | None, found: list[Region]) -> int:
        """Return the index of the region that a goal has become, -1 where it is gone."""
        if goal is None:
            return -1
        parts = [k for k, region in enumerate(found) if region.is_part_of(goal, SAME_M)]
        at = goal.at_m
        return min(parts, key=lambda k: float(np.hypot(found[k].at_m[0] - at[0], found[k].at_m[1] - at[1])), default=-1)

    def _begin(self, found: list[Region], robots: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the last tours in terms of the regions found now, and the regions that are in none of them."""
        order: list[int] = []
        left = set(range(len(found)))
        at = np.array([region.at_m for region in found])
        tours = self.tours if len(self.tours) == robots else []
        for n in range(robots):
            if n:
                order.append(-1)
            for x, y in tours[n] if tours else []:
                near = [k for k in left if np.hypot(at[k, 0] - x, at[k, 1] - y) <= SAME_M]
                if near:
                    best = min(near, key=lambda k: (float(np.hypot(at[k, 0] - x, at[k, 1] - y)), k))
                    order.append(best)
                    left.discard(best)
        return np.array(order, dtype=np.int64), np.array(sorted(left), dtype=np.int64)

    # --- orders ---

    def _take(self, robot: RobotView, region: Region | None, notes: list[Note]) -> None:
        if region is None:
            self.goals.pop(robot.id, None)
            return
        before = self.goals.get(robot.id)
        self.goals[robot.id] = region
        if before is not None and region.is_part_of(before, SAME_M):
            return
        self.serial += 1
        self.names[robot.id] = f"region {self.serial}"
        notes.append(
            Note(
                "target_taken",
                robot=robot.id,
                target=self.names[robot.id],
                reason="area" if region.frontier_m == 0 else f"{region.frontier_m:.1f} m of frontier",
                x_m=region.at_m[0],
                y_m=region.at_m[1],
                size_m2=region.value_m2,
            )
        )

    def _stops(
        self, robot: RobotView, goal: Region, area_of: NDArray[np.int64], explored: NDArray[np.bool_]
    ) -> list[Block]:
        """Return the places that a robot's order leads through.

        Sensors may be off in explored areas but for the one where a way ends: it ends where the robot is to look.
        """
        stops = [goal.view]
        for region in self.then.get(robot.id, []):
            here, there = int(area_of[stops[-1]]), int(area_of[region.view])
            if explored[here] and there != here:
                break
            stops.append(region.view)
        return stops

    def _orders(self, belief: Belief, robot: RobotView) -> list[Order] | None:
        """Return the orders of a robot, None where there is no way to its goal, which is given up."""
        assert self.survey is not None
        goal = self.goals.get(robot.id)
        if goal is None:
            return self.guide.stop(robot)
        assert self.regions is not None
        area_of = self.regions.areas_of_blocks(self.survey, belief.areas)
        explored = np.array([area.known_share >= self.options.delta for area in belief.areas])
        stops = self._stops(robot, goal, area_of, explored)
        orders = self.guide.go(belief, self.survey, robot, self.names[robot.id], stops)
        if orders is None:
            self.setbacks.give_up(robot, goal.at_m, belief.t_s)
            del self.goals[robot.id]
        return orders


def _passed_m(before: tuple[float, float], robot: RobotView, point: tuple[float, float]) -> float:
    """Return how near a robot has come to a point on the straight line from where it was, m."""
    dx, dy = robot.x_m - before[0], robot.y_m - before[1]
    square = dx * dx + dy * dy
    share = 0.0 if square == 0 else ((point[0] - before[0]) * dx + (point[1] - before[1]) * dy) / square
    share = min(1.0, max(0.0, share))
    return float(np.hypot(before[0] + share * dx - point[0], before[1] + share * dy - point[1]))
