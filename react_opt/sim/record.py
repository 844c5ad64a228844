"""What a mission leaves behind, gathered while it runs: frames, events, when pixels became known, tracks."""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import NDArray

from react_opt.instance import Mission
from react_opt.orchestrator.strategy import Note
from react_opt.plan import Claim
from react_opt.sim.robot import SimRobot
from react_opt.sim.world import World
from react_opt.trace import (
    NEVER,
    PixelMap,
    Trace,
    TraceEvent,
    TraceFrame,
    TraceRobot,
    Track,
    pixel_data,
    track_data,
)

_MOST_UNITS = NEVER - 1


class Recorder:
    """The trace of a mission in the making.

    Parameters
    ----------
    mission
        As simulated.
    world
        The truth, which coverage is measured by.
    scan_s
        Time between scans, s: the unit of what is recorded, or a multiple where a mission is very long.
    """

    def __init__(self, mission: Mission, world: World, scan_s: float) -> None:
        self._mission = mission
        self._world = world
        self._unit_s = scan_s * max(1, ceil(mission.horizon_s / scan_s / _MOST_UNITS))
        self._known = np.full(world.blocked.shape, NEVER, dtype=np.uint16)
        self._coverable = world.coverable.ravel()
        self._total = max(1, int(self._coverable.sum()))
        self._covered = 0
        self.frames: list[TraceFrame] = []
        self.events: list[TraceEvent] = []
        self._tracks: dict[str, list[tuple[float, float, float, float]]] = {}
        self.decisions_wall_s: list[float] = []
        self.wall_s: dict[str, float] = {}

    @property
    def coverage(self) -> float:
        """Known share of the coverable area, 0 to 1."""
        return self._covered / self._total

    def learn(self, t_s: float, pixels: NDArray[np.int64]) -> None:
        """Take note that pixels (row by row) have reached the merged map."""
        known = self._known.ravel()
        new = pixels[known[pixels] == NEVER]
        known[new] = min(_MOST_UNITS, round(t_s / self._unit_s))
        self._covered += int(self._coverable[new].sum())

    def event(self, t_s: float, kind: str, **fields: object) -> None:
        """Add an event."""
        self.events.append(TraceEvent.model_validate({"t_s": t_s, "type": kind, **fields}))

    def note(self, t_s: float, note: Note) -> None:
        """Add what a strategy has to say."""
        claim = note.claim
        if claim is not None:  # certificates are large, and wall times differ from run to run
            told = {name: getattr(claim, name) for name in Claim.model_fields}  # of any claim what all claims hold
            claim = Claim(**told | {"certificate": None, "wall_s": {}})
        self.events.append(TraceEvent.model_validate({**vars(note), "t_s": t_s, "claim": claim}))

    def track(self, robot: SimRobot, sensing: bool) -> None:
        """Add a robot's pose at the instant of a scan, and whether it scans."""
        pose = (robot.u_m, robot.v_m, robot.heading_rad, float(sensing))
        self._tracks.setdefault(robot.id, []).append(pose)

    def frame(self, t_s: float, robots: list[SimRobot]) -> None:
        """Add the fleet as it is."""
        unit = self._world.map.resolution_m
        places = self._world.map.pixel_to_world([(robot.u_m / unit, robot.v_m / unit) for robot in robots])
        self.frames.append(
            TraceFrame(
                t_s=t_s,
                coverage=round(self.coverage, 6),
                robots=tuple(
                    TraceRobot(
                        id=robot.id,
                        x_m=round(float(x), 4),
                        y_m=round(float(y), 4),
                        yaw_rad=round(robot.heading_rad + self._world.map.origin_yaw_rad, 4),
                        sensing=robot.sensing,
                        battery_j=round(robot.battery_j, 4),
                        target=robot.target,
                    )
                    for robot, (x, y) in zip(robots, places, strict=True)
                ),
            )
        )

    def trace(self, *, finished: bool, scan_s: float) -> Trace:
        """Return the trace so far."""
        tracks = (
            Track(robot=name, unit_s=scan_s, data=track_data(np.array(poses))) for name, poses in self._tracks.items()
        )
        return Trace(
            mission=self._mission,
            seed=self._mission.seed,
            status="finished" if finished else "stopped",
            frames=tuple(self.frames),
            known=self._pixels(self._known, self._unit_s),
            truth=self._pixels(self._world.codes(), 1.0),
            tracks=tuple(tracks),
            events=tuple(self.events),
            wall_s={name: round(value, 3) for name, value in self.wall_s.items()},
            decisions_wall_s=tuple(round(value, 5) for value in self.decisions_wall_s),
        )

    def _pixels(self, numbers: NDArray[np.uint16] | NDArray[np.uint8], unit_s: float) -> PixelMap:
        map_ = self._world.map
        return PixelMap(
            rows=map_.rows,
            cols=map_.cols,
            resolution_m=map_.resolution_m,
            origin_x_m=map_.origin_x_m,
            origin_y_m=map_.origin_y_m,
            origin_yaw_rad=map_.origin_yaw_rad,
            unit_s=unit_s,
            data=pixel_data(numbers),
        )
