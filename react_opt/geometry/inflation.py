"""Where a robot of some size may stand: clearances, inflated maps, and why a point is out of reach."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, hypot, isfinite
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from react_opt.errors import UsageError
from react_opt.geometry.occupancy import FREE, MAX_PIXELS, OCCUPIED, UNKNOWN, FloatArray, OccupancyMap
from react_opt.geometry.sight import point_free_px, segment_free_px
from react_opt.kernels import kernel

UnknownSpace = Literal["blocked", "free", "costlier"]
"""How unknown pixels count: as walls, as free space, or as free space where the robot drives more slowly."""

Rule = Literal["strict", "centres"]
"""Which pixels are free: see :func:`inflate`."""

_ROUNDING = 1e-9  # of a pixel; a clearance that equals the radius but for rounding is enough


@dataclass(frozen=True)
class Footprint:
    """A robot's outline as a disc around its turning centre.

    Parameters
    ----------
    radius_m
        Radius of the disc, m; 0 is a point.
    """

    radius_m: float

    def __post_init__(self) -> None:
        if not (isfinite(self.radius_m) and self.radius_m >= 0):
            raise UsageError(f"a footprint's radius is a number of metres >= 0, not {self.radius_m}")

    @classmethod
    def circumscribed(cls, length_m: float, width_m: float) -> Footprint:
        """Return the smallest disc that holds a rectangle: safe at every heading."""
        return cls(hypot(length_m, width_m) / 2)

    @classmethod
    def inscribed(cls, length_m: float, width_m: float) -> Footprint:
        """Return the largest disc inside a rectangle: what must be free at whatever heading."""
        return cls(min(length_m, width_m) / 2)


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """The points where a footprint's centre may be, as an inflated pixel map (made by :func:`inflate`).

    By the strict rule a pixel is free when *every* point of it is at least the footprint's radius away from
    everything that blocks, so a path through free pixels is free of collision without any tolerance. The pixels
    may be finer than the map's (``refine``), since that cover costs up to one pixel at each wall.

    Parameters
    ----------
    source
        The occupancy map.
    footprint
        The footprint it is inflated by.
    unknown
        How unknown pixels count.
    unknown_speed_factor
        Share of the speed that is left in unknown pixels, in (0, 1]; 1 unless ``unknown`` is ``costlier``.
    rule
        Which pixels are free.
    refine
        Pixels here per pixel of the map, along one side.
    padded
        ``(rows + 2, cols + 2)`` uint8, 1 where blocked, with one blocked ring around the map.
    clearance_m
        ``(rows + 1, cols + 1)`` float32: exact distance from every pixel *corner* to what blocks, m; the map's
        diagonal everywhere when nothing blocks.
    slow
        ``(rows, cols)`` uint8, 1 in the unknown pixels that slow the robot down.
    """

    source: OccupancyMap
    footprint: Footprint
    unknown: UnknownSpace
    unknown_speed_factor: float
    rule: Rule
    refine: int
    padded: NDArray[np.uint8]
    clearance_m: NDArray[np.float32]
    slow: NDArray[np.uint8]

    @property
    def resolution_m(self) -> float:
        """Side of one pixel here, m."""
        return self.source.resolution_m / self.refine

    @property
    def blocked(self) -> NDArray[np.uint8]:
        """``(rows, cols)`` 1 where the footprint's centre may not be."""
        return self.padded[1:-1, 1:-1]

    @cached_property
    def regions(self) -> NDArray[np.int32]:
        """``(rows, cols)`` number of the connected region of each free pixel, from 1; 0 where blocked.

        Two points are reachable from each other exactly when they lie in the same region: pixels connect
        through their sides, never through a corner alone.
        """
        labels, _ = ndimage.label(self.blocked == 0)
        return np.asarray(labels, dtype=np.int32)

    def to_pixels(self, points_m: ArrayLike) -> FloatArray:
        """Return ``(..., 2)`` pixel coordinates (column, row) here of world points, m."""
        return self.source.world_to_pixel(points_m) * self.refine

    def to_world(self, pixels: ArrayLike) -> FloatArray:
        """Return the ``(..., 2)`` world points, m, of pixel coordinates (column, row) here."""
        return self.source.pixel_to_world(np.asarray(pixels, dtype=np.float64) / self.refine)

    def points_free(self, points_m: ArrayLike) -> NDArray[np.bool_]:
        """Tell for ``(n, 2)`` world points, m, whether the footprint may stand there."""
        return _points_free(self.padded, _rows_of_two(self.to_pixels(points_m)))

    def segment_free(self, start_m: ArrayLike, end_m: ArrayLike) -> bool:
        """Tell whether the footprint may be driven straight from one world point to another, exactly."""
        (x0, y0), (x1, y1) = self.to_pixels(start_m), self.to_pixels(end_m)
        return bool(segment_free_px(self.padded, x0, y0, x1, y1))

    def path_free(self, points_m: ArrayLike) -> bool:
        """Tell whether the footprint may be driven along ``(k, 2)`` way points, m (one point: may stand there)."""
        return bool(_path_free(self.padded, _rows_of_two(self.to_pixels(points_m))))

    def clearance_at(self, points_m: ArrayLike) -> FloatArray:
        """Return the distance from ``(n, 2)`` world points to what blocks, m, 0 off the map.

        Exact at pixel corners and interpolated bilinearly between them (exact along straight walls).
        """
        return _clearances(self.clearance_m, _rows_of_two(self.to_pixels(points_m)))

    def regions_at(self, points_m: ArrayLike) -> NDArray[np.int32]:
        """Return the region (see :attr:`regions`) of ``(n, 2)`` world points, 0 where not free."""
        return _regions_at(self.padded, self.regions, _rows_of_two(self.to_pixels(points_m)))

    def why_not(self, point_m: ArrayLike) -> str | None:
        """Return why the footprint may not stand at a world point, None where it may."""
        if bool(self.points_free(point_m)[0]):
            return None
        x, y = self.source.world_to_pixel(point_m)
        if not (0 <= x <= self.source.cols and 0 <= y <= self.source.rows):
            corners = [(c, r) for c in (0, self.source.cols) for r in (0, self.source.rows)]
            placed = self.source.pixel_to_world(corners).round(3)
            (left, bottom), (right, top) = placed.min(axis=0), placed.max(axis=0)
            return f"off the map, which lies between ({left:g}, {bottom:g}) and ({right:g}, {top:g}) m"
        value = self.source.values_at(point_m)
        if value == OCCUPIED:
            return "inside an obstacle"
        if value == UNKNOWN and self.unknown == "blocked":
            return "in unknown space, which counts as blocked"
        clearance = self._distance_to_blocked(x, y)
        return f"{clearance:.3f} m from an obstacle, less than the footprint's {self.footprint.radius_m:.3f} m"

    def _distance_to_blocked(self, x: float, y: float) -> float:
        """Return the exact distance, m, from (column, row) on the source map to what blocks."""
        cells = self.source.cells
        rows, cols = np.nonzero(cells != FREE if self.unknown == "blocked" else cells == OCCUPIED)
        dx = np.maximum(np.maximum(cols - x, x - cols - 1), 0)
        dy = np.maximum(np.maximum(rows - y, y - rows - 1), 0)
        nearest = float(np.hypot(dx, dy).min(initial=np.inf))
        if self.unknown == "blocked":
            nearest = min(nearest, x, self.source.cols - x, y, self.source.rows - y)
        return nearest * self.source.resolution_m

    def nearest_free_point(self, point_m: ArrayLike, region: int | None = None) -> FloatArray | None:
        """Return the nearest point where the footprint may stand; the point itself where it may.

        Parameters
        ----------
        point_m
            A world point, m, on the map or off it.
        region
            If given, only points of this region (see :attr:`regions`) count.

        Returns
        -------
        FloatArray | None
            ``(2,)`` world point, m: the centre of the free pixel whose centre is nearest; None without any.
        """
        if bool(self.points_free(point_m)[0]) and region in (None, int(self.regions_at(point_m)[0])):
            return np.asarray(point_m, dtype=np.float64)
        rows, cols = np.nonzero(self.blocked == 0 if region is None else self.regions == region)
        if rows.size == 0:
            return None
        centres = np.stack((cols, rows), axis=1) + 0.5
        nearest = int(np.argmin(np.sum((centres - self.to_pixels(point_m)) ** 2, axis=1)))
        return self.to_world(centres[nearest])


