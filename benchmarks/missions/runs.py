"""What a campaign runs: one mission, or the limits of one team, each a job in a process of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from react_opt.energy import RobotProfile
from react_opt.geometry.mapfile import load_map
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import Mission, canonical
from react_opt.jobs import Job
from react_opt.jsonio import parse, save
from react_opt.limits.bound import candidates, time_bound
from react_opt.limits.fullmap import best_plan, outlook_of
from react_opt.limits.hidden import survey
from react_opt.sim.run import simulate, with_options
from react_opt.sim.summary import coverage_times, spent_j, summarise
from react_opt.sim.world import World
from react_opt.trace import Trace

SHARES = (0.80, 0.88, 0.90, 0.95, 0.97, 0.99)
LIMIT_SHARES = (0.90, 0.97, 0.99)
CURVE_S = 10.0
RULES = ("area_explored", "no_new_pixel", "small_gain")
FULL_MAP = "full map"


@dataclass(frozen=True)
class Setting:
    """One point of a campaign, run with every seed."""

    strategy: str
    robots: int
    rule: str = "area_explored"
    always_on: bool = False
    blocking: bool = True
    horizon_s: float | None = None

    def key(self, seed: int) -> str:
        """Return the name of the job."""
        extra = (
            f" {self.rule}" * (self.rule != "area_explored")
            + " always on" * self.always_on
            + " no blocking" * (not self.blocking)
            + (f" T={self.horizon_s:g}" if self.horizon_s else "")
        )
        return f"{self.strategy} x{self.robots}{extra} seed {seed}"

    def mission(self, base: Mission, seed: int) -> Mission:
        """Return the mission."""
        data = canonical(
            with_options(base, strategy=self.strategy, robots=self.robots, seed=seed, always_on=self.always_on)
        )
        data.update(switching=self.rule, blocking=self.blocking)
        if self.horizon_s is not None:
            data["horizon_s"] = self.horizon_s
        mission: Mission = parse(data, kind="mission")
        return mission


def mission_jobs(
    base: Mission, folder: str, settings: Sequence[Setting], seeds: int, traces: str | None, time_limit_s: float
) -> Iterator[Job]:
    """Yield a job per setting and seed."""
    for seed in range(1, seeds + 1):  # all settings get their first seed before any gets its second
        for setting in settings:
            arguments = {"mission": canonical(setting.mission(base, seed)), "folder": folder}
            if traces is not None:
                arguments["trace_file"] = str(Path(traces) / (setting.key(seed).replace(" ", "_") + ".json"))
            yield Job(setting.key(seed), "benchmarks.missions.runs:run_mission", arguments, time_limit_s)


def limit_jobs(base: Mission, folder: str, teams: Sequence[int], steps: int, restarts: int) -> Iterator[Job]:
    """Yield the bounds of all teams, one job, and a job per full-map plan, with blocking and without."""
    data = canonical(base)
    yield Job(
        "bounds", "benchmarks.missions.runs:run_bounds", {"mission": data, "folder": folder, "teams": list(teams)}
    )
    for team in teams:
        for blocking in (True, False) if team >= 3 else (True,):
            for share in LIMIT_SHARES:
                arguments = {
                    "mission": {**data, "robots": data["robots"][:team], "failures": [], "blocking": blocking},
                    "folder": folder, "share": share, "steps": steps, "restarts": restarts,
                }  # fmt: skip
                key = f"{FULL_MAP} x{team}{'' if blocking else ' no blocking'} {share:.0%}"
                yield Job(key, "benchmarks.missions.runs:run_full_map", arguments)


# --- in the job's process ---


def run_mission(mission: dict[str, Any], folder: str, trace_file: str | None = None) -> dict[str, Any]:
    """Simulate a mission and return what the tables need."""
    trace = simulate(parse(mission, kind="mission"), folder)
    if trace_file is not None:
        save(trace, trace_file)
    summary = summarise(trace, SHARES)
    times = coverage_times(trace)
    instants = np.arange(0.0, trace.mission.horizon_s + 1e-9, CURVE_S)
    known = times[np.isfinite(times)]
    last = float(known[-1]) if len(known) else 0.0
    return {
        "reached": {f"{m.coverage:g}": [m.t_s, m.energy_j] for m in summary.milestones},
        "coverage": summary.coverage,
        "end_s": summary.end_s,
        "last_s": last,
        "curve": [
            round(float(share), 5) for share in np.searchsorted(times, instants, side="right") / max(1, len(times))
        ],
        "robots": [_robot(trace, n, last) for n in range(len(trace.mission.robots))],
        "wall_s": summary.wall_s,
        "events": summary.events,
    }


def _robot(trace: Trace, n: int, last_s: float) -> dict[str, float]:
    """Return a robot's energy up to its last useful motion, and what always-on sensors would have added to it.

    Useful is what it drove before the last pixel of the mission became known to anybody.
    """
    frames = [frame for frame in trace.frames if frame.t_s <= last_s + 1.0]
    at = 0.0
    for before, after in pairwise(frames):
        a, b = before.robots[n], after.robots[n]
        if abs(a.x_m - b.x_m) + abs(a.y_m - b.y_m) > 0.02:
            at = after.t_s
    track = next((t for t in trace.tracks if t.robot == trace.mission.robots[n].id), None)
    off = 0.0
    if track is not None:
        poses = track.array()
        until = poses[: int(at / track.unit_s)]
        off = float((until[:, 3] == 0).sum() * track.unit_s)
    profile = trace.mission.profiles[trace.mission.robots[n].profile]
    return {"useful_s": at, "energy_j": round(spent_j(trace, n, at), 2), "off_j": round(off * profile.sensing_w, 2)}


@lru_cache(maxsize=2)
def _truth(path: str) -> OccupancyMap:
    return load_map(path)


def run_bounds(mission: dict[str, Any], folder: str, teams: list[int]) -> list[dict[str, Any]]:
    """Return the proven lower bounds of all teams (the first robots of a mission) at all shares."""
    parsed: Mission = parse(mission, kind="mission")
    truth = _truth(str(Path(folder) / parsed.map))
    profiles = [RobotProfile(**parsed.profiles[robot.profile].model_dump()) for robot in parsed.robots]
    starts = np.array([(robot.x_m, robot.y_m) for robot in parsed.robots])
    world = World(truth, min(p.radius_m for p in profiles), max(p.lidar_range_m for p in profiles), starts)
    hidden = survey(world, profiles, starts)
    regions = candidates(hidden)
    bounds = [time_bound(hidden, regions, share, team) for team in teams for share in LIMIT_SHARES]
    return [
        {
            "robots": bound.robots, "share": bound.share, "time_s": round(bound.time_s, 3),
            "reachability_s": round(bound.reachability_s, 3), "regions": bound.regions,
        }
        for bound in bounds
    ]  # fmt: skip


def run_full_map(mission: dict[str, Any], folder: str, share: float, steps: int, restarts: int) -> dict[str, Any]:
    """Return the best plan found with the whole map known."""
    parsed: Mission = parse({**mission, "horizon_s": max(mission["horizon_s"], 400.0)}, kind="mission")
    truth = _truth(str(Path(folder) / parsed.map))
    plan = best_plan(parsed, truth, share, outlook=outlook_of(parsed, truth), steps=steps, restarts=restarts)
    return {"time_s": plan.time_s, "planned_s": round(plan.planned_s, 2), "paths_m": plan.paths_m}
