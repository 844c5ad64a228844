"""Routes worth adding: the pricing problem of each class of robots, heuristically and exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.models.inspection import ABSENT, FloatArray, InspectionArrays, IntArray
from react_opt.solvers.inspection.answer import rounded
from react_opt.solvers.inspection.labels import EXACT, HEURISTIC, MOST_BUCKETS, best_routes
from react_opt.solvers.inspection.master import Column
from react_opt.solvers.inspection.ngroutes import best_ng_routes

ELEMENTARY_UP_TO = 40  # targets; above, routes remember a neighbourhood
NEIGHBOURHOOD = 5  # to begin with; it grows where the linear program uses cycles
MOST_REMEMBERED = 14
WORTH_NOTHING = 1e-9
BEAM = 250  # labels per number of stops when routes are sought heuristically
FIRST_LABELS = 4096  # room to begin with
SLACK = 0.75


@kernel
def is_metric(time_s: FloatArray, energy_j: FloatArray) -> bool:
    """Whether no detour over a target is shorter than the direct drive, in time or in energy."""
    n = len(time_s) - 2
    for k in range(n):
        for i in range(n + 1):
            if i == k:
                continue
            for j in range(n + 2):
                if j in (i, k, n):
                    continue
                slack = 1e-9 * (1.0 + time_s[i, j])
                if time_s[i, k] + time_s[k, j] < time_s[i, j] - slack:
                    return False
                if energy_j[i, k] + energy_j[k, j] < energy_j[i, j] - 1e-9 * (1.0 + energy_j[i, j]):
                    return False
    return True


@dataclass(frozen=True)
class Cuts:
    """Subset-row cuts as the pricing sees them.

    Parameters
    ----------
    bits
        ``(N,)`` bits of the cuts that each target is in.
    penalty
        ``(64,)`` price of each cut.
    """

    bits: NDArray[np.uint64]
    penalty: FloatArray


@dataclass(frozen=True)
class Priced:
    """What one pricing found.

    Parameters
    ----------
    columns
        Routes above the threshold, best first.
    best
        Largest profit of any route (of the relaxation), the threshold where none exceeds it; None where the
        search was not exact.
    bound
        Bound on the profit of any route, infinite where unknown: weaker than ``best``, always at hand.
    labels
        Labels made.
    """

    columns: list[Column]
    best: float | None
    bound: float
    labels: int


class Pricer:
    """Pricing of one class of robots.

    Parameters
    ----------
    arrays
        The problem.
    group, robot
        Number of the class, and a robot of it.
    """

    def __init__(self, arrays: InspectionArrays, group: int, robot: int) -> None:
        self.group, self.robot, self.arrays = group, robot, arrays
        self.time_s = np.ascontiguousarray(arrays.time_s[robot])
        self.energy_j = np.ascontiguousarray(arrays.energy_j[robot])
        self.cost = self.time_s if arrays.by_time else self.energy_j
        self.energy_limit = float(arrays.energy_limit_j[robot])
        n = len(arrays.value)
        self.n, self.words = n, max(1, (n + 63) // 64)
        self.metric = bool(is_metric(self.time_s, self.energy_j))
        self._budgets()
        self.elementary = n <= ELEMENTARY_UP_TO
        self.everything = np.tile(_bits([list(range(n))], self.words), (n, 1))
        self.memory = self.everything if self.elementary else self._neighbourhoods()
        self._room = _labels(FIRST_LABELS, self.words)
        self._values: list[float] = arrays.value.tolist()
        self._cost: list[list[float]] = self.cost.tolist()
        buckets = (
            _bucket_count(self.time_s, self.time_limit, n),
            _bucket_count(self.energy_j, self.energy_limit, n),
        )
        # A budget that the other one leaves mostly unused bounds nothing: its table is not worth computing.
        binding = _tightness(self.time_s, self.time_limit), _tightness(self.energy_j, self.energy_limit)
        self.buckets = (
            0 if binding[0] < SLACK * binding[1] and buckets[1] else buckets[0],
            0 if binding[1] < SLACK * binding[0] and buckets[0] else buckets[1],
        )

    def _budgets(self) -> None:
        """Drop a budget that the other implies: labels then compare by one budget, which beats far more of them."""
        time_limit = self.arrays.time_limit_s
        self.time_limit = time_limit
        listed = (self.time_s < ABSENT) | (self.energy_j < ABSENT)
        time_share, energy_share = self.time_s[listed] * self.energy_limit, self.energy_j[listed] * time_limit
        if (energy_share <= time_share).all():
            self.energy_j, self.energy_limit = np.zeros_like(self.energy_j), np.inf
        elif (time_share <= energy_share).all():
            self.time_s, self.time_limit = np.zeros_like(self.time_s), np.inf

    def _neighbourhoods(self) -> NDArray[np.uint64]:
        drives = self.arrays.time_s[self.robot, : self.n, : self.n]
        near = np.argsort(drives.T - 1e18 * np.eye(self.n), axis=1, kind="stable")
        self._remembered = [set(row) for row in near[:, :NEIGHBOURHOOD].tolist()]
        return _bits([sorted(row) for row in self._remembered], self.words)

    def allows(self, stops: Sequence[int]) -> bool:
        """Whether the memories, as they have grown, allow a route."""
        if self.elementary or len(set(stops)) == len(stops):
            return len(set(stops)) == len(stops)
        known: set[int] = set()
        for k in stops:
            if k in known:
                return False
            known = known & self._remembered[k] | {k}
        return True

    def grow(self, stops: Sequence[int]) -> bool:
        """Let memories grow until they forbid a route's shortest cycle (Roberti and Mingozzi 2014); whether they did.

        Parameters
        ----------
        stops
            A route that visits some target twice.
        """
        if self.elementary:
            return False
        last: dict[int, int] = {}
        cycles = []
        for at, k in enumerate(stops):
            if k in last:
                cycles.append((at - last[k], last[k], at))
            last[k] = at
        for _, first, again in sorted(cycles):
            between, k = stops[first + 1 : again], stops[first]
            if all(k in self._remembered[j] or len(self._remembered[j]) < MOST_REMEMBERED for j in between):
                for j in between:
                    self._remembered[j].add(k)
                self.memory = _bits([sorted(row) for row in self._remembered], self.words)
                return True
        return False

    def price(
        self,
        prize: FloatArray,
        rate: float,
        threshold: float,
        mode: int,
        most: int,
        count: int,
        stop: NDArray[np.uint8],
        cuts: Cuts | None = None,
    ) -> Priced:
        """Return routes whose profit exceeds a threshold.

        Parameters
        ----------
        prize, rate
            ``(N,)`` prizes and the weight of the second objective.
        threshold
            Profit to exceed.
        mode
            ``HEURISTIC``, ``EXACT`` or ``ENUMERATE``.
        most
            Labels at most.
        count
            Columns at most.
        stop
            ``(1,)`` set to nonzero by another thread to end early.
        cuts
            Subset-row cuts with their prices; None for none.
        """
        n = self.n
        if self.metric and mode in (HEURISTIC, EXACT):
            prize = np.where(prize > WORTH_NOTHING, prize, -np.inf)
        memory = self.memory if mode == EXACT else self.everything
        charges = (np.zeros(n, np.uint64), np.zeros(64)) if cuts is None else (cuts.bits, cuts.penalty)
        bound = np.zeros(1)
        while True:
            room = self._room
            if mode == EXACT and not self.elementary:
                made = self._ng_routes(prize, rate, threshold, stop, room)
                bound[0] = np.inf
            else:
                made = best_routes(
                    prize, rate, self.cost, self.time_s, self.energy_j, self.time_limit, self.energy_limit,
                    memory, self.metric, threshold, mode, *self.buckets, *charges, BEAM, bound, stop,
                    *room[:10],
                )  # fmt: skip
            if made >= 0 or stop[0] != 0 or len(room[0]) >= most:
                break
            self._room = _labels(min(most, 8 * len(room[0])), self.words)
        node, parent, _, _, final = self._room[:5]
        size = abs(made)
        good = np.flatnonzero(final[:size] > threshold)
        best = None
        if made > 0 and mode != HEURISTIC:
            best = float(final[good].max()) if len(good) else threshold
        order = good[np.argsort(-final[good], kind="stable")]
        columns: list[Column] = []
        seen: dict[frozenset[int], int] = {}
        for label in order.tolist():
            if len(columns) >= count:
                break
            stops: list[int] = []
            at = label
            while node[at] < n:
                stops.append(int(node[at]))
                at = int(parent[at])
            stops.reverse()
            total = self._total(stops)
            key = frozenset(stops) if len(set(stops)) == len(stops) else frozenset([-label])
            value = sum(self._values[k] for k in stops)
            if key not in seen:
                seen[key] = len(columns)
                columns.append(Column(self.group, tuple(stops), value, total))
            elif total < columns[seen[key]].cost:
                columns[seen[key]] = Column(self.group, tuple(stops), value, total)
        return Priced(columns, best, float(bound[0]), size)

    def _ng_routes(
        self, prize: FloatArray, rate: float, threshold: float, stop: NDArray[np.uint8], room: tuple[NDArray[Any], ...]
    ) -> int:
        """Fill ``room`` with the labels of ng-routes, in the order of the budget that binds."""
        time_first = self.buckets[0] >= self.buckets[1] and self.time_limit < np.inf
        main, other = (self.time_s, self.energy_j) if time_first else (self.energy_j, self.time_s)
        limits = (self.time_limit, self.energy_limit)
        node, parent, profit, mask, final, used_main, used_other, after = room[:8]
        return int(
            best_ng_routes(
                prize, rate, self.cost, main, other, limits[0 if time_first else 1], limits[1 if time_first else 0],
                self.memory, self.metric, threshold, self.buckets[0 if time_first else 1], stop, node, parent, profit,
                mask, final, used_main, used_other, after, room[10],
            )
        )  # fmt: skip

    def _total(self, stops: list[int]) -> float:
        """Return the second objective of a route."""
        total, at = 0.0, self.n
        for k in stops:
            total += self._cost[at][k]
            at = k
        return total + self._cost[at][self.n + 1]

    def column(self, stops: tuple[int, ...]) -> Column:
        """Return a route as a column."""
        value = float(self.arrays.value[list(stops)].sum())
        return Column(self.group, stops, value, self._total(list(stops)))


def _labels(most: int, words: int) -> tuple[NDArray[Any], ...]:
    """Return room for labels, in the order in which :func:`best_routes` takes it, and for a queue."""
    whole, real = np.int64, np.float64
    return (
        np.empty(most, whole), np.empty(most, whole), np.empty(most, real), np.empty((most, words), np.uint64),
        np.empty(most, real), np.empty(most, real), np.empty(most, real), np.empty(most, whole),
        np.empty(most, np.bool_), np.empty(most, np.uint64), np.empty(most, whole),
    )  # fmt: skip


def _bits(members: list[list[int]], words: int) -> NDArray[np.uint64]:
    """Return sets of targets as rows of 64-bit words."""
    flags = np.zeros((len(members), 64 * words), np.uint8)
    for row, those in enumerate(members):
        flags[row, those] = 1
    return np.packbits(flags, axis=1, bitorder="little").view("<u8").astype(np.uint64)


def _bucket_count(resource: FloatArray, limit: float, n: int) -> int:
    """Return buckets such that every drive between targets leaves its bucket, 0 where that takes too many."""
    inner = resource[:n, :n]
    least = float(inner.min(initial=np.inf))
    if least <= 0 or limit <= 0 or not np.isfinite(least) or not np.isfinite(limit):
        return 0
    count = int(np.ceil(limit / least)) + 1
    return 0 if count > MOST_BUCKETS else max(count, min(60, 4 * n))


def simple_bound(arrays: InspectionArrays, pricers: list[Pricer], grid: float) -> float:
    """Return a bound on the value that needs no solver.

    Only targets count that some robot can visit first and then go to its end (where no detour is shorter), and
    of these as much, in fractions, as the budgets of all robots together pay for when every visit costs no more
    than the cheapest drive to it and its service.
    """
    n = len(arrays.value)
    within = np.zeros(n, np.bool_)
    for pricer in pricers:
        t = pricer.time_s[n, :n] + pricer.time_s[:n, n + 1]
        e = pricer.energy_j[n, :n] + pricer.energy_j[:n, n + 1]
        within |= (t <= pricer.time_limit) & (e <= pricer.energy_limit) if pricer.metric else True
    value = np.where(within, arrays.value, 0.0)
    best = float(value.sum())
    if not n or not len(arrays.time_s):
        return best if len(arrays.time_s) else 0.0
    limits = np.full(len(arrays.time_s), arrays.time_limit_s), arrays.energy_limit_j
    for drives, limit in zip((arrays.time_s, arrays.energy_j), limits, strict=True):
        to_end = drives[:, : n + 1, n + 1].min(axis=1)
        budget = float(np.maximum(limit - to_end, 0.0).sum())
        needs = drives[:, : n + 1, :n].min(axis=(0, 1))
        order = np.argsort(-value / np.maximum(needs, 1e-12), kind="stable")
        share = np.clip((budget - (np.cumsum(needs[order]) - needs[order])) / np.maximum(needs[order], 1e-12), 0.0, 1.0)
        best = min(best, float((share * value[order]).sum()))
    return rounded(best + 1e-9 * max(1.0, best), grid)


def _tightness(resource: FloatArray, limit: float) -> float:
    """Return the mean drive as a share of the budget."""
    drives = resource[:-2, :-2]
    drives = drives[drives < ABSENT]
    return float(drives.mean()) / max(limit, 1e-9) if len(drives) else 0.0


def classes_of(arrays: InspectionArrays) -> tuple[list[int], list[int], IntArray]:
    """Return per class a robot and the number of robots, and ``(R,)`` the class of each robot."""
    first = arrays.classes
    robots = sorted(set(first.tolist()))
    number = {robot: index for index, robot in enumerate(robots)}
    group = np.array([number[int(r)] for r in first], dtype=np.int64)
    return robots, [int((group == c).sum()) for c in range(len(robots))], group
