"""Tours of a fleet through targets of known worth: coverage early, and all of it soon.

The tours minimise a weighted sum of the times at which the expected coverage reaches certain shares of the whole, and
of the end. That weighs the first square metres against the last ones: a small region on the way is taken along where
coming back for it costs more than what waits. The end comes when going on costs more than what is left behind is worth,
at a price per unit of worth: a visit is made in passing if the time that it costs is less than its price, however much
of the whole is still to come, and nothing is planned for the sake of crumbs. All robots are planned together.

What is seen of other targets on a way counts, whoever drives it; a target of which little is left by the time that its
turn comes is passed over.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Tasks(NamedTuple):
    """What there is to visit, and how long the ways take."""

    start_s: FloatArray
    """``(R, K)`` s from robots to targets."""
    between_s: FloatArray
    """``(K, K)`` s between targets."""
    at_first: FloatArray
    """``(R, K, K)`` which share of each target has been seen when a robot has come to a target; of that one, all."""
    on_way: FloatArray
    """``(K, K, K)`` which share of each target is seen on the way between two, both ends included."""
    value: FloatArray
    """``(K,)`` worth of each target."""
    known: float
    """What is covered already, in the same unit."""
    shares: FloatArray
    """Shares of all there is, increasing, whose times count."""
    weights: FloatArray
    """What each second until they are reached costs."""
    price_s: float
    """What it costs to leave a unit of worth behind at the end, s."""
    left_s: float
    """Time left; what is visited later counts as missed."""
    first: IntArray
    """``(R,)`` target that each robot is on its way to (-1: none)."""
    keep_s: float
    """What turning away from it costs."""


END = 3.0
"""Weight of the end."""
SEEN = 0.25
"""A target of which no more than this share is unseen is not driven to."""
MISSED_S = 300.0
"""What it costs to reach nothing of the whole in time, s; of a part of it as much less."""


@kernel
def tour_cost(order: IntArray, tasks: Tasks, unseen: FloatArray) -> float:
    """Return the cost of tours, s.

    Parameters
    ----------
    order
        Targets in order of visit, robot after robot, with -1 between robots.
    tasks
        What there is to visit.
    unseen
        ``(K,)`` scratch space.
    """
    value, known, price_s, left_s = tasks.value, tasks.known, tasks.price_s, tasks.left_s
    shares, weights = tasks.shares, tasks.weights
    robots, count = tasks.start_s.shape
    unseen[:] = 1.0
    total = known
    for k in range(count):
        total += value[k]
    covered, step = known, 0
    while step < shares.shape[0] and covered >= shares[step] * total - 1e-9:
        step += 1
    cursor, clock = np.zeros(robots, dtype=np.int64), np.full(robots, np.inf)
    last, driven = np.full(robots, -1, dtype=np.int64), np.zeros(robots)
    robot = 0
    for n in range(order.shape[0]):
        if order[n] < 0:
            robot += 1
            cursor[robot] = n + 1
    for r in range(robots):
        n = cursor[r]
        if n < order.shape[0] and order[n] >= 0:
            clock[r] = tasks.start_s[r, order[n]]
            if tasks.first[r] >= 0 and tasks.first[r] != order[n]:
                clock[r] += tasks.keep_s
    cost, spread, missed = 0.0, 0.0, 0.0
    end = price_s * (total - covered)
    while True:
        r, when = 0, clock[0]
        for q in range(1, robots):
            if clock[q] < when:
                r, when = q, clock[q]
        if when == np.inf:
            break
        k = order[cursor[r]]
        shown = tasks.at_first[r, k] if last[r] < 0 else tasks.on_way[last[r], k]
        gain = 0.0
        for m in range(count):
            if unseen[m] > 1.0 - shown[m]:
                gain += value[m] * (unseen[m] - (1.0 - shown[m]))
                unseen[m] = 1.0 - shown[m]
        last[r], driven[r] = k, when
        covered += gain
        spread += when * gain
        if when > left_s:
            missed += gain
        end = min(end, when + price_s * (total - covered))
        while step < shares.shape[0] and covered >= shares[step] * total - 1e-9:
            cost += weights[step] * when
            step += 1
        n = cursor[r] + 1
        while n < order.shape[0] and order[n] >= 0 and unseen[order[n]] <= SEEN:
            n += 1
        cursor[r] = n
        clock[r] = np.inf if n == order.shape[0] or order[n] < 0 else when + tasks.between_s[k, order[n]]
    for n in range(step, shares.shape[0]):  # a share that is missed by what is passed over comes with the end
        cost += weights[n] * driven.max()
    cost += END * end + MISSED_S * missed / (total + 1e-9)
    length = 0.0
    for r in range(robots):
        length += min(driven[r], 2.0 * left_s)
    return cost + 0.02 * length + 0.2 * spread / (total - known + 1e-9)


def better_tours(kept: IntArray, tasks: Tasks, work: int, margin_s: float) -> list[list[int]]:
    """Return each robot's targets in new tours, or in those kept where the new ones are hardly better.

    Parameters
    ----------
    kept
        Tours, as for :func:`tour_cost`.
    tasks
        What there is to visit.
    work
        Most evaluations in looking for new tours.
    margin_s
        New tours must cost so much less, s: a change of mind costs turning and braking. Where a robot has nothing to
        do in the tours kept, new ones are taken in any case.
    """
    order, cost = plan_tours(kept, tasks, work)
    last = _split(kept)
    if all(last) and cost > tour_cost(kept, tasks, np.empty(len(tasks.value))) - margin_s:
        return last
    return _split(order)


def _split(order: IntArray) -> list[list[int]]:
    """Return the tours, robot by robot."""
    tours: list[list[int]] = [[]]
    for k in order.tolist():
        if k < 0:
            tours.append([])
        else:
            tours[-1].append(k)
    return tours


@kernel
def plan_tours(begin: IntArray, tasks: Tasks, work: int) -> tuple[IntArray, float]:
    """Return tours and their cost, by local search from given ones: deterministic, and limited by counted work.

    Moves: a run of up to three targets goes elsewhere, forwards or backwards; two targets change places; a stretch
    is driven backwards; the ends of two robots' tours are exchanged (a separator moves). The first move that helps
    is taken. What work is left goes into shaking the best tours and descending again.

    Parameters
    ----------
    begin
        Tours to start from, as for :func:`tour_cost`: every target once and R - 1 separators.
    tasks
        What there is to visit.
    work
        Most evaluations.
    """
    unseen = np.empty(len(tasks.value))
    best = begin.copy()
    best_cost, done = _descend(best, tasks, unseen, work)
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
        cost, used = _descend(order, tasks, unseen, work - done)
        done += used + 1
        if cost < best_cost - 1e-6:
            best[:] = order
            best_cost = cost
    return best, best_cost


@kernel
def _descend(order: IntArray, tasks: Tasks, unseen: FloatArray, work: int) -> tuple[float, int]:
    """Improve tours in place until no move helps or the work is used up; return their cost, and the work done."""
    n = order.shape[0]
    trial = np.empty(n, dtype=np.int64)
    cost = tour_cost(order, tasks, unseen)
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
                        new = tour_cost(trial, tasks, unseen)
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
                new = tour_cost(trial, tasks, unseen)
                done += 1
                if new < cost - 1e-6:
                    order[:] = trial
                    cost, improved = new, True
                trial[:] = order
                for k in range(j - i + 1):
                    trial[i + k] = order[j - k]
                new = tour_cost(trial, tasks, unseen)
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
def insert_all(order: IntArray, missing: IntArray, tasks: Tasks) -> IntArray:
    """Return tours with the missing targets put in one after the other, each where it costs least."""
    unseen = np.empty(len(tasks.value))
    now = order.copy()
    for m in range(missing.shape[0]):
        n = now.shape[0]
        best, cost = 0, np.inf
        trial = np.empty(n + 1, dtype=np.int64)
        for j in range(n + 1):
            trial[:j], trial[j], trial[j + 1 :] = now[:j], missing[m], now[j:]
            new = tour_cost(trial, tasks, unseen)
            if new < cost:
                best, cost = j, new
        after = np.empty(n + 1, dtype=np.int64)
        after[:best], after[best], after[best + 1 :] = now[:best], missing[m], now[best:]
        now = after
    return now
