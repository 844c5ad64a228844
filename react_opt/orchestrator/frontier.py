"""Exploration by frontiers, the base of the baselines: go where known-free space borders the unknown.

All of them share REACT's sensing, motion, path costs and switching; they differ in :meth:`Frontiers.choose`. A robot
chooses anew when it has arrived, when its frontier is gone (it has been seen), and every few seconds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from react_opt.orchestrator.belief import Belief, FloatArray, RobotView
from react_opt.orchestrator.orders import Driver, able, distance_m
from react_opt.orchestrator.strategy import Decision, Note, Order, StrategyOptions
from react_opt.orchestrator.survey import Cluster, Survey

SHORTEST_M = 0.4  # shorter frontiers are noise: a robot is wider
TRIES = 8
RECONSIDER_S = 3.0  # explore_lite's planner_frequency is 0.33 Hz
SAME_M = 2.0  # a frontier that moved less is the same one
STAND_BLOCKS = 6  # so many coarse blocks away from a frontier a place to stand is looked for
SEEN_M = 0.5  # a frontier that is still there when a robot stands at it so near is given up


@dataclass(frozen=True, eq=False)
class Choice:
    """What the robots choose from.

    Parameters
    ----------
    robots
        Those that choose.
    clusters
        The frontiers, ``F`` of them.
    time_s, energy_j
        ``(R, F)`` costs to drive there, infinite where there is no way.
    beyond_s
        ``(F,)`` s from each frontier to the unexplored area nearest to it, for variants that know the areas; else 0.
    """

    robots: Sequence[RobotView]
    clusters: Sequence[Cluster]
    time_s: FloatArray
    energy_j: FloatArray
    beyond_s: FloatArray


class Frontiers(ABC):
    """Base of the frontier strategies (see this module)."""

    knows_areas = False

    def __init__(self, options: StrategyOptions) -> None:
        self.options = options
        self.survey: Survey | None = None
        self.driver = Driver()
        self.goal_m: dict[str, tuple[float, float]] = {}
        self.names: dict[str, str] = {}
        self.serial = 0
        self.given_up: list[tuple[float, float]] = []
        self.last_s = -np.inf

    @abstractmethod
    def choose(self, choice: Choice) -> list[int]:
        """Return for each robot the index of its frontier, -1 for none."""

    def decide(self, belief: Belief) -> Decision:
        """Return what changes now."""
        robots = able(belief)
        if self.survey is None:
            self.survey = Survey([robot.profile for robot in belief.robots])
        self.survey.update(belief.map, belief.version)
        notes: list[Note] = []
        orders: list[Order] = []
        for _ in range(TRIES):  # a frontier without a way is given up, and another one chosen
            answers = self._choose(belief, robots, notes)
            orders += [order for answer in answers for order in answer or ()]
            if not any(answer is None for answer in answers):
                break
        return Decision(orders, notes, done=not self.goal_m)

    def _choose(self, belief: Belief, robots: list[RobotView], notes: list[Note]) -> list[list[Order] | None]:
        """Choose where it is due; return the orders of each robot, None where there is no way."""
        clusters = self._clusters(robots)
        for robot in robots:
            self._drop_goal(robot, clusters)
        self.goal_m = {name: at for name, at in self.goal_m.items() if name in {robot.id for robot in robots}}
        waits = [robot for robot in robots if robot.id not in self.goal_m]
        if clusters and (waits or belief.t_s >= self.last_s + RECONSIDER_S):
            self.last_s = belief.t_s
            choice = self._choice(belief, robots, clusters)
            for robot, picked in zip(robots, self.choose(choice), strict=True):
                self._take(robot, clusters[picked] if picked >= 0 else None, notes)
        return [self._orders(belief, robot) for robot in robots]

    def _take(self, robot: RobotView, cluster: Cluster | None, notes: list[Note]) -> None:
        if cluster is None:
            self.goal_m.pop(robot.id, None)
            return
        at = (cluster.x_m, cluster.y_m)
        before = self.goal_m.get(robot.id)
        if before is not None and np.hypot(before[0] - at[0], before[1] - at[1]) < SAME_M:
            return
        self.serial += 1
        self.goal_m[robot.id], self.names[robot.id] = at, f"frontier {self.serial}"
        why = f"{cluster.length_m:.1f} m of frontier"
        notes.append(
            Note("target_taken", robot=robot.id, target=self.names[robot.id], reason=why, x_m=at[0], y_m=at[1])
        )

    def _orders(self, belief: Belief, robot: RobotView) -> list[Order] | None:
        assert self.survey is not None
        at = self.goal_m.get(robot.id)
        if at is None:
            return self.driver.stop(robot)
        orders = self.driver.go(belief, self.survey, robot, self._stand(*at), self.names[robot.id])
        if orders is None:
            self.given_up.append(at)
            del self.goal_m[robot.id]
        return orders

    def _clusters(self, robots: Sequence[RobotView]) -> list[Cluster]:
        """Return the frontiers that some robot reaches and nobody has given up."""
        assert self.survey is not None
        if not robots:
            return []
        times = self.survey.times_from(robots[0].x_m, robots[0].y_m, optimistic=True)
        return [
            cluster
            for cluster in self.survey.clusters(SHORTEST_M)
            if not any(np.hypot(x - cluster.x_m, y - cluster.y_m) < SEEN_M for x, y in self.given_up)
            and np.isfinite(times[self.survey.block_of(*self._stand(cluster.x_m, cluster.y_m))])
        ]

    def _stand(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return where to drive to for a frontier: the drivable block nearest to its middle."""
        assert self.survey is not None
        block = self.survey.block_of(x_m, y_m)
        near = self.survey.nearest_block(block, self.survey.main, STAND_BLOCKS)
        return (x_m, y_m) if near is None else self.survey.point_of(near)

    def _drop_goal(self, robot: RobotView, clusters: Sequence[Cluster]) -> None:
        """Forget a goal that has been reached or seen, and give up one that stays unknown though reached."""
        at = self.goal_m.get(robot.id)
        if at is None:
            return
        near = [cluster for cluster in clusters if np.hypot(cluster.x_m - at[0], cluster.y_m - at[1]) < SAME_M]
        if not near:
            del self.goal_m[robot.id]
        elif robot.state in ("idle", "stuck"):
            del self.goal_m[robot.id]
            if robot.state == "stuck" or distance_m(robot, at) < 2 * SEEN_M + 1.0:
                self.given_up.append(at)

    def _choice(self, belief: Belief, robots: list[RobotView], clusters: list[Cluster]) -> Choice:
        assert self.survey is not None
        blocks = [self.survey.block_of(*self._stand(cluster.x_m, cluster.y_m)) for cluster in clusters]
        time_s, energy_j = np.empty((2, len(robots), len(clusters)))
        for row, robot in enumerate(robots):
            times = self.survey.times_from(robot.x_m, robot.y_m, optimistic=True)
            time_s[row] = [times[block] for block in blocks]
            profile = robot.profile
            energy_j[row] = time_s[row] * (profile.idle_w + profile.motion_w + profile.sensing_w)
        beyond_s = self._beyond(belief, clusters) if self.knows_areas else np.zeros(len(clusters))
        return Choice(robots, clusters, time_s, energy_j, beyond_s)

    def _beyond(self, belief: Belief, clusters: list[Cluster]) -> FloatArray:
        """Return for each frontier the s from it to the nearest area that is not explored."""
        left = [area for area in belief.areas if area.known_share < self.options.delta and not area.unreachable]
        if not left:
            return np.zeros(len(clusters))
        assert self.survey is not None
        blocks = np.array([self.survey.block_of(*self._stand(cluster.x_m, cluster.y_m)) for cluster in clusters])
        each = [self.survey.times_from(*area.stand_m, optimistic=True)[blocks[:, 0], blocks[:, 1]] for area in left]
        return np.asarray(np.min(each, axis=0), dtype=np.float64)
