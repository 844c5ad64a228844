"""The checker of traces: replays a mission from its trace alone and reports every rule that it breaks.

It simulates nothing and imports no simulator, belief, strategy or energy law: it states motion, battery and sensing
again. Where noise is part of the mission, its cut-off (three deviations) widens the limits; between two instants it
cannot know how much of a turn was made standing, nor whether a robot that is too near to a wall to turn crept back and
drove on again, so there the battery has a lower and an upper limit.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from math import hypot, inf

import numpy as np
from numpy.typing import NDArray

from react_opt.certify_base import Certificate, Violation
from react_opt.certify_scans import first_seen
from react_opt.instance import Mission, Profile, canonical
from react_opt.trace import NEVER, Trace

FloatArray = NDArray[np.float64]
CREEP_M_S = 0.05  # slower than this a turn counts as one on the spot
CHARGE_M = 0.5  # a robot charges within this of a charger
DIGITS = 1e-3  # frames are rounded to 1e-4
CURVED = 1.01  # the way between two instants over the straight line, at most
BACK_M_S = 0.1  # how fast a robot that cannot turn creeps away from a wall
NEAR_M = 0.1  # it does within so much more than its radius of one
OPTIONS = ("strategy", "seed", "always_on", "robots", "failures")  # what the command line may change


def check_trace(mission: Mission, trace: Trace, cells: NDArray[np.uint8] | None = None) -> Certificate:
    """Check a trace against its mission.

    Parameters
    ----------
    mission
        The mission as in its file.
    trace
        What is said to have happened.
    cells
        The map that the mission names (0 free, 1 occupied, 2 unknown), None to take the trace's word for it.

    Returns
    -------
    Certificate
        Its objective is the final coverage as worked out here.
    """
    foreign = tuple(_mission_rule(mission, trace))
    if foreign:
        return Certificate(foreign)
    replay = _Replay(trace)
    shape = tuple(replay.shape_rule(cells))
    if shape:
        return Certificate(shape)
    found = [
        *replay.order_rule(),
        *replay.motion_rule(),
        *replay.wall_rule(),
        *replay.collision_rule(),
        *replay.battery_rule(),
        *replay.death_rule(),
        *replay.sensing_rule(),
        *replay.known_rule(),
        *replay.coverage_rule(),
    ]
    return Certificate(tuple(found), replay.coverage(inf))


def _mission_rule(mission: Mission, trace: Trace) -> Iterator[Violation]:
    """The trace is of this mission: only strategy, seed, number of robots and always_on may differ."""
    mine, theirs = canonical(mission), canonical(trace.mission)
    for name, value in mine.items():
        if name not in OPTIONS and theirs[name] != value:
            yield Violation("mission", "", None, None, f"a trace of another mission: {name} differs")
    if theirs["robots"] != mine["robots"][: len(theirs["robots"])]:
        yield Violation("mission", "", None, None, "a trace of another mission: robots differs")
    if trace.seed != trace.mission.seed:
        yield Violation("mission", "", None, None, f"seed: expected {trace.mission.seed}, found {trace.seed}")


class _Replay:
    """A trace unpacked, and one method per rule."""

    def __init__(self, trace: Trace) -> None:
        self.trace = trace
        self.mission = trace.mission
        self.codes = trace.truth.array("u1")
        self.cells = (self.codes & 3).astype(np.uint8)
        self.coverable = (self.codes & 4) != 0
        known = trace.known.array("<u2")
        self.known_s = np.where(known == NEVER, inf, known * trace.known.unit_s)
        self.unit_m = trace.truth.resolution_m
        self.robots = trace.mission.robots
        self.profiles: list[Profile] = [trace.mission.profiles[robot.profile] for robot in self.robots]
        by_id = {track.robot: track for track in trace.tracks}
        self.tracks = [by_id[robot.id].array() for robot in self.robots if robot.id in by_id]
        self.step_s = trace.tracks[0].unit_s if trace.tracks else 1.0
        noise = trace.mission.noise
        self.fast = 1.0 + 3.0 * noise.speed
        self.power = (max(0.2, 1.0 - 3.0 * noise.power), 1.0 + 3.0 * noise.power)
        dead = ("robot_dead", "battery_empty")
        self.died = {event.robot: event.t_s for event in reversed(trace.events) if event.type in dead}

    def shape_rule(self, cells: NDArray[np.uint8] | None) -> Iterator[Violation]:
        """Maps have the shapes they say, every robot has one track of one length, frames name the mission's robots."""
        if self.known_s.shape != self.codes.shape:
            yield Violation("shape", "", None, None, "known and truth differ in shape")
        if cells is not None and not np.array_equal(cells, self.cells):
            yield Violation("truth", "", None, None, "the trace's truth is not the mission's map")
        if np.any(self.coverable & (self.cells != 0)):
            yield Violation("truth", "", None, None, "a pixel counts as coverable though it is not free")
        if len(self.tracks) != len(self.robots) or len({len(track) for track in self.tracks}) > 1:
            yield Violation("shape", "", None, None, "expected one track of the same length for every robot")
        ids = tuple(robot.id for robot in self.robots)
        for frame in self.trace.frames:
            if tuple(robot.id for robot in frame.robots) != ids:
                yield Violation("shape", "", None, None, f"the frame at {frame.t_s:g} s does not hold the robots")
                return

    def order_rule(self) -> Iterator[Violation]:
        """Frames and events come in order of time, events name robots there are, and a finished mission ends once."""
        times = [frame.t_s for frame in self.trace.frames]
        if any(b <= a for a, b in itertools.pairwise(times)):
            yield Violation("order", "", None, None, "frames are not in order of time")
        when = [event.t_s for event in self.trace.events]
        if any(b < a for a, b in itertools.pairwise(when)):
            yield Violation("order", "", None, None, "events are not in order of time")
        ids = {robot.id for robot in self.robots}
        for event in self.trace.events:
            if event.robot is not None and event.robot not in ids:
                yield Violation("order", event.robot, None, None, f"no such robot ({event.type})")
        ends = sum(event.type == "mission_end" for event in self.trace.events)
        if ends != (self.trace.status == "finished"):
            yield Violation("order", "", None, None, f"status {self.trace.status} with {ends} ends")

    def motion_rule(self) -> Iterator[Violation]:
        """Robots start at their starts and keep to their limits of speed, acceleration and turning; frames agree."""
        for robot, profile, track in zip(self.robots, self.profiles, self.tracks, strict=True):
            length = np.hypot(*np.diff(track[:, :2], axis=0).T)
            speed = length / self.step_s
            fastest = profile.speed_max_m_s * self.fast
            turned = np.abs(_wrapped(np.diff(track[:, 2])))
            gained = np.diff(speed, prepend=0.0)
            for name, found, limit in (
                ("speed", speed, fastest * (1 + 1e-6)),
                ("turning", turned / self.step_s, profile.turn_rad_s * (1 + 1e-6)),
                ("acceleration", gained / self.step_s, profile.accel_m_s2 * 1.5),  # means of neighbouring intervals
            ):
                for at in np.flatnonzero(found > limit)[:1]:
                    over = float(found[at] - limit)
                    yield Violation(
                        name, robot.id, None, over, f"at {at * self.step_s:g} s: {found[at]:.4g} > {limit:.4g}"
                    )
        yield from self._frames_agree()

    def _frames_agree(self) -> Iterator[Violation]:
        """Frames show the robots where their tracks are."""
        truth = self.trace.truth
        c, s = np.cos(truth.origin_yaw_rad), np.sin(truth.origin_yaw_rad)
        for n, (robot, track) in enumerate(zip(self.robots, self.tracks, strict=True)):
            for frame in self.trace.frames:
                at = frame.t_s / self.step_s
                if at != int(at) or int(at) >= len(track):
                    continue
                u, v = track[int(at), :2]
                x, y = truth.origin_x_m + c * u - s * v, truth.origin_y_m + s * u + c * v
                off = hypot(frame.robots[n].x_m - x, frame.robots[n].y_m - y)
                if off > DIGITS:
                    yield Violation("frame", robot.id, None, off, f"at {frame.t_s:g} s it is not where its track is")
                    break
            if len(track):
                u, v = track[0, :2]
                x, y = truth.origin_x_m + c * u - s * v, truth.origin_y_m + s * u + c * v
                if hypot(robot.x_m - x, robot.y_m - y) > DIGITS:
                    yield Violation("frame", robot.id, None, None, "its track does not begin at its start")

    def wall_rule(self) -> Iterator[Violation]:
        """No robot's outline overlaps a pixel that is not free."""
        for robot, profile, track in zip(self.robots, self.profiles, self.tracks, strict=True):
            for at, (u, v, yaw, _) in enumerate(track):
                if _hits(self.cells, u / self.unit_m, v / self.unit_m, yaw, profile, self.unit_m):
                    text = f"at {at * self.step_s:g} s it stands in something"
                    yield Violation("wall", robot.id, None, None, text)
                    break

    def collision_rule(self) -> Iterator[Violation]:
        """Where robots block each other, no two outlines overlap (the dead ones count)."""
        if not self.mission.blocking:
            return
        for n, one in enumerate(self.tracks):
            for m in range(n):
                reach = _radius(self.profiles[n]) + _radius(self.profiles[m])
                near = np.flatnonzero(np.hypot(*(one[:, :2] - self.tracks[m][:, :2]).T) < reach - 1e-6)
                for at in near:
                    if _overlap(one[at], self.profiles[n], self.tracks[m][at], self.profiles[m]):
                        text = f"at {at * self.step_s:g} s it overlaps {self.robots[m].id}"
                        yield Violation("collision", self.robots[n].id, None, None, text)
                        break

    def battery_rule(self) -> Iterator[Violation]:
        """Batteries follow the law between frames, rise at chargers only, and stay within 0 and capacity."""
        for n, (robot, profile) in enumerate(zip(self.robots, self.profiles, strict=True)):
            frames = self.trace.frames
            for frame in frames:
                level = frame.robots[n].battery_j
                if level < -DIGITS or level > profile.capacity_j + DIGITS:
                    yield Violation("battery", robot.id, None, None, f"at {frame.t_s:g} s it holds {level:.6g} J")
                    break
            for before, after in itertools.pairwise(frames):
                low, high = self._spent(n, before.t_s, after.t_s)
                spent = before.robots[n].battery_j - after.robots[n].battery_j
                if not low - DIGITS <= spent <= high + DIGITS:
                    text = (
                        f"from {before.t_s:g} s to {after.t_s:g} s it spends {spent:.6g} J, not {low:.6g} to {high:.6g}"
                    )
                    yield Violation("battery", robot.id, None, max(low - spent, spent - high), text)
                    break

    def _spent(self, n: int, start_s: float, end_s: float) -> tuple[float, float]:
        """Return the least and the most that a robot spends between two instants, J."""
        profile, track = self.profiles[n], self.tracks[n]
        died = self.died.get(self.robots[n].id, inf)
        alive = max(0.0, min(end_s, died) - start_s)
        first, last = int(start_s / self.step_s), min(int(np.ceil(end_s / self.step_s)), len(track) - 1)
        part = track[first : last + 1]
        if died <= start_s or len(part) < 2:
            return 0.0, self._most(profile, alive)
        if end_s != last * self.step_s or first * self.step_s != start_s or died < end_s:
            return 0.0, self._most(profile, end_s - start_s)  # it ends between two instants
        length = np.hypot(*np.diff(part[:, :2], axis=0).T)
        turned = np.abs(_wrapped(np.diff(part[:, 2])))
        whole = profile.turn_rad_s * self.step_s
        back = max(0.0, whole - float(turned.min())) if turned.max() > 0.5 * whole else 0.0  # to and fro within a step
        turning = profile.turn_w * (float(turned.sum()) + back) / profile.turn_rad_s
        base = profile.idle_w * alive + profile.sensing_w * float(part[:-1, 3].sum()) * self.step_s
        metre = profile.motion_w / profile.speed_max_m_s
        low = base + metre * float(length.sum())
        crept = BACK_M_S * self.step_s * self._near_walls(part[:-1], profile)  # half a step back, the same way forth
        high = base + metre * (float(length.sum()) * CURVED + crept) + turning
        return self.power[0] * low - self._charged(n, part, end_s - start_s), self.power[1] * high

    def _near_walls(self, poses: FloatArray, profile: Profile) -> int:
        """Return how many of some poses are so near to a wall that a robot may be unable to turn there."""
        reach = (_radius(profile) + NEAR_M) / self.unit_m
        count = 0
        for u, v in poses[:, :2] / self.unit_m:
            top, left = max(0, int(v - reach)), max(0, int(u - reach))
            around = np.argwhere(self.cells[top : int(v + reach) + 1, left : int(u + reach) + 1] != 0)
            off = np.abs(around + np.array([top + 0.5 - v, left + 0.5 - u])) - 0.5  # to the nearest edge of each pixel
            count += bool(np.any(np.hypot(*np.maximum(off, 0.0).T) <= reach))
        return count

    def _most(self, profile: Profile, time_s: float) -> float:
        watts = profile.idle_w + profile.motion_w * self.fast + profile.turn_w + profile.sensing_w
        return self.power[1] * watts * time_s

    def _charged(self, n: int, part: FloatArray, time_s: float) -> float:
        """Return the most that chargers near by give in a time, J."""
        truth = self.trace.truth
        c, s = np.cos(truth.origin_yaw_rad), np.sin(truth.origin_yaw_rad)
        given = 0.0
        for charger in self.mission.chargers:
            dx, dy = charger.x_m - truth.origin_x_m, charger.y_m - truth.origin_y_m
            u, v = c * dx + s * dy, c * dy - s * dx
            if np.hypot(part[:, 0] - u, part[:, 1] - v).min() <= CHARGE_M + DIGITS:
                given += charger.power_w * time_s
        return given

    def death_rule(self) -> Iterator[Violation]:
        """Robots die when the mission says so, or when their battery is empty, and do not move afterwards."""
        end_s = self.trace.frames[-1].t_s if self.trace.frames else 0.0
        for failure in self.mission.failures:
            died = self.died.get(failure.robot, inf)
            if failure.t_s + self.step_s < end_s and died > failure.t_s + self.step_s:
                yield Violation("death", failure.robot, None, None, f"it fails at {failure.t_s:g} s, but goes on")
        for robot, track in zip(self.robots, self.tracks, strict=True):
            died = self.died.get(robot.id, inf)
            after = track[int(np.ceil(died / self.step_s)) :] if died < inf else track[:0]
            if len(after) and (np.any(after[:, :3] != after[0, :3]) or np.any(after[:, 3])):
                yield Violation("death", robot.id, None, None, f"it died at {died:g} s, but moves or senses later")

    def sensing_rule(self) -> Iterator[Violation]:
        """With always_on every robot that is alive senses; frames say what the tracks say."""
        for n, (robot, track) in enumerate(zip(self.robots, self.tracks, strict=True)):
            alive = np.arange(len(track)) * self.step_s < self.died.get(robot.id, inf)
            if self.mission.always_on and not track[alive, 3].all():
                yield Violation("sensing", robot.id, None, None, "always_on, but its sensors are off")
            for frame in self.trace.frames:
                at = frame.t_s / self.step_s
                if at == int(at) and int(at) < len(track) and bool(track[int(at), 3]) != frame.robots[n].sensing:
                    yield Violation("sensing", robot.id, None, None, f"at {frame.t_s:g} s frame and track differ")
                    break

    def known_rule(self) -> Iterator[Violation]:
        """A pixel is known from when a robot first scanned it, never if none did; over a radio link it may be later."""
        seen = np.full(self.cells.shape, inf)
        for profile, track in zip(self.profiles, self.tracks, strict=True):
            on = track[:, 3] > 0
            times = np.flatnonzero(on).astype(np.float64) * np.float64(self.step_s)
            first_seen(self.cells, self.unit_m, track[on, :3], times, profile.lidar_rays, profile.lidar_range_m, seen)
        unit = self.trace.known.unit_s
        early = self.known_s < np.where(np.isfinite(seen), seen - unit / 2, inf)
        if early.any():
            count = int(early.sum())
            yield Violation("known", "", None, count, f"{count} pixels are known before any robot had scanned them")
        late = (self.known_s > seen + unit / 2) & np.isfinite(seen)
        if self.mission.link is None and late.any():
            count = int(late.sum())
            yield Violation("known", "", None, count, f"{count} pixels became known later than scanned, or never")

    def coverage(self, t_s: float) -> float:
        """Return the share of the coverable area that is known at a time."""
        known = np.isfinite(self.known_s) & (self.known_s <= t_s)
        total = int(self.coverable.sum())
        return float((known & self.coverable).sum() / total) if total else 1.0

    def coverage_rule(self) -> Iterator[Violation]:
        """The frames' coverage is what the map known at their time gives."""
        times = np.sort(self.known_s[self.coverable])
        for frame in self.trace.frames:
            expected = np.searchsorted(times, frame.t_s + 1e-9, side="right") / max(1, len(times))
            if abs(expected - frame.coverage) > 2e-6:
                off = float(frame.coverage - expected)
                text = f"at {frame.t_s:g} s: expected {expected:.6f}, found {frame.coverage:.6f}"
                yield Violation("coverage", "", None, off, text)
                return


