"""What a planner that knows the whole map works with: standing points, driving times between them, what each sees."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from react_opt.energy import RobotProfile
from react_opt.geometry.inflation import Footprint, FreeSpace, inflate
from react_opt.geometry.occupancy import UNKNOWN
from react_opt.geometry.raycast import ray_table, scan_px
from react_opt.geometry.sight import segment_free_px
from react_opt.kernels import kernel
from react_opt.paths.motion import Field, segment_px, terrain
from react_opt.sim.world import World

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SPACING_M = 0.6
EDGE_M = 2.0
MOST_POINTS = 4000
SAMPLES = 3000
"""About so many of the coverable pixels are counted in the search; the simulator counts all."""


@dataclass(frozen=True, eq=False)
class Outlook:
    """Standing points and what is known of them; the last ones are the robots' starts.

    Parameters
    ----------
    space
        Where the robots may stand.
    points_m
        ``(n, 2)`` standing points, m.
    time_s, before
        ``(n, n)`` driving times, s, and the point before the last on the way (-9999: none).
    sees
        ``(n, words)`` uint64 bits: the sampled pixels that a scan from there shows.
    samples
        How many pixels are sampled.
    """

    space: FreeSpace
    points_m: FloatArray
    time_s: FloatArray
    before: NDArray[np.int32]
    sees: NDArray[np.uint64]
    samples: int


def look_out(world: World, profile: RobotProfile, starts_m: FloatArray) -> Outlook:
    """Return standing points about every :data:`SPACING_M`, with the robots' starts at the end.

    Parameters
    ----------
    world
        The truth.
    profile
        The robot (of a mixed fleet, one that is nowhere better than the others).
    starts_m
        ``(r, 2)`` start points, m.
    """
    space = inflate(world.map, Footprint(profile.radius_m))
    points = np.concatenate((_standing_points(space, profile, starts_m), _nooks(world, space, profile), starts_m))
    pixels = np.ascontiguousarray(space.to_pixels(points))
    one, two, seconds = _edges(space.padded, terrain(space, profile), pixels, EDGE_M / space.resolution_m)
    graph = coo_matrix((seconds, (one, two)), shape=(len(points), len(points))).tocsr()
    time_s, before = dijkstra(graph, directed=False, return_predecessors=True)
    unit = world.map.resolution_m
    pixel = np.flatnonzero(world.coverable.ravel())
    pixel = pixel[:: max(1, len(pixel) // SAMPLES)]
    number = np.full(world.coverable.size, -1, dtype=np.int64)
    number[pixel] = np.arange(len(pixel))
    sees = np.zeros((len(points), -(-len(pixel) // 64)), dtype=np.uint64)
    table, reach = ray_table(profile.lidar_rays), profile.lidar_range_m / unit
    _scan_all(world.map.cells, np.ascontiguousarray(world.map.world_to_pixel(points)), table, reach, number, sees)
    return Outlook(space, points, time_s, before.astype(np.int32), sees, len(pixel))


def _standing_points(space: FreeSpace, profile: RobotProfile, starts_m: FloatArray) -> FloatArray:
    """Return the easiest place to drive of every square of the map that the robots reach."""
    regions = np.unique(space.regions_at(starts_m))
    reachable = np.isin(space.regions, regions[regions > 0])
    corners = space.clearance_m
    clear = np.minimum((corners[:-1, :-1] + corners[1:, 1:]) / 2, profile.full_speed_clearance_m)
    rows, cols = np.nonzero(reachable)
    side = (
        SPACING_M
        / space.resolution_m
        * max(1.0, np.sqrt(len(rows) * (space.resolution_m / SPACING_M) ** 2 / MOST_POINTS))
    )
    square = (rows // side).astype(np.int64) * (space.blocked.shape[1] + 1) + (cols // side).astype(np.int64)
    off = np.hypot((rows + 0.5) % side - side / 2, (cols + 0.5) % side - side / 2)
    order = np.lexsort((off, -np.round(clear[rows, cols], 2), square))
    _, first = np.unique(square[order], return_index=True)
    best = order[first]
    return space.to_world(np.stack((cols[best], rows[best]), axis=1) + 0.5)


def _nooks(world: World, space: FreeSpace, profile: RobotProfile) -> FloatArray:
    """Return the places nearest to the walls, a spacing apart, where robots fit: what is hidden shows from there."""
    clear = space.clearance_m
    tight = np.maximum(np.maximum(clear[:-1, :-1], clear[:-1, 1:]), np.maximum(clear[1:, :-1], clear[1:, 1:]))
    side = SPACING_M / space.resolution_m
    fine = np.kron(world.drivable, np.ones((space.refine, space.refine), dtype=np.bool_))
    rows, cols = np.nonzero((space.blocked == 0) & fine & (tight < profile.radius_m + 1.5 * space.resolution_m))
    square = (rows // side).astype(np.int64) * (space.blocked.shape[1] + 1) + (cols // side).astype(np.int64)
    _, first = np.unique(square, return_index=True)
    return space.to_world(np.stack((cols[first], rows[first]), axis=1) + 0.5)


@kernel
def _edges(
    padded: NDArray[np.uint8], field: Field, pixels: FloatArray, far: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the pairs of points that a robot can drive straight between, and how long it takes, s."""
    one, two, seconds = [0 for _ in range(0)], [0 for _ in range(0)], [0.0 for _ in range(0)]
    for i in range(pixels.shape[0]):
        for j in range(i + 1, pixels.shape[0]):
            x0, y0, x1, y1 = pixels[i, 0], pixels[i, 1], pixels[j, 0], pixels[j, 1]
            if abs(x1 - x0) > far or abs(y1 - y0) > far or hypot(x1 - x0, y1 - y0) > far:
                continue
            if segment_free_px(padded, x0, y0, x1, y1):
                one.append(i)
                two.append(j)
                seconds.append(segment_px(field, x0, y0, x1, y1) + 1e-6)
    return np.array(one), np.array(two), np.array(seconds)


@kernel
def _scan_all(
    truth: NDArray[np.uint8], pixels: FloatArray, table: FloatArray, reach: float, number: IntArray,
    sees: NDArray[np.uint64],
) -> None:  # fmt: skip
    known, found = np.full(truth.shape, UNKNOWN, dtype=np.uint8), np.empty(truth.size, dtype=np.int64)
    flat = known.reshape(-1)
    for n in range(pixels.shape[0]):
        count = scan_px(truth, known, pixels[n, 0], pixels[n, 1], 1.0, 0.0, table, reach, found)
        for k in range(count):
            flat[found[k]] = UNKNOWN
            at = number[found[k]]
            if at >= 0:
                sees[n, at >> 6] |= np.uint64(1) << np.uint64(at & 63)
