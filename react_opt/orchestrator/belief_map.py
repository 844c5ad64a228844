"""The merged map of a belief, kept ready for planning: each pixel that changes touches only what is near it.

Pixels are observed free, observed occupied, unknown, or unknown but occupied on the prior map (a sketch says so).
The later observation wins. Planning works on *blocks* of pixels of about 0.1 m:

- the clearance of each block's centre: the exact distance to the nearest occupied pixel, up to a cap;
- *deep* blocks: unknown ones in a 2 x 2 square of wholly unknown blocks. The rays of a LiDAR diverge, so single
  pixels stay unseen between them; they are no unknown region, and a missing pixel in a wall's face is no way in;
- for each robot radius, how many deep blocks a disc on the block's centre touches: where there are none, and the
  clearance suffices, the robot can stand in known-free space.

What lies where is counted in pixels of one fixed *frame* (it may have negative rows and columns); the canvas is the
part held in memory and grows.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, hypot

import numpy as np
from numpy.typing import ArrayLike, NDArray

from react_opt.geometry.occupancy import FREE, OCCUPIED, UNKNOWN, FloatArray, OccupancyMap
from react_opt.kernels import kernel

PRIOR_OCCUPIED = 3
BLOCK_M = 0.1
ROOM_M = 1.0

Cells = NDArray[np.uint8]
IntArray = NDArray[np.int64]


class BeliefMap:
    """The merged occupancy map and its planning layers.

    Parameters
    ----------
    frame
        Any map in the frame: its origin and resolution count, not its cells.
    window
        First and one past the last row, then columns, of the canvas, in the frame's pixels.
    radii_m
        Radii of the robots' discs, m.
    cap_m
        Clearances are exact up to this, m.
    prior
        A sketch of the building, at whatever resolution, or None.
    """

    def __init__(
        self,
        frame: OccupancyMap,
        window: tuple[int, int, int, int],
        radii_m: tuple[float, ...],
        cap_m: float,
        prior: OccupancyMap | None = None,
    ) -> None:
        self.frame = frame
        self.k = max(1, round(BLOCK_M / frame.resolution_m))
        self.cap_px = cap_m / frame.resolution_m
        self.radii_m = radii_m
        self._discs = tuple(_disc(radius / frame.resolution_m, self.k) for radius in radii_m)
        self._prior = prior
        self.version = 0
        self._observed_px = 0
        self._lay(window)

    def _lay(self, window: tuple[int, int, int, int]) -> None:
        """Make an empty canvas, with the prior map on it."""
        k = self.k
        low_row, low_col = (window[0] // k) * k, (window[2] // k) * k
        shape = (ceil((window[1] - low_row) / k) * k, ceil((window[3] - low_col) / k) * k)
        self.row0, self.col0 = low_row, low_col
        self.cells: Cells = np.full(shape, UNKNOWN, dtype=np.uint8)
        blocks = (shape[0] // k, shape[1] // k)
        self.known = np.zeros(blocks, dtype=np.int16)
        self.solid = np.zeros(blocks, dtype=np.int16)
        self.clear = np.full(blocks, self.cap_px, dtype=np.float32)
        self.deep = np.ones(blocks, dtype=np.bool_)
        self.near = tuple(np.zeros(blocks, dtype=np.int16) for _ in self.radii_m)
        for near, disc in zip(self.near, self._discs, strict=True):
            _count_all(near, disc)
        self.touched = np.zeros(blocks, dtype=np.bool_)
        """Blocks whose unknown or free state changed since somebody cleared this."""
        self.bound([np.array((0, blocks[0], 0, blocks[1]))])
        if self._prior is not None:
            rows, cols = np.indices(shape).reshape(2, -1)
            centres = np.stack((cols, rows), axis=1) + 0.5
            said = self._prior.values_at(self.to_world(centres)) == OCCUPIED
            rows, cols = rows[said] + low_row, cols[said] + low_col
            self._apply(rows, cols, np.full(len(rows), PRIOR_OCCUPIED, dtype=np.uint8))

    def bound(self, windows: Sequence[IntArray]) -> None:
        """Say where the areas are: first and one past the last row, then columns, of their blocks."""
        self.inside = np.zeros(self.known.shape, dtype=np.bool_)
        """Blocks of the areas: beyond them unknown space is not taken to be free."""
        for r0, r1, c0, c1 in windows:
            self.inside[r0:r1, c0:c1] = True
        pixels = np.repeat(np.repeat(self.inside, self.k, axis=0), self.k, axis=1)
        self._at_most: Cells = np.where(pixels, UNKNOWN, OCCUPIED).astype(np.uint8)
        """What a pixel counts as where nothing has been observed: a cell shows the lesser of this and what it holds."""

    @property
    def window(self) -> tuple[int, int, int, int]:
        """First and one past the last row, then columns, of the canvas in the frame's pixels."""
        rows, cols = self.cells.shape
        return self.row0, self.row0 + rows, self.col0, self.col0 + cols

    def merge(self, rows: ArrayLike, cols: ArrayLike, values: ArrayLike) -> int:
        """Merge observed pixels (0 free, 1 occupied) of the frame, in the order given; return how many changed.

        The canvas grows where they lie beyond it.
        """
        r, c = np.asarray(rows, dtype=np.int64), np.asarray(cols, dtype=np.int64)
        if r.size == 0:
            return 0
        low_row, high_row, low_col, high_col = self.window
        if r.min() < low_row or r.max() >= high_row or c.min() < low_col or c.max() >= high_col:
            self.cover(int(r.min()), int(r.max()) + 1, int(c.min()), int(c.max()) + 1)
        changed = self._apply(r, c, np.asarray(values, dtype=np.uint8))
        if changed:
            self.version += 1
        return changed

    def _apply(self, rows: IntArray, cols: IntArray, values: Cells) -> int:
        r, c = rows - self.row0, cols - self.col0
        flipped, count, changed, freed = _merge(
            self.cells, self.known, self.solid, self.clear, self.deep, self.touched, self.k, self.cap_px, r, c, values
        )
        for near, disc in zip(self.near, self._discs, strict=True):
            _uncount(near, disc, flipped[:count])
        if freed[0] <= freed[1]:
            _reclear(self.cells, self.clear, self.k, self.cap_px, freed)
        return int(changed)

    def cover(self, low_row: int, high_row: int, low_col: int, high_col: int) -> None:
        """Grow the canvas, where need be, to hold a window of the frame and some room around it."""
        window = self.window
        if window[0] <= low_row and high_row <= window[1] and window[2] <= low_col and high_col <= window[3]:
            return
        room = ceil(ROOM_M / self.frame.resolution_m)
        before, row0, col0 = self.cells, self.row0, self.col0
        self._lay(
            (
                min(window[0], low_row - room),
                max(window[1], high_row + room),
                min(window[2], low_col - room),
                max(window[3], high_col + room),
            )
        )
        self.version += 1
        rows, cols = np.nonzero(before <= OCCUPIED)
        self._apply(rows + row0, cols + col0, before[rows, cols])
        self.touched[:] = True

    def merged(self) -> OccupancyMap:
        """Return the map as observed; what lies beyond the areas and has not been seen counts as occupied."""
        x, y = self.frame.pixel_to_world((self.col0, self.row0))
        seen = np.minimum(self.cells, self._at_most)
        return OccupancyMap(seen, self.frame.resolution_m, float(x), float(y), self.frame.origin_yaw_rad)

    def to_canvas(self, points_m: ArrayLike) -> FloatArray:
        """Return canvas pixel coordinates (column, row) of world points."""
        return self.frame.world_to_pixel(points_m) - (self.col0, self.row0)

    def to_world(self, pixels: ArrayLike) -> FloatArray:
        """Return world points of canvas pixel coordinates (column, row)."""
        return self.frame.pixel_to_world(np.asarray(pixels, dtype=np.float64) + np.array((self.col0, self.row0)))

    def centres_m(self, blocks: ArrayLike) -> FloatArray:
        """Return ``(n, 2)`` world points of the centres of blocks, given by their numbers row by row."""
        rows, cols = np.divmod(np.asarray(blocks, dtype=np.int64), self.clear.shape[1])
        return self.to_world((np.stack((cols, rows), axis=-1) + 0.5) * self.k)

    def passable(self, layer: int, optimistic: bool) -> NDArray[np.bool_]:
        """Return the blocks on whose centre the disc of a layer's radius may stand."""
        least_px = self.radii_m[layer] / self.frame.resolution_m - 1e-6
        return _passable(self.clear, self.near[layer], self.inside, np.float32(least_px), optimistic)


