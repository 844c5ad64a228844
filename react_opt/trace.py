"""What a mission leaves behind: an append-only record of poses, maps, orders, decisions and batteries (kind ``trace``).

Everything but ``wall_s`` depends on the mission and its seed alone: the same mission gives the same trace.
"""

from __future__ import annotations

import base64
import zlib
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from react_opt.instance import MAX_COUNT, Mission, Part
from react_opt.plan import Claim

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Name = Annotated[str, Field(strict=True)]
Index = Annotated[int, Field(strict=True, ge=0, le=MAX_COUNT)]
Flag = Annotated[bool, Field(strict=True)]

NEVER = 65535  # a pixel that was not known when the mission ended

EventType = Literal[
    "target_new",  # a local target appeared: at x_m, y_m with its size
    "target_taken",  # a robot was sent to it
    "target_deferred",  # not served by this decision, for the reason given
    "target_postponed",  # put off to the inspection: priority below postpone_below, or abandoned
    "target_inspected",  # nothing of its region is unknown any more
    "target_abandoned",  # its robot made no progress for stuck_s
    "order",  # any other order: a robot sent to an area, to wait, or home
    "replan",  # OROS, assignment or inspection was solved: claim
    "area_explored",  # target: the area's id
    "area_unreachable",  # the belief proves it: it left the high-level problem
    "area_added",  # the building is larger than was thought
    "sensing_on",
    "sensing_off",
    "link_down",
    "link_up",
    "yield",  # the robot waits for another one by the priority rule
    "robot_stuck",
    "robot_dead",
    "battery_empty",
    "inspection_gate",  # whether the deferred inspection is entered, and why
    "mission_end",
]


class TraceRobot(Part):
    """A robot at one instant; ``target`` is the local target or area it is on its way to."""

    id: Name
    x_m: Number
    y_m: Number
    yaw_rad: Number
    sensing: Flag
    battery_j: Number
    target: Name | None = None


class TraceFrame(Part):
    """The fleet at one instant; ``coverage`` is the known share of the truly coverable area, 0 to 1."""

    t_s: Number
    robots: tuple[TraceRobot, ...]
    coverage: Number


class TraceEvent(Part):
    """Something that happened or was decided.

    Parameters
    ----------
    t_s
        Simulated time, s.
    type
        What it was.
    robot, target
        Whom and which target or area it concerns, None where nobody.
    reason
        Why, in words a person can read.
    x_m, y_m
        Where, m (of a target: where it is), None where nowhere.
    size_m2
        Of a target: the area of its unknown region, m^2.
    claim
        Of a replan: what the solver claims (without its certificate).
    """

    t_s: Number
    type: EventType
    robot: Name | None = None
    target: Name | None = None
    reason: str | None = None
    x_m: Number | None = None
    y_m: Number | None = None
    size_m2: Number | None = None
    claim: Claim | None = None


class PixelMap(Part):
    """Numbers per pixel, compressed.

    Parameters
    ----------
    rows, cols
        Shape; row 0 has the smallest y.
    resolution_m, origin_x_m, origin_y_m, origin_yaw_rad
        Side of a pixel, m, and the pose of the outer corner of pixel (0, 0), m and rad.
    unit_s
        For times: one unit in s.
    data
        Row by row as little-endian uint16 (``known``) or uint8 (``truth``), zlib, base64.
    """

    rows: Index
    cols: Index
    resolution_m: Number
    origin_x_m: Number
    origin_y_m: Number
    origin_yaw_rad: Number = 0.0
    unit_s: Number = 1.0
    data: Name

    def array(self, dtype: Literal["<u2", "u1"]) -> NDArray[np.uint16] | NDArray[np.uint8]:
        """Return the ``(rows, cols)`` numbers."""
        raw = zlib.decompress(base64.b64decode(self.data))
        return np.frombuffer(raw, dtype=dtype).reshape(self.rows, self.cols)


def pixel_data(numbers: NDArray[np.uint16] | NDArray[np.uint8]) -> str:
    """Return numbers per pixel as :class:`PixelMap` holds them."""
    little = numbers.astype("<u2") if numbers.dtype == np.uint16 else numbers
    return base64.b64encode(zlib.compress(np.ascontiguousarray(little).tobytes(), 9)).decode("ascii")


class Track(Part):
    """Where a robot was at every instant at which it may scan, compressed: what a replay needs to scan again.

    Parameters
    ----------
    robot
        Its id.
    unit_s
        Time from one instant to the next, s; the first is 0.
    data
        Rows of four little-endian float64: pose on the grid (m along the map's columns and rows from its corner,
        rad from the columns' direction), and 1 where it scanned, else 0; zlib, base64.
    """

    robot: Name
    unit_s: Number
    data: Name

    def array(self) -> NDArray[np.float64]:
        """Return the ``(n, 4)`` rows."""
        return np.frombuffer(zlib.decompress(base64.b64decode(self.data)), dtype="<f8").reshape(-1, 4)


def track_data(rows: NDArray[np.float64]) -> str:
    """Return ``(n, 4)`` rows as :class:`Track` holds them."""
    return base64.b64encode(zlib.compress(np.ascontiguousarray(rows, dtype="<f8").tobytes(), 6)).decode("ascii")


class Trace(Part):
    """A mission as it went.

    Parameters
    ----------
    mission
        The whole mission, as simulated (options of the command line applied).
    seed
        Its seed.
    status
        ``finished``, or ``stopped`` where it can be resumed.
    frames
        The fleet at regular instants.
    known
        Per pixel when it became known, in units of ``unit_s``; :data:`NEVER` where it did not.
    truth
        Per pixel 0 free, 1 occupied, 2 unknown in the map file, plus 4 where it counts as coverable.
    tracks
        The robots' poses at the instants of scans.
    events
        In order of time.
    wall_s
        Computing time by phase (sense, decide, drive, ...), s.
    decisions_wall_s
        Computing time of each decision, s, in order.
    """

    kind: Literal["trace"] = "trace"
    schema_version: Literal[1] = 1
    mission: Mission
    seed: Index
    status: Literal["finished", "stopped"] = "finished"
    frames: tuple[TraceFrame, ...]
    known: PixelMap
    truth: PixelMap
    tracks: tuple[Track, ...] = ()
    events: tuple[TraceEvent, ...]
    wall_s: dict[str, Number] = {}
    decisions_wall_s: tuple[Number, ...] = ()
