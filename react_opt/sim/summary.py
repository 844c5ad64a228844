"""A mission in a few numbers, worked out from its trace alone."""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from react_opt.instance import Part
from react_opt.trace import NEVER, Trace

MILESTONES = (0.80, 0.88, 0.90, 0.95, 0.97, 0.99)

Share = Annotated[float, Field(ge=0, le=1)]


class Milestone(Part):
    """When a share of the coverable area was known, and what the fleet had spent by then; None: not reached."""

    coverage: Share
    t_s: float | None
    energy_j: float | None


class RobotSummary(Part):
    """A robot's mission: energy spent, battery left, time with sensors on, length driven, and when it died."""

    id: str
    energy_j: float
    battery_j: float
    sensing_s: float
    driven_m: float
    died_s: float | None


class Summary(Part):
    """What ``react-opt simulate --json`` prints.

    Parameters
    ----------
    mission, strategy, seed
        Which mission it was.
    status
        ``finished``, or ``stopped`` before its end.
    end_s, coverage, coverable_m2
        When it ended (s), with which share of which area (m^2) known.
    milestones
        Times and energies of the fleet at given coverages.
    robots
        One per robot.
    unreachable_areas
        Areas that the belief proved unreachable.
    events
        How often each type of event occurred.
    decisions, decision_wall_s
        How often the strategy decided, and its computing time, s (of this machine).
    wall_s
        Computing time of the whole simulation, s (of this machine).
    """

    kind: Literal["simulation_summary"] = "simulation_summary"
    schema_version: Literal[1] = 1
    mission: str
    strategy: str
    seed: int
    status: Literal["finished", "stopped"]
    end_s: float
    coverage: Share
    coverable_m2: float
    milestones: tuple[Milestone, ...]
    robots: tuple[RobotSummary, ...]
    unreachable_areas: tuple[str, ...]
    events: dict[str, int]
    decisions: int
    decision_wall_s: float
    wall_s: float


def coverage_times(trace: Trace) -> NDArray[np.float64]:
    """Return for every coverable pixel when it became known, in order, s; infinite where it did not."""
    coverable = (trace.truth.array("u1") & 4) != 0
    known = trace.known.array("<u2")[coverable]
    return np.sort(np.where(known == NEVER, np.inf, known * trace.known.unit_s))


def summarise(trace: Trace, milestones: tuple[float, ...] = MILESTONES) -> Summary:
    """Return the summary of a mission.

    Parameters
    ----------
    trace
        The mission.
    milestones
        Coverages, 0 to 1.
    """
    times = coverage_times(trace)
    reached = []
    for share in milestones:
        at = float(times[max(0, int(np.ceil(share * len(times) - 1e-9)) - 1)]) if len(times) else np.inf
        known = bool(np.isfinite(at))
        spent = round(sum(spent_j(trace, n, at) for n in range(len(trace.mission.robots))), 2)
        reached.append(
            Milestone(
                coverage=share,
                t_s=at if known else None,
                energy_j=spent if known else None,
            )
        )
    last = trace.frames[-1] if trace.frames else None
    end_s = 0.0 if last is None else last.t_s
    return Summary(
        mission=trace.mission.name,
        strategy=trace.mission.strategy,
        seed=trace.seed,
        status=trace.status,
        end_s=end_s,
        coverage=round(float(np.isfinite(times).mean()), 6) if len(times) else 1.0,
        coverable_m2=round(len(times) * trace.truth.resolution_m**2, 2),
        milestones=tuple(reached),
        robots=tuple(_robot(trace, n, end_s) for n in range(len(trace.mission.robots))),
        unreachable_areas=tuple(e.target for e in trace.events if e.type == "area_unreachable" and e.target),
        events=dict(sorted(Counter(event.type for event in trace.events).items())),
        decisions=len(trace.decisions_wall_s),
        decision_wall_s=round(sum(trace.decisions_wall_s), 3),
        wall_s=round(sum(trace.wall_s.values()), 3),
    )


def spent_j(trace: Trace, robot: int, t_s: float) -> float:
    """Return what a robot has spent by a time, J (charging does not count against it)."""
    if not trace.frames:  # stopped before its first one
        return 0.0
    at = np.array([frame.t_s for frame in trace.frames])
    left = np.array([frame.robots[robot].battery_j for frame in trace.frames])
    spent = np.concatenate(([0.0], np.cumsum(np.maximum(-np.diff(left), 0.0))))
    return float(np.interp(t_s, at, spent))


def _robot(trace: Trace, n: int, end_s: float) -> RobotSummary:
    name = trace.mission.robots[n].id
    places = np.array([(frame.robots[n].x_m, frame.robots[n].y_m) for frame in trace.frames]).reshape(-1, 2)
    tracks = [track.array() for track in trace.tracks if track.robot == name]
    if tracks:
        places = tracks[0][:, :2]
    unit_s = trace.tracks[0].unit_s if tracks else 0.0
    died = (e.t_s for e in trace.events if e.type in ("robot_dead", "battery_empty") and e.robot == name)
    return RobotSummary(
        id=name,
        energy_j=round(spent_j(trace, n, end_s), 2),
        battery_j=trace.frames[-1].robots[n].battery_j if trace.frames else 0.0,
        sensing_s=float(tracks[0][:, 3].sum() * unit_s) if tracks else 0.0,
        driven_m=round(float(np.hypot(*np.diff(places, axis=0).T).sum()), 2) if len(places) > 1 else 0.0,
        died_s=next(died, None),
    )
