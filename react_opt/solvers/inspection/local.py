"""Large neighbourhood search for the inspection: remove strings of neighbouring stops, insert greedily.

Slack induction by string removals (Christiaens and Vanden Berghe 2020), with prizes: a solution need not visit
every target. Simulated annealing walks on ``value - rate * cost``; what is remembered is the best by value,
then cost. Nobody waits, so an insertion is judged by two sums; the cheapest insertion of a target into a route
is remembered for as long as that route is kept, since a removal touches few routes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.models.inspection import InspectionArrays, Routes

MEAN_REMOVED = 8.0
LONGEST_STRING = 10.0
BLINK = 0.01
RATES = (2.0, 1.0)
POOL = 200  # routes remembered per portion
MOST_SEEN = 3000  # routes remembered in all


@dataclass
class Searcher:
    """A search that can be run in portions; deterministic for a seed and a number of iterations.

    Parameters
    ----------
    arrays
        The problem.
    routes
        Feasible routes to start from.
    seed
        Seed of the search.
    stop
        ``(1,)`` set to nonzero by another thread to end a portion early.
    """

    arrays: InspectionArrays
    routes: Routes
    seed: int
    stop: NDArray[np.uint8] = field(default_factory=lambda: np.zeros(1, np.uint8))

    def __post_init__(self) -> None:
        """Lay the routes out as an array, and sort every target's neighbours."""
        arrays, n = self.arrays, len(self.arrays.value)
        self._tour: NDArray[np.int64] = np.full((len(arrays.time_s), n + 1), -1, dtype=np.int64)
        self._put(self.routes)
        mean = np.minimum(arrays.cost[:, :n, :n].min(axis=0, initial=np.inf), 1e15)
        self._near = np.argsort(mean + mean.T - 3e15 * np.eye(n), axis=1, kind="stable")
        self._portion = 0
        self._into = np.ascontiguousarray(arrays.cost.transpose(0, 2, 1))
        limit = np.full(len(arrays.time_s), arrays.time_limit_s) if arrays.by_time else arrays.energy_limit_j
        self._cost_limit = limit.astype(np.float64)
        self._pool = np.full((POOL, n + 1), -1, dtype=np.int64)
        self._pool_robot = np.full(POOL, -1, dtype=np.int64)
        self.seen: set[tuple[int, tuple[int, ...]]] = set()

    def _put(self, routes: Routes) -> None:
        self._tour[:] = -1
        for r, route in enumerate(routes):
            self._tour[r, : len(route)] = route

    def offer(self, routes: Routes) -> None:
        """Go on from other routes, better ones."""
        self.routes = [list(route) for route in routes]
        self._put(routes)

    def run(self, iterations: int, heat: float = 0.3, room: float | None = None) -> Routes:
        """Search for a number of iterations, cooling down once; return the best routes known.

        Parameters
        ----------
        iterations
            Removals and insertions to try.
        heat
            Starting temperature, as a share of what one mean target is worth.
        room
            What cost weighs against value, 1 for three tenths of the value per cost known; None for ``RATES`` by
            turns.
        """
        arrays = self.arrays
        value, cost = arrays.worth(self.routes)
        mean = float(arrays.value.mean()) if len(arrays.value) else 0.0
        rate = 0.3 * value / cost if value > 0 and cost > 0 else 0.0
        # by turns a search for room and one for value
        rate *= RATES[self._portion % len(RATES)] if room is None else room
        if value == 0.0:
            rate = 1e-6 * mean
        if iterations > 0 and len(arrays.value):
            search(
                self._tour, arrays.value, arrays.time_s, arrays.energy_j, arrays.cost, arrays.time_limit_s,
                arrays.energy_limit_j, self._near, rate, max(1e-9, heat * mean), max(1e-12, 0.002 * mean),
                iterations, self.seed * 1_000_003 + self._portion, self.stop, self._pool,
                self._pool_robot, self._into, self._cost_limit,
            )  # fmt: skip
        self._portion += 1
        if len(self.seen) < MOST_SEEN:
            for row, r in zip(self._pool.tolist(), self._pool_robot.tolist(), strict=True):
                if r < 0:
                    break
                self.seen.add((r, tuple(row[: row.index(-1)])))
        self.routes = [[int(k) for k in row[: int(np.argmax(row < 0))]] for row in self._tour]
        return self.routes


@kernel
def _uniform(state: Any) -> float:
    """Return a random number in [0, 1) and step the state (splitmix64; state ``(1,)`` of 64 bits)."""
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) / 9007199254740992.0


@kernel
def _length(tour: Any, r: int) -> int:
    size = 0
    while tour[r, size] >= 0:
        size += 1
    return size


@kernel
def _sums(tour: Any, r: int, size: int, n: int, time_s: Any, energy_j: Any, cost: Any) -> Any:
    before = n
    a = b = c = 0.0
    for x in range(size + 1):
        after = tour[r, x] if x < size else n + 1
        a += time_s[r, before, after]
        b += energy_j[r, before, after]
        c += cost[r, before, after]
        before = after
    return a, b, c


