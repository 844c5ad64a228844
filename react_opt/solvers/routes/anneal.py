"""Simulated annealing over sequences: ruin and recreate by strings of cells, and exchanges of whole segments.

The ruin removes short strings of cells around a random cell from several robots, and the recreation inserts them
(and cells nobody senses) one by one where they add most, as in slack induction by string removals (Christiaens
and Vanden Berghe, 2020). Segment moves make one cell follow another by reversing, moving or swapping tails, as in
local search for minimum latency problems. Every move is valued by reading the changed sequences in full, so any
reward profile works.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.solvers.routes.problem import FloatArray, IntArray
from react_opt.solvers.routes.sequences import Steps

Order = NDArray[np.int32]
_DELAYS = 8  # delays whose loss is tabulated
_RUIN_SHARE = 0.08  # share of iterations that ruin and recreate; they cost some fifty times as much
_BLINK = 0.02
_STRING = 10  # longest string removed


@kernel(nogil=True)
def draw(state: NDArray[np.uint64]) -> float:
    """Next uniform number in [0, 1) of a xorshift generator whose state is ``(1,)`` and not zero."""
    x = state[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    state[0] = x
    uniform: float = (x * np.uint64(2685821657736338717) >> np.uint64(11)) / 9007199254740992.0
    return uniform


@kernel(nogil=True)
def read(
    r: int,
    order: Order,
    lengths: IntArray,
    arrival: Steps,
    owner: Order,
    horizon: int,
    reward: FloatArray,
    sigma: float,
    steps: Steps,
    energy_j: FloatArray,
    whole: IntArray,
    joules: FloatArray,
) -> float:
    """Read the sequence of robot r: drop what it cannot serve, set arrivals and owners, return its value.

    The value is coverage less sigma times all the energy spent until the horizon.

    Parameters
    ----------
    r
        Robot.
    order, lengths, arrival, owner
        State: ``(n_robots, n_cells)`` sequences, their lengths, arrivals; ``(n_cells,)`` robot of each cell or -1.
    horizon, reward, sigma
        See `RouteProblem`.
    steps, energy_j, whole, joules
        See `SequenceModel`.
    """
    at, t, back = whole[r, 0], whole[r, 1], whole[r, 2]
    spare_j, wait_j, sense_j = joules[r, 0], joules[r, 1], joules[r, 2]
    spent, value, kept = 0.0, 0.0, 0
    for k in range(lengths[r]):
        cell = order[r, k]
        then = t + steps[at, cell]
        idle = 0.0
        if then < 1:
            then, idle = 1, wait_j
        owner[cell] = -1
        if then > horizon:
            continue
        earned = reward[cell, then] - sigma * sense_j
        if reward[cell, then] <= 0.0 or earned <= 0.0:
            continue
        after = spent + energy_j[at, cell] + idle + sense_j
        rest = horizon - then
        if back >= 0:
            rest -= steps[cell, back]
            if rest < 0:
                continue
            if after + energy_j[cell, back] + rest * wait_j > spare_j:
                continue
        elif after + rest * wait_j > spare_j:
            continue
        owner[cell] = r
        order[r, kept] = cell
        arrival[r, kept] = then
        kept += 1
        value += reward[cell, then]
        spent, at, t = after, cell, then
    lengths[r] = kept
    rest = horizon - t
    if back >= 0:
        spent += energy_j[at, back]
        rest -= steps[at, back]
    return value - sigma * (spent + rest * wait_j)


@kernel(nogil=True)
def _tabulate(
    r: int, order: Order, lengths: IntArray, arrival: Steps, horizon: int, reward: FloatArray, loss: FloatArray
) -> None:
    """``loss[r, k, d]``: coverage lost when everything from position k on comes d steps later."""
    length = lengths[r]
    for d in range(loss.shape[2]):
        total = 0.0
        loss[r, length, d] = 0.0
        for k in range(length - 1, -1, -1):
            cell, t = order[r, k], arrival[r, k]
            total += reward[cell, t]
            if t + d <= horizon and reward[cell, t + d] > 0.0:
                total -= reward[cell, t + d]
            loss[r, k, d] = total


@kernel(nogil=True)
def _insert(
    cell: int,
    order: Order,
    lengths: IntArray,
    arrival: Steps,
    horizon: int,
    reward: FloatArray,
    sigma: float,
    steps: Steps,
    back_steps: Steps,
    energy_j: FloatArray,
    whole: IntArray,
    joules: FloatArray,
    loss: FloatArray,
    state: NDArray[np.uint64],
) -> int:
    """Insert a cell where it adds most (positions are missed now and then); the robot, or -1 if nowhere."""
    best, best_r, best_k = 0.0, -1, -1
    top = loss.shape[2] - 1
    for r in range(len(lengths)):
        length = lengths[r]
        at, t = whole[r, 0], whole[r, 1]
        wait_j, sense_j = joules[r, 1], joules[r, 2]
        for k in range(length + 1):
            if k > 0:
                at, t = order[r, k - 1], arrival[r, k - 1]
            then = max(1, t + back_steps[cell, at])
            if then > horizon:
                continue
            gain = reward[cell, then] - sigma * sense_j
            if gain <= best:
                continue
            delay = 0
            if k < length:
                delay = then + steps[cell, order[r, k]] - arrival[r, k]
                if delay <= top:
                    gain -= loss[r, k, delay]
                else:
                    gain -= loss[r, k, top]
                    if gain <= best:
                        continue
                    gain += loss[r, k, top]
                    for q in range(k, length):
                        other, late = order[r, q], arrival[r, q] + delay
                        gain -= reward[other, arrival[r, q]]
                        if late <= horizon and reward[other, late] > 0.0:
                            gain += reward[other, late]
                if gain <= best:
                    continue
                following = order[r, k]
                added = energy_j[at, cell] + energy_j[cell, following] - energy_j[at, following] - delay * wait_j
                gain -= sigma * added
            else:
                gain -= sigma * (energy_j[at, cell] - (then - t) * wait_j)
            if gain > best and draw(state) >= _BLINK:
                best, best_r, best_k = gain, r, k
    if best_r >= 0:
        for k in range(lengths[best_r], best_k, -1):
            order[best_r, k] = order[best_r, k - 1]
        order[best_r, best_k] = cell
        lengths[best_r] += 1
    return best_r


@kernel(nogil=True)
def _ruin(
    order: Order,
    lengths: IntArray,
    arrival: Steps,
    owner: Order,
    near: Order,
    removed: Order,
    touched: NDArray[np.bool_],
    state: NDArray[np.uint64],
) -> int:
    """Take strings out around a random cell, unserved cells nearby too; returns how many ``removed`` now holds."""
    n_cells = len(owner)
    seed = int(draw(state) * n_cells)
    most = _STRING if draw(state) < 0.9 else 3 * _STRING
    strings = 1 + int(draw(state) * 4.0)
    wish = 1 + int(draw(state) * 10.0)
    count, taken, extra = 0, 0, 0
    for position in range(-1, near.shape[1]):
        cell = seed if position < 0 else near[seed, position]
        if cell < 0:
            break
        r = owner[cell]
        if r == -1:
            if extra < wish:
                removed[count] = cell
                owner[cell] = -2  # in hand
                count += 1
                extra += 1
            continue
        if r < 0 or taken >= strings or touched[r]:
            continue
        touched[r] = True
        taken += 1
        where = 0
        while order[r, where] != cell:
            where += 1
        size = min(1 + int(draw(state) * most), lengths[r])
        first = max(0, min(where - int(draw(state) * size), lengths[r] - size))
        for k in range(first, first + size):
            removed[count] = order[r, k]
            owner[order[r, k]] = -2
            count += 1
        for k in range(first, lengths[r] - size):
            order[r, k] = order[r, k + size]
        lengths[r] -= size
    return count


@kernel(nogil=True)
def _segment_move(
    order: Order,
    lengths: IntArray,
    owner: Order,
    near: Order,
    touched: NDArray[np.bool_],
    spare: Order,
    state: NDArray[np.uint64],
    old_order: Order,
) -> bool:
    """Make a random cell follow one near it, by one of several moves; False when there is none to make.

    The sequences it changes are marked in ``touched`` and kept in ``old_order``.
    """
    n_cells = len(owner)
    b = int(draw(state) * n_cells)
    reach = min(near.shape[1], 12)
    a = near[b, int(draw(state) * reach)]
    if a < 0:
        return False
    rb, ra = owner[b], owner[a]
    if ra < 0 or rb < 0:
        return False
    ia, ib = 0, 0
    while order[ra, ia] != a:
        ia += 1
    while order[rb, ib] != b:
        ib += 1
    for r in (ra, rb):
        touched[r] = True
        for k in range(lengths[r]):
            old_order[r, k] = order[r, k]
    kind = draw(state)
    if ra != rb and kind < 0.4:  # swap tails: a is followed by b and what comes after it
        tail_a, tail_b = lengths[ra] - ia - 1, lengths[rb] - ib
        for k in range(tail_a):
            spare[k] = order[ra, ia + 1 + k]
        for k in range(tail_b):
            order[ra, ia + 1 + k] = order[rb, ib + k]
        for k in range(tail_a):
            order[rb, ib + k] = spare[k]
        lengths[ra], lengths[rb] = ia + 1 + tail_b, ib + tail_a
        return True
    if ra == rb and kind < 0.4:  # reverse what lies between
        low, high = (ia + 1, ib) if ia < ib else (ib, ia - 1)
        if low >= high:
            return False
        while low < high:
            order[ra, low], order[ra, high] = order[ra, high], order[ra, low]
            low += 1
            high -= 1
        return True
    # Move a string that begins (or, reversed, ends) with b behind a.
    size = 1 + int(draw(state) * draw(state) * 30.0)
    flip = draw(state) < 0.3
    if flip:
        first = max(0, ib - size + 1)
        size = ib - first + 1
    else:
        first = ib
        size = min(size, lengths[rb] - ib)
    if ra == rb and first <= ia < first + size:
        return False
    for k in range(size):
        spare[k] = order[rb, first + size - 1 - k] if flip else order[rb, first + k]
    for k in range(first, lengths[rb] - size):
        order[rb, k] = order[rb, k + size]
    lengths[rb] -= size
    if ra == rb and ia > first:
        ia -= size
    for k in range(lengths[ra] - 1, ia, -1):
        order[ra, k + size] = order[ra, k]
    for k in range(size):
        order[ra, ia + 1 + k] = spare[k]
    lengths[ra] += size
    return True


@kernel(nogil=True)
def anneal(
    order: Order,
    lengths: IntArray,
    best_order: Order,
    best_lengths: IntArray,
    best: float,
    hot: float,
    cold: float,
    iterations: int,
    state: NDArray[np.uint64],
    horizon: int,
    reward: FloatArray,
    sigma: float,
    steps: Steps,
    back_steps: Steps,
    energy_j: FloatArray,
    near: Order,
    whole: IntArray,
    joules: FloatArray,
) -> float:
    """Anneal for some iterations from ``hot`` to ``cold``; the value of the best sequences seen is returned.

    Parameters
    ----------
    order, lengths
        Current sequences, changed in place.
    best_order, best_lengths, best
        Best sequences so far and their value, changed in place when beaten.
    hot, cold
        Temperatures, in units of the objective.
    iterations
        Moves to try.
    state
        Random state (`draw`).
    horizon, reward, sigma
        See `RouteProblem`.
    steps, energy_j, near, whole, joules
        See `SequenceModel`; ``back_steps`` is ``steps`` transposed.
    """
    robots, n_cells = order.shape
    arrival = np.zeros((robots, n_cells), dtype=np.int32)
    owner = np.full(n_cells, -1, dtype=np.int32)
    old_order, old_lengths = order.copy(), lengths.copy()
    old_arrival = arrival.copy()
    values, old_values = np.zeros(robots), np.zeros(robots)
    touched = np.zeros(robots, dtype=np.bool_)
    spare = np.empty(n_cells, dtype=np.int32)
    removed = np.empty(n_cells, dtype=np.int32)
    keys = np.empty(n_cells)
    loss = np.empty((robots, n_cells + 1, _DELAYS))
    for r in range(robots):
        values[r] = read(r, order, lengths, arrival, owner, horizon, reward, sigma, steps, energy_j, whole, joules)
    current = values.sum()
    if current > best:
        best = current
        best_order[:] = order
        best_lengths[:] = lengths
    for iteration in range(iterations):
        heat = hot * (cold / hot) ** (iteration / iterations)
        old_values[:] = values
        touched[:] = False
        old_lengths[:] = lengths
        if draw(state) >= _RUIN_SHARE:
            moved = _segment_move(order, lengths, owner, near, touched, spare, state, old_order)
            if moved:
                for r in range(robots):
                    if touched[r]:
                        old_arrival[r, : old_lengths[r]] = arrival[r, : old_lengths[r]]
                for r in range(robots):
                    if touched[r]:
                        values[r] = read(
                            r, order, lengths, arrival, owner, horizon, reward, sigma, steps, energy_j, whole, joules
                        )  # fmt: skip
            else:
                continue
        else:
            for r in range(robots):
                old_order[r, : lengths[r]] = order[r, : lengths[r]]
                old_arrival[r, : lengths[r]] = arrival[r, : lengths[r]]
            count = _ruin(order, lengths, arrival, owner, near, removed, touched, state)
            for r in range(robots):
                if touched[r]:
                    values[r] = read(
                        r, order, lengths, arrival, owner, horizon, reward, sigma, steps, energy_j, whole, joules
                    )  # fmt: skip
                _tabulate(r, order, lengths, arrival, horizon, reward, loss)
            way = draw(state)
            for k in range(count):
                cell = removed[k]
                if way < 0.6:
                    keys[k] = draw(state)
                elif way < 0.8:
                    keys[k] = steps[whole[0, 0], cell]
                else:
                    keys[k] = -float(steps[whole[0, 0], cell])
            for index in np.argsort(keys[:count], kind="mergesort"):
                cell = removed[index]
                owner[cell] = -1
                r = _insert(
                    cell, order, lengths, arrival, horizon, reward, sigma, steps, back_steps, energy_j, whole,
                    joules, loss, state,
                )  # fmt: skip
                if r >= 0:
                    touched[r] = True
                    values[r] = read(
                        r, order, lengths, arrival, owner, horizon, reward, sigma, steps, energy_j, whole, joules
                    )  # fmt: skip
                    _tabulate(r, order, lengths, arrival, horizon, reward, loss)
        total = values.sum()
        if total > current + heat * np.log(1.0 - draw(state)):
            current = total
            if current > best + 1e-9 * abs(best):
                best = current
                best_order[:] = order
                best_lengths[:] = lengths
            continue
        for r in range(robots):  # undo
            if touched[r]:
                for k in range(lengths[r]):
                    owner[order[r, k]] = -1
        for r in range(robots):
            if touched[r]:
                lengths[r] = old_lengths[r]
                for k in range(lengths[r]):
                    order[r, k] = old_order[r, k]
                    arrival[r, k] = old_arrival[r, k]
                    owner[order[r, k]] = r
                values[r] = old_values[r]
    return best
