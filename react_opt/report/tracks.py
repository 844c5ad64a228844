"""What figures and the replay need of a trace, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.trace import NEVER, Trace

FloatArray = NDArray[np.float64]

STATE_OF = {
    "target_new": "new",
    "target_taken": "taken",
    "target_deferred": "deferred",
    "target_postponed": "postponed",
    "target_inspected": "inspected",
    "target_abandoned": "abandoned",
}
"""The state that a target is in after an event of this type."""


@dataclass(frozen=True)
class Tracks:
    """A trace as arrays: ``n`` frames of ``m`` robots.

    Parameters
    ----------
    t_s, coverage
        ``(n,)`` times, s, and the known share of the coverable area, 0 to 1.
    robots
        Ids of the robots in the order of the mission.
    x_m, y_m, yaw_rad, battery_j
        ``(n, m)``, NaN where a frame does not name the robot.
    sensing
        ``(n, m)``.
    """

    t_s: FloatArray
    coverage: FloatArray
    robots: tuple[str, ...]
    x_m: FloatArray
    y_m: FloatArray
    yaw_rad: FloatArray
    battery_j: FloatArray
    sensing: NDArray[np.bool_]


def on_grid(trace: Trace, x_m: ArrayLike, y_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return world points in the map's own frame: turned about its corner by its yaw, which is 0 for most maps."""
    grid = trace.known
    c, s = np.cos(grid.origin_yaw_rad), np.sin(grid.origin_yaw_rad)
    dx, dy = np.asarray(x_m, np.float64) - grid.origin_x_m, np.asarray(y_m, np.float64) - grid.origin_y_m
    return grid.origin_x_m + c * dx + s * dy, grid.origin_y_m + c * dy - s * dx


def tracks(trace: Trace) -> Tracks:
    """Return a trace's frames as arrays, in the map's own frame."""
    named = [robot.id for robot in trace.mission.robots]
    extra = [robot.id for frame in trace.frames for robot in frame.robots]
    robots = tuple(dict.fromkeys(named + extra))
    column = {name: k for k, name in enumerate(robots)}
    shape = (len(trace.frames), len(robots))
    x, y, yaw, battery = (np.full(shape, np.nan) for _ in range(4))
    sensing = np.zeros(shape, dtype=np.bool_)
    for row, frame in enumerate(trace.frames):
        for robot in frame.robots:
            at = row, column[robot.id]
            x[at], y[at], yaw[at], battery[at] = robot.x_m, robot.y_m, robot.yaw_rad, robot.battery_j
            sensing[at] = robot.sensing
    x, y = on_grid(trace, x, y)
    yaw -= trace.known.origin_yaw_rad
    t = np.array([frame.t_s for frame in trace.frames])
    coverage = np.array([frame.coverage for frame in trace.frames])
    return Tracks(t, coverage, robots, x, y, yaw, battery, sensing)


def known_s(trace: Trace) -> FloatArray:
    """Return per pixel when it became known, s; NaN where it did not."""
    units = trace.known.array("<u2")
    return np.where(units == NEVER, np.nan, units * trace.known.unit_s)


def extent(trace: Trace) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of the pixel maps, m."""
    grid = trace.known
    right, top = grid.origin_x_m + grid.cols * grid.resolution_m, grid.origin_y_m + grid.rows * grid.resolution_m
    return grid.origin_x_m, right, grid.origin_y_m, top


def target_states(trace: Trace, until_s: float = float("inf")) -> dict[str, tuple[float, float, str]]:
    """Return place (m, in the map's own frame) and state of every local target by a time, where it has a place."""
    place: dict[str, tuple[float, float]] = {}
    state: dict[str, str] = {}
    bound_for: dict[str | None, str] = {}
    for event in trace.events:
        if event.t_s > until_s or event.target is None or event.type not in STATE_OF:
            continue
        if event.x_m is not None and event.y_m is not None:
            at = on_grid(trace, event.x_m, event.y_m)
            place[event.target] = float(at[0]), float(at[1])
        state[event.target] = STATE_OF[event.type]
        if event.type == "target_taken":  # what its robot was on its way to waits again
            before = bound_for.get(event.robot, event.target)
            if before != event.target and state.get(before) == "taken":
                state[before] = "new"
            bound_for[event.robot] = event.target
    return {name: (*place[name], state[name]) for name in state if name in place}
