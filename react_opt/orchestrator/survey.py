"""What a belief's map says about driving and seeing, on blocks of pixels: fast enough to ask at every decision.

*Blocks* of 0.1 m say what is open, solid or hidden and how much clearance there is; *coarse blocks* of 0.2 m carry
drive times. Both are for estimates and choices: the way that is driven comes from
:meth:`react_opt.orchestrator.belief.Belief.path`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import OCCUPIED, OccupancyMap
from react_opt.orchestrator.survey_drives import Ground, drive_times, ground_of, nearest_passable, way_is_free
from react_opt.orchestrator.survey_kernels import (
    coarse_blocks,
    count_solids,
    cut,
    newly_solid,
    stamp_clearance,
    survey_blocks,
    view_gain,
)

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Block = tuple[int, int]
"""Row and column of a coarse block."""

BLOCK_M = 0.1
COARSE = 2
NEAR_BLOCKS, CLOSED_IN_BLOCKS = 10, 50
"""A drive starts from the nearest coarse block within the first reach; if none leads anywhere, within the second."""
SLACK_M = 0.1
"""A way counts as blocked where something known comes so much nearer than contact: blocks are not exact."""


@dataclass(frozen=True, eq=False)
class Cluster:
    """A piece of the frontier, where open blocks border hidden ones.

    Parameters
    ----------
    blocks
        ``(k, 2)`` rows and columns of its coarse blocks.
    x_m, y_m
        Centre of the one nearest to their mean, m.
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
        Of the robots: the widest footprint and the slowest speed count.
    hidden_slower
        Ways through hidden space are rarely straight, if there are any: their time is taken to be so much longer.
    """

    def __init__(self, profiles: Sequence[RobotProfile], hidden_slower: float = 1.15) -> None:
        self.hidden_slower = hidden_slower
        self.radius_m = max(profile.radius_m for profile in profiles)
        self.profile = min(profiles, key=lambda profile: profile.speed_max_m_s)
        self.version = -1
        self._cells: NDArray[np.uint8] = np.zeros((0, 0), dtype=np.uint8)
        self._frame: tuple[float, ...] = ()

    def update(self, source: OccupancyMap, version: int) -> None:
        """Take over a map."""
        if version == self.version:
            return
        self.version, self.map = version, source
        res = source.resolution_m
        self.k = max(1, round(BLOCK_M / res))
        self.block_m = self.k * res
        self.coarse_m = COARSE * self.block_m
        reach_px = max(self.radius_m, self.profile.full_speed_clearance_m) / res
        self.blocks = survey_blocks(source.cells, self.k)
        self.solids = count_solids(self.blocks)
        frame = (res, source.origin_x_m, source.origin_y_m, *map(float, source.cells.shape))
        new, kept = newly_solid(self._cells, source.cells) if frame == self._frame else (None, False)
        if new is None or not kept:
            self._clear_px = np.full(self.blocks.shape, reach_px)
            new = np.argwhere(source.cells == OCCUPIED)
        self._frame, self._cells = frame, source.cells.copy()
        stamp_clearance(self._clear_px, new, self.k, reach_px)
        self.known, self.may, clear_px, self.border, self.hidden, self.best = coarse_blocks(
            self.blocks, self._clear_px, self.radius_m / res - 1e-6, COARSE
        )
        parts, _ = ndimage.label(self.may)  # through sides: drives do not squeeze through corners
        sizes = np.bincount(parts.ravel())
        sizes[0] = 0
        self.main = parts == np.argmax(sizes) if sizes.any() else self.may  # apart from islands among obstacles
        speed = self.profile.speed_m_s(clear_px * res, self.radius_m)
        self._grounds: dict[bool, Ground] = {}  # of this map, by whether unknown space counts as free
        self.slowness = np.where(self.known, 1.0, self.hidden_slower) * self.coarse_m / speed

    # --- places ---

    def to_blocks(self, points_m: ArrayLike) -> FloatArray:
        """Return block coordinates (column, row) of world points, not rounded."""
        return self.map.world_to_pixel(points_m) / self.k

    def block_of(self, x_m: float, y_m: float) -> Block:
        """Return the coarse block that a point lies in, the nearest one of the map."""
        x, y = (self.to_blocks((x_m, y_m)) / COARSE).tolist()
        rows, cols = self.known.shape
        return int(min(max(y, 0), rows - 1)), int(min(max(x, 0), cols - 1))

    def point_of(self, block: Block) -> tuple[float, float]:
        """Return where in a coarse block a robot has most clearance, m; its centre where it cannot stand there."""
        at = int(self.best[block])
        if at >= 0:
            col, row = at % self.blocks.shape[1] + 0.5, at // self.blocks.shape[1] + 0.5
        else:
            col, row = (block[1] + 0.5) * COARSE, (block[0] + 0.5) * COARSE
        point = self.map.pixel_to_world((col * self.k, row * self.k))
        return float(point[0]), float(point[1])

    def nearest_block(self, block: Block, passable: NDArray[np.bool_], reach: int) -> Block | None:
        """Return the passable coarse block nearest to one, within a number of rows and columns, None for none."""
        row, col = nearest_passable(passable, block[0], block[1], reach)
        return (row, col) if row >= 0 else None

    # --- driving ---

    def times_from(self, x_m: float, y_m: float, *, optimistic: bool) -> FloatArray:
        """Return ``(rows, cols)`` s to drive from a point to every coarse block, infinite where there is no way.

        Over known-free blocks only, unless ``optimistic``. A point that lies in no such block starts from the
        nearest one.
        """
        return self.times_from_nearest([(x_m, y_m)], optimistic=optimistic)

    def times_from_nearest(self, points_m: Sequence[tuple[float, float]], *, optimistic: bool) -> FloatArray:
        """Return ``(rows, cols)`` s to every coarse block from the point from where it takes least."""
        blocks = [self._start(self.block_of(*point), optimistic) for point in points_m]
        starts = np.array([block for block in blocks if block is not None], dtype=np.int64).reshape(-1, 2)
        if optimistic not in self._grounds:
            self._grounds[optimistic] = ground_of(self.may if optimistic else self.known, self.slowness)
        return np.asarray(drive_times(self._grounds[optimistic], starts))

    def _start(self, block: Block, optimistic: bool) -> Block | None:
        """Return the coarse block that a drive starts from, further away where a robot is closed in."""
        start = self.nearest_block(block, self.main if optimistic else self.known, NEAR_BLOCKS)
        return self.nearest_block(block, self.main, CLOSED_IN_BLOCKS) if start is None and optimistic else start

    def is_free(self, way_m: ArrayLike) -> bool:
        """Tell whether nothing known blocks a way of ``(n, 2)`` points, m."""
        way = self.to_blocks(way_m)
        return bool(way_is_free(self._clear_px, way, (self.radius_m - SLACK_M) / self.map.resolution_m))

    def clearance_m(self) -> FloatArray:
        """Return the distance from the centre of each block to what is known to be solid, m, up to a few radii."""
        return np.asarray(self._clear_px * self.map.resolution_m)

    # --- seeing ---

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
        at = np.argwhere(labels > 0)
        of = labels[at[:, 0], at[:, 1]]
        at = at[np.argsort(of, kind="stable")]
        begin = np.concatenate(([0], np.cumsum(np.bincount(of, minlength=count + 1)[1:])))
        first, last, middle, length = cut(at, begin, self.border, shortest_m, widest_m, self.block_m, self.coarse_m)
        places = self.map.pixel_to_world((at[middle][:, ::-1] + 0.5) * (COARSE * self.k))
        return [
            Cluster(at[low:high], x, y, blocks * self.block_m)
            for low, high, (x, y), blocks in zip(
                first.tolist(), last.tolist(), places.tolist(), length.tolist(), strict=True
            )
        ]

    def gain_m2(self, x_m: float, y_m: float, range_m: float, mean_free_m: float, rays: int = 120) -> float:
        """Return the hidden area (m^2) that a scan from a point is expected to reveal.

        Rays end at solid blocks and at the range. Nobody knows what stands in hidden space: a ray is taken to meet
        something there after ``mean_free_m`` on average, so what lies deep in it counts for less.
        """
        x, y = self.to_blocks((x_m, y_m))
        size = self.block_m
        gain = view_gain(self.blocks, float(x), float(y), range_m / size, mean_free_m / size, rays)
        return float(gain) * size * size
