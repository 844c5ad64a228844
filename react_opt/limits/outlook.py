"""What a planner that knows the whole map works with: places and what each sees, standing points, ways between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from react_opt.energy import RobotProfile
from react_opt.geometry.inflation import Footprint, FreeSpace, inflate
from react_opt.geometry.occupancy import UNKNOWN
from react_opt.geometry.raycast import ray_table, scan_px
from react_opt.kernels import kernel
from react_opt.limits.legs import Lattice, all_legs, edge_views, edges, graph_of, place_at
from react_opt.limits.ride import Ground, turn_loss_s
from react_opt.paths.motion import terrain
from react_opt.sim.world import World

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Bits = NDArray[np.uint64]

SPACING_M = 0.6
"""Between the points that ways lead over."""
APART_M = 1.1
"""Between the points that are visited."""
PLACE_M = 0.2
"""Side of the squares in which a scan counts as one from the middle."""
EDGE_M = 3.0
MOST_POINTS = 3000
MOST_VISITED = 550
MOST_PLACES = 30_000
SAMPLES = 6000
"""About so many of the coverable pixels are counted in the search; the simulator counts all. With few of them the last
percent is overfitted: of what the sample leaves open the simulator then misses more."""


@dataclass(frozen=True, eq=False)
class Outlook:
    """Standing points and what is known of them. Lengths are grid metres: along the map's own axes from its corner.

    Parameters
    ----------
    space
        Where the robots may stand.
    ground
        What slows them down.
    lattice
        Places all over the floor, and the sampled pixels that a scan from each shows, as bits.
    points_m
        ``(p, 2)`` points that ways lead over.
    chosen
        ``(n,)`` those of them that may be visited; the last ones are the robots' starts.
    time_s, out_rad, into_rad
        ``(n, n)`` times of the fastest ways between those found, and their headings at both ends.
    seen
        ``(n (n + 1) / 2, words)`` what is seen on the way between i <= j, at ``j (j + 1) / 2 + i``.
    before, tail
        ``(n, p)`` the edge on which the way from a chosen point to a point ends, and the point that each edge leaves.
    loss_s
        What bends cost (:func:`react_opt.limits.ride.turn_loss_s`).
    samples
        How many pixels are sampled.
    """

    space: FreeSpace
    ground: Ground
    lattice: Lattice
    points_m: FloatArray
    chosen: IntArray
    time_s: FloatArray
    out_rad: FloatArray
    into_rad: FloatArray
    seen: Bits
    before: NDArray[np.int32]
    tail: IntArray
    loss_s: FloatArray
    samples: int

    def way(self, i: int, j: int) -> FloatArray:
        """Return the ``(k, 2)`` points on the way from one chosen point to another one, both included."""
        source, goal = (j, i) if j >= i else (i, j)
        k = int(self.chosen[goal])
        found = [k]
        while k != self.chosen[source]:
            k = int(self.tail[self.before[source, k]])
            found.append(k)
        return self.points_m[found if j >= i else found[::-1]]

    def pixels(self, points_m: FloatArray) -> FloatArray:
        """Return grid metres as pixel coordinates of :attr:`space`."""
        return np.ascontiguousarray(points_m / self.space.resolution_m)


def look_out(world: World, profile: RobotProfile, starts_m: FloatArray) -> Outlook:
    """Look around a building.

    Parameters
    ----------
    world
        The truth.
    profile
        The robot (of a mixed fleet, one that is nowhere better than the others).
    starts_m
        ``(r, 2)`` start points, world coordinates, m.
    """
    space = inflate(world.map, Footprint(profile.radius_m))
    unit = world.map.resolution_m
    starts = world.map.world_to_pixel(starts_m) * unit
    regions = np.unique(space.regions_at(starts_m))
    reachable = np.isin(space.regions, regions[regions > 0])
    area_m2 = reachable.sum() * space.resolution_m**2
    lattice, samples = _places(world, space, profile, reachable, area_m2)
    points = np.concatenate((_standing_points(space, profile, reachable, area_m2), _nooks(world, space, profile)))
    points = np.concatenate((points, starts))
    own = np.zeros((len(points), lattice[2].shape[1]), dtype=np.uint64)
    for n, (u, v) in enumerate(points):
        place = place_at(lattice, u, v)
        if place >= 0:
            own[n] = lattice[2][place]
    one, two, seconds = edges(
        space.padded, terrain(space, profile), np.ascontiguousarray(points / space.resolution_m),
        EDGE_M / space.resolution_m,
    )  # fmt: skip
    chosen = _chosen(points, own, len(starts), one, two)
    views = edge_views(points, one, two, lattice)
    graph, tail = graph_of(points, one, two, seconds)
    n = len(chosen)
    before = np.full((n, len(points)), -1, dtype=np.int32)
    time, out, into = np.full((n, n), np.inf), np.zeros((n, n)), np.zeros((n, n))
    seen = np.zeros((n * (n + 1) // 2, own.shape[1]), dtype=np.uint64)
    loss = turn_loss_s(profile)
    all_legs(graph, views, own, chosen, tail, loss, before, time, out, into, seen)
    ground = (world.space.clearance_m, unit)
    return Outlook(space, ground, lattice, points, chosen, time, out, into, seen, before, tail, loss, samples)


def _coarser(side: float, area_m2: float, most: int) -> float:
    """Return a side of squares that is no smaller, and so large that no more than so many fill an area."""
    return float(max(side, np.sqrt(area_m2 / most)))


def _places(
    world: World, space: FreeSpace, profile: RobotProfile, reachable: NDArray[np.bool_], area_m2: float
) -> tuple[Lattice, int]:
    """Return a free place in every square that has one, and what a scan from there shows."""
    side_m = _coarser(PLACE_M, area_m2, MOST_PLACES)
    rows, cols = np.nonzero(reachable)
    side = side_m / space.resolution_m
    high, wide = int(np.ceil(reachable.shape[0] / side)), int(np.ceil(reachable.shape[1] / side))
    square = ((rows + 0.5) // side).astype(np.int64) * wide + ((cols + 0.5) // side).astype(np.int64)
    off = np.hypot((rows + 0.5) % side - side / 2, (cols + 0.5) % side - side / 2)
    order = np.lexsort((off, square))
    found, first = np.unique(square[order], return_index=True)
    best = order[first]
    number = np.full(high * wide, -1, dtype=np.int32)
    number[found] = np.arange(len(found))
    where = np.stack((cols[best], rows[best]), axis=1) + 0.5
    pixel = np.flatnonzero(world.coverable.ravel())
    stride = max(1, len(pixel) // SAMPLES)
    whole = len(pixel) // stride * stride
    pick = np.arange(0, whole, stride) + np.random.default_rng(0).integers(stride, size=whole // stride)
    sampled = np.full(world.coverable.size, -1, dtype=np.int64)
    sampled[pixel[pick]] = np.arange(len(pick))
    sees = np.zeros((len(where), -(-len(pick) // 64)), dtype=np.uint64)
    table, reach = ray_table(profile.lidar_rays), profile.lidar_range_m / world.map.resolution_m
    _scan_all(world.map.cells, np.ascontiguousarray(where / space.refine), table, reach, sampled, sees)
    return (number.reshape(high, wide), side_m, sees), len(pick)


def _standing_points(
    space: FreeSpace, profile: RobotProfile, reachable: NDArray[np.bool_], area_m2: float
) -> FloatArray:
    """Return the easiest place to drive of every square of the map that the robots reach, grid metres."""
    corners = space.clearance_m
    clear = np.minimum((corners[:-1, :-1] + corners[1:, 1:]) / 2, profile.full_speed_clearance_m)
    rows, cols = np.nonzero(reachable)
    side = _coarser(SPACING_M, area_m2, MOST_POINTS) / space.resolution_m
    square = (rows // side).astype(np.int64) * (space.blocked.shape[1] + 1) + (cols // side).astype(np.int64)
    off = np.hypot((rows + 0.5) % side - side / 2, (cols + 0.5) % side - side / 2)
    order = np.lexsort((off, -np.round(clear[rows, cols], 2), square))
    _, first = np.unique(square[order], return_index=True)
    best = order[first]
    return np.asarray((np.stack((cols[best], rows[best]), axis=1) + 0.5) * space.resolution_m, dtype=np.float64)


def _nooks(world: World, space: FreeSpace, profile: RobotProfile) -> FloatArray:
    """Return the places nearest to the walls, a spacing apart, where robots fit: what is hidden shows from there."""
    clear = space.clearance_m
    tight = np.maximum(np.maximum(clear[:-1, :-1], clear[:-1, 1:]), np.maximum(clear[1:, :-1], clear[1:, 1:]))
    fine = np.kron(world.drivable, np.ones((space.refine, space.refine), dtype=np.bool_))
    rows, cols = np.nonzero((space.blocked == 0) & fine & (tight < profile.radius_m + 1.5 * space.resolution_m))
    side = _coarser(SPACING_M, len(rows) * space.resolution_m**2, MOST_POINTS // 3) / space.resolution_m
    square = (rows // side).astype(np.int64) * (space.blocked.shape[1] + 1) + (cols // side).astype(np.int64)
    _, first = np.unique(square, return_index=True)
    return np.asarray((np.stack((cols[first], rows[first]), axis=1) + 0.5) * space.resolution_m, dtype=np.float64)


def _chosen(points: FloatArray, own: Bits, starts: int, one: IntArray, two: IntArray) -> IntArray:
    """Return the points to visit: those that see most, none in plain view within a spacing of another; the starts last.

    What none of them sees is added for, point by point.
    """
    many = len(points) - starts
    sizes = np.bitwise_count(own).sum(axis=1).astype(np.int64)
    near = np.hypot(*(points[one] - points[two]).T) < APART_M
    close: list[list[int]] = [[] for _ in points]
    for i, j in zip(one[near].tolist(), two[near].tolist(), strict=True):
        close[i].append(j)
        close[j].append(i)
    taken = np.zeros(len(points), dtype=np.bool_)
    picked: list[int] = []
    for k in np.argsort(-sizes[:many], kind="stable"):
        if not taken[k] and len(picked) < MOST_VISITED * 4 // 5:
            picked.append(int(k))
            taken[k] = True
            taken[close[k]] = True
    known = np.bitwise_or.reduce(own[picked + list(range(many, len(points)))], axis=0)
    while len(picked) < MOST_VISITED:
        gain = np.bitwise_count(own[:many] & ~known).sum(axis=1)
        best = int(np.argmax(gain))
        if gain[best] == 0:
            break
        picked.append(best)
        known |= own[best]
    return np.array(sorted(picked) + list(range(many, len(points))), dtype=np.int64)


@kernel
def _scan_all(
    truth: NDArray[np.uint8], pixels: FloatArray, table: FloatArray, reach: float, number: IntArray, sees: Bits
) -> None:
    known, found = np.full(truth.shape, UNKNOWN, dtype=np.uint8), np.empty(truth.size, dtype=np.int64)
    flat = known.reshape(-1)
    for n in range(pixels.shape[0]):
        count = scan_px(truth, known, pixels[n, 0], pixels[n, 1], 1.0, 0.0, table, reach, found)
        for k in range(count):
            flat[found[k]] = UNKNOWN
            at = number[found[k]]
            if at >= 0:
                sees[n, at >> 6] |= np.uint64(1) << np.uint64(at & 63)
