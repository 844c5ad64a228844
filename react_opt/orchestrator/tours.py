"""Tours of a fleet through targets of known worth: coverage early, and all of it soon.

The tours minimise a weighted sum of the times at which the expected coverage reaches certain shares of the whole, and
of the end. That weighs the first square metres against the last ones: a small region on the way is taken along where
coming back for it costs more than what waits. The end comes when going on costs more than what is left behind is worth,
at a price per unit of worth: a visit is made in passing if the time that it costs is less than its price, however much
of the whole is still to come, and nothing is planned for the sake of crumbs. All robots are planned together.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

Facts = tuple[
    FloatArray, FloatArray, FloatArray, float, FloatArray, FloatArray, float, float, IntArray, float, FloatArray
]

END = 3.0
"""Weight of the end."""
MISSED_S = 300.0
"""What it costs to reach nothing of the whole in time, s; of a part of it as much less."""


@kernel
def tour_cost(
    order: IntArray,
    start_s: FloatArray,
    between_s: FloatArray,
    value: FloatArray,
    known: float,
    shares: FloatArray,
    weights: FloatArray,
    price_s: float,
    left_s: float,
    first: IntArray,
    keep_s: float,
    arrive: FloatArray,
) -> float:
    """Return the cost of tours, s.

    Parameters
    ----------
    order
        Targets in order of visit, robot after robot, with -1 between robots.
    start_s, between_s
        ``(R, K)`` and ``(K, K)`` s.
    value, known
        ``(K,)`` worth of each target, and what is covered already, in the same unit.
    shares, weights
        Shares of all there is, increasing, and what each second until they are reached costs.
    price_s
        What it costs to leave a unit of worth behind at the end, s.
    left_s
        Time left; what is visited later counts as missed.
    first, keep_s
        ``(R,)`` target that each robot is on its way to (-1: none), and what turning away from it costs.
    arrive
        ``(R, K + 1)`` scratch space.
    """
    robots, count = start_s.shape
    robot, at, now, cost = 0, -1, 0.0, 0.0
    length = np.zeros(robots, dtype=np.int64)
    worth = np.empty((robots, count + 1))
    spread, missed = 0.0, 0.0
    for n in range(order.shape[0]):
        k = order[n]
        if k < 0:
            robot, at, now = robot + 1, -1, 0.0
            continue
        if at < 0:
            now = start_s[robot, k]
            if first[robot] >= 0 and first[robot] != k:
                now += keep_s
        else:
            now += between_s[at, k]
        at = k
        arrive[robot, length[robot]], worth[robot, length[robot]] = now, value[k]
        length[robot] += 1
        spread += now * value[k]
        if now > left_s:
            missed += value[k]
    total = known
    for k in range(count):
        total += value[k]
    covered, step = known, 0
    while step < shares.shape[0] and covered >= shares[step] * total - 1e-9:
        step += 1
    cursor = np.zeros(robots, dtype=np.int64)
    end = price_s * (total - covered)
    while True:
        best, when = -1, np.inf
        for r in range(robots):
            if cursor[r] < length[r] and arrive[r, cursor[r]] < when:
                best, when = r, arrive[r, cursor[r]]
        if best < 0:
            break
        covered += worth[best, cursor[best]]
        cursor[best] += 1
        end = min(end, when + price_s * (total - covered))
        while step < shares.shape[0] and covered >= shares[step] * total - 1e-9:
            cost += weights[step] * when
            step += 1
    cost += END * end + MISSED_S * missed / (total + 1e-9)
    driven = 0.0
    for r in range(robots):
        if length[r] > 0:
            driven += min(arrive[r, length[r] - 1], 2.0 * left_s)
    return cost + 0.02 * driven + 0.2 * spread / (total - known + 1e-9)


@kernel
def plan_tours(
    begin: IntArray,
    start_s: FloatArray,
    between_s: FloatArray,
    value: FloatArray,
    known: float,
    shares: FloatArray,
    weights: FloatArray,
    price_s: float,
    left_s: float,
    first: IntArray,
    keep_s: float,
    work: int,
) -> tuple[IntArray, float]:
    """Return tours and their cost, by local search from given ones: deterministic, and limited by counted work.

    Moves: a run of up to three targets goes elsewhere, forwards or backwards; two targets change places; a stretch
    is driven backwards; the ends of two robots' tours are exchanged (a separator moves). The first move that helps
    is taken. What work is left goes into shaking the best tours and descending again.

    Parameters
    ----------
    begin
        Tours to start from, as for :func:`tour_cost`: every target once and R - 1 separators.
    work
        Most evaluations.

    The other parameters are those of :func:`tour_cost`.
    """
    robots, count = start_s.shape
    arrive = np.empty((robots, count + 1))
    facts = (start_s, between_s, value, known, shares, weights, price_s, left_s, first, keep_s, arrive)
    best = begin.copy()
    best_cost, done = _descend(best, facts, work)
    n = best.shape[0]
    order, trial = best.copy(), best.copy()
    dice = 12345
    while done < work and n > 2:
        order[:] = best
        for _ in range(3):
            dice = (dice * 1103515245 + 12345) % 2147483648
            i = (dice >> 8) % n
            run = 1 + (dice >> 20) % min(3, n - i)
            dice = (dice * 1103515245 + 12345) % 2147483648
            _move(order, trial, i, run, (dice >> 8) % (n - run + 1), (dice >> 20) % 2 == 1)
            order[:] = trial
        cost, used = _descend(order, facts, work - done)
        done += used + 1
        if cost < best_cost - 1e-6:
            best[:] = order
            best_cost = cost
    return best, best_cost


@kernel
def _descend(order: IntArray, facts: Facts, work: int) -> tuple[float, int]:
    """Improve tours in place until no move helps or the work is used up; return their cost, and the work done."""
    n = order.shape[0]
    trial = np.empty(n, dtype=np.int64)
    cost = tour_cost(order, *facts)
    done = 1
    improved = True
    while improved and done < work:
        improved = False
        for run in range(1, 4):
            for i in range(n - run + 1):
                for j in range(n - run + 1):
                    if j == i or done >= work:
                        continue
                    for back in range(2 if run > 1 else 1):
                        _move(order, trial, i, run, j, back == 1)
                        new = tour_cost(trial, *facts)
                        done += 1
                        if new < cost - 1e-6:
                            order[:] = trial
                            cost, improved = new, True
        for i in range(n - 1):
            for j in range(i + 1, n):
                if done >= work:
                    break
                trial[:] = order
                trial[i], trial[j] = order[j], order[i]
                new = tour_cost(trial, *facts)
                done += 1
                if new < cost - 1e-6:
                    order[:] = trial
                    cost, improved = new, True
                trial[:] = order
                for k in range(j - i + 1):
                    trial[i + k] = order[j - k]
                new = tour_cost(trial, *facts)
                done += 1
                if new < cost - 1e-6:
                    order[:] = trial
                    cost, improved = new, True
    return cost, done


@kernel
def _move(order: IntArray, trial: IntArray, i: int, run: int, j: int, back: bool) -> None:
    """Write into ``trial`` the order with ``run`` elements from ``i`` taken out and put in at ``j`` of the rest."""
    n = order.shape[0]
    at, rest = 0, 0
    for k in range(n):
        if at == j:
            for m in range(run):
                trial[at] = order[i + run - 1 - m] if back else order[i + m]
                at += 1
        if k < i or k >= i + run:
            trial[at] = order[k]
            at += 1
            rest += 1
    if at == j:
        for m in range(run):
            trial[at] = order[i + run - 1 - m] if back else order[i + m]
            at += 1


@kernel
def insert_all(
    order: IntArray,
    missing: IntArray,
    start_s: FloatArray,
    between_s: FloatArray,
    value: FloatArray,
    known: float,
    shares: FloatArray,
    weights: FloatArray,
    price_s: float,
    left_s: float,
    first: IntArray,
    keep_s: float,
) -> IntArray:
    """Return tours with the missing targets put in one after the other, each where it costs least."""
    robots, count = start_s.shape
    arrive = np.empty((robots, count + 1))
    facts = (start_s, between_s, value, known, shares, weights, price_s, left_s, first, keep_s, arrive)
    now = order.copy()
    for m in range(missing.shape[0]):
        n = now.shape[0]
        best, cost = 0, np.inf
        trial = np.empty(n + 1, dtype=np.int64)
        for j in range(n + 1):
            trial[:j], trial[j], trial[j + 1 :] = now[:j], missing[m], now[j:]
            new = tour_cost(trial, *facts)
            if new < cost:
                best, cost = j, new
        after = np.empty(n + 1, dtype=np.int64)
        after[:best], after[best], after[best + 1 :] = now[:best], missing[m], now[best:]
        now = after
    return now
