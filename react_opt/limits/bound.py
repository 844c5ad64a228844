"""A proven lower bound on the time to see a share of a building, for a team that may even know the whole map.

**Reachability.** No tile is seen before some robot can be where a point of it is visible. The share of the area that
can have been seen by a time is bounded by the tiles for which that is so.

**Hidden regions.** Take sets of places N_1 .. N_k, and as group i the tiles that are visible from N_i alone (each tile
in one group only). A team none of whose robots has entered N_i has not seen group i. So if the plan has seen all but
``slack`` of the area by time T, then for the set S of the N_i that were entered

    sum of the groups not in S  +  what lies in no group and is not visible from anywhere by T   <=   slack,

and some way of sharing S among the robots must have each robot visit its part of S by T. A robot's visits, in the order
of the first entries, take at least the sum of the least times from set to set. Those come from the certified potentials
of :mod:`react_opt.limits.reach`, so they hold for every continuous path. The least T over all 2^k sets S and all ways
to share them, found exactly by dynamic programming (Held and Karp 1962), is the bound. It holds for any choice of the
N_i; which ones are taken is a search for a strong bound, and no part of the proof.

**From rest**: all of these times begin with a start, at which robots gather speed (:func:`from_rest_s`).

**Both joined** (:mod:`react_opt.limits.detours`). A robot that has entered some of the N_i by T has seen nothing by T
but what is visible from places that it can have come by on top of that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.limits.detours import Detours, seen_from_blocks
from react_opt.limits.hidden import Hidden, from_rest_s

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MOST_REGIONS = 14
GROWTH = (0.0, 0.05, 0.15, 0.3, 0.5, 0.7)
ROUNDS = 30
_GUIDE = np.array([0.1, 1.0, 0.5, 0.25, 0.1])
"""What the search for a family goes by: the bound, and times of visiting alone with all, half, a quarter, no slack."""

LEAST_WEIGHT = 0.002
"""Regions that hide less than this share of the area are not considered."""


@dataclass(frozen=True)
class Bound:
    """No plan of this team has seen this share before ``time_s``.

    Parameters
    ----------
    share
        Share of the coverable area.
    robots
        How many robots.
    time_s
        The bound, s.
    reachability_s
        The bound by reachability alone, s.
    regions
        How many hidden regions it counts.
    """

    share: float
    robots: int
    time_s: float
    reachability_s: float
    regions: int


@dataclass(frozen=True, eq=False)
class Regions:
    """Sets of places that could be counted, and what bounds need of them.

    Parameters
    ----------
    inside
        ``(n, groups)`` which groups of tiles are visible from the region alone.
    weight
        ``(n,)`` coverable pixels of those.
    start_s
        ``(robots, n)`` least time from each start, s.
    between_s
        ``(n, n)`` least time from region to region, s.
    block_s
        ``(n, blocks)`` least time from each region to each block of places (:meth:`Hidden.blocks`), s.
    """

    inside: NDArray[np.bool_]
    weight: IntArray
    start_s: FloatArray
    between_s: FloatArray
    block_s: FloatArray


def candidates(hidden: Hidden, shares: Sequence[float] = GROWTH) -> Regions:
    """Return regions to choose from: around well hidden groups, the places that see what is seen mostly from there.

    Parameters
    ----------
    hidden
        The building and the fleet.
    shares
        A region grows by all places that see a group, when no more than such a share of them lies outside it.
    """
    seen, weight = hidden.seen_from, hidden.group_weight
    sizes = np.bitwise_count(seen).sum(axis=1).astype(np.int64)
    bits = np.arange(hidden.starts_s.shape[1])
    taken = sizes == 0
    regions: list[NDArray[np.uint64]] = []
    inside: list[NDArray[np.bool_]] = []
    for g in np.argsort(sizes, kind="stable"):
        if taken[g]:
            continue
        common = np.bitwise_count(seen & seen[g]).sum(axis=1).astype(np.int64)
        taken |= 1.25 * common >= np.minimum(sizes, sizes[g])
        outside = sizes - common
        for most_outside in shares:
            region = np.bitwise_or.reduce(seen[outside <= most_outside * sizes], axis=0)
            within = ~(seen & ~region).any(axis=1)
            new = not any(np.array_equal(within, other) for other in inside)
            if new and weight[within].sum() >= LEAST_WEIGHT * weight.sum():
                regions.append(region)
                inside.append(within)
    masks = [(row[bits >> 6] >> (bits & 63).astype(np.uint64) & np.uint64(1)).astype(np.bool_) for row in regions]
    start = np.array([[field[mask].min() for mask in masks] for field in hidden.starts_s])
    between = np.zeros((len(masks), len(masks)))
    block, count = hidden.blocks()
    block_s = np.full((len(masks), count), np.inf)
    for i, mask in enumerate(masks):
        least = hidden.place_reach_s(mask)
        between[i] = [least[other].min() for other in masks]
        np.minimum.at(block_s[i], block, least)
    groups = np.array(inside).reshape(-1, len(sizes))
    start = start.reshape(-1, len(masks))
    return Regions(groups, groups @ weight, start, np.maximum(between, between.T), block_s)  # paths lead both ways


def detours(hidden: Hidden, regions: Regions) -> Detours:
    """Return what the joined bound needs (:mod:`react_opt.limits.detours`)."""
    block, count = hidden.blocks()
    start = np.full((len(hidden.starts_s), count), np.inf)
    for r, least in enumerate(hidden.starts_s):
        np.minimum.at(start[r], block, least)
    begin, lists = seen_from_blocks(hidden.seen_from, block, count)
    return Detours(hidden, begin, lists, start, regions.inside, regions.start_s, regions.between_s, regions.block_s)


def time_bound(hidden: Hidden, regions: Regions, share: float, robots: int) -> Bound:
    """Return a lower bound on the time at which the first ``robots`` robots can have seen a share of the area.

    Parameters
    ----------
    hidden
        The building and the fleet.
    regions
        Regions to choose from (:func:`candidates`).
    share
        Of the coverable area, in (0, 1].
    robots
        How many of the fleet's robots.
    """
    slack = hidden.total - int(np.ceil(share * hidden.total - 1e-9))
    simple = reachability_s(hidden, share, robots)
    earliest = hidden.group_earliest_s(robots)
    order = np.argsort(-earliest, kind="stable")
    late = (np.ascontiguousarray(earliest[order]), np.ascontiguousarray(hidden.group_weight[order]))
    inside = np.ascontiguousarray(regions.inside[:, order])
    starts = np.ascontiguousarray(regions.start_s[:robots])
    slacks = np.array([slack, slack // 2, slack // 4, 0], dtype=np.int64)
    between = np.ascontiguousarray(regions.between_s)

    def worth(family: list[int], team: int) -> FloatArray:
        members = np.array(sorted(family, key=lambda n: int(regions.weight[n])), dtype=np.int64)
        return np.asarray(_family_s(members, inside, starts[:team], between, *late, slacks))

    found, used = simple, 0
    kept: list[int] = []
    for team in sorted({1, robots}):  # what binds one robot is where the search for several begins
        kept = _search(lambda family, team=team: worth(family, team), len(regions.weight), kept)  # type: ignore[misc]
    for size in range(1, len(kept) + 1):
        bound = float(worth(kept[:size], robots)[0])
        if bound > found:
            found, used = bound, size
    joined, size = detours(hidden, regions).strongest(share, robots, kept)
    if joined > found:
        found, used = joined, size
    return Bound(share, robots, from_rest_s(found, hidden.gather_s), from_rest_s(simple, hidden.gather_s), used)


def _search(worth: Callable[[list[int]], FloatArray], count: int, kept: list[int]) -> list[int]:
    """Return a strong family of regions: a few are dropped at random, then the best ones added while that helps."""
    rng = np.random.default_rng(0)
    best = float(worth(kept) @ _GUIDE)
    for _ in range(ROUNDS):
        family = [n for n in kept if rng.random() > 0.3]
        value = float(worth(family) @ _GUIDE)
        while len(family) < MOST_REGIONS:
            tried = [(float(worth([*family, n]) @ _GUIDE), n) for n in range(count) if n not in family]
            value_n, n = max(tried, default=(0.0, -1))
            if value_n <= value + 1e-6:
                break
            family.append(n)
            value = value_n
        if value >= best:
            kept, best = family, value
    return kept


def reachability_s(hidden: Hidden, share: float, robots: int) -> float:
    """Return the bound by reachability alone, tile by tile, s."""
    earliest = hidden.earliest_s[:robots].min(axis=0)
    order = np.argsort(earliest, kind="stable")
    needed = int(np.ceil(share * hidden.total - 1e-9))
    at = int(np.searchsorted(np.cumsum(hidden.weight[order]), needed))
    return float(earliest[order][at]) if needed > 0 else 0.0


@kernel
def _family_s(
    members: IntArray, inside: NDArray[np.bool_], starts: FloatArray, between: FloatArray, late_s: FloatArray,
    late_weight: IntArray, slacks: IntArray,
) -> FloatArray:  # fmt: skip
    """Return the bound that a family of regions gives with the first slack, then by visits alone with each slack.

    Groups stand in order of falling ``late_s``; a group inside several regions counts for the first one.
    """
    k, groups = members.shape[0], late_s.shape[0]
    weight = np.zeros(k, dtype=np.int64)
    outside = np.zeros(groups + 1, dtype=np.int64)  # sums of what is in no region, from the latest group on
    for g in range(groups):
        outside[g + 1] = outside[g]
        owner = -1
        for m in range(k):
            if inside[members[m], g]:
                owner = m
                break
        if owner >= 0:
            weight[owner] += late_weight[g]
        else:
            outside[g + 1] += late_weight[g]
    visit = _visits(members, starts, between)
    total = weight.sum()
    bound = np.full(slacks.shape[0] + 1, np.inf)
    for chosen in range(1 << k):
        entered = 0
        for m in range(k):
            if chosen >> m & 1:
                entered += weight[m]
        for n in range(slacks.shape[0]):
            spare = slacks[n] - (total - entered)
            if spare < 0:
                break
            bound[n + 1] = min(bound[n + 1], visit[chosen])
            if n == 0 and visit[chosen] < bound[0]:
                at = np.searchsorted(outside, spare, side="right") - 1  # this many late groups may be left out
                late = late_s[at] if at < groups else 0.0
                bound[0] = min(bound[0], max(visit[chosen], late))
    return bound


@kernel
def _visits(members: IntArray, starts: FloatArray, between: FloatArray) -> FloatArray:
    """Return for each set of regions the least time by which robots can have entered them all."""
    k, sets = members.shape[0], 1 << members.shape[0]
    team = np.empty(0)
    last = np.empty((sets, max(k, 1)))
    for r in range(starts.shape[0]):
        alone = np.full(sets, np.inf)
        alone[0] = 0.0
        last[:] = np.inf
        for m in range(k):
            last[1 << m, m] = starts[r, members[m]]
        for chosen in range(1, sets):
            for m in range(k):
                here = last[chosen, m]
                if np.isinf(here):
                    continue
                alone[chosen] = min(alone[chosen], here)
                for n in range(k):
                    if not chosen >> n & 1:
                        more = chosen | 1 << n
                        last[more, n] = min(last[more, n], here + between[members[m], members[n]])
        if r == 0:
            team = alone
            continue
        shared = team.copy()
        for chosen in range(1, sets):
            part = chosen
            while part > 0:  # what the robot takes over from those before it
                if alone[part] < shared[chosen]:
                    shared[chosen] = min(shared[chosen], max(alone[part], team[chosen ^ part]))
                part = (part - 1) & chosen
        team = shared
    return team
