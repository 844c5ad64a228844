"""Given paths, driven by simulated robots: how plans that were made with the whole map known are measured."""

from __future__ import annotations

from math import hypot

import numpy as np

from react_opt.instance import Mission, canonical
from react_opt.jsonio import parse
from react_opt.orchestrator.belief import Belief
from react_opt.orchestrator.strategy import Decision, Order, Point


class Drive:
    """An order source that has robots drive given paths (a :class:`react_opt.orchestrator.strategy.Strategy`)."""

    def __init__(self, paths_m: dict[str, tuple[Point, ...]]) -> None:
        self._left = {name: list(path) for name, path in paths_m.items()}
        self._sent: set[str] = set()

    def decide(self, belief: Belief) -> Decision:
        """Send every robot on its way once, and on again where traffic has stopped it."""
        orders = []
        for robot in belief.robots:
            left = self._left.get(robot.id, [])
            if robot.state not in ("idle", "stuck") or not left:
                continue
            way: tuple[Point, ...] = ()
            if robot.id in self._sent:
                away = [hypot(x - robot.x_m, y - robot.y_m) for x, y in left]
                at = int(np.argmin(away))
                del left[: at + 1 if away[at] < 0.5 else at]
                way = belief.path(robot, left[0], optimistic=True) if left else ()
            if left:
                orders.append(Order(robot.id, (*way, *left)))
            self._sent.add(robot.id)
        busy = any(robot.state in ("driving", "yielding") for robot in belief.robots)
        return Decision(orders, done=not orders and not busy)


def nominal(mission: Mission) -> Mission:
    """Return a mission without noise, failures and radio, its sensors never off: what limits are stated for."""
    data = canonical(mission)
    data.update(noise={}, failures=[], link=None, always_on=True, prior_map=None)
    plain: Mission = parse(data, kind="mission")
    return plain
