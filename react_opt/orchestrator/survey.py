"""What a belief's map says about driving and seeing, on blocks of pixels: fast enough to ask at every decision.

A *block* is a square of pixels, about 0.25 m wide. A robot can drive in it where it holds a pixel at which nothing
known blocks the footprint. Blocks are coarse for estimates only: the way that is driven comes from
:meth:`react_opt.orchestrator.belief.Belief.path`, pixel by pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.orchestrator.survey_kernels import block_sums, drive_times, stamp_clearance, view_gain

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BLOCK_M = 0.25
UNKNOWN_SLOWER = 1.15
"""Ways through unknown space are rarely straight: their time is taken to be so much longer."""


@dataclass(frozen=True, eq=False)
class Cluster:
    """A piece of the border between known-free and unknown space.

    Parameters
    ----------
    blocks
        ``(k, 2)`` rows and columns of its blocks.
    x_m, y_m
        Centre of the block nearest to their mean, m.
    length_m
        Length of the border, m.
    """

    blocks: IntArray
    x_m: float
    y_m: float
    length_m: float


class Survey:
    """Clearances, frontiers, drive times and views on a belief's map, kept up to date from map to map.

    Parameters
    ----------
    profiles
        Of the robots: the widest footprint decides where any of them drives.
    """

    def __init__(self, profiles: list[RobotProfile]) -> None:
        self.radius_m = max(profile.radius_m for profile in profiles)
        self.profile = min(profiles, key=lambda profile: profile.speed_max_m_s)
        self._cells: NDArray[np.uint8] | None = None
        self._frame: tuple[float, ...] = ()
        self.version = -1

    def update(self, source: OccupancyMap, version: int) -> None:
        """Take over a map; only what became occupied since the last one costs time."""
        if version == self.version:
            return
        self.version = version
        cells = source.cells
        frame = (
            source.resolution_m,
            source.origin_x_m,
            source.origin_y_m,
            float(cells.shape[0]),
            float(cells.shape[1]),
        )
        self.map = source
        res = source.resolution_m
        self.block_px = max(1, round(BLOCK_M / res))
        self.block_m = self.block_px * res
        reach_px = max(self.radius_m, self.profile.full_speed_clearance_m) / res
        occupied = cells == 1
        if frame != self._frame or self._cells is None or bool(((self._cells == 1) & ~occupied).any()):
            self._frame = frame
            self._square = np.full(cells.shape, np.iinfo(np.int32).max, dtype=np.int32)
            new = np.argwhere(occupied)
        else:
            new = np.argwhere(occupied & (self._cells != 1))
        self._cells = cells.copy()
        stamp_clearance(self._square, new, int(np.ceil(reach_px)))
        contact = (self.radius_m / res) ** 2
        self.known, self.may, clear_px, self.unknown, self.border, self.pixel = block_sums(
            cells, self._square, contact, self.block_px
        )
        speed = self.profile.speed_m_s(np.minimum(clear_px, reach_px) * res, self.radius_m)
        self.slowness = np.where(self.known, 1.0, UNKNOWN_SLOWER) * self.block_m / speed

    def block_of(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Return row and column of the block that a point lies in, the nearest one of the map."""
        x, y = self.map.world_to_pixel((x_m, y_m))
        rows, cols = self.known.shape
        return (
            int(np.clip(y // self.block_px, 0, rows - 1)),
            int(np.clip(x // self.block_px, 0, cols - 1)),
        )

    def point_of(self, block: tuple[int, int]) -> tuple[float, float]:
        """Return where in a block a robot has most clearance, m; its centre where it can nowhere drive."""
        row, col = block
        at = int(self.pixel[row, col])
        if at >= 0:
            x, y = at % self.map.cols + 0.5, at // self.map.cols + 0.5
        else:
            x, y = (col + 0.5) * self.block_px, (row + 0.5) * self.block_px
        point = self.map.pixel_to_world((x, y))
        return float(point[0]), float(point[1])

    def times_from(self, x_m: float, y_m: float, *, optimistic: bool) -> FloatArray:
        """Return ``(rows, cols)`` s to drive from a point to every block, infinite where there is no way.

        Over known-free blocks only, unless ``optimistic``. A point that lies in no such block starts from the
        nearest one.
        """
        passable = self.may if optimistic else self.known
        row, col = self.block_of(x_m, y_m)
        if not passable[row, col]:
            rows, cols = np.nonzero(passable)
            if len(rows) == 0:
                return np.full(passable.shape, np.inf)
            nearest = int(np.argmin((rows - row) ** 2 + (cols - col) ** 2))
            row, col = int(rows[nearest]), int(cols[nearest])
        return drive_times(passable, self.slowness, row, col)

    def clusters(self, shortest_m: float, widest_m: float = np.inf) -> list[Cluster]:
        """Return the connected pieces of the frontier, those shorter than a length left out.

        Parameters
        ----------
        shortest_m
            Pieces with a shorter border are noise.
        widest_m
            Larger pieces are cut in two across their longer side until they are not.
        """
        labels, count = ndimage.label(self.border > 0, structure=np.ones((3, 3)))
        if count == 0:
            return []
        at = np.argwhere(labels > 0)
        of = labels[at[:, 0], at[:, 1]]
        order = np.argsort(of, kind="stable")
        pieces = np.split(at[order], np.flatnonzero(np.diff(of[order])) + 1)
        result = []
        while pieces:
            piece = pieces.pop(0)
            extent = np.ptp(piece, axis=0)
            axis = int(np.argmax(extent))
            if extent[axis] * self.block_m > widest_m:
                low = piece[:, axis] <= piece[:, axis].min() + extent[axis] // 2
                pieces[:0] = [piece[low], piece[~low]]
                continue
            length_m = float(self.border[piece[:, 0], piece[:, 1]].sum()) * self.map.resolution_m
            if length_m < shortest_m:
                continue
            middle = piece[np.argmin(((piece - piece.mean(axis=0)) ** 2).sum(axis=1))]
            x, y = self.map.pixel_to_world(((middle[1] + 0.5) * self.block_px, (middle[0] + 0.5) * self.block_px))
            result.append(Cluster(piece, float(x), float(y), length_m))
        return result

    def gain_m2(self, x_m: float, y_m: float, range_m: float, mean_free_m: float, rays: int = 120) -> float:
        """Return the unknown area (m^2) that a scan from a point is expected to reveal.

        Rays end at occupied pixels and at the range. Nobody knows what stands in unknown space: a ray is taken to
        meet something there after ``mean_free_m`` on average, so what lies deep in it counts for less.
        """
        x, y = self.map.world_to_pixel((x_m, y_m))
        res = self.map.resolution_m
        return float(view_gain(self.map.cells, float(x), float(y), range_m / res, mean_free_m / res, rays)) * res * res
