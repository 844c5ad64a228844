"""The rules of the road: who makes way when robots meet, and who enters a narrow passage first.

Robots tell each other where they are and where they are going. Four times a second, in this order:

1. **Narrow passages are reserved.** A stretch of a robot's way where two robots cannot pass each other belongs to the
   first robot that comes within :data:`CLAIM_M` of it (in the mission's order where several come at once), until it
   has left it. Robots that go the same way may follow; one that would come against it waits before the entry.
2. **Who follows keeps its distance.** A robot whose way is taken by one that drives, and not towards it, brakes behind
   that one; when that one stands still for more than :data:`PATIENCE_S`, it is no longer followed but met.
3. **Who meets another, one of the two makes way.** Priority, from the highest: a robot that another one makes way for
   stands above all that the other meets (so priority is handed on along a queue); a robot inside a reserved passage
   before one outside; a driving one before a standing one; the earlier in the mission's order. The lower one
   (a) drives around the other, where that costs at most :data:`DETOUR_S` more, else
   (b) pulls over: it drives to the nearest place off the other's way, backwards along its own way if need be (robots
   of lower priority that stand there make way in their turn), and goes on when the other has passed, after
   :data:`HOLD_S` at the latest; and where there is no such place
   (c) the roles change, and the higher one makes way (a robot that stands in a dead end first comes out of it).
4. **Dead robots are driven around**; where that is not possible the robot waits, gets stuck, and abandons its target.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from math import hypot, inf, sqrt

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.orchestrator.belief import RobotView
from react_opt.orchestrator.fleet_belief import FleetBelief
from react_opt.sim.record import Recorder
from react_opt.sim.robot import ARRIVED_M, Point, SimRobot
from react_opt.sim.world import World

CLAIM_M = 1.5
DETOUR_S = 6.0
HOLD_S = 15.0
LOOK_M = 3.0
"""How far ahead along its way a robot looks for others."""

MARGIN_M = 0.06
"""Room that is planned for between two robots that pass each other."""

TOUCH_M = 0.01
"""Robots that would come nearer than this meet."""

PATIENCE_S = 2.0
"""A robot that follows another one waits so long when that one stands still."""

_SAMPLE_M = 0.1
_FAR_M = 15.0  # the part of a way that others keep free
_REFUGE_S = 40.0
_RETRY_S = 1.0

Points = NDArray[np.float64]
ViewOf = Callable[[SimRobot], RobotView]


class Rules:
    """Caps the robots' speeds and lets them make way, by the rules of this module.

    Parameters
    ----------
    world, robots, belief, record
        The mission's.
    """

    def __init__(self, world: World, robots: list[SimRobot], belief: FleetBelief, record: Recorder) -> None:
        self._world = world
        self._robots = robots
        self._belief = belief
        self._record = record
        self._by_id = {robot.id: robot for robot in robots}
        self._place = {robot.id: n for n, robot in enumerate(robots)}
        self._first: set[str] = set()
        self._still = dict.fromkeys(self._by_id, 0.0)
        self._claims: dict[str, tuple[Points, Point]] = {}
        self._since: dict[str, float] = {}
        self._tried: dict[tuple[str, str], float] = {}
        self._heir: dict[str, str] = {}
        self._ways: dict[str, Points] = {}

    def apply(self, t_s: float, view_of: ViewOf) -> None:
        """Apply the rules at an instant.

        Parameters
        ----------
        t_s
            Now, s.
        view_of
            Returns a robot as the belief sees it.
        """
        for robot in self._robots:
            if robot.speed_m_s > 0.0 or robot.turning_rad_s != 0.0:
                self._still[robot.id] = t_s
        moving = [robot for robot in self._robots if robot.alive]
        self._ways = {robot.id: self._way(robot) for robot in moving}
        for robot in moving:
            robot.cap_m_s = inf
            if robot.yields_to is not None:
                self._hold(robot, t_s, view_of)
            elif not robot.path:
                self._heir.pop(robot.id, None)
            if not robot.path:
                self._first.discard(robot.id)
        for robot in moving:
            self._claim(robot)
        for robot in moving:
            self._look_ahead(robot, t_s, view_of)

    # --- ways ---

    def _way(self, robot: SimRobot) -> Points:
        """Return points along a robot's way every ``_SAMPLE_M``, itself first, as far as ``_FAR_M``."""
        return sampled([(robot.u_m, robot.v_m), *robot.path], _SAMPLE_M, _FAR_M)

    def _order_way(self, robot: SimRobot, view: RobotView) -> list[Point]:
        """Return the way to the end of a robot's order, from where it is now."""
        if robot.order is None or not robot.order.path_m:
            return []
        goal = robot.order.path_m[-1]
        path = self._belief.path(view, goal) or self._belief.path(view, goal, optimistic=True)
        return self._grid(path)

    def _grid(self, path_m: tuple[Point, ...]) -> list[Point]:
        unit = self._world.map.resolution_m
        pixels = self._world.map.world_to_pixel(np.array(path_m, dtype=np.float64).reshape(-1, 2)) * unit
        return [(float(u), float(v)) for u, v in pixels]

    def _discs(self, points: Points, radius: float) -> Points:
        """Return discs (world x, y, radius) on grid points."""
        unit = self._world.map.resolution_m
        places = self._world.map.pixel_to_world(points.reshape(-1, 2) / unit)
        return np.column_stack((places, np.full(len(places), radius)))

    @staticmethod
    def _room(one: SimRobot, other: SimRobot) -> float:
        return one.profile.radius_m + other.profile.radius_m + MARGIN_M

    # --- rule 1 ---

    def _narrow(self, robot: SimRobot, way: Points) -> NDArray[np.bool_]:
        """Tell for each point of a way whether two robots cannot pass each other there."""
        widest = max(other.profile.radius_m for other in self._robots)
        unit = self._world.map.resolution_m
        clear = self._belief.clearance_m(self._world.map.pixel_to_world(way / unit))
        return np.asarray(clear < robot.profile.radius_m + widest + MARGIN_M / 2)

    def _claim(self, robot: SimRobot) -> None:
        """Claim the next narrow stretch, or cap the speed to stop before it."""
        way = self._ways[robot.id]
        self._claims.pop(robot.id, None)
        if len(way) < 2:
            return
        near = way[: int((CLAIM_M + LOOK_M) / _SAMPLE_M)]
        narrow = self._narrow(robot, near)
        if not narrow.any():
            return
        first = int(np.argmax(narrow))
        if first * _SAMPLE_M > CLAIM_M:
            return
        after = np.flatnonzero(~narrow[first:])
        last = first + int(after[0]) if len(after) else len(near) - 1
        stretch = near[first : last + 1]
        along = (float(stretch[-1, 0] - stretch[0, 0]), float(stretch[-1, 1] - stretch[0, 1]))
        for other in self._robots:
            if other is robot or other.id not in self._claims or first == 0:
                continue
            theirs, their_way = self._claims[other.id]
            if along[0] * their_way[0] + along[1] * their_way[1] > 0:
                continue
            gaps = np.hypot(*(stretch[:, None, :] - theirs[None, :, :]).transpose(2, 0, 1))
            if gaps.min() < 0.3:
                self._cap(robot, first * _SAMPLE_M - 0.3)
                return
        self._claims[robot.id] = (stretch, along)

    def _cap(self, robot: SimRobot, room_m: float) -> None:
        """Cap a robot's speed so that it can stop within a distance."""
        cap = sqrt(2 * 0.8 * robot.profile.accel_m_s2 * max(room_m, 0.0))
        robot.cap_m_s = min(robot.cap_m_s, cap)

    # --- rules 2 to 4 ---

    def _look_ahead(self, robot: SimRobot, t_s: float, view_of: ViewOf) -> None:
        way = self._ways[robot.id]
        if len(way) < 2:
            return
        near = way[: int(LOOK_M / _SAMPLE_M) + 1]
        for other in self._robots:
            if other is robot:
                continue
            gaps = np.hypot(near[:, 0] - other.u_m, near[:, 1] - other.v_m)
            ahead = np.flatnonzero(gaps < robot.profile.radius_m + other.profile.radius_m + TOUCH_M)
            if len(ahead) == 0 or (ahead[0] == 0 and gaps[: ahead.max() + 2].min() > gaps[0] - 0.002):
                continue  # nobody there, or it drives away from the other
            at = int(ahead[0])
            self._cap(robot, at * _SAMPLE_M)
            if self._goes_its_way(robot, other) and t_s < self._still[other.id] + PATIENCE_S:
                continue
            self._meet(robot, other, t_s, view_of)

    def _goes_its_way(self, robot: SimRobot, other: SimRobot) -> bool:
        """Tell whether another robot drives, and not towards this one."""
        theirs = self._ways.get(other.id)
        if theirs is None or not other.path:
            return False
        gaps = np.hypot(theirs[:, 0] - robot.u_m, theirs[:, 1] - robot.v_m)[: int(LOOK_M / _SAMPLE_M) + 1]
        touch = robot.profile.radius_m + other.profile.radius_m + TOUCH_M
        return bool(gaps.min() > min(touch, gaps[0] - 0.002))

    def _rank(self, robot: SimRobot) -> tuple[int, ...]:
        """Return a robot's priority; smaller goes first. One that makes way ranks just below whom it makes way for."""
        if robot.id in self._first:
            return (-1, self._place[robot.id])
        own = self._own_rank(robot)
        above = self._heir.get(robot.id)
        return own if above is None else min(own, (*self._own_rank(self._by_id[above]), 1))

    def _own_rank(self, robot: SimRobot) -> tuple[int, ...]:
        return (0 if self._inside(robot) else 1, 0 if robot.path else 1, self._place[robot.id])

    def _inside(self, robot: SimRobot) -> bool:
        claim = self._claims.get(robot.id)
        return claim is not None and hypot(claim[0][0, 0] - robot.u_m, claim[0][0, 1] - robot.v_m) < 0.15

    def _meet(self, robot: SimRobot, other: SimRobot, t_s: float, view_of: ViewOf) -> None:
        """Let one of two robots that meet make way."""
        if not other.alive:
            self._try(robot, other, t_s, view_of, dead=True)
            return
        first, second = (robot, other) if self._rank(robot) <= self._rank(other) else (other, robot)
        if second.yields_to == first.id or first.yields_to == second.id:
            return  # it is on its way
        if self._try(second, first, t_s, view_of):
            return
        if second.path or self._comes_out(second, first, t_s, view_of):
            self._try(first, second, t_s, view_of)

    def _comes_out(self, robot: SimRobot, other: SimRobot, t_s: float, view_of: ViewOf) -> bool:
        """Let a robot that stands in a dead end drive out of it, past all that will make way; tell whether it can."""
        if robot.order is not None and robot.path:
            return False
        dead = [self._body(robot, one) for one in self._robots if not one.alive]
        bodies = np.concatenate(dead) if dead else np.empty((0, 3))
        way = self._discs(self._ways[other.id], self._room(robot, other) + ARRIVED_M)
        path = self._belief.refuge(view_of(robot), bodies, way[::2], _REFUGE_S)
        if not path:
            return False
        self._tell(robot, other, t_s, "comes out")
        robot.follow(self._grid(path))
        self._ways[robot.id] = self._way(robot)
        self._first.add(robot.id)
        return True

    def _try(self, robot: SimRobot, other: SimRobot, t_s: float, view_of: ViewOf, dead: bool = False) -> bool:
        """Let a robot make way for another one; tell whether it could."""
        if t_s < self._tried.get((robot.id, other.id), -inf) + _RETRY_S:
            return False
        self._tried[robot.id, other.id] = t_s
        view = view_of(robot)
        others = [one for one in self._robots if one is not robot]
        bodies = np.concatenate([self._body(robot, one) for one in others])
        way = self._ways.get(other.id, np.array([(other.u_m, other.v_m)]))
        corridor = self._discs(way, self._room(robot, other))
        if robot.order is not None and robot.order.path_m and robot.path:
            goal = robot.order.path_m[-1]
            straight = self._belief.detour(view, goal, np.empty((0, 3)), np.empty((0, 3)))[0]
            time, path = self._belief.detour(view, goal, bodies, corridor[::2])
            if path and (dead or time <= straight + DETOUR_S):
                self._tell(robot, other, t_s, "goes around")
                robot.follow(self._grid(path))
                self._ways[robot.id] = self._way(robot)
                return True
        if dead:
            return False
        corridor[:, 2] += ARRIVED_M
        path = self._belief.refuge(view, bodies, corridor[::2], _REFUGE_S)
        if not path:  # those of lower priority will make way in their turn
            rank = self._rank(other)
            above = [
                self._body(robot, one) for one in others if one is other or self._rank(one) < rank or not one.alive
            ]
            path = self._belief.refuge(view, np.concatenate(above), corridor[::2], _REFUGE_S)
        if not path:
            return False
        self._tell(robot, other, t_s, "pulls over")
        robot.follow(self._grid(path))
        self._ways[robot.id] = self._way(robot)
        if robot.order is not None and robot.order.path_m:
            robot.yields_to = other.id
            self._since[robot.id] = t_s
        self._heir[robot.id] = other.id
        return True

    def _body(self, robot: SimRobot, other: SimRobot) -> Points:
        """Return the disc that a robot's centre keeps out of, because another one stands there."""
        return self._discs(np.array([(other.u_m, other.v_m)]), self._room(robot, other))

    def _tell(self, robot: SimRobot, other: SimRobot, t_s: float, how: str) -> None:
        self._record.event(t_s, "yield", robot=robot.id, target=robot.target, reason=f"{how}: {other.id} comes first")

    def _hold(self, robot: SimRobot, t_s: float, view_of: ViewOf) -> None:
        """Let a robot that made way go on when the other has passed."""
        assert robot.yields_to is not None
        other = self._by_id[robot.yields_to]
        late = t_s > self._since[robot.id] + HOLD_S
        if robot.path and not late and other.alive and other.path:
            return  # still on its way to the side
        if not late and other.alive and other.path:
            mine = self._order_way(robot, view_of(robot))
            ahead = sampled([(robot.u_m, robot.v_m), *mine], _SAMPLE_M, LOOK_M)
            theirs = self._ways[other.id]
            gaps = np.hypot(*(ahead[:, None, :] - theirs[None, :, :]).transpose(2, 0, 1))
            if gaps.min() < self._room(robot, other):
                return
        robot.yields_to = None
        self._heir.pop(robot.id, None)
        robot.follow(self._order_way(robot, view_of(robot)))
        self._ways[robot.id] = self._way(robot)