def _disc(radius_px: float, k: int) -> IntArray:
    """Return offsets (rows, columns) of the blocks whose square a disc on a block's centre touches."""
    reach = int(radius_px / k) + 1
    offsets = [
        (r, c)
        for r in range(-reach, reach + 1)
        for c in range(-reach, reach + 1)
        if hypot(max(abs(r) * k - k / 2, 0), max(abs(c) * k - k / 2, 0)) < radius_px
    ]
    return np.array(offsets, dtype=np.int64)


@kernel
def clear_at(clear: NDArray[np.float32], pixels: FloatArray, k: int, resolution_m: float) -> FloatArray:
    """Return the clearances (m) of the blocks that ``(n, 2)`` canvas pixels (column, row) lie in or are nearest to."""
    out = np.empty(pixels.shape[0])
    for n in range(pixels.shape[0]):
        c = int(min(max(pixels[n, 0] // k, 0.0), clear.shape[1] - 1.0))
        r = int(min(max(pixels[n, 1] // k, 0.0), clear.shape[0] - 1.0))
        out[n] = clear[r, c] * np.float32(resolution_m)
    return out


@kernel
def _passable(
    clear: NDArray[np.float32], near: NDArray[np.int16], inside: NDArray[np.bool_], least: np.float32, optimistic: bool
) -> NDArray[np.bool_]:
    """Return where a disc may stand: enough clearance, and nothing unknown around, or what is not taken to be free."""
    rows, cols = clear.shape
    out = np.empty((rows, cols), dtype=np.bool_)
    for r in range(rows):
        for c in range(cols):
            out[r, c] = clear[r, c] >= least and (near[r, c] == 0 or (optimistic and inside[r, c]))
    return out


@kernel
def _count_all(near: NDArray[np.int16], disc: IntArray) -> None:
    """Count the blocks within a disc when all are deep."""
    for r in range(near.shape[0]):
        for c in range(near.shape[1]):
            for n in range(disc.shape[0]):
                u, v = r + disc[n, 0], c + disc[n, 1]
                if 0 <= u < near.shape[0] and 0 <= v < near.shape[1]:
                    near[r, c] += 1


@kernel
def _uncount(near: NDArray[np.int16], disc: IntArray, flipped: IntArray) -> None:
    """Take blocks that are no longer deep from the counts around them."""
    rows, cols = near.shape
    for m in range(flipped.shape[0]):
        r, c = flipped[m] // cols, flipped[m] % cols
        for n in range(disc.shape[0]):
            u, v = r + disc[n, 0], c + disc[n, 1]
            if 0 <= u < rows and 0 <= v < cols:
                near[u, v] -= 1


@kernel
def _blank(known: NDArray[np.int16], solid: NDArray[np.int16], r: int, c: int) -> bool:
    return bool(known[r, c] == 0 and solid[r, c] == 0)


@kernel
def _is_deep(known: NDArray[np.int16], solid: NDArray[np.int16], r: int, c: int) -> bool:
    """Tell whether a block lies in a 2 x 2 square of blank blocks."""
    rows, cols = known.shape
    for top in (r - 1, r):
        for left in (c - 1, c):
            if top < 0 or left < 0 or top + 1 >= rows or left + 1 >= cols:
                continue
            if (
                _blank(known, solid, top, left)
                and _blank(known, solid, top, left + 1)
                and _blank(known, solid, top + 1, left)
                and _blank(known, solid, top + 1, left + 1)
            ):
                return True
    return False


@kernel
def _stamp(clear: NDArray[np.float32], k: int, cap_px: float, row: int, col: int) -> None:
    """Lower the clearances around one occupied pixel."""
    rows, cols = clear.shape
    reach = int(cap_px / k) + 1
    r, c = row // k, col // k
    for u in range(max(0, r - reach), min(rows, r + reach + 1)):
        y = (u + 0.5) * k
        dy = max(row - y, y - row - 1, 0.0)
        for v in range(max(0, c - reach), min(cols, c + reach + 1)):
            x = (v + 0.5) * k
            dx = max(col - x, x - col - 1, 0.0)
            distance = np.sqrt(dx * dx + dy * dy)
            if distance < clear[u, v]:
                clear[u, v] = distance


@kernel
def _merge(
    cells: Cells,
    known: NDArray[np.int16],
    solid: NDArray[np.int16],
    clear: NDArray[np.float32],
    deep: NDArray[np.bool_],
    touched: NDArray[np.bool_],
    k: int,
    cap_px: float,
    pixel_rows: IntArray,
    pixel_cols: IntArray,
    values: Cells,
) -> tuple[IntArray, int, int, IntArray]:
    """Write pixels; return blocks no longer deep and their number, pixels changed, and the box of pixels freed."""
    rows, cols = known.shape
    flipped = np.empty(9 * pixel_rows.shape[0], dtype=np.int64)
    count, changed = 0, 0
    freed = np.array([cells.shape[0], -1, cells.shape[1], -1], dtype=np.int64)
    for n in range(pixel_rows.shape[0]):
        r, c, value = pixel_rows[n], pixel_cols[n], values[n]
        old = cells[r, c]
        if old == value or (value == PRIOR_OCCUPIED and old != UNKNOWN):
            continue
        cells[r, c] = value
        changed += 1
        u, v = r // k, c // k
        blank = _blank(known, solid, u, v)
        if old >= UNKNOWN and value <= OCCUPIED:
            known[u, v] += 1
        was, now = old in (OCCUPIED, PRIOR_OCCUPIED), value != FREE
        if now and not was:
            solid[u, v] += 1
            _stamp(clear, k, cap_px, r, c)
        elif was and not now:
            solid[u, v] -= 1
            freed[0], freed[1] = min(freed[0], r), max(freed[1], r)
            freed[2], freed[3] = min(freed[2], c), max(freed[3], c)
        touched[u, v] = True
        if not blank:
            continue
        for p in range(max(0, u - 1), min(rows, u + 2)):
            for q in range(max(0, v - 1), min(cols, v + 2)):
                if deep[p, q] and not _is_deep(known, solid, p, q):
                    deep[p, q] = False
                    touched[p, q] = True
                    flipped[count] = p * cols + q
                    count += 1
    return flipped, count, changed, freed


@kernel
def _reclear(cells: Cells, clear: NDArray[np.float32], k: int, cap_px: float, box: IntArray) -> None:
    """Work out the clearances anew around a box of pixels that are not occupied any more."""
    reach = int(cap_px) + 2 * k
    rows, cols = clear.shape
    r0, r1 = max(0, (box[0] - reach) // k), min(rows, (box[1] + reach) // k + 1)
    c0, c1 = max(0, (box[2] - reach) // k), min(cols, (box[3] + reach) // k + 1)
    for u in range(r0, r1):
        for v in range(c0, c1):
            clear[u, v] = cap_px
    for r in range(max(0, r0 * k - reach), min(cells.shape[0], r1 * k + reach)):
        for c in range(max(0, c0 * k - reach), min(cells.shape[1], c1 * k + reach)):
            if cells[r, c] == OCCUPIED or cells[r, c] == PRIOR_OCCUPIED:
                _stamp(clear, k, cap_px, r, c)