@kernel
def _legs(leg: Any, tour: Any, r: int, size: int, n: int, cost: Any) -> None:
    before = n
    for x in range(size + 1):
        after = tour[r, x] if x < size else n + 1
        leg[r, x] = cost[r, before, after]
        before = after


@kernel
def _cheapest(
    r: int, k: int, tour: Any, size: int, leg: Any, into: Any, time_s: Any, energy_j: Any, cost: Any, room_t: float,
    room_e: float, room_c: float, least: float, blink: float, random: Any,
) -> Any:  # fmt: skip
    """Return cost and place of the cheapest insertion of a target into a route, if cheaper than ``least``."""
    n, best_x = into.shape[1] - 2, -1
    before = n
    for y in range(size + 1):
        after = tour[r, y] if y < size else n + 1
        add = into[r, k, before] + cost[r, k, after] - leg[r, y]
        if (
            add < least
            and add <= room_c  # the budget that binds most often, before those that need more memory
            and time_s[r, before, k] + time_s[r, k, after] - time_s[r, before, after] <= room_t
            and energy_j[r, before, k] + energy_j[r, k, after] - energy_j[r, before, after] <= room_e
            and (blink == 0.0 or _uniform(random) >= blink)
        ):
            least, best_x = add, y
        before = after
    if best_x < 0:
        return np.inf, -1
    return least, best_x