def sampled(points: list[Point], step_m: float, far_m: float) -> Points:
    """Return points every ``step_m`` along a polyline, as far as ``far_m``, and its end where that is nearer."""
    lengths: list[float] = []
    total = 0.0
    for (x0, y0), (x1, y1) in itertools.pairwise(points):
        lengths.append(hypot(x1 - x0, y1 - y0))
        total += lengths[-1]
        if total > far_m + 2 * step_m:
            break  # what comes after is too far away
    corners = np.array(points[: len(lengths) + 1])
    return _along(corners, np.array(lengths), step_m, far_m)


@kernel
def _along(corners: Points, lengths: NDArray[np.float64], step_m: float, far_m: float) -> Points:
    """Return the points of :func:`sampled`, from the corners of a polyline and the lengths between them."""
    out = np.empty((int(lengths.sum() / step_m) + lengths.shape[0] + 3, 2))
    out[0] = corners[0]
    count, left, total = 1, step_m, 0.0
    for n in range(lengths.shape[0]):
        x0, y0, x1, y1 = corners[n, 0], corners[n, 1], corners[n + 1, 0], corners[n + 1, 1]
        at = left
        while at <= lengths[n]:
            out[count, 0], out[count, 1] = x0 + (x1 - x0) * at / lengths[n], y0 + (y1 - y0) * at / lengths[n]
            count += 1
            at += step_m
            total += step_m
            if total >= far_m:
                return out[:count].copy()
        left = at - lengths[n]
    last = corners[-1]
    if out[count - 1, 0] != last[0] or out[count - 1, 1] != last[1]:
        out[count] = last
        count += 1
    return out[:count].copy()
