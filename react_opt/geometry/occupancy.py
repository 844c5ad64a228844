"""Occupancy maps: what is free, what is occupied and what nobody has seen yet, pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, isfinite, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

FREE = 0
OCCUPIED = 1
UNKNOWN = 2

MAX_PIXELS = 100_000_000
"""Largest map read or refined, in pixels; a bigger one is refused before memory is taken for it."""

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class OccupancyMap:
    """A grid of square pixels, each free, occupied or unknown, and where it lies in the world.

    Continuous pixel coordinates are ``(x, y) = (column, row)``: pixel ``cells[r, c]`` covers
    ``[c, c + 1] x [r, r + 1]``. The origin is the world pose of pixel coordinates ``(0, 0)``, the outer
    corner of ``cells[0, 0]``, and the yaw turns the grid's axes against the world's, as in ROS.

    Parameters
    ----------
    cells
        ``(rows, cols)`` uint8 of :data:`FREE`, :data:`OCCUPIED`, :data:`UNKNOWN`; row 0 has the smallest y.
        The array is made read-only.
    resolution_m
        Side of a pixel, m.
    origin_x_m, origin_y_m, origin_yaw_rad
        World pose of the outer corner of ``cells[0, 0]``, m and rad.

    Raises
    ------
    ValueError
        Where shape, values or numbers make no map.
    """

    cells: NDArray[np.uint8]
    resolution_m: float
    origin_x_m: float = 0.0
    origin_y_m: float = 0.0
    origin_yaw_rad: float = 0.0

    def __post_init__(self) -> None:
        cells = np.ascontiguousarray(self.cells, dtype=np.uint8)
        if cells.ndim != 2 or cells.size == 0:
            raise ValueError(f"a map has rows and columns, not the shape {cells.shape}")
        if int(cells.max()) > UNKNOWN:
            raise ValueError(f"a pixel is 0, 1 or 2, not {int(cells.max())}")
        if not (isfinite(self.resolution_m) and self.resolution_m > 0):
            raise ValueError(f"the resolution is a positive number of metres, not {self.resolution_m}")
        if not all(isfinite(v) for v in (self.origin_x_m, self.origin_y_m, self.origin_yaw_rad)):
            raise ValueError("the origin is finite")
        if cells is self.cells:
            cells = cells.view()
        cells.setflags(write=False)
        object.__setattr__(self, "cells", cells)

    @property
    def rows(self) -> int:
        """Number of pixel rows."""
        return int(self.cells.shape[0])

    @property
    def cols(self) -> int:
        """Number of pixel columns."""
        return int(self.cells.shape[1])

    def world_to_pixel(self, points_m: ArrayLike) -> FloatArray:
        """Return continuous pixel coordinates of world points.

        Parameters
        ----------
        points_m
            ``(..., 2)`` world points, m.

        Returns
        -------
        FloatArray
            ``(..., 2)`` of (column, row), not rounded; points off the map are not clipped.
        """
        points = np.asarray(points_m, dtype=np.float64)
        x, y = _columns(points)
        x, y = x - self.origin_x_m, y - self.origin_y_m
        c, s = cos(self.origin_yaw_rad), sin(self.origin_yaw_rad)
        return _joined((c * x + s * y) / self.resolution_m, (c * y - s * x) / self.resolution_m, points.shape)

    def pixel_to_world(self, pixels: ArrayLike) -> FloatArray:
        """Return the world points of continuous pixel coordinates: the inverse of :meth:`world_to_pixel`.

        Parameters
        ----------
        pixels
            ``(..., 2)`` of (column, row); the centre of ``cells[r, c]`` is ``(c + 0.5, r + 0.5)``.

        Returns
        -------
        FloatArray
            ``(..., 2)`` world points, m.
        """
        points = np.asarray(pixels, dtype=np.float64)
        x, y = _columns(points)
        x, y = x * self.resolution_m, y * self.resolution_m
        c, s = cos(self.origin_yaw_rad), sin(self.origin_yaw_rad)
        return _joined(self.origin_x_m + c * x - s * y, self.origin_y_m + s * x + c * y, points.shape)

    def values_at(self, points_m: ArrayLike) -> NDArray[np.uint8]:
        """Return what the map says at world points; a point off the map is :data:`UNKNOWN`.

        Parameters
        ----------
        points_m
            ``(..., 2)`` world points, m.
        """
        index = np.floor(self.world_to_pixel(points_m))
        inside = np.all((index >= 0) & (index < (self.cols, self.rows)), axis=-1)
        at = np.where(inside[..., None], index, 0).astype(np.int64)
        return np.where(inside, self.cells[at[..., 1], at[..., 0]], UNKNOWN).astype(np.uint8)


Coordinate = float | FloatArray


def _columns(points: FloatArray) -> tuple[Coordinate, Coordinate]:
    """Return the two coordinates of points; of a single one as plain numbers, which are far quicker to reckon with."""
    if points.ndim == 1:
        x, y = points.tolist()
        return x, y
    return points[..., 0], points[..., 1]


def _joined(x: Coordinate, y: Coordinate, shape: tuple[int, ...]) -> FloatArray:
    """Return points of a shape from their coordinates."""
    points = np.empty(shape)
    points[..., 0], points[..., 1] = x, y
    return points
