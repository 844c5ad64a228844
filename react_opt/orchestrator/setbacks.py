"""What robots failed at: regions that a robot gives up for a while, and robots that do not get away from a place."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

import numpy as np
from numpy.typing import NDArray

from react_opt.orchestrator.belief import FloatArray, RobotView
from react_opt.orchestrator.strategy import Point

GIVE_UP_M = 1.0
"""What lies nearer to a place that was given up is given up with it; a robot that moved further is not stuck there."""
STUCK_S = 30.0
"""So long a robot leaves a region alone, and so much later it is expected anywhere for each time it was stuck, s."""


class Setbacks:
    """Remembers them, so that others get the work of a robot that cannot do it.

    A region is given up by one robot only: what one of them cannot reach another one may. A robot that was stuck more
    than once at the same place would be stuck again whatever it is told, and each region that it is sent to would wait
    for it; it is planned with as if it came that much later.
    """

    def __init__(self) -> None:
        self._given_up: dict[str, list[tuple[Point, float]]] = {}
        self._stuck: dict[str, tuple[Point, int]] = {}

    def give_up(self, robot: RobotView, at_m: Point, now_s: float) -> None:
        """Note that a robot has no way to a place, or got stuck on it."""
        self._given_up.setdefault(robot.id, []).append((at_m, now_s + STUCK_S))

    def stuck(self, robot: RobotView) -> None:
        """Note that a robot made no progress where it is."""
        here = (robot.x_m, robot.y_m)
        place, times = self._stuck.get(robot.id, (here, 0))
        same = hypot(here[0] - place[0], here[1] - place[1]) < GIVE_UP_M
        self._stuck[robot.id] = (place, times + 1) if same else (here, 1)

    def forget(self, robots: Sequence[RobotView], now_s: float) -> None:
        """Forget what is over: regions after their time, and robots that have moved on."""
        for name, rows in self._given_up.items():
            self._given_up[name] = [row for row in rows if row[1] > now_s]
        for robot in robots:
            if robot.id in self._stuck:
                (x, y), _ = self._stuck[robot.id]
                if hypot(robot.x_m - x, robot.y_m - y) >= GIVE_UP_M:
                    del self._stuck[robot.id]

    def delay_s(self, robots: Sequence[RobotView]) -> FloatArray:
        """Return ``(R,)`` how much later than they would robots are expected, s: nothing for the first time."""
        times = np.array([self._stuck[robot.id][1] if robot.id in self._stuck else 0 for robot in robots])
        late: FloatArray = STUCK_S * np.maximum(0, times - 1)
        return late

    def out_of_reach(self, robots: Sequence[RobotView], places_m: Sequence[Point]) -> NDArray[np.bool_]:
        """Return ``(R, K)`` which robot has given up which place."""
        at = np.array(places_m, dtype=np.float64).reshape(-1, 2)
        out = np.zeros((len(robots), len(at)), dtype=np.bool_)
        for n, robot in enumerate(robots):
            for (x, y), _ in self._given_up.get(robot.id, ()):
                out[n] |= np.hypot(at[:, 0] - x, at[:, 1] - y) < GIVE_UP_M
        return out