def inflate(
    source: OccupancyMap,
    footprint: Footprint,
    *,
    unknown: UnknownSpace = "blocked",
    unknown_speed_factor: float = 0.5,
    rule: Rule = "strict",
    refine: int | None = None,
) -> FreeSpace:
    """Inflate a map by a footprint.

    Parameters
    ----------
    source
        The occupancy map. What lies off it is unknown and counts like unknown pixels do (paths never leave
        the map in any case).
    footprint
        The robot's disc.
    unknown
        Unknown pixels are ``blocked``, ``free``, or ``costlier``: free, at a share of the speed.
    unknown_speed_factor
        That share, in (0, 1].
    rule
        ``strict``: a pixel is free when every point of it keeps the radius from every blocked pixel's square.
        ``centres``: when its centre keeps the radius from every blocked pixel's centre, as ROS costmaps have
        it; this opens passages up to a pixel narrower than the footprint, and the footprint may cut into a
        blocked pixel by up to 1.2 pixels.
    refine
        Pixels per pixel of the map along one side, 1 to 8. By default 1 for ``centres``; for ``strict`` as many
        as bring a pixel below a quarter of the radius, at most 4 and only while the refined map stays below
        16 million pixels.

    Raises
    ------
    UsageError
        Where an option is not one of those above.

    Notes
    -----
    The distance between two pixels of a grid is the distance between two of their corners, and the corner of
    a pixel nearest to a blocked pixel is nearest to one of *its* corners. So one Euclidean distance transform
    over the grid's corners gives exact clearances, and the smallest of a pixel's four corners is exactly the
    smallest clearance of all its points.
    """
    if unknown not in ("blocked", "free", "costlier"):
        raise UsageError(f"unknown space is blocked, free or costlier, not {unknown!r}")
    if not 0 < unknown_speed_factor <= 1:
        raise UsageError(f"the speed factor of unknown space lies in (0, 1], not {unknown_speed_factor}")
    if rule not in ("strict", "centres"):
        raise UsageError(f"the rule of inflation is strict or centres, not {rule!r}")
    if refine is None:
        refine = _default_refinement(source, footprint) if rule == "strict" else 1
    if not 1 <= refine <= 8:
        raise UsageError(f"refine is 1 to 8, not {refine}")
    if source.cells.size * refine**2 > MAX_PIXELS:
        raise UsageError(f"a map of {source.cells.size} pixels refined {refine} times is too large")
    cells = np.repeat(np.repeat(source.cells, refine, axis=0), refine, axis=1) if refine > 1 else source.cells
    solid = cells != FREE if unknown == "blocked" else cells == OCCUPIED
    pixel_m = source.resolution_m / refine
    outside = unknown == "blocked"
    clearance = _corner_clearance(solid, outside) * pixel_m
    if rule == "strict":
        nearest = np.minimum(clearance[:-1], clearance[1:])
        nearest = np.minimum(nearest[:, :-1], nearest[:, 1:])
    else:
        nearest = _distances(np.pad(solid, 1, constant_values=outside))[1:-1, 1:-1] * pixel_m
    padded = np.ones((cells.shape[0] + 2, cells.shape[1] + 2), dtype=np.uint8)
    padded[1:-1, 1:-1] = (nearest < footprint.radius_m - _ROUNDING * pixel_m) | solid
    slow = np.asarray((cells == UNKNOWN) & (unknown == "costlier"), dtype=np.uint8)
    factor = unknown_speed_factor if unknown == "costlier" else 1.0
    return FreeSpace(source, footprint, unknown, factor, rule, refine, padded, clearance.astype(np.float32), slow)


