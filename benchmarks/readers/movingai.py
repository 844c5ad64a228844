"""MovingAI scenarios: start and goal points on a grid map, as an inspection driven along exact shortest paths.

The map named in a line is looked for beside the scenario file. The first starts are the robots' places, the goals
that follow are targets of equal value; a point robot drives one pixel per second, on any-angle shortest paths that
keep off blocked pixels. Half the time that a nearest-neighbour tour would take is given.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.readers.text import fault, lines_of, number
from react_opt.energy import RobotProfile
from react_opt.geometry.inflation import Footprint, inflate
from react_opt.geometry.movingai import read_movingai_map
from react_opt.paths.exact import exact_costs

ROBOTS, TARGETS = 3, 30
RADIUS = 0.2  # of a pixel
POINT_ROBOT = RobotProfile(
    length_m=0.3, width_m=0.3, speed_max_m_s=1.0, speed_min_m_s=1.0, full_speed_clearance_m=0.0, accel_m_s2=1e6,
    turn_rad_s=1e6, idle_w=0.0, motion_w=1.0, turn_w=0.0, sensing_w=0.0, battery_j=0.0, capacity_j=0.0, reserve_j=0.0,
    lidar_range_m=1.0, lidar_rays=1,
)  # fmt: skip


class Query(NamedTuple):
    """A line of a scenario: its map, start and goal in pixels (column, row from the top), and the octile optimum."""

    map: str
    start: tuple[int, int]
    goal: tuple[int, int]
    length: float


def queries(file: str) -> list[Query]:
    """Return the lines of a scenario file."""
    found = []
    for k, line in enumerate(lines_of(file), start=1):
        words = line.split()
        if not words or words[0].lower() == "version":
            continue
        if len(words) != 9:
            fault(file, f"line {k}", f"expected 9 columns, found {len(words)}")
        values = [number(file, f"line {k}", word) for word in words[2:]]
        if any(value != int(value) or value < 0 for value in values[:6]):
            fault(file, f"line {k}", "expected whole sizes and coordinates >= 0")
        x, y, u, v = (int(value) for value in values[2:6])
        if x >= values[0] or u >= values[0] or y >= values[1] or v >= values[1]:
            fault(file, f"line {k}", "expected start and goal on the map")
        found.append(Query(words[1], (x, y), (u, v), values[6]))
    if not found:
        fault(file, "", "expected at least one scenario")
    return found


def read(file: str) -> list[dict[str, Any]]:
    """Return the one ``inspection`` instance of a scenario file and its map."""
    lines = queries(file)
    path = Path(file).parent / Path(lines[0].map).name
    map_ = read_movingai_map(path)
    lines = [line for line in lines if line.map == lines[0].map]
    starts = list(dict.fromkeys(line.start for line in lines))[:ROBOTS]
    goals = [goal for goal in dict.fromkeys(line.goal for line in lines) if goal not in starts][:TARGETS]
    pixels = np.array([*starts, *goals], dtype=np.float64)
    points = np.column_stack([pixels[:, 0] + 0.5, map_.rows - pixels[:, 1] - 0.5])  # rows are counted from the top
    space = inflate(map_, Footprint(RADIUS), rule="strict")
    table = exact_costs(space, POINT_ROBOT).cost_table(points)
    names = [*(f"s{k}" for k in range(len(starts))), *(f"g{k}" for k in range(len(goals)))]
    length = table.length_m
    return [
        {
            "kind": "inspection",
            "schema_version": 1,
            "name": f"scenario_{Path(file).name.removesuffix('.scen')}",
            "time_left_s": _time_left_s(length, len(starts)),
            "robots": [{"id": f"r{k}", "at": f"s{k}", "battery_j": 0.0} for k in range(len(starts))],
            "targets": [{"id": f"g{k}"} for k in range(len(goals))],
            "travel": [
                {"from": names[i], "to": names[j], "time_s": float(length[i, j]), "energy_j": 0.0}
                for i in range(len(names))
                for j in range(len(starts), len(names))
                if i != j and table.reachable[i, j]
            ],
        }
    ]


def _time_left_s(length: Any, robots: int) -> float:
    """Return half of what each robot would drive if a nearest-neighbour tour from the first start were shared."""
    near = np.where(np.isnan(length), np.inf, length)
    left, at, total = set(range(robots, len(near))), 0, 0.0
    while left:
        k = min(left, key=lambda j: (near[at, j], j))
        if not np.isfinite(near[at, k]):
            break
        total += float(near[at, k])
        left.discard(k)
        at = k
    return round(0.5 * total / robots, 3)
