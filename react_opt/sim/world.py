"""The building as it is, which only the simulator knows: what blocks, and which pixels count as coverable."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from react_opt.areas import grid_lines
from react_opt.errors import UsageError
from react_opt.geometry.inflation import Footprint, FreeSpace, inflate
from react_opt.geometry.occupancy import FREE, FloatArray, OccupancyMap
from react_opt.geometry.raycast import ray_table, sees_any_px
from react_opt.kernels import kernel

_LOOKS = 720  # directions in which a pixel looks for a place to be seen from
_APART = 271  # one after the other is so many directions further; no divisor in common with their number


class World:
    """The hidden truth.

    Parameters
    ----------
    truth
        The map. What it does not know is opaque and cannot be entered.
    radius_m
        Radius of the smallest robot's disc: where it can be driven decides what is coverable, m.
    range_m
        The longest LiDAR range, m.
    starts_m
        ``(n, 2)`` start points of the robots, m.

    Raises
    ------
    UsageError
        Where a robot cannot stand at its start.
    """

    def __init__(self, truth: OccupancyMap, radius_m: float, range_m: float, starts_m: FloatArray) -> None:
        self.map = truth
        self.space: FreeSpace = inflate(truth, Footprint(radius_m), rule="strict", refine=1)
        """Clearances for the robots; its pixels are those of the map."""
        self.blocked: NDArray[np.uint8] = (truth.cells != FREE).astype(np.uint8)
        self.drivable = self._drivable(radius_m, starts_m)
        self.coverable = self._coverable(range_m)

    def _drivable(self, radius_m: float, starts_m: FloatArray) -> NDArray[np.bool_]:
        """Pixels whose centre a robot can reach: connected to a start through such pixels."""
        clear = self.space.clearance_m
        centre = (clear[:-1, :-1] + clear[:-1, 1:] + clear[1:, :-1] + clear[1:, 1:]) / 4
        free = (centre >= radius_m - 1e-6) & (self.blocked == 0)
        labels, _ = ndimage.label(free, structure=np.ones((3, 3)))
        reached = np.zeros(1 + int(labels.max()), dtype=bool)
        for n, (x, y) in enumerate(self.map.world_to_pixel(starts_m)):
            label = _label_near(labels, x, y, 0.15 / self.map.resolution_m + 1)
            if label == 0:
                place = f"({starts_m[n][0]:g}, {starts_m[n][1]:g}) m"
                why = self.space.why_not(starts_m[n]) or "too close to an obstacle"
                raise UsageError(f"robots[{n}]: the robot cannot stand at its start, {place}: it is {why}")
            reached[label] = True
        return np.asarray(reached[labels])

    def _coverable(self, range_m: float) -> NDArray[np.bool_]:
        """Free pixels that a LiDAR sees from some place that a robot reaches."""
        seen = np.zeros(self.blocked.shape, dtype=np.bool_)
        range_px = range_m / self.map.resolution_m
        table = ray_table(_LOOKS)[np.arange(_LOOKS) * _APART % _LOOKS]  # all around first, then in between
        _mark_coverable(self.blocked, np.ascontiguousarray(self.drivable), table, range_px, seen)
        return seen

    def extent_m(self, cell_m: float) -> tuple[float, float, float, float]:
        """Return two opposite corners of the areas that cover the building's floor, m: its size, which is known."""
        zero = self.map.world_to_pixel((0.0, 0.0))
        side = cell_m / self.map.resolution_m
        lines = []
        for axis in (0, 1):
            taken = np.flatnonzero(self.coverable.any(axis=axis))
            lines.append(grid_lines(float(taken[0]), float(taken[-1] + 1), float(zero[axis]), side))
        corners = [(float(lines[0][n]), float(lines[1][n])) for n in (0, -1)]
        (x0, y0), (x1, y1) = self.map.pixel_to_world(corners)
        return float(x0), float(y0), float(x1), float(y1)

    @property
    def coverable_m2(self) -> float:
        """Area that counts as coverable, m^2."""
        return float(self.coverable.sum()) * self.map.resolution_m**2

    def codes(self) -> NDArray[np.uint8]:
        """Return the truth as a trace holds it: 0, 1, 2 as in the map, plus 4 where coverable."""
        return self.map.cells + np.uint8(4) * self.coverable.astype(np.uint8)


def _label_near(labels: NDArray[np.int32], x: float, y: float, reach_px: float) -> int:
    """Return the label of the nearest labelled pixel within reach of a point, 0 without any."""
    rows, cols = np.nonzero(labels)
    if rows.size == 0:
        return 0
    distance = np.hypot(cols + 0.5 - x, rows + 0.5 - y)
    nearest = int(np.argmin(distance))
    return int(labels[rows[nearest], cols[nearest]]) if distance[nearest] <= reach_px else 0


@kernel
def _mark_coverable(
    blocked: NDArray[np.uint8],
    drivable: NDArray[np.bool_],
    table: NDArray[np.float64],
    range_px: float,
    seen: NDArray[np.bool_],
) -> None:
    for r in range(blocked.shape[0]):
        for c in range(blocked.shape[1]):
            if blocked[r, c] == 0:
                seen[r, c] = drivable[r, c] or sees_any_px(blocked, drivable, c + 0.5, r + 0.5, table, range_px)


@kernel
def footprint_free(
    blocked: NDArray[np.uint8], x: float, y: float, cos_yaw: float, sin_yaw: float, half_l: float, half_w: float
) -> bool:
    """Tell whether a rectangle overlaps no blocked pixel and lies on the map, exactly.

    Parameters
    ----------
    blocked
        ``(rows, cols)`` non-zero where blocked.
    x, y, cos_yaw, sin_yaw
        Pose, pixel coordinates.
    half_l, half_w
        Half its length and width, pixels.
    """
    rows, cols = blocked.shape
    reach_x = half_l * abs(cos_yaw) + half_w * abs(sin_yaw)
    reach_y = half_l * abs(sin_yaw) + half_w * abs(cos_yaw)
    c0, c1 = int(np.floor(x - reach_x)), int(np.floor(x + reach_x))
    r0, r1 = int(np.floor(y - reach_y)), int(np.floor(y + reach_y))
    if c0 < 0 or r0 < 0 or c1 >= cols or r1 >= rows:
        return False
    half_pixel = 0.5 * (abs(cos_yaw) + abs(sin_yaw))
    for r in range(r0, r1 + 1):
        for c in range(c0, c1 + 1):
            if blocked[r, c] == 0:
                continue
            dx, dy = c + 0.5 - x, r + 0.5 - y
            along, across = dx * cos_yaw + dy * sin_yaw, dy * cos_yaw - dx * sin_yaw
            if (
                abs(along) < half_l + half_pixel
                and abs(across) < half_w + half_pixel
                and abs(dx) < reach_x + 0.5
                and abs(dy) < reach_y + 0.5
            ):
                return False
    return True