def _default_refinement(source: OccupancyMap, footprint: Footprint) -> int:
    """Return how finely the inflated map covers: see :func:`inflate`."""
    if footprint.radius_m == 0:
        return 1  # nothing is inflated, so finer pixels say nothing new
    wanted = min(4, ceil(4 * source.resolution_m / footprint.radius_m - _ROUNDING))
    while wanted > 1 and source.cells.size * wanted**2 > 16_000_000:
        wanted -= 1
    return wanted


def _corner_clearance(solid: NDArray[np.bool_], outside: bool) -> FloatArray:
    """Return ``(rows + 1, cols + 1)`` distances from pixel corners to solid pixels, in pixels.

    ``outside`` tells whether everything off the map is solid, too.
    """
    around = np.pad(solid, 1, constant_values=outside)
    touches = around[:-1, :-1] | around[:-1, 1:] | around[1:, :-1] | around[1:, 1:]
    return _distances(touches)


def _distances(marked: NDArray[np.bool_]) -> FloatArray:
    """Return the distance of every element to the nearest marked one; the diagonal without any (finite)."""
    if not marked.any():
        return np.full(marked.shape, float(np.hypot(*marked.shape)))
    return np.asarray(ndimage.distance_transform_edt(~marked), dtype=np.float64)


def _rows_of_two(pixels: FloatArray) -> FloatArray:
    """Return points as a contiguous ``(n, 2)`` array, as the kernels take them."""
    return np.ascontiguousarray(pixels.reshape(-1, 2))


