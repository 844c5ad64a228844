"""The high-level grid over a map: square areas g[a,b], where a robot can stand in each, and windows of a map.

Areas are aligned with the map's own axes, so a map with a rotated origin has the same areas as the same map
without. ``a`` counts columns from the left and ``b`` rows from the bottom, from 0, on the map's own axes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from react_opt.errors import UsageError
from react_opt.geometry.inflation import FreeSpace
from react_opt.geometry.occupancy import FloatArray, OccupancyMap

MAX_AREAS = 100_000
Window = tuple[int, int, int, int]
"""First and one past the last row, then columns, in pixels of the inflated map."""


@dataclass(frozen=True, eq=False)
class AreaGrid:
    """Areas over one region of a map (made by :func:`lay_grid`).

    Parameters
    ----------
    space
        Where the robots may stand.
    reachable
        ``(rows, cols)`` True in the pixels of ``space`` that the robots reach.
    col_edges, row_edges
        Pixel coordinates of the grid lines, increasing; may lie off the map.
    """

    space: FreeSpace
    reachable: NDArray[np.bool_]
    col_edges: NDArray[np.int64]
    row_edges: NDArray[np.int64]

    @property
    def shape(self) -> tuple[int, int]:
        """Number of columns and rows of areas."""
        return len(self.col_edges) - 1, len(self.row_edges) - 1

    def window(self, a: int, b: int, to_a: int | None = None, to_b: int | None = None) -> Window:
        """Return the pixels of one area, or of all from it to another one further right or up."""
        rows, cols = self.reachable.shape
        low_row, high_row = np.clip(self.row_edges[[b, (b if to_b is None else to_b) + 1]], 0, rows)
        low_col, high_col = np.clip(self.col_edges[[a, (a if to_a is None else to_a) + 1]], 0, cols)
        return int(low_row), int(high_row), int(low_col), int(high_col)

    def area_of(self, point_m: FloatArray) -> tuple[int, int] | None:
        """Return the area ``(a, b)`` that a world point lies in, None where it lies in none."""
        x, y = self.space.to_pixels(point_m)
        a = int(np.searchsorted(self.col_edges, x, side="right")) - 1
        b = int(np.searchsorted(self.row_edges, y, side="right")) - 1
        columns, rows = self.shape
        return (a, b) if 0 <= a < columns and 0 <= b < rows else None

    def standing_point(self, a: int, b: int, easy_m: float, near_m: FloatArray | None = None) -> FloatArray | None:
        """Return where a robot stands in an area, None where it cannot.

        Of the largest connected part of the area that robots reach, the pixels with the best clearance count, up
        to ``easy_m``: more makes driving no easier. Of these the one nearest to the area's centre is taken, the
        centre itself where it is one of them. With ``near_m``, simply the reachable point nearest to that point.

        Parameters
        ----------
        a, b
            The area.
        easy_m
            Clearance at which driving is not slowed down, m.
        near_m
            World point to be near to instead, m.
        """
        low_row, high_row, low_col, high_col = self.window(a, b)
        inside = self.reachable[low_row:high_row, low_col:high_col]
        if not inside.any():
            return None
        if near_m is None:
            parts, _ = ndimage.label(inside)
            inside = parts == np.argmax(np.bincount(parts.ravel())[1:]) + 1
            at = self.space.clearance_m[low_row : high_row + 1, low_col : high_col + 1]
            clearance = np.minimum((at[:-1, :-1] + at[:-1, 1:] + at[1:, :-1] + at[1:, 1:]) / 4, easy_m)
            inside &= clearance >= clearance[inside].max() - 1e-6
            x, y = self.col_edges[[a, a + 1]].mean(), self.row_edges[[b, b + 1]].mean()
        else:
            x, y = self.space.to_pixels(near_m)
        row, col = floor(y) - low_row, floor(x) - low_col
        if 0 <= row < inside.shape[0] and 0 <= col < inside.shape[1] and inside[row, col]:
            wanted = self.space.to_world((x, y))
            if self.space.points_free(wanted)[0]:
                return wanted
        rows, cols = np.nonzero(inside)
        best = int(np.argmin((cols + low_col + 0.5 - x) ** 2 + (rows + low_row + 0.5 - y) ** 2))
        return self.space.to_world((cols[best] + low_col + 0.5, rows[best] + low_row + 0.5))

    def touches(self, a: int, b: int, to_a: int, to_b: int) -> bool:
        """Tell whether a robot can cross the border between an area and its right or upper neighbour."""
        low_row, high_row, low_col, high_col = self.window(a, b)
        rows, cols = self.reachable.shape
        if to_a > a:
            if not 0 < high_col < cols:
                return False
            return bool((self.reachable[low_row:high_row, high_col - 1 : high_col + 1]).all(axis=1).any())
        if not 0 < high_row < rows:
            return False
        return bool((self.reachable[high_row - 1 : high_row + 1, low_col:high_col]).all(axis=0).any())


def lay_grid(space: FreeSpace, region: int, cell_m: float) -> AreaGrid:
    """Lay areas over one connected region.

    The areas cover the floor that the footprint touches, with the fewest columns and rows. Where grid lines
    at multiples of ``cell_m`` in the map's frame do with so few, they are taken (so a building drawn from (0, 0)
    has areas from (0, 0)); else the grid is centred over the region. Lines are rounded to the map's pixels.

    Parameters
    ----------
    space
        Where the robots may stand.
    region
        Number of the region in ``space.regions``.
    cell_m
        Side of an area, m.

    Raises
    ------
    UsageError
        Where an area is smaller than a pixel, or there are more than :data:`MAX_AREAS`.
    """
    if cell_m < space.source.resolution_m:
        raise UsageError(f"a cell of {cell_m:g} m is smaller than the map's pixel, {space.source.resolution_m:g} m")
    reachable = space.regions == region
    origin = space.to_pixels((0.0, 0.0))
    reach = space.footprint.radius_m / space.resolution_m
    side = cell_m / space.resolution_m
    edges = []
    for axis, zero in ((0, origin[0]), (1, origin[1])):
        taken = np.flatnonzero(reachable.any(axis=axis))
        low, high = max(0.0, taken[0] - reach), min(reachable.shape[1 - axis], taken[-1] + 1 + reach)
        lines = grid_lines(float(low), float(high), float(zero), side) / space.refine
        edges.append(np.rint(lines).astype(np.int64) * space.refine)
    if (len(edges[0]) - 1) * (len(edges[1]) - 1) > MAX_AREAS:
        raise UsageError(f"cells of {cell_m:g} m make more than {MAX_AREAS} of them on this map")
    return AreaGrid(space, reachable, edges[0], edges[1])


def grid_lines(low: float, high: float, zero: float, side: float) -> FloatArray:
    """Return the fewest lines a ``side`` apart that enclose ``[low, high]``.

    Multiples of the side from ``zero`` where they do with so few, else centred.
    """
    slack = 1e-6 * side
    count = max(1, ceil((high - low - slack) / side))
    start = zero + floor((low - zero + slack) / side) * side
    if start + count * side < high - slack:
        start = (low + high - count * side) / 2
    return np.asarray(start + np.arange(min(count, MAX_AREAS) + 1) * side, dtype=np.float64)


def cut(space: FreeSpace, window: Window) -> FreeSpace:
    """Return a window of a map as a map of its own: outside it nobody drives, but clearances still see its walls.

    Parameters
    ----------
    space
        The whole map.
    window
        Its bounds are multiples of ``space.refine``.
    """
    low_row, high_row, low_col, high_col = window
    source, fine = space.source, space.refine
    x, y = source.pixel_to_world((low_col / fine, low_row / fine))
    cells = source.cells[low_row // fine : high_row // fine, low_col // fine : high_col // fine]
    inside = np.s_[low_row:high_row, low_col:high_col]
    corners = np.s_[low_row : high_row + 1, low_col : high_col + 1]
    return replace(
        space,
        source=OccupancyMap(cells, source.resolution_m, float(x), float(y), source.origin_yaw_rad),
        padded=np.pad(space.blocked[inside], 1, constant_values=1),
        clearance_m=np.ascontiguousarray(space.clearance_m[corners]),
        slow=np.ascontiguousarray(space.slow[inside]),
    )