@kernel(nogil=True)
def search(
    tour: Any, value: Any, time_s: Any, energy_j: Any, cost: Any, time_limit: float, energy_limit: Any, near: Any,
    rate: float, hot: float, cold: float, iterations: int, seed: int, halt: Any, pool: Any,
    pool_robot: Any, into: Any, cost_limit: Any,
) -> None:  # fmt: skip
    """Improve ``tour`` (in and out: ``(R, N + 1)`` stops per robot, -1 after the last) in place.

    Routes of each plan that is better than any before it are written to ``pool`` (rows as in ``tour``) and
    ``pool_robot`` (-1 after the last). ``into`` is ``cost`` with its last axes swapped, ``cost_limit`` ``(R,)`` the
    budget that ``cost`` draws on.
    """
    random = np.array([seed], np.uint64)
    _uniform(random)
    n_robots, n = len(tour), len(value)
    size, robot, place = np.empty(n_robots, np.int64), np.full(n, -1, np.int64), np.empty(n, np.int64)
    used_t, used_e, used_c = np.empty(n_robots), np.empty(n_robots), np.empty(n_robots)
    for r in range(n_robots):
        size[r] = _length(tour, r)
        used_t[r], used_e[r], used_c[r] = _sums(tour, r, size[r], n, time_s, energy_j, cost)
        for x in range(size[r]):
            robot[tour[r, x]], place[tour[r, x]] = r, x
    now_value = 0.0
    for k in range(n):
        if robot[k] >= 0:
            now_value += value[k]
    best, best_value, best_cost = tour.copy(), now_value, used_c.sum()
    now_score = now_value - rate * best_cost
    old_tour, old_size = tour.copy(), size.copy()
    old_robot, old_place = robot.copy(), place.copy()
    old_t, old_e, old_c = used_t.copy(), used_e.copy(), used_c.copy()
    touched = np.zeros(n_robots, np.bool_)
    leg = np.zeros((n_robots, n + 1))  # cost of each drive of the routes
    for r in range(n_robots):
        _legs(leg, tour, r, size[r], n, cost)
    known = np.zeros((n_robots, n), np.bool_)  # insertions into the routes of ``old_tour``
    known_add, known_x = np.empty((n_robots, n)), np.empty((n_robots, n), np.int64)
    waiting, rank = np.empty(n, np.int64), np.empty(n)
    cooling = (cold / hot) ** (1.0 / max(1, iterations))
    heat, n_pool, top_score = hot, 0, now_score
    pool_robot[:] = -1
    for _ in range(iterations):
        if halt[0] != 0:
            break
        heat *= cooling
        touched[:] = False
        # ruin: strings of stops around a random target
        visited = 0
        for r in range(n_robots):
            visited += size[r]
        centre = int(_uniform(random) * n)
        if visited > 0:
            longest = min(LONGEST_STRING, visited / n_robots)
            strings = int(_uniform(random) * (4.0 * MEAN_REMOVED / (1.0 + longest) - 1.0) + 1.0)
            for x in range(-1, n - 1):
                if strings <= 0:
                    break
                k = centre if x < 0 else near[centre, x + 1]
                r = robot[k]
                if r < 0 or touched[r]:
                    continue
                length = int(_uniform(random) * min(longest, size[r]) + 1.0)
                length = min(length, size[r])
                kept = 0  # stops kept in the middle of the string
                if length > 1 and _uniform(random) < 0.5:
                    while length + kept < size[r] and _uniform(random) > 0.1:
                        kept += 1
                span = length + kept
                first = place[k] - int(_uniform(random) * span)
                first = max(0, min(first, size[r] - span))
                skip = first + (1 + int(_uniform(random) * (length - 1)) if kept > 0 else span)
                write = first
                for y in range(first, size[r]):
                    stop = tour[r, y]
                    if y < first + span and not (skip <= y < skip + kept):
                        robot[stop] = -1
                        now_value -= value[stop]
                    else:
                        tour[r, write] = stop
                        place[stop] = write
                        write += 1
                for y in range(write, size[r]):
                    tour[r, y] = -1
                size[r] = write
                touched[r] = True
                strings -= 1
        for r in range(n_robots):
            if touched[r]:
                used_t[r], used_e[r], used_c[r] = _sums(tour, r, size[r], n, time_s, energy_j, cost)
                _legs(leg, tour, r, size[r], n, cost)
        # recreate: every target that waits, in a random order of some kind, at its cheapest place
        n_waiting = 0
        kind = int(_uniform(random) * 4)
        for k in range(n):
            if robot[k] < 0:
                waiting[n_waiting] = k
                if kind == 0:
                    rank[n_waiting] = _uniform(random)
                elif kind == 1:
                    rank[n_waiting] = -value[k] * (0.7 + 0.6 * _uniform(random))
                elif kind == 2:
                    rank[n_waiting] = time_s[0, n, k] * (0.8 + 0.4 * _uniform(random))
                else:
                    rank[n_waiting] = -time_s[0, n, k] * (0.8 + 0.4 * _uniform(random))
                n_waiting += 1
        for x in range(1, n_waiting):  # by insertion: few wait, and np.argsort takes long to compile
            k, key = waiting[x], rank[x]
            y = x
            while y > 0 and rank[y - 1] > key:
                waiting[y], rank[y] = waiting[y - 1], rank[y - 1]
                y -= 1
            waiting[y], rank[y] = k, key
        for x in range(n_waiting):
            k = waiting[x]
            least, best_r, best_x = np.inf, -1, -1
            for r in range(n_robots):
                room_t, room_e, room_c = time_limit - used_t[r], energy_limit[r] - used_e[r], cost_limit[r] - used_c[r]
                if touched[r]:
                    add, y = _cheapest(
                        r, k, tour, size[r], leg, into, time_s, energy_j, cost, room_t, room_e, room_c, least, BLINK,
                        random,
                    )  # fmt: skip
                else:
                    if not known[r, k]:
                        known[r, k] = True
                        known_add[r, k], known_x[r, k] = _cheapest(
                            r, k, tour, size[r], leg, into, time_s, energy_j, cost, room_t, room_e, room_c, np.inf,
                            0.0, random,
                        )  # fmt: skip
                    add, y = known_add[r, k], known_x[r, k]
                    if add < least and _uniform(random) < BLINK:
                        continue
                if add < least:
                    least, best_r, best_x = add, r, y
            if best_r < 0 or value[k] <= rate * least - heat:
                continue
            r = best_r
            for y in range(size[r], best_x, -1):
                tour[r, y] = tour[r, y - 1]
                place[tour[r, y]] = y
            tour[r, best_x] = k
            size[r] += 1
            robot[k], place[k] = r, best_x
            touched[r] = True
            now_value += value[k]
            before = tour[r, best_x - 1] if best_x > 0 else n
            after = tour[r, best_x + 1] if best_x + 1 < size[r] else n + 1
            used_t[r] += time_s[r, before, k] + time_s[r, k, after] - time_s[r, before, after]
            used_e[r] += energy_j[r, before, k] + energy_j[r, k, after] - energy_j[r, before, after]
            used_c[r] += least
            _legs(leg, tour, r, size[r], n, cost)
        good = True
        for r in range(n_robots):
            if touched[r]:  # anew: sums over absent drives lose their digits
                used_t[r], used_e[r], used_c[r] = _sums(tour, r, size[r], n, time_s, energy_j, cost)
                good = good and used_t[r] <= time_limit and used_e[r] <= energy_limit[r]
        total = used_c.sum()
        score = now_value - rate * total
        if good and score > now_score + heat * np.log(1.0 - _uniform(random)):
            now_score = score
            if score > top_score:
                top_score = score
                for r in range(n_robots):
                    if touched[r] and n_pool < len(pool):
                        pool[n_pool], pool_robot[n_pool] = tour[r], r
                        n_pool += 1
            rounding = 1e-9 * max(1.0, best_value)
            if now_value > best_value + rounding or (
                now_value > best_value - rounding and total < best_cost - 1e-9 * max(1.0, best_cost)
            ):
                best_value, best_cost = now_value, total
                best[:] = tour
            for r in range(n_robots):
                if touched[r]:
                    old_tour[r] = tour[r]
                    known[r] = False
            old_size[:], old_robot[:], old_place[:] = size, robot, place
            old_t[:], old_e[:], old_c[:] = used_t, used_e, used_c
        else:
            for r in range(n_robots):
                if touched[r]:
                    tour[r] = old_tour[r]
                    _legs(leg, tour, r, old_size[r], n, cost)
            size[:], robot[:], place[:] = old_size, old_robot, old_place
            used_t[:], used_e[:], used_c[:] = old_t, old_e, old_c
            now_value = 0.0
            for k in range(n):
                if robot[k] >= 0:
                    now_value += value[k]
    tour[:] = best
