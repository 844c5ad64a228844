"""A mission file to a trace: options of the command line, maps, and going on with a trace that was stopped."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from react_opt.errors import InputError, ReactError, UsageError
from react_opt.geometry.mapfile import load_map
from react_opt.instance import Mission, canonical
from react_opt.jsonio import parse
from react_opt.sim.loop import Progress, Simulation
from react_opt.trace import Trace


def with_options(
    mission: Mission,
    *,
    strategy: str | None = None,
    robots: int | None = None,
    seed: int | None = None,
    always_on: bool = False,
) -> Mission:
    """Return a mission with options of the command line applied.

    Parameters
    ----------
    mission
        As in its file.
    strategy, seed
        Instead of the mission's.
    robots
        How many: the first ones of the mission, with the failures that concern them.
    always_on
        Sensors never off.

    Raises
    ------
    UsageError
        Where there are not so many robots, or the seed is negative.
    """
    data = canonical(mission)
    if strategy is not None:
        data["strategy"] = strategy
    if seed is not None:
        if seed < 0:
            raise UsageError(f"--seed: expected a whole number >= 0, found {seed}")
        data["seed"] = seed
    if robots is not None:
        if not 1 <= robots <= len(mission.robots):
            raise UsageError(f"--robots: expected 1 to {len(mission.robots)}, found {robots}")
        data["robots"] = data["robots"][:robots]
        ids = {row["id"] for row in data["robots"]}
        data["failures"] = [row for row in data["failures"] if row["robot"] in ids]
    data["always_on"] = data["always_on"] or always_on
    changed: Mission = parse(data, kind="mission")
    return changed


def simulate(
    mission: Mission,
    folder: str | Path = ".",
    *,
    resume: Trace | None = None,
    on_progress: Progress | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Trace:
    """Simulate a mission.

    Parameters
    ----------
    mission
        The mission.
    folder
        Where its map files are, relative to which they are named.
    resume
        A stopped trace of the same mission. Missions are deterministic, so what it records is simulated again and
        compared with it, and then the mission goes on: the end is that of a run without interruption. This costs
        the computing time of the first part once more.
    on_progress, should_stop
        See :meth:`react_opt.sim.loop.Simulation.run`.

    Raises
    ------
    InputError
        Where a map is missing or bad.
    UsageError
        Where the mission cannot be simulated (a robot inside a wall, no such strategy), or the trace to resume is
        of another mission.
    ReactError
        Where what the trace records cannot be reproduced: it was made by another version.
    """
    if resume is not None and canonical(resume.mission) != canonical(mission):
        raise UsageError("--resume: the trace is of another mission (or other options)")
    if not mission.robots:
        raise InputError.single(mission.name, "robots", "expected at least one robot")
    prior = None if mission.prior_map is None else load_map(Path(folder) / mission.prior_map)
    simulation = Simulation(mission, load_map(Path(folder) / mission.map), prior)
    trace = simulation.run(on_progress=on_progress, should_stop=should_stop)
    if resume is not None:
        _compare(resume, trace)
    return trace


def _compare(before: Trace, trace: Trace) -> None:
    """Raise where a trace does not go on from another one."""
    theirs, ours = (
        [[part.model_dump(mode="json") for part in parts] for parts in (one.frames, one.events)]
        for one in (before, trace)
    )
    for old, new in zip(theirs, ours, strict=True):
        shared = min(len(old), len(new)) if before.status == "stopped" else max(len(old), len(new))
        if old[:shared] != new[:shared]:
            raise ReactError("--resume: the recorded part cannot be reproduced; was it made by another version?")
