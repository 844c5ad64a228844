"""The replay of a mission: one HTML file that opens from disk and needs nothing else.

What comes from files reaches the page only as base64 of compressed JSON, so no text in it can end the script's tag;
the page's script puts it into the document as text alone. A content security policy names the page's own script and
style by their hashes, so nothing else could run.
"""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from react_opt.limits.curve import CoverageBound, share_at
from react_opt.report.colours import ROBOT_COLOURS
from react_opt.report.replay.blocks import in_blocks
from react_opt.report.tracks import on_grid, tracks
from react_opt.trace import NEVER, Trace, TraceEvent, pixel_data

SCALES = {"t": 1e-3, "x": 0.01, "y": 0.01, "yaw": 0.01, "battery": 0.1, "coverage": 1e-5}
"""One unit of what the page holds: s, m, m, rad, J, a share."""

_SCRIPTS = ("data.js", "draw.js", "app.js")
_GONE = -(2**31)  # a robot that a frame does not name


def replay_page(
    traces: Sequence[Trace], *, truth: bool = True, bounds: Sequence[CoverageBound | None] | None = None
) -> str:
    """Return the replay of one trace, or of two side by side, as an HTML page.

    Parameters
    ----------
    traces
        One trace or two.
    truth
        Whether the page holds the walls that the robots have not seen (shown or hidden by the viewer).
    bounds
        Per trace what any team can have seen at most (:func:`react_opt.limits.curve.coverage_bound`), None for none.
    """
    given = [None] * len(traces) if bounds is None else bounds
    folder = files("react_opt.report.replay")
    script = "".join((folder / name).read_text(encoding="utf-8") for name in _SCRIPTS)
    style = (folder / "page.css").read_text(encoding="utf-8")
    payload = json.dumps(
        [_payload(in_blocks(trace), truth, bound) for trace, bound in zip(traces, given, strict=True)],
        separators=(",", ":"),
    )
    parts = {
        "@POLICY@": f"default-src 'none'; script-src '{_hash(script)}'; style-src '{_hash(style)}'; base-uri 'none'",
        "@STYLE@": style,
        "@DATA@": payload,
        "@SCRIPT@": script,
    }
    page = (folder / "page.html").read_text(encoding="utf-8")
    for mark, text in parts.items():
        page = page.replace(mark, text)
    return page


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _payload(trace: Trace, truth: bool, bound: CoverageBound | None) -> dict[str, str]:
    """Return a trace as three base64 texts: what happened, when pixels became known, and what they are."""
    told = json.dumps(_told(trace, bound), separators=(",", ":"), allow_nan=False)
    values = trace.truth.array("u1").astype(np.uint8)
    if not truth:
        values = np.where(trace.known.array("<u2") == NEVER, 3, values).astype(np.uint8)
    return {
        "told": base64.b64encode(zlib.compress(told.encode(), 9)).decode(),
        "known": pixel_data(_by_frame(trace)),
        "truth": pixel_data(values),
    }


def _unit_s(trace: Trace) -> float:
    """Return the time from frame to frame, s, or the trace's own unit where that is longer."""
    times = [frame.t_s for frame in trace.frames]
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    return max(step, trace.known.unit_s)


def _by_frame(trace: Trace) -> NDArray[np.uint16]:
    """Return per pixel the first frame that shows it: exact at every frame, and half the size."""
    known = trace.known.array("<u2")
    frame = np.ceil(known * (trace.known.unit_s / _unit_s(trace)) - 1e-6)
    return np.where(known == NEVER, NEVER, np.minimum(frame, NEVER - 1)).astype(np.uint16)


def _told(trace: Trace, bound: CoverageBound | None) -> dict[str, Any]:
    mission, grid, paths = trace.mission, trace.known, tracks(trace)
    names: dict[str, int] = {}
    goals = np.full(paths.sensing.shape, -1)
    column = {name: k for k, name in enumerate(paths.robots)}
    for row, frame in enumerate(trace.frames):
        for robot in frame.robots:
            if robot.target is not None:
                goals[row, column[robot.id]] = names.setdefault(robot.target, len(names))
    profiles = {robot.id: mission.profiles[robot.profile] for robot in mission.robots}
    return {
        "name": mission.name,
        "strategy": mission.strategy,
        "seed": trace.seed,
        "status": trace.status,
        "horizon_s": mission.horizon_s,
        "always_on": mission.always_on,
        "cell_m": mission.cell_m,
        "grid": grid.model_dump(include={"rows", "cols", "resolution_m", "origin_x_m", "origin_y_m"})
        | {"unit_s": _unit_s(trace)},
        "robots": [
            {
                "id": name,
                "colour": ROBOT_COLOURS[k % len(ROBOT_COLOURS)],
                "lidar_range_m": profiles[name].lidar_range_m if name in profiles else 0.0,
                "capacity_j": profiles[name].capacity_j if name in profiles else 0.0,
                "reserve_j": profiles[name].reserve_j if name in profiles else 0.0,
            }
            for k, name in enumerate(paths.robots)
        ],
        "scales": SCALES,
        "t": _deltas(paths.t_s / SCALES["t"]),
        "coverage": _deltas(paths.coverage / SCALES["coverage"]),
        "most": [] if bound is None else _deltas(np.ceil(share_at(bound, paths.t_s) / SCALES["coverage"] - 1e-9)),
        "x": [_deltas(each / SCALES["x"]) for each in paths.x_m.T],
        "y": [_deltas(each / SCALES["y"]) for each in paths.y_m.T],
        "yaw": [_deltas(each / SCALES["yaw"]) for each in paths.yaw_rad.T],
        "battery": [_deltas(each / SCALES["battery"]) for each in paths.battery_j.T],
        "sensing": [_deltas(each.astype(float)) for each in paths.sensing.T],
        "goal": [_deltas(each.astype(float)) for each in goals.T],
        "goals": list(names),
        "events": [_event(trace, event) for event in trace.events],
    }


def _deltas(values: NDArray[np.float64]) -> list[int]:
    """Return whole numbers as their differences, which compress well; NaN becomes a number that is never reached."""
    whole = np.where(np.isnan(values), float(_GONE), np.rint(values)).astype(np.int64)
    return [int(value) for value in np.diff(whole, prepend=0)]


def _event(trace: Trace, event: TraceEvent) -> dict[str, Any]:
    told = event.model_dump(mode="json", exclude_none=True, exclude={"claim"})
    if event.x_m is not None and event.y_m is not None:
        x, y = on_grid(trace, event.x_m, event.y_m)
        told |= {"x_m": round(float(x), 2), "y_m": round(float(y), 2)}
    if event.claim is not None:
        kept = {"status", "objective", "bound", "gap", "limit", "method", "solver", "reason"}
        told["claim"] = event.claim.model_dump(mode="json", include=kept)
    return told
