"""Small buildings and missions for tests of the simulator."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import FleetRobot, Mission
from react_opt.jsonio import load

FACTORY = Path(__file__).parents[2] / "examples" / "factory"
JACKAL = load(FACTORY / "fleet_1.json").profiles["jackal"].model_copy(update={"lidar_range_m": 5.0, "lidar_rays": 180})


def building(boxes: list[tuple[float, float, float, float]], size_m: tuple[float, float] = (12.0, 8.0)) -> OccupancyMap:
    """Return a building of a size with walls around, and walls in boxes (x0, y0, x1, y1), at 0.1 m per pixel."""
    cols, rows = round(size_m[0] * 10), round(size_m[1] * 10)
    cells = np.zeros((rows, cols), dtype=np.uint8)
    cells[[0, -1], :] = 1
    cells[:, [0, -1]] = 1
    for x0, y0, x1, y1 in boxes:
        cells[round(y0 * 10) : round(y1 * 10), round(x0 * 10) : round(x1 * 10)] = 1
    return OccupancyMap(cells, 0.1)


TWO_ROOMS = building([(5.9, 0.0, 6.1, 3.4), (5.9, 4.6, 6.1, 8.0), (9.0, 2.0, 10.0, 6.0)])


def mission(starts: list[tuple[float, float]], **changes: Any) -> Mission:
    """Return a mission of robots at starts; the file of its map is not read in tests."""
    values: dict[str, Any] = {
        "name": "two rooms",
        "map": "two_rooms.yaml",
        "cell_m": 6.0,
        "horizon_s": 60.0,
        "step_s": 6.0,
        "profiles": {"jackal": JACKAL},
        "robots": tuple(FleetRobot(id=f"r{n + 1}", profile="jackal", x_m=x, y_m=y) for n, (x, y) in enumerate(starts)),
        "delta": 0.98,
        "strategy": "nearest",
        "postpone_below": 0.1,
        "seed": 1,
    }
    return Mission(**{**values, **changes})
