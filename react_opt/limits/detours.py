"""What a team can still see beside the hidden regions it must visit: a bound that joins both.

Suppose a team enters the hidden regions S (see :mod:`react_opt.limits.bound`) and no others, all by time T. Each region
of S is entered by some robot; let S_r be those that are counted for robot r, so the S_r share S. If the team has seen a
tile by T, then some robot r was, by T, at a place p from which it is visible. The robot entered the regions of S_r in
some order, some of them (Q) before it was at p, the others (R) after, all by T. So

    T >= c_r(S_r, p) = min over Q + R = S_r of  (least time from its start through all of Q to p)
                                              + (least time from p through all of R),

with the least times from set to set and from set to place, leg by leg. Hence for every tile that has been seen by T

    T >= e(tile) = min over r, and over the places p from which it is visible, of c_r(S_r, p),

and a tile that is visible from a region outside S alone has not been seen at all. So T is at least the smallest number
for which the tiles with ``e(tile) <= T``, those excepted, make up the share wanted. The least of these numbers over all
S and all ways to share them is a bound for any choice of the regions. With no regions it is the bound by reachability.

Places are taken together in squares and tiles in groups, each with the least of its times, which can only lower it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.limits.alone import alone_s
from react_opt.limits.hidden import Hidden

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MOST_COUNTED, MOST_ALONE = 8, 10
MOST_SHARED = 4100
"""So many ways to share regions among robots are tried at most: that limits how many regions are counted, too."""

ROUNDS, ROUNDS_ALONE = 4, 8
"""How often a search for a family begins anew, for a team and for one robot."""

_GUIDE = ((1.0, 0.5, 0.25, 0.0), (1.0, 0.3, 0.1, 0.03))
_WIDE = ((1.0, 0.8, 0.6, 0.4, 0.2, 0.0), (1.0, 0.5, 0.3, 0.2, 0.1, 0.05))
"""A search goes by the bound, and a little by those with such parts of what may be left out to spare, so weighted."""

_NEVER_S = 1e4  # what a bound counts there that cannot be reached at all
_TRIED = 10
_EXACT_S = 1e-3  # so much below the true number bounds may lie


@dataclass(frozen=True, eq=False)
class Detours:
    """What of a building and its regions the bound of this module needs.

    Parameters
    ----------
    hidden
        The building and the fleet.
    begin, lists
        The blocks of places from which each group of tiles is visible.
    start_block_s
        ``(robots, blocks)`` least times from the starts, s.
    inside
        ``(n, groups)`` which groups are visible from a region alone.
    start_s, between_s, block_s
        ``(robots, n)``, ``(n, n)``, ``(n, blocks)`` least times from the starts to the regions and from region to
        region and block, s.
    """

    hidden: Hidden
    begin: IntArray
    lists: IntArray
    start_block_s: FloatArray
    inside: NDArray[np.bool_]
    start_s: FloatArray
    between_s: FloatArray
    block_s: FloatArray

    def bounds_s(self, family: list[int], robots: int, needed: list[int]) -> FloatArray:
        """Return the bounds that a family of regions gives on seeing so many pixels, s."""
        return self.alone_s(family, needed) if robots == 1 else self.team_s(family, robots, needed)

    def alone_s(self, family: list[int], needed: list[int]) -> FloatArray:
        """Return the bounds for the first robot alone, s."""
        between = np.ascontiguousarray(self.between_s[np.ix_(family, family)])
        start, block = np.ascontiguousarray(self.start_s[0, family]), np.ascontiguousarray(self.block_s[family])
        found: FloatArray = alone_s(
            start, between, self.start_block_s[0], block, self.begin, self.lists, self._hidden_in(family),
            self.hidden.group_weight, np.array(needed),
        )  # fmt: skip
        return found

    def team_s(self, family: list[int], robots: int, needed: list[int]) -> FloatArray:
        """Return the bounds for the first robots together, s."""
        times = np.empty((robots, 1 << len(family), len(self.begin) - 1))
        alone = np.empty(times.shape[:2])
        between = np.ascontiguousarray(self.between_s[np.ix_(family, family)])
        block = np.ascontiguousarray(self.block_s[family])
        for r in range(robots):
            start = np.ascontiguousarray(self.start_s[r, family])
            alone[r], least = detour_s(self.start_block_s[r], start, between, block)
            times[r] = group_s(np.ascontiguousarray(least.T), self.begin, self.lists).T
        hidden_in, weight = self._hidden_in(family), self.hidden.group_weight
        return np.array([joined_s(alone, times, hidden_in, weight, pixels, np.inf) for pixels in needed])

    def _hidden_in(self, family: list[int]) -> IntArray:
        """Return ``(groups,)`` bits: the regions of a family from which alone a group is visible."""
        bits = np.zeros(self.inside.shape[1], dtype=np.int64)
        for m, n in enumerate(family):
            bits |= self.inside[n].astype(np.int64) << m
        return bits

    def strongest(self, share: float, robots: int, first: list[int]) -> tuple[float, int]:
        """Return a strong bound on seeing a share, s, and how many regions it counts.

        The search begins with the first ones of a list of regions, as many as serve best. Then, round by round, some of
        the best family found are dropped at random (none at first), and the region that helps most is added, again and
        again. Where all have been tried once, only those that did best are tried again. For one robot, where that is
        quick, a second search by another guide begins with what the first one found.
        """
        most = min(MOST_COUNTED, int(np.log(MOST_SHARED) / np.log(robots + 1)))
        families = [first[:size] for size in range(min(most, len(first)) + 1)]
        kept, bound, size = self._search(share, robots, families, (most, ROUNDS, 3 * _TRIED), *_GUIDE)
        if robots == 1:
            _, other, larger = self._search(share, 1, [kept], (MOST_ALONE, ROUNDS_ALONE, 6 * _TRIED), *_WIDE)
            if other > bound:
                return other, larger
        return bound, size

    def _search(
        self, share: float, robots: int, families: list[list[int]], effort: tuple[int, int, int],
        spare: tuple[float, ...], guide: tuple[float, ...],
    ) -> tuple[list[int], float, int]:  # fmt: skip
        """Return a strong family by a guide; the best bound of any family tried and how many regions that one has."""
        most, rounds, pool = effort  # regions counted, rounds, and regions tried in all but the first one
        total = self.hidden.total
        slack = total - int(np.ceil(share * total - 1e-9))
        needed = [total - int(part * slack) for part in spare]
        known: dict[frozenset[int], tuple[float, float]] = {}

        def worth(family: list[int]) -> tuple[float, float]:
            key = frozenset(family)
            if key not in known:
                bounds = self.bounds_s(sorted(family), robots, needed)
                value = np.where(np.isfinite(bounds), bounds, _NEVER_S) @ np.array(guide)
                known[key] = float(value), float(bounds[0])
            return known[key]

        kept = max(families, key=worth)
        tried = list(range(len(self.inside)))
        rng = np.random.default_rng(0)
        for n in range(rounds):
            family = [region for region in kept if n == 0 or rng.random() > 0.4]
            while len(family) < most:
                ranked = sorted(((worth([*family, m]), -m) for m in tried if m not in family), reverse=True)
                if not ranked or ranked[0][0] <= worth(family):
                    break
                family.append(-ranked[0][1])
                tried = [-m for _, m in ranked[: max(_TRIED, len(ranked) // 4)]]
            kept = max(kept, family, key=worth)
            tried = [int(m) for m in rng.permutation(len(self.inside))[:pool]]
        bound, size = max((bound, -len(key)) for key, (_, bound) in known.items())  # the search goes by more than that
        return kept, bound, -size


@kernel
def seen_from_blocks(seen_from: NDArray[np.uint64], block: IntArray, blocks: int) -> tuple[IntArray, IntArray]:
    """Return for each group the blocks of places from which any of it is visible: where its list begins, and the lists.

    Parameters
    ----------
    seen_from
        ``(groups, words)`` bits: the places from which a group is visible.
    block, blocks
        ``(places,)`` the block of each place, and how many there are.
    """
    groups, words = seen_from.shape
    begin = np.zeros(groups + 1, dtype=np.int64)
    found = [0 for _ in range(0)]
    mark = np.full(blocks, -1, dtype=np.int64)
    for g in range(groups):
        for w in range(words):
            word = seen_from[g, w]
            if word == 0:
                continue
            for bit in range(64):
                if word >> np.uint64(bit) & np.uint64(1):
                    b = block[64 * w + bit]
                    if mark[b] != g:
                        mark[b] = g
                        found.append(b)
        begin[g + 1] = len(found)
    return begin, np.array(found)


@kernel
def detour_s(
    start_block: FloatArray, start: FloatArray, between: FloatArray, to_block: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return for each set of regions the least time to visit it, and it and each block of places, s.

    Parameters
    ----------
    start_block, start
        ``(blocks,)`` and ``(k,)`` least times from a robot's start.
    between, to_block
        ``(k, k)`` and ``(k, blocks)`` least times from the regions.

    Returns
    -------
    tuple
        ``(2^k,)`` and ``(2^k, blocks)``.
    """
    k, blocks = to_block.shape
    sets = 1 << k
    there, back = (
        np.full((sets, max(1, k)), np.inf),
        np.full((sets, max(1, k)), np.inf),
    )  # ending, beginning in a region
    for chosen in range(1, sets):
        for m in range(k):
            if not chosen >> m & 1:
                continue
            rest = chosen ^ (1 << m)
            if rest == 0:
                there[chosen, m], back[chosen, m] = start[m], 0.0
                continue
            for n in range(k):
                if rest >> n & 1:
                    there[chosen, m] = min(there[chosen, m], there[rest, n] + between[n, m])
                    back[chosen, m] = min(back[chosen, m], back[rest, n] + between[m, n])
    alone = np.zeros(sets)
    before, after = np.full((sets, blocks), np.inf), np.full((sets, blocks), np.inf)
    before[0], after[0] = start_block, 0.0
    for chosen in range(1, sets):
        alone[chosen] = there[chosen].min()
        for m in range(k):
            if chosen >> m & 1:
                for b in range(blocks):
                    before[chosen, b] = min(before[chosen, b], there[chosen, m] + to_block[m, b])
                    after[chosen, b] = min(after[chosen, b], to_block[m, b] + back[chosen, m])
    least = np.empty((sets, blocks))
    for chosen in range(sets):
        for b in range(blocks):
            least[chosen, b] = before[chosen, b]
        part = chosen
        while part > 0:  # visited after the place
            first = chosen ^ part
            for b in range(blocks):
                least[chosen, b] = min(least[chosen, b], before[first, b] + after[part, b])
            part = (part - 1) & chosen
        for b in range(blocks):
            least[chosen, b] = max(least[chosen, b], alone[chosen])
    return alone, least