def _wrapped(angles: FloatArray) -> FloatArray:
    return np.asarray((angles + np.pi) % (2 * np.pi) - np.pi)


def _radius(profile: Profile) -> float:
    return hypot(profile.length_m, profile.width_m) / 2


def _axes(yaw: float) -> FloatArray:
    return np.array([(np.cos(yaw), np.sin(yaw)), (-np.sin(yaw), np.cos(yaw))])


def _hits(cells: NDArray[np.uint8], x: float, y: float, yaw: float, profile: Profile, unit_m: float) -> bool:
    """Tell whether a robot's outline overlaps a pixel that is not free, or leaves the map."""
    half = np.array((profile.length_m, profile.width_m)) / 2 / unit_m - 1e-9
    axes = _axes(yaw)
    reach = np.abs(axes.T) @ half
    low = np.floor((x - reach[0], y - reach[1])).astype(int)
    high = np.floor((x + reach[0], y + reach[1])).astype(int)
    if low.min() < 0 or high[0] >= cells.shape[1] or high[1] >= cells.shape[0]:
        return True
    rows, cols = np.nonzero(cells[low[1] : high[1] + 1, low[0] : high[0] + 1])
    offset = np.stack((cols + low[0] + 0.5 - x, rows + low[1] + 0.5 - y))
    along = np.abs(axes @ offset)
    rim = 0.5 * np.abs(axes).sum(axis=1)
    inside = (along < (half + rim)[:, None]).all(axis=0) & (np.abs(offset) < (reach + 0.5)[:, None]).all(axis=0)
    return bool(inside.any())


def _overlap(one: FloatArray, mine: Profile, other: FloatArray, theirs: Profile) -> bool:
    """Tell whether two outlines overlap: no axis of either keeps them apart."""
    axes = np.concatenate((_axes(one[2]), _axes(other[2])))
    gap = np.abs(axes @ (one[:2] - other[:2]))
    reach = np.abs(axes @ _axes(one[2]).T) @ (np.array((mine.length_m, mine.width_m)) / 2)
    reach += np.abs(axes @ _axes(other[2]).T) @ (np.array((theirs.length_m, theirs.width_m)) / 2)
    return bool((gap < reach - 1e-6).all())
