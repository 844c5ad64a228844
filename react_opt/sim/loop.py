"""A mission from start to end: robots scan, maps arrive, the strategy decides, robots drive. The recipe on one page.

Simulated time advances in ticks of :data:`TICK_S`. Robots scan every :data:`SCAN_S` while their sensors are on;
their maps reach the belief as the link allows; the strategy decides every :data:`DECIDE_S` if the map has changed,
and at once when a robot arrives, gets stuck or dies; a robot that it leaves standing is a reason to ask again every few
seconds. Nothing depends on the machine's clock.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import hypot

import numpy as np

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import Mission
from react_opt.orchestrator.belief import RobotView
from react_opt.orchestrator.fleet_belief import FleetBelief
from react_opt.orchestrator.registry import make_strategy
from react_opt.orchestrator.strategy import Decision, Order, Strategy, StrategyOptions
from react_opt.sim.link import Channel
from react_opt.sim.news import News
from react_opt.sim.record import Recorder
from react_opt.sim.robot import SimRobot
from react_opt.sim.rules import Rules, sampled
from react_opt.sim.sensing import Lidars
from react_opt.sim.traffic import Traffic
from react_opt.sim.world import World
from react_opt.trace import Trace

TICK_S = 0.125
SCAN_S = 0.25
DECIDE_S = 1.0
_WAIT_S = 5.0  # a strategy that leaves a robot standing is asked again after so long: what it gave up may be tried anew
RULES_S = 0.25
REPLAN_S = 0.5
_LOOK_M = 4.0  # so far ahead a robot looks whether its way is still open
FRAME_S = 1.0
_PROGRESS_M = 0.3  # a robot that has not moved so far for stuck_s is stuck
_CHARGE_M = 0.5  # a robot charges when it stands within this of a charger

Progress = Callable[[float, float], None]


class Simulation:
    """A mission under way.

    Parameters
    ----------
    mission
        What to simulate.
    truth
        The map that the mission names.
    prior
        Its prior map, or None.
    strategy
        Who decides; by default the mission's own strategy.

    Raises
    ------
    UsageError
        Where a robot cannot stand at its start, or the strategy does not exist.
    """

    def __init__(
        self,
        mission: Mission,
        truth: OccupancyMap,
        prior: OccupancyMap | None = None,
        strategy: Strategy | None = None,
    ) -> None:
        profiles = {name: RobotProfile(**profile.model_dump()) for name, profile in mission.profiles.items()}
        used = [profiles[robot.profile] for robot in mission.robots]
        starts = np.array([(robot.x_m, robot.y_m) for robot in mission.robots], dtype=np.float64)
        range_m = max(profile.lidar_range_m for profile in used)
        self.mission = mission
        self.world = World(truth, min(profile.radius_m for profile in used), range_m, starts)
        extent_m = mission.extent_m or self.world.extent_m(mission.cell_m)
        self.belief = FleetBelief(
            truth, extent_m, mission.cell_m, used, range_m=range_m, prior=prior, bodies_block=mission.blocking
        )
        self.strategy = make_strategy(mission.strategy, options_of(mission)) if strategy is None else strategy
        seeds = np.random.SeedSequence(mission.seed).spawn(len(mission.robots))
        self.robots = []
        for row, profile, seed in zip(mission.robots, used, seeds, strict=True):
            u, v = truth.world_to_pixel((row.x_m, row.y_m)) * truth.resolution_m
            yaw = row.yaw_rad - truth.origin_yaw_rad
            rng = np.random.default_rng(seed)
            robot = SimRobot(row.id, profile, float(u), float(v), yaw, profile.battery_j, rng)
            robot.anchor = (robot.u_m, robot.v_m, 0.0)
            self.robots.append(robot)
        self._by_id = {robot.id: robot for robot in self.robots}
        self.record = Recorder(mission, self.world, SCAN_S)
        self.news = News(self.belief, self.record)
        self.lidars = Lidars(mission, self.world)
        self.traffic = Traffic(self.world, self.robots, mission.blocking)
        self.rules = Rules(self.world, self.robots, self.belief, self.record) if mission.blocking else None
        self.channel = Channel(mission.link, self.world, self.robots)
        self._late: dict[str, Order] = {}
        self._deaths = {failure.robot: failure.t_s for failure in mission.failures}
        self._ticks = 0
        self._news = True
        self._decided = (-np.inf, -1)
        self._done = False
        self._ended = False

    @property
    def t_s(self) -> float:
        """Simulated time, s."""
        return self._ticks * TICK_S

    def run(self, *, on_progress: Progress | None = None, should_stop: Callable[[], bool] | None = None) -> Trace:
        """Simulate to the end, or until asked to stop; return the trace.

        Parameters
        ----------
        on_progress
            Called with the simulated time (s) and the coverage about once per simulated second.
        should_stop
            Polled at every tick.
        """
        while not self._ended:
            if should_stop is not None and should_stop():
                return self.record.trace(finished=False, scan_s=SCAN_S)
            self.step()
            if on_progress is not None and self._every(FRAME_S):
                on_progress(self.t_s, self.record.coverage)
        return self.record.trace(finished=True, scan_s=SCAN_S)

    def step(self) -> None:
        """Simulate one tick."""
        self._clocked("drive", self._lose_robots)
        if self._every(SCAN_S):
            self._clocked("sense", self._sense)
        if self._due():
            self._clocked("decide", self._decide)
        if self._every(FRAME_S):
            self._clocked("record", lambda: self.record.frame(self.t_s, self.robots))
        if self._over():
            self._end()
            return
        if self._every(REPLAN_S):
            self._clocked("drive", self._keep_to_open_ways)
        if self.rules is not None and len(self.robots) > 1 and self._every(RULES_S):
            self._clocked("traffic", self._apply_rules)
        self._clocked("drive", self._drive)
        self._ticks += 1

    def _every(self, period_s: float) -> bool:
        return self._ticks % round(period_s / TICK_S) == 0

    def _clocked(self, phase: str, work: Callable[[], None]) -> None:
        begun = time.perf_counter()
        work()
        self.record.wall_s[phase] = self.record.wall_s.get(phase, 0.0) + time.perf_counter() - begun

    # --- what happens in a tick ---

    def _lose_robots(self) -> None:
        """Let robots die that fail now or whose battery is empty."""
        for robot in self.robots:
            if not robot.alive:
                continue
            failed = self.t_s >= self._deaths.get(robot.id, np.inf)
            if failed or robot.battery_j <= 0:
                robot.battery_j = max(robot.battery_j, 0.0)
                robot.state, robot.speed_m_s, robot.turning_rad_s, robot.sensing = "dead", 0.0, 0.0, False
                robot.halt()
                kind = "robot_dead" if failed else "battery_empty"
                self.record.event(self.t_s, kind, robot=robot.id, reason="failure" if failed else "battery empty")
                self._news = True

    def _sense(self) -> None:
        """Switch sensors and scan."""
        for robot in self.robots:
            known = self.channel.known(robot)
            on = robot.alive and self.lidars.wanted(robot, known, self.belief)
            if on != robot.sensing and robot.alive:
                self.record.event(self.t_s, "sensing_on" if on else "sensing_off", robot=robot.id)
            robot.sensing = on
            self.record.track(robot, on)
            if on:
                self.channel.send(robot, self.lidars.scan(robot, known))
        arrived, turned = self.channel.advance(self.robots, self.t_s, SCAN_S)
        for pixels in arrived:
            rows, cols = np.divmod(pixels, self.world.map.cols)
            self.belief.merge(self.t_s, rows, cols, self.world.map.cells[rows, cols])
            self.record.learn(self.t_s, pixels)
        for name, up in turned:
            self.record.event(self.t_s, "link_up" if up else "link_down", robot=name)
            self._news = self._news or up
            if up and name in self._late:
                self._give(self._by_id[name], self._late.pop(name))

    def _due(self) -> bool:
        """Whether the strategy is to decide now."""
        last_s, version = self._decided
        if self.belief.version == 0:
            return False  # no map has arrived yet
        if self._news or (self.t_s >= last_s + DECIDE_S and version != self.belief.version):
            return True
        waits = not self._done and any(robot.state == "idle" for robot in self.robots)
        return waits and self.t_s >= last_s + _WAIT_S

    def _decide(self) -> None:
        """Report the robots to the belief, ask the strategy and hand out its orders."""
        for robot in self.robots:
            if self.channel.linked(robot) or not self._ticks:
                self.belief.report(self._view(robot))
        self.news.note(self.t_s)  # the switching rules go by what the areas were at the last decision
        begun = time.perf_counter()
        decision = self.strategy.decide(self.belief)
        self.record.decisions_wall_s.append(time.perf_counter() - begun)
        self._news, self._done = False, decision.done
        self._decided = (self.t_s, self.belief.version)
        self._obey(decision)

    def _obey(self, decision: Decision) -> None:
        for note in decision.notes:
            self.record.note(self.t_s, note)
        for order in decision.orders:
            robot = self._by_id[order.robot]
            if robot.alive and self.channel.linked(robot):
                self._give(robot, order)
            else:
                self._late[robot.id] = order  # it arrives with the link

    def _give(self, robot: SimRobot, order: Order) -> None:
        """Let a robot take an order."""
        if robot.target != order.target:
            if order.target is not None:
                self.record.event(self.t_s, "order", robot=robot.id, target=order.target)
            if self.mission.noise.waiting_s and order.path_m:
                robot.wait_s = float(robot.rng.exponential(self.mission.noise.waiting_s))
        robot.order = order
        if robot.yields_to is not None and order.path_m:
            return  # it goes on with its new order when the other robot has passed
        robot.yields_to = None
        robot.follow(self._on_grid(tuple(order.path_m)))
        if robot.state != "driving" or not robot.path:
            robot.anchor = (robot.u_m, robot.v_m, self.t_s)
        robot.state = "driving" if robot.path else "idle"

    def _view(self, robot: SimRobot) -> RobotView:
        unit = self.world.map.resolution_m
        x, y = self.world.map.pixel_to_world((robot.u_m / unit, robot.v_m / unit))
        return RobotView(
            robot.id, robot.profile, float(x), float(y), robot.heading_rad + self.world.map.origin_yaw_rad,
            robot.battery_j, "yielding" if robot.yields_to else robot.state, robot.target, robot.sensing, self.t_s,
        )  # fmt: skip

    def _keep_to_open_ways(self) -> None:
        """Let robots whose way turns out blocked find another one to the same end, or stop where there is none."""
        unit = self.world.map.resolution_m
        for robot in self.robots:
            if not robot.alive or not robot.path or robot.order is None or not robot.order.path_m:
                continue
            points = sampled([(robot.u_m, robot.v_m), *robot.path], unit, _LOOK_M)[2:]
            view = self._view(robot)
            if self.belief.way_open(view, self.world.map.pixel_to_world(points / unit)):
                continue
            goal = robot.order.path_m[-1]
            path = self.belief.path(view, goal) or self.belief.path(view, goal, optimistic=True)
            robot.yields_to = None
            robot.follow(self._on_grid(path))
            if not path:
                robot.state = "stuck"
                self.record.event(self.t_s, "robot_stuck", robot=robot.id, target=robot.target, reason="no way is left")
                self._news = True

    def _on_grid(self, path_m: tuple[tuple[float, float], ...]) -> list[tuple[float, float]]:
        unit = self.world.map.resolution_m
        pixels = self.world.map.world_to_pixel(np.array(path_m, dtype=np.float64).reshape(-1, 2)) * unit
        return [(float(u), float(v)) for u, v in pixels]

    def _apply_rules(self) -> None:
        assert self.rules is not None
        self.rules.apply(self.t_s, self._view)

    def _drive(self) -> None:
        """Move all robots by one tick, draw their energy, and see who has arrived or is stuck."""
        if self._every(1.0):
            for robot in self.robots:
                robot.draw_noise(self.mission.noise)
        self.traffic.move(TICK_S)
        self._charge()
        for robot in self.robots:
            if not robot.alive:
                continue
            robot.spend(TICK_S)
            robot.wait_s = max(0.0, robot.wait_s - TICK_S)
            u, v, since = robot.anchor
            if hypot(robot.u_m - u, robot.v_m - v) > _PROGRESS_M or not (robot.path or robot.yields_to):
                robot.anchor = (robot.u_m, robot.v_m, self.t_s)
            elif self.t_s - since > self.mission.stuck_s:
                self._abandon(robot)
            if robot.state == "driving" and not robot.path and robot.yields_to is None:
                robot.state = "idle"
                self._news = self._news or self.channel.linked(robot)
            if robot.state != "driving" and not self.channel.linked(robot) and not robot.path:
                robot.follow(self.channel.crumbs(robot))  # back to where it was heard

    def _abandon(self, robot: SimRobot) -> None:
        self.record.event(self.t_s, "robot_stuck", robot=robot.id, target=robot.target)
        self.record.event(
            self.t_s, "target_abandoned", robot=robot.id, target=robot.target,
            reason=f"no progress for {self.mission.stuck_s:g} s",
        )  # fmt: skip
        robot.halt()
        robot.yields_to = None
        robot.state = "stuck"
        robot.anchor = (robot.u_m, robot.v_m, self.t_s)
        self._news = True

    def _charge(self) -> None:
        """Charge the robots that stand at a charger, as many as it has slots, in the mission's order."""
        for charger in self.mission.chargers:
            u, v = self.world.map.world_to_pixel((charger.x_m, charger.y_m)) * self.world.map.resolution_m
            left = charger.slots
            for robot in self.robots:
                near = hypot(robot.u_m - u, robot.v_m - v) <= _CHARGE_M and robot.speed_m_s == 0.0
                if left and near and robot.alive and robot.battery_j < robot.profile.capacity_j:
                    left -= 1
                    robot.battery_j = min(robot.profile.capacity_j, robot.battery_j + charger.power_w * TICK_S)

    def _over(self) -> bool:
        alive = [robot for robot in self.robots if robot.alive]
        standing = all(not robot.path and robot.speed_m_s == 0.0 for robot in alive)
        return (
            self.t_s >= self.mission.horizon_s
            or not alive
            or (self._done and standing and not self._news and not self.channel.busy)
        )

    def _end(self) -> None:
        why = "horizon" if self.t_s >= self.mission.horizon_s else "done" if self._done else "no robot left"
        self.record.event(self.t_s, "mission_end", reason=why)
        if not self._every(FRAME_S):
            self.record.frame(self.t_s, self.robots)
        self._ended = True


def options_of(mission: Mission) -> StrategyOptions:
    """Return what a strategy is told about a mission."""
    return StrategyOptions(
        delta=mission.delta,
        step_s=mission.step_s,
        horizon_s=mission.horizon_s,
        window_steps=mission.window_steps,
        postpone_below=mission.postpone_below,
        seed=mission.seed,
    )
