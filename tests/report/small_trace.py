"""A mission told by hand on the example factory: two robots drive fixed ways and see what a LiDAR would see."""

from __future__ import annotations

import itertools
import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from react_opt.geometry import load_map
from react_opt.jsonio import load, parse
from react_opt.trace import NEVER, Trace, pixel_data

ROOT = Path(__file__).resolve().parent.parent.parent
FACTORY = ROOT / "examples" / "factory" / "factory.yaml"
FRAME_S = 0.5
SPEED_M_S = 0.89
RANGE_M = 8.0
WAYS = {
    "r1": "13.3,5.4 13.3,8.2 12.6,10.4 12.6,18 11.2,26.5 5,29 5,33 1.9,38.4 1.9,40.8 5,45",
    "r2": "13.3,3 13.3,8.2 13,14 11.2,26.5 6,25.7 6,20 5,15 7.5,9.9 7.5,4.4",
}


def _pose(text: str, metres: float) -> tuple[float, float, float]:
    way = [(float(x), float(y)) for x, y in (point.split(",") for point in text.split())]
    for (x0, y0), (x1, y1) in itertools.pairwise(way):
        length = math.hypot(x1 - x0, y1 - y0)
        if metres <= length:
            share = metres / length
            return x0 + share * (x1 - x0), y0 + share * (y1 - y0), math.atan2(y1 - y0, x1 - x0)
        metres -= length
    (x0, y0), (x1, y1) = way[-2:]
    return x1, y1, math.atan2(y1 - y0, x1 - x0)


@cache
def scripted(coarse: int = 5, name: str = "told by hand", until_s: float = 60.0) -> Trace:
    """Return the trace; ``coarse`` pixels of the map, along a side, become one."""
    source = load_map(FACTORY)
    rows, cols = source.rows // coarse, source.cols // coarse
    blocks = source.cells[: rows * coarse, : cols * coarse].reshape(rows, coarse, cols, coarse)
    values = np.where((blocks == 1).any(axis=(1, 3)), 1, blocks[:, coarse // 2, :, coarse // 2]).astype(np.uint8)
    resolution = source.resolution_m * coarse
    known = np.full((rows, cols), NEVER, dtype=np.uint16)
    coverable = values == 0
    rays = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    battery = dict.fromkeys(WAYS, 8245.96)
    frames: list[dict[str, Any]] = []
    events: list[dict[str, Any]] = []
    t = 0.0
    while t <= until_s:
        robots = []
        for name_, way in WAYS.items():
            x, y, yaw = _pose(way, SPEED_M_S * t)
            on = not (name_ == "r2" and 10 <= t < 22)
            if on:
                _scan(values, known, (x, y), rays, (source.origin_x_m, source.origin_y_m), resolution, round(t / 0.1))
            target = "t1" if t < 30 else "0,3"
            robots.append(
                {
                    "id": name_,
                    "x_m": x,
                    "y_m": y,
                    "yaw_rad": yaw,
                    "sensing": on,
                    "battery_j": battery[name_],
                    "target": target,
                }
            )
            battery[name_] -= FRAME_S * (9.0 + (16.9 if on else 0.0))
        seen = (known != NEVER) & coverable
        frames.append({"t_s": t, "robots": robots, "coverage": float(seen.sum() / coverable.sum())})
        t += FRAME_S
    claim = {
        "status": "feasible",
        "objective": 170.25,
        "bound": 172.5,
        "gap": 2.25 / 170.25,
        "limit": "work",
        "method": "routes",
        "solver": "highs",
    }
    proven = claim | {"status": "optimal", "objective": 150.0, "bound": 150.0, "gap": 0.0, "limit": "none"}
    place = {"x_m": 18.0, "y_m": 15.0}
    events += [
        {"t_s": 0.0, "type": "replan", "reason": "the mission begins", "claim": claim},
        {"t_s": 0.0, "type": "order", "robot": "r1", "target": "1,1", "reason": "first area of its route"},
        dict(t_s=4.0, type="target_new", target="t1", size_m2=12.5, **place),
        dict(t_s=4.5, type="target_taken", target="t1", robot="r1", reason="best worth 1.84", **place),
        {"t_s": 10.0, "type": "sensing_off", "robot": "r2", "reason": "area 1,1 is explored"},
        {"t_s": 14.0, "type": "target_new", "target": "t2", "size_m2": 6.0, "x_m": 3.0, "y_m": 3.0},
        {"t_s": 15.0, "type": "target_deferred", "target": "t2", "reason": "outbid: r2 takes t1"},
        {"t_s": 22.0, "type": "sensing_on", "robot": "r2", "reason": "it enters an area that is not explored"},
        {"t_s": 26.0, "type": "target_postponed", "target": "t2", "reason": "priority 0.4 below 1"},
        {"t_s": 30.0, "type": "target_inspected", "target": "t1", "robot": "r1", "reason": "nothing of it is unknown"},
        {"t_s": 31.0, "type": "replan", "reason": "area 1,1 explored", "claim": proven},
        {"t_s": 40.0, "type": "link_down", "robot": "r1", "reason": "outage"},
        {"t_s": 45.0, "type": "link_up", "robot": "r1"},
        {"t_s": until_s, "type": "mission_end", "reason": "the time is over"},
    ]  # fmt: skip
    fleet = load(ROOT / "examples" / "factory" / "fleet_2.json")
    mission = {
        "kind": "mission", "name": name, "map": "factory.yaml", "cell_m": 10.0, "horizon_s": 240.0, "step_s": 10.0,
        "profiles": {key: each.model_dump() for key, each in fleet.profiles.items()},
        "robots": [each.model_dump() for each in fleet.robots], "delta": 0.9, "strategy": "react",
        "postpone_below": 1.0, "seed": 7,
    }  # fmt: skip
    grid = {
        "rows": rows,
        "cols": cols,
        "resolution_m": resolution,
        "origin_x_m": source.origin_x_m,
        "origin_y_m": source.origin_y_m,
    }
    return parse(
        {
            "kind": "trace",
            "mission": mission,
            "seed": 7,
            "frames": frames,
            "known": grid | {"unit_s": 0.1, "data": pixel_data(known)},
            "truth": grid | {"data": pixel_data((values + 4 * coverable).astype(np.uint8))},
            "events": [event for event in events if event["t_s"] <= until_s],
        }
    )


def _scan(
    values: Any,
    known: Any,
    at: tuple[float, float],
    rays: Any,
    origin: tuple[float, float],
    resolution: float,
    now: int,
) -> None:
    open_ = np.ones(len(rays), dtype=bool)
    for reach in np.arange(0, RANGE_M, resolution / 2):
        col = np.floor((at[0] + reach * np.cos(rays[open_]) - origin[0]) / resolution).astype(int)
        row = np.floor((at[1] + reach * np.sin(rays[open_]) - origin[1]) / resolution).astype(int)
        inside = (row >= 0) & (row < values.shape[0]) & (col >= 0) & (col < values.shape[1])
        row, col = np.clip(row, 0, values.shape[0] - 1), np.clip(col, 0, values.shape[1] - 1)
        known[row[inside], col[inside]] = np.minimum(known[row[inside], col[inside]], now)
        still = np.flatnonzero(open_)
        open_[still[~inside | (values[row, col] == 1)]] = False
