"""From where each part of a building can be seen, and when a robot can be there at the earliest.

Everything here errs on the safe side, so that what follows from it holds for every plan: a robot may stand wherever its
inscribed circle fits, drives as fast as the law of :mod:`react_opt.energy` allows at the best clearance in the tile
(and no slower than it can have braked to on its way in, since the simulator looks ahead no further), never turns and
gathers speed at its start alone (:func:`from_rest_s`); a tile is seen from a place when any point of it can be seen
from any point of that place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from react_opt.energy import RobotProfile
from react_opt.kernels import kernel
from react_opt.limits.reach import reach_s, tile_reach_s
from react_opt.limits.sightlines import Memory, memory, tiles_in_sight
from react_opt.sim.loop import TICK_S
from react_opt.sim.world import World

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

TILE_M = 0.1
"""Side of the tiles that places and targets are counted in, m; a whole number of the map's pixels, at least one."""

MOST_TILES = 250_000
GROUP_M = 0.3
BLOCK_M = 0.5
"""Side of the squares in which places are taken together where detours are counted, m."""
MOST_GROUPS = 8000


@dataclass(frozen=True, eq=False)
class Hidden:
    """A building and a fleet, as the bounds see them.

    Parameters
    ----------
    step_s
        ``(rows, cols)`` least time to drive one tile side in a tile, s; infinite where no robot fits.
    places
        ``(rows, cols)`` number of the tiles where a robot fits and can come, -1 elsewhere.
    weight
        ``(n,)`` coverable pixels in each tile that has any.
    earliest_s
        ``(robots, n)`` when a robot can be, at the earliest, where some point of the tile is visible, s.
    group
        ``(n,)`` group of neighbouring tiles that a tile belongs to.
    seen_from
        ``(groups, words)`` uint64 bits: the places from which any of a group's tiles is visible.
    """

    step_s: FloatArray
    places: IntArray
    weight: IntArray
    earliest_s: FloatArray
    group: IntArray
    seen_from: NDArray[np.uint64]
    starts_s: FloatArray
    """``(robots, places)`` least time from each robot's start, s."""
    tile_m: float
    """Side of a tile, m."""
    gather_s: float
    """What gathering speed at the start costs each robot at least, s (:func:`from_rest_s`)."""

    @property
    def total(self) -> int:
        """Coverable pixels."""
        return int(self.weight.sum())

    @property
    def group_weight(self) -> IntArray:
        """``(groups,)`` coverable pixels of each group."""
        return np.bincount(self.group, self.weight, len(self.seen_from)).astype(np.int64)

    def blocks(self) -> tuple[IntArray, int]:
        """Return ``(places,)`` the square of places that each one belongs to, and how many there are."""
        rows, cols = np.nonzero(self.places >= 0)
        side = max(1, round(BLOCK_M / self.tile_m))
        _, block = np.unique(rows // side * self.places.shape[1] + cols // side, return_inverse=True)
        return block.astype(np.int64), int(block.max()) + 1

    def group_earliest_s(self, robots: int) -> FloatArray:
        """Return ``(groups,)`` when any tile of a group can be seen by the first robots at the earliest, s."""
        earliest = np.full(len(self.seen_from), np.inf)
        np.minimum.at(earliest, self.group, self.earliest_s[:robots].min(axis=0))
        return earliest

    def place_reach_s(self, source: NDArray[np.bool_]) -> FloatArray:
        """Return the least time from a set of places to each place, s."""
        on_map = np.zeros(self.places.shape, dtype=np.bool_)
        at = self.places >= 0
        on_map[at] = source[self.places[at]]
        return tile_reach_s(reach_s(self.step_s, on_map))[at]


def survey(world: World, profiles: Sequence[RobotProfile], starts_m: FloatArray) -> Hidden:
    """Look at a building from everywhere.

    Parameters
    ----------
    world
        The truth.
    profiles
        One per robot; bounds hold for the best of all in every respect.
    starts_m
        ``(n, 2)`` start points, m.
    """
    unit = world.map.resolution_m
    side = max(1, round(TILE_M / unit), ceil(np.sqrt(world.blocked.size / MOST_TILES)))
    opaque = _tiles(world.blocked, side, np.min, 1)
    weight = _tiles(world.coverable, side, np.sum, 0).astype(np.int64)
    step = _steps(world, profiles, side)
    reached = []
    for x, y in world.map.world_to_pixel(starts_m):
        start = np.zeros(step.shape, dtype=np.bool_)
        start[int(y) // side, int(x) // side] = True
        step[start] = np.minimum(step[start], side * unit / max(p.speed_max_m_s for p in profiles))
        reached.append(tile_reach_s(reach_s(step, start)))
    best = np.min(reached, axis=0)
    at = np.isfinite(best)
    places = np.where(at, np.cumsum(at).reshape(at.shape) - 1, -1).astype(np.int64)
    step[~at] = np.inf
    rows, cols = np.nonzero(weight)
    grain = max(1, round(GROUP_M / (side * unit)), ceil(np.sqrt(len(rows) / MOST_GROUPS)))
    _, group = np.unique(rows // grain * weight.shape[1] + cols // grain, return_inverse=True)
    order = np.argsort(group, kind="stable")
    rows, cols, group = rows[order], cols[order], group[order].astype(np.int64)
    starts = np.array([field[at] for field in reached])
    seen_from = np.zeros((int(group[-1]) + 1 if len(group) else 0, -(-int(at.sum()) // 64)), dtype=np.uint64)
    earliest = np.full((len(starts), len(rows)), np.inf)
    reach = max(p.lidar_range_m for p in profiles) / (side * unit)
    gather = _gather_s(step, world.map.world_to_pixel(starts_m), side, unit, profiles)
    _look(np.ascontiguousarray(opaque), places, rows, cols, group, reach, memory(), starts, seen_from, earliest)
    return Hidden(step, places, weight[rows, cols], earliest, group, seen_from, starts, side * unit, gather)


def _tiles(pixels: NDArray[np.generic], side: int, of: object, beyond: int) -> NDArray[np.generic]:
    """Return a number per tile of ``side`` x ``side`` pixels."""
    rows, cols = pixels.shape
    padded = np.pad(pixels, ((0, -rows % side), (0, -cols % side)), constant_values=beyond)
    tiles = padded.reshape(padded.shape[0] // side, side, padded.shape[1] // side, side)
    return np.asarray(of(tiles, axis=(1, 3)))  # type: ignore[operator]


def _steps(world: World, profiles: Sequence[RobotProfile], side: int) -> FloatArray:
    """Return the least time to drive one tile side in each tile, s."""
    unit = world.map.resolution_m
    corners = world.space.clearance_m.astype(np.float64)
    best = np.maximum(np.maximum(corners[:-1, :-1], corners[:-1, 1:]), np.maximum(corners[1:, :-1], corners[1:, 1:]))
    best = np.asarray(_tiles(best, side, np.max, 0), dtype=np.float64)
    fits = best + np.sqrt(0.5) * unit >= min(min(p.length_m, p.width_m) for p in profiles) / 2
    speed = np.max([profile.speed_m_s(best + 1e-5) for profile in profiles], axis=0)
    squared = np.where(fits, speed**2, 0.0)
    accel = max(profile.accel_m_s2 for profile in profiles)
    fastest = max(profile.speed_max_m_s for profile in profiles)
    reach = ceil((fastest**2 / (2 * accel) + 2 * fastest * TICK_S) / (side * unit)) + 1
    rows, cols = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    apart = np.hypot(np.maximum(np.abs(rows) - 1, 0), np.maximum(np.abs(cols) - 1, 0)) * side * unit
    lost = 2 * accel * np.maximum(0.0, apart - 2 * fastest * TICK_S)
    squared = np.maximum(squared, ndimage.grey_dilation(squared, structure=-lost))
    slowest = min(profile.speed_min_m_s for profile in profiles)
    return np.where(fits, side * unit / np.sqrt(np.maximum(squared, slowest**2)), np.inf)


def from_rest_s(time_s: float, gather_s: float) -> float:
    """Return when a robot that starts from rest can have done what takes it a time at full speed, s, at the earliest.

    Its speed ``u`` seconds after the start is at most ``accel * (u + TICK_S)``: the simulator's robots gather speed at
    the beginning of a tick. With ``V`` the least of the greatest speeds allowed near the start, the time at full speed
    (the integral of speed over greatest speed) that it does by ``t`` is at most that of ``min(1, accel * u / V)`` up to
    ``t + TICK_S``: ``t + TICK_S - V / (2 accel)``, or ``accel * (t + TICK_S) ** 2 / (2 V)`` before ``V / accel``.

    Parameters
    ----------
    time_s
        A lower bound for robots that gather speed at once, s.
    gather_s
        ``V / (2 accel)``, s (:attr:`Hidden.gather_s`).
    """
    late = time_s + gather_s if time_s >= gather_s else 2 * sqrt(gather_s * time_s)
    return max(time_s, late - TICK_S)


def _gather_s(
    step: FloatArray, starts_px: FloatArray, side: int, unit: float, profiles: Sequence[RobotProfile]
) -> float:
    """Return :attr:`Hidden.gather_s`: for the slowest greatest speed of any tile that lies within the way it takes."""
    accel = max(profile.accel_m_s2 for profile in profiles)
    fastest = max(profile.speed_max_m_s for profile in profiles)
    near = ceil(fastest**2 / (2 * accel) / (side * unit)) + 1
    slowest = fastest
    for x, y in starts_px:
        r, c = int(y) // side, int(x) // side
        steps = step[max(0, r - near) : r + near + 1, max(0, c - near) : c + near + 1]
        slowest = min(slowest, side * unit / float(steps[np.isfinite(steps)].max()))
    return slowest / (2 * accel)


@kernel
def _look(
    opaque: NDArray[np.uint8], places: IntArray, rows: IntArray, cols: IntArray, group: IntArray, reach: float,
    work: Memory, starts: FloatArray, seen_from: NDArray[np.uint64], earliest: FloatArray,
) -> None:  # fmt: skip
    """Fill in from where groups are seen, and when tiles can be seen at the earliest."""
    found = np.empty(5 * opaque.size, dtype=np.int64)
    where = places.reshape(-1)
    for n in range(rows.shape[0]):
        count = tiles_in_sight(opaque, rows[n], cols[n], reach, work, found)
        for k in range(count):
            place = where[found[k]]
            if place >= 0:
                seen_from[group[n], place >> 6] |= np.uint64(1) << np.uint64(place & 63)
                for r in range(starts.shape[0]):
                    earliest[r, n] = min(earliest[r, n], starts[r, place])