@kernel
def _points_free(padded: NDArray[np.uint8], pixels: FloatArray) -> NDArray[np.bool_]:
    free = np.empty(pixels.shape[0], dtype=np.bool_)
    for n in range(pixels.shape[0]):
        free[n] = point_free_px(padded, pixels[n, 0], pixels[n, 1])
    return free


@kernel
def _path_free(padded: NDArray[np.uint8], pixels: FloatArray) -> bool:
    if pixels.shape[0] == 0:
        return False
    for n in range(pixels.shape[0]):
        m = max(n - 1, 0)
        if not segment_free_px(padded, pixels[m, 0], pixels[m, 1], pixels[n, 0], pixels[n, 1]):
            return False
    return True


@kernel
def clearance_px(clearance_m: NDArray[np.float32], x: float, y: float) -> float:
    """Return the clearance at pixel coordinates inside the map, m, bilinearly between the pixel's corners."""
    c = min(int(x), clearance_m.shape[1] - 2)
    r = min(int(y), clearance_m.shape[0] - 2)
    u, v = x - c, y - r
    low = (1.0 - u) * clearance_m[r, c] + u * clearance_m[r, c + 1]
    high = (1.0 - u) * clearance_m[r + 1, c] + u * clearance_m[r + 1, c + 1]
    return float((1.0 - v) * low + v * high)


@kernel
def _clearances(clearance_m: NDArray[np.float32], pixels: FloatArray) -> FloatArray:
    result = np.zeros(pixels.shape[0])
    for n in range(pixels.shape[0]):
        x, y = pixels[n, 0], pixels[n, 1]
        if 0.0 <= x <= clearance_m.shape[1] - 1 and 0.0 <= y <= clearance_m.shape[0] - 1:
            result[n] = clearance_px(clearance_m, x, y)
    return result


@kernel
def _regions_at(padded: NDArray[np.uint8], regions: NDArray[np.int32], pixels: FloatArray) -> NDArray[np.int32]:
    result = np.zeros(pixels.shape[0], dtype=np.int32)
    for n in range(pixels.shape[0]):
        x, y = pixels[n, 0], pixels[n, 1]
        if not point_free_px(padded, x, y):
            continue
        for shift in range(9):  # on a rim, the pixel beside it may be the free one
            c = int(np.floor(x + (shift % 3 - 1) * 2e-6 * (shift > 0)))
            r = int(np.floor(y + (shift // 3 - 1) * 2e-6 * (shift > 0)))
            if 0 <= c < regions.shape[1] and 0 <= r < regions.shape[0] and regions[r, c] > 0:
                result[n] = regions[r, c]
                break
    return result
