"""Draw the example factory: 20 m x 50 m, 0.05 m per pixel, as a ROS map (``factory.yaml`` + ``factory.pgm``).

The building is this project's own. Metres, x to the right, y up, (0, 0) at the inner building's lower-left corner;
ten areas of 10 m, two columns (L, R) by five rows (0 to 4). Robots enter through a tunnel in R0. Two conveyors
and a few walls make a maze of the areas: R0-R1-R2-L2, from there down to the dead end L1-L0 (so L1 and L2 are
crossed twice), and up to L3, where the ring L3-L4-R4-R3 closes through a passage of 0.8 m. Stores and offices
behind such passages are the blind spots. Around the building the map is unknown, as a mapping robot leaves it.

Run ``python examples/factory/draw_factory.py [FOLDER]``; the files are the same byte for byte on every machine.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

RESOLUTION_M = 0.05
WIDTH_M, HEIGHT_M, MARGIN_M = 20.0, 50.0, 1.0
FREE, WALL, UNKNOWN = 254, 0, 205  # grey values of the ROS map_server convention

Box = tuple[float, float, float, float]

# Boxes are (x from, y from, x to, y to).
OUTER_WALLS: list[Box] = [(0, 0, 20, 0.2), (0, 49.8, 20, 50), (0, 0, 0.2, 50), (19.8, 0, 20, 50)]
TUNNEL: list[Box] = [(12.0, 0.2, 12.2, 6.6), (14.4, 0.2, 14.6, 6.6)]
PARTITIONS: list[Box] = [
    (10.0, 0.2, 10.2, 10.4),  # L0 | R0, no door
    (16.0, 9.9, 19.8, 10.1),  # half of R0 | R1
    (0.2, 9.8, 6.8, 10.0), (8.2, 9.8, 10.2, 10.0),  # L0 | L1, door of 1.4 m
    (9.9, 34.0, 10.1, 47.6), (9.9, 48.4, 10.1, 49.8),  # L3 | R3 open below 34 m; L4 | R4, passage of 0.8 m
    (0.2, 40.0, 1.2, 40.2), (2.6, 40.0, 9.9, 40.2),  # L3 | L4, door of 1.4 m
    (10.1, 40.0, 11.0, 40.2), (12.4, 40.0, 17.4, 40.2), (18.2, 40.0, 19.8, 40.2),  # R3 | R4, door and 0.8 m passage
]  # fmt: skip
BLIND_SPOTS: list[Box] = [
    (10.2, 5.0, 11.2, 5.2),  # R0: cabinet beside the tunnel, passage of 0.8 m
    (4.6, 0.2, 4.8, 6.2), (0.2, 6.0, 3.8, 6.2), (2.2, 2.0, 2.4, 4.6),  # L0: office, passage of 0.8 m
    (15.6, 12.8, 19.8, 13.0), (15.6, 18.0, 19.8, 18.2),  # R1: store, door of 0.8 m, a screen inside
    (15.6, 13.0, 15.8, 15.1), (15.6, 15.9, 15.8, 18.0), (17.4, 13.0, 17.6, 16.2),
    (3.4, 44.8, 3.6, 49.8), (1.0, 44.8, 3.4, 45.0),  # L4: store, passage of 0.8 m
    (17.0, 44.8, 17.2, 49.8), (17.0, 43.8, 19.8, 44.0),  # R4: store, passage of 0.8 m
]  # fmt: skip
CONVEYORS: list[Box] = [(9.5, 10.4, 10.5, 25.0), (8.2, 29.5, 19.8, 30.5)]
SHELVES: list[Box] = [
    (15.8, 1.5, 16.6, 6.5), (18.0, 1.5, 18.8, 6.5),
    (16.2, 25.0, 19.8, 25.8), (16.2, 27.4, 19.8, 28.2),
    (0.2, 21.2, 4.2, 22.0), (0.2, 24.0, 4.2, 24.8), (0.2, 26.8, 4.2, 27.6),
    (13.0, 34.0, 13.8, 38.8), (15.8, 34.0, 16.6, 38.8),
]  # fmt: skip
MACHINES: list[Box] = [
    (6.4, 2.4, 8.0, 3.4), (6.4, 5.4, 8.0, 6.4), (2.0, 12.0, 4.4, 14.0), (5.8, 15.5, 7.4, 17.5),
    (16.8, 21.3, 18.2, 22.7), (2.4, 31.8, 4.4, 33.0), (5.6, 34.6, 7.6, 35.8), (2.0, 35.6, 3.2, 37.8),
    (5.6, 42.5, 7.2, 44.0), (5.6, 46.0, 7.2, 47.5), (13.0, 42.5, 15.0, 45.0), (13.0, 46.4, 15.0, 48.6),
]  # fmt: skip
CONSOLE_CENTRES = [(11.6, 12.5), (11.6, 17.0), (11.6, 22.0), (8.4, 13.0), (8.4, 18.5)]
CONSOLE_CENTRES += [(12.5, 31.6), (15.5, 31.6), (18.2, 31.6)]
CONSOLES: list[Box] = [(x - 0.25, y - 0.25, x + 0.25, y + 0.25) for x, y in CONSOLE_CENTRES]
TURNED_MACHINES: list[tuple[float, float, float, float, float]] = [  # centre x, y, length, width, degrees
    (14.0, 24.0, 2.0, 1.2, 25.0),
    (3.2, 17.2, 1.8, 1.0, -30.0),
]
TANKS: list[tuple[float, float, float]] = [(13.2, 19.4, 0.3), (7.2, 38.0, 0.8), (17.4, 41.6, 0.3)]  # x, y, radius


def draw() -> NDArray[np.uint8]:
    """Return the map's grey values, row 0 at the top as in the image file."""
    columns = round((WIDTH_M + 2 * MARGIN_M) / RESOLUTION_M)
    rows = round((HEIGHT_M + 2 * MARGIN_M) / RESOLUTION_M)
    x = (np.arange(columns) + 0.5) * RESOLUTION_M - MARGIN_M
    y = ((np.arange(rows) + 0.5) * RESOLUTION_M - MARGIN_M)[:, None]
    grey = np.full((rows, columns), UNKNOWN, dtype=np.uint8)
    grey[(x > 0) & (x < WIDTH_M) & (y > 0) & (y < HEIGHT_M)] = FREE
    for boxes in (OUTER_WALLS, TUNNEL, PARTITIONS, BLIND_SPOTS, CONVEYORS, SHELVES, MACHINES, CONSOLES):
        for x0, y0, x1, y1 in boxes:
            grey[(x > x0) & (x < x1) & (y > y0) & (y < y1)] = WALL
    for x0, y0, length, width, degrees in TURNED_MACHINES:
        cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        along, across = (x - x0) * cos + (y - y0) * sin, (y - y0) * cos - (x - x0) * sin
        grey[(np.abs(along) < length / 2) & (np.abs(across) < width / 2)] = WALL
    for x0, y0, radius in TANKS:
        grey[(x - x0) ** 2 + (y - y0) ** 2 < radius**2] = WALL
    return grey[::-1]


def main(folder: Path) -> None:
    """Write ``factory.pgm`` and ``factory.yaml`` into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    Image.fromarray(draw()).save(folder / "factory.pgm")
    (folder / "factory.yaml").write_text(
        "image: factory.pgm\n"
        f"resolution: {RESOLUTION_M}\n"
        f"origin: [{-MARGIN_M}, {-MARGIN_M}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        encoding="utf-8",
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