@kernel
def group_s(least: FloatArray, begin: IntArray, lists: IntArray) -> FloatArray:
    """Return ``(groups, sets)`` the least of the times, ``(blocks, sets)``, at the blocks that see each group."""
    groups, sets = begin.shape[0] - 1, least.shape[1]
    found = np.full((groups, sets), np.inf)
    for g in range(groups):
        for n in range(begin[g], begin[g + 1]):
            b = lists[n]
            for chosen in range(sets):
                found[g, chosen] = min(found[g, chosen], least[b, chosen])
    return found


@kernel
def joined_s(
    alone: FloatArray, times: FloatArray, hidden_in: IntArray, weight: IntArray, needed: int, most_s: float
) -> float:
    """Return the least time over all sets of regions entered and all ways to share them, ``most_s`` at most, s.

    Parameters
    ----------
    alone, times
        ``(robots, sets)`` and ``(robots, sets, groups)``, from :func:`detour_s` and :func:`group_s`.
    hidden_in
        ``(groups,)`` bits: the regions from which alone a group is visible.
    weight
        ``(groups,)`` pixels of each group.
    needed
        Pixels wanted.
    most_s
        From here on it does not matter, s.
    """
    robots, sets, groups = times.shape
    k = 0
    while 1 << k < sets:
        k += 1
    total = 1
    for _ in range(k):
        total *= robots + 1
    best = most_s
    share = np.zeros(robots, dtype=np.int64)
    seen = np.empty(groups)
    for n in range(total):
        share[:] = 0
        entered, code = 0, n
        for m in range(k):
            r = code % (robots + 1)
            code //= robots + 1
            if r > 0:
                share[r - 1] |= 1 << m
                entered |= 1 << m
        longest = 0.0
        for r in range(robots):
            longest = max(longest, alone[r, share[r]])
        if longest >= best:
            continue
        sum_seen = 0
        for g in range(groups):
            seen[g] = np.inf
            if hidden_in[g] & ~entered:
                continue
            for r in range(robots):
                seen[g] = min(seen[g], times[r, share[r], g])
            if seen[g] < best:
                sum_seen += weight[g]
        if sum_seen < needed:
            continue  # no better than the best one
        low, high = -1.0, 0.0  # fewer than wanted by low
        for g in range(groups):
            if np.isfinite(seen[g]):
                high = max(high, seen[g])
        high = min(best, high)
        while high - low > _EXACT_S:
            middle = (low + high) / 2
            by_then = 0
            for g in range(groups):
                if seen[g] <= middle:
                    by_then += weight[g]
            if by_then >= needed:
                high = middle
            else:
                low = middle
        best = min(best, max(longest, low))
    return best
