"""What robots know and when their maps arrive: at once without a link model, else over a radio channel.

The channel has one base station. A robot at distance d from it sends ``rate_bit_s * (1 - (d / range_m)^2)``, nothing
beyond the range or during an outage. What a robot has newly seen waits in its queue, :data:`PIXEL_BITS` per pixel and
:data:`PACKET_BITS` per scan, and arrives in order; together with it arrives where the robot is. Orders and the merged
map go the other way at once while there is a link. A robot without a link goes on with what it has been told; once it
stands, it drives back the way it came until there is a link again.
"""

from __future__ import annotations

from collections import deque
from math import hypot

import numpy as np
from numpy.typing import NDArray

from react_opt.geometry.occupancy import UNKNOWN
from react_opt.instance import Link
from react_opt.sim.robot import SimRobot
from react_opt.sim.world import World

PIXEL_BITS = 8
PACKET_BITS = 512
_CRUMB_M = 0.3

Pixels = NDArray[np.int64]


class Channel:
    """Maps on their way from the robots to the belief, and what each robot knows itself.

    Parameters
    ----------
    link
        The channel, None for one without limits.
    world, robots
        The mission's.
    """

    def __init__(self, link: Link | None, world: World, robots: list[SimRobot]) -> None:
        self._link = link
        self._truth = world.map.cells.ravel()
        self.merged = np.full(world.blocked.shape, UNKNOWN, dtype=np.uint8)
        """The truth of the pixels that have arrived."""
        self._own = {} if link is None else {robot.id: self.merged.copy() for robot in robots}
        self._queue: dict[str, deque[tuple[Pixels, float]]] = {robot.id: deque() for robot in robots}
        self._log: list[Pixels] = []
        self._read = dict.fromkeys(self._queue, 0)
        self._up = dict.fromkeys(self._queue, True)
        self._crumbs: dict[str, list[tuple[float, float]]] = {robot.id: [] for robot in robots}
        if link is not None:
            u, v = world.map.world_to_pixel((link.x_m, link.y_m)) * world.map.resolution_m
            self._base = (float(u), float(v))

    def known(self, robot: SimRobot) -> NDArray[np.uint8]:
        """Return the map that a robot has itself; scans are written into it."""
        return self.merged if self._link is None else self._own[robot.id]

    def linked(self, robot: SimRobot) -> bool:
        """Tell whether a robot can be reached."""
        return self._up[robot.id]

    @property
    def busy(self) -> bool:
        """Whether something is still on its way."""
        return any(self._queue.values())

    def crumbs(self, robot: SimRobot) -> list[tuple[float, float]]:
        """Return the places where a robot has been since it lost the link, the last one first, grid metres."""
        return self._crumbs[robot.id][::-1]

    def rate_bit_s(self, robot: SimRobot, t_s: float) -> float:
        """Return how fast a robot can send now, bit/s."""
        if self._link is None:
            return np.inf
        if any(start <= t_s < end for start, end in self._link.outages_s):
            return 0.0
        away = hypot(robot.u_m - self._base[0], robot.v_m - self._base[1]) / self._link.range_m
        return self._link.rate_bit_s * max(0.0, 1.0 - away * away)

    def send(self, robot: SimRobot, pixels: Pixels) -> None:
        """Put what a robot has newly seen into its queue."""
        if len(pixels):
            self._queue[robot.id].append((pixels, float(PACKET_BITS + PIXEL_BITS * len(pixels))))

    def advance(self, robots: list[SimRobot], t_s: float, dt: float) -> tuple[list[Pixels], list[tuple[str, bool]]]:
        """Let a time pass; return what arrives, in order, and whose link came (True) or went.

        Parameters
        ----------
        robots
            All robots; what the dead ones have not sent is lost.
        t_s, dt
            Now, and since the last time, s.
        """
        arrived: list[Pixels] = []
        turned: list[tuple[str, bool]] = []
        for robot in robots:
            if not robot.alive:
                self._queue[robot.id].clear()
                continue
            rate = self.rate_bit_s(robot, t_s)
            if (rate > 0) != self._up[robot.id]:
                self._up[robot.id] = rate > 0
                turned.append((robot.id, rate > 0))
            self._note_place(robot, rate > 0)
            arrived += self._sent(robot, rate * dt if rate > 0 else 0.0)
        if self._link is not None:
            for pixels in arrived:
                self.merged.ravel()[pixels] = self._truth[pixels]
            self._log += arrived
            self._share(robots)
        return arrived, turned

    def _sent(self, robot: SimRobot, bits: float) -> list[Pixels]:
        queue, out = self._queue[robot.id], []
        while queue and bits > 0:
            pixels, left = queue.popleft()
            if left > bits:
                queue.appendleft((pixels, left - bits))
                break
            bits -= left
            out.append(pixels)
        return out

    def _share(self, robots: list[SimRobot]) -> None:
        """Give the merged map to all that can be reached."""
        for robot in robots:
            if robot.alive and self._up[robot.id]:
                own = self._own[robot.id].ravel()
                for pixels in self._log[self._read[robot.id] :]:
                    own[pixels] = self._truth[pixels]
                self._read[robot.id] = len(self._log)

    def _note_place(self, robot: SimRobot, up: bool) -> None:
        crumbs = self._crumbs[robot.id]
        if up:
            crumbs.clear()
        if not crumbs or hypot(crumbs[-1][0] - robot.u_m, crumbs[-1][1] - robot.v_m) > _CRUMB_M:
            crumbs.append((robot.u_m, robot.v_m))
