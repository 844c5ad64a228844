"""Simulated annealing over sequences: segment moves, and ruin and recreate by strings of cells.

The ruin removes short strings of cells around a random cell from several robots, and the recreation inserts them
(and cells nobody senses) one by one where they add most, as in slack induction by string removals (Christiaens and
Vanden Berghe, 2020).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.moves import (
    Order,
    RandomState,
    State,
    Tables,
    draw,
    join,
    keep,
    read,
    reverse,
    shift,
    skip,
    swap_tails,
)
from react_opt.solvers.routes.ranking import inner, ranking

_DELAYS = 8  # delays whose loss is tabulated
_BLINK = 0.02  # share of positions that an insertion overlooks
_STRING = 10  # longest string usually removed
_REACH = 12  # nearest cells that a segment move chooses from


@inner
def _state(robots: int, n_cells: int) -> State:
    return State(
        np.zeros((robots, n_cells), dtype=np.int32),
        np.zeros(robots, dtype=np.int64),
        np.zeros((robots, n_cells), dtype=np.int32),
        np.zeros(robots),
        np.full(n_cells, -1, dtype=np.int32),
        np.zeros(n_cells, dtype=np.int32),
        np.zeros((robots, n_cells + 1)),
        np.zeros((robots, n_cells + 1)),
        np.zeros(robots),
        np.zeros(robots),
    )


@inner
def _copy(order: Order, lengths: IntArray, to_order: Order, to_lengths: IntArray) -> None:
    for r in range(len(lengths)):
        to_lengths[r] = lengths[r]
        for k in range(lengths[r]):
            to_order[r, k] = order[r, k]


@inner
def _tabulate(r: int, s: State, tables: Tables, loss: FloatArray) -> None:
    """``loss[r, k, d]``: coverage lost when everything from position k on comes d steps later."""
    horizon, reward, length = tables.horizon, tables.reward, s.lengths[r]
    for d in range(loss.shape[2]):
        loss[r, length, d] = 0.0
    for k in range(length - 1, -1, -1):
        cell, t = s.order[r, k], s.arrival[r, k]
        for d in range(loss.shape[2]):
            now = 0.0
            if t + d <= horizon and reward[cell, t + d] > 0.0:
                now = reward[cell, t + d]
            loss[r, k, d] = loss[r, k + 1, d] + reward[cell, t] - now


@inner
def _insert(cell: int, s: State, tables: Tables, loss: FloatArray, random: RandomState) -> int:
    """Insert a cell where it adds most (positions are missed now and then); the robot, or -1 if nowhere."""
    horizon, reward, sigma = tables.horizon, tables.reward, tables.sigma
    steps, back_steps, energy_j = tables.steps[cell], tables.back_steps[cell], tables.energy_j
    best, best_r, best_k = 0.0, -1, -1
    top = loss.shape[2] - 1
    for r in range(len(s.lengths)):
        length = s.lengths[r]
        at, t = tables.whole[r, 0], tables.whole[r, 1]
        wait_j, sense_j = tables.joules[r, 1], tables.joules[r, 2]
        for k in range(length + 1):
            if k > 0:
                at, t = s.order[r, k - 1], s.arrival[r, k - 1]
            then = max(1, t + back_steps[at])
            if then > horizon:
                continue
            gain = reward[cell, then] - sigma * sense_j
            if gain <= best:
                continue
            if k < length:
                following = s.order[r, k]
                delay = then + steps[following] - s.arrival[r, k]
                if gain - loss[r, k, min(delay, top)] <= best:
                    continue
                if delay <= top:
                    gain -= loss[r, k, delay]
                else:
                    for q in range(k, length):
                        other, late = s.order[r, q], s.arrival[r, q] + delay
                        gain -= reward[other, s.arrival[r, q]]
                        if late <= horizon and reward[other, late] > 0.0:
                            gain += reward[other, late]
                        if gain <= best:
                            break
                added = energy_j[at, cell] + energy_j[cell, following] - energy_j[at, following] - delay * wait_j
            else:
                added = energy_j[at, cell] - (then - t) * wait_j
            gain -= sigma * added
            over = added + sense_j - s.slack_j[r]
            if over > 0.0:  # cells at the end will have to go
                gain -= s.joule[r] * over
            if gain > best and draw(random) >= _BLINK:
                best, best_r, best_k = gain, r, k
    if best_r >= 0:
        for k in range(s.lengths[best_r], best_k, -1):
            s.order[best_r, k] = s.order[best_r, k - 1]
        s.order[best_r, best_k] = cell
        s.lengths[best_r] += 1
    return best_r


@inner
def _ruin(s: State, tables: Tables, removed: Order, touched: NDArray[np.bool_], random: RandomState) -> int:
    """Take strings out around a random cell, unserved cells nearby too; returns how many ``removed`` now holds."""
    near = tables.near
    seed = int(draw(random) * len(s.owner))
    longest = _STRING if draw(random) < 0.9 else 3 * _STRING
    strings = 1 + int(draw(random) * 4.0)
    wish = 1 + int(draw(random) * 10.0)
    count, taken, extra = 0, 0, 0
    for place in range(-1, near.shape[1]):
        cell = seed if place < 0 else near[seed, place]
        if cell < 0:
            break
        r = s.owner[cell]
        if r == -1:
            if extra < wish:
                removed[count] = cell
                s.owner[cell] = -2
                count += 1
                extra += 1
            continue
        if r < 0 or taken >= strings or touched[r]:
            continue
        touched[r] = True
        taken += 1
        size = min(1 + int(draw(random) * longest), s.lengths[r])
        first = max(0, min(s.position[cell] - int(draw(random) * size), s.lengths[r] - size))
        for k in range(first, first + size):
            removed[count] = s.order[r, k]
            s.owner[s.order[r, k]] = -2
            count += 1
        for k in range(first, s.lengths[r] - size):
            s.order[r, k] = s.order[r, k + size]
        s.lengths[r] -= size
    return count


@inner
def _recreate(
    s: State, tables: Tables, removed: Order, touched: NDArray[np.bool_], loss: FloatArray, random: RandomState
) -> None:
    """Insert the cells in hand one by one, in an order drawn at random or by distance from the first robot."""
    for r in range(len(s.lengths)):
        if touched[r]:
            read(r, s, tables)
        _tabulate(r, s, tables, loss)
    keys = np.empty(len(removed))
    way = draw(random)
    for k in range(len(removed)):
        far = float(tables.steps[tables.whole[0, 0], removed[k]])
        keys[k] = draw(random) if way < 0.6 else far if way < 0.8 else -far
    for k in ranking(keys):
        cell = removed[k]
        s.owner[cell] = -1
        r = _insert(cell, s, tables, loss, random)
        if r >= 0:
            touched[r] = True
            read(r, s, tables)
            _tabulate(r, s, tables, loss)


@inner
def _segment_move(
    bar: float, s: State, old: State, tables: Tables, touched: NDArray[np.bool_], random: RandomState
) -> bool:
    """Make a random cell follow one near it by one of the moves, unless it looks worse than ``bar``."""
    b = int(draw(random) * len(s.owner))
    a = tables.near[b, int(draw(random) * draw(random) * min(tables.near.shape[1], _REACH))]
    if a < 0 or s.owner[a] < 0:
        return False
    ra, rb = s.owner[a], s.owner[b]
    touched[ra] = True
    if rb < 0:
        return join(a, b, bar, s, old, tables)
    touched[rb] = True
    kind = draw(random)
    if kind < 0.02:
        touched[ra] = ra == rb
        return skip(b, bar, s, old, tables)
    if kind < 0.45:
        if ra != rb:
            return swap_tails(a, b, bar, s, old, tables)
        return reverse(a, b, bar, s, old, tables)
    size = 1 + int(draw(random) * draw(random) * 30.0)
    return shift(a, b, size, draw(random) < 0.4, bar, s, old, tables)


@kernel(nogil=True)
def anneal(
    order: Order,
    lengths: IntArray,
    best_order: Order,
    best_lengths: IntArray,
    best: float,
    heat: float,
    iterations: int,
    ruin_share: float,
    random: RandomState,
    tables: Tables,
) -> float:
    """Anneal for some iterations at one temperature; the value of the best sequences seen is returned.

    Parameters
    ----------
    order, lengths
        Current sequences, changed in place.
    best_order, best_lengths, best
        Best sequences so far and their value, changed in place when beaten.
    heat
        Temperature in units of the objective.
    iterations
        Moves to try.
    ruin_share
        Share of them that ruin and recreate.
    random
        Random state (`draw`).
    tables
        The problem.
    """
    robots, n_cells = order.shape
    s, old = _state(robots, n_cells), _state(robots, n_cells)
    touched = np.zeros(robots, dtype=np.bool_)
    removed = np.empty(n_cells, dtype=np.int32)
    loss = np.empty((robots, n_cells + 1, _DELAYS))
    _copy(order, lengths, s.order, s.lengths)
    current = 0.0
    for r in range(robots):
        read(r, s, tables)
        current += s.values[r]
    if current > best:
        best = current
        _copy(s.order, s.lengths, best_order, best_lengths)
    for _ in range(iterations):
        for r in range(robots):
            touched[r] = False
        bar = heat * np.log(1.0 - draw(random))
        if draw(random) >= ruin_share:
            # The estimate overstates what is lost at the horizon, hence the margin.
            if not _segment_move(1.2 * bar - 1e-9, s, old, tables, touched, random):
                continue
            for r in range(robots):
                if touched[r]:
                    read(r, s, tables)
        else:
            for r in range(robots):
                keep(r, s, old)
            count = _ruin(s, tables, removed, touched, random)
            _recreate(s, tables, removed[:count], touched, loss, random)
        total = 0.0
        for r in range(robots):
            total += s.values[r]
        if total > current + bar:
            current = total
            if current > best + 1e-9 * abs(best):
                best = current
                _copy(s.order, s.lengths, best_order, best_lengths)
            continue
        for r in range(robots):  # undo
            if touched[r]:
                for k in range(s.lengths[r]):
                    s.owner[s.order[r, k]] = -1
        for r in range(robots):
            if touched[r]:
                s.lengths[r] = old.lengths[r]
                for k in range(s.lengths[r]):
                    s.order[r, k] = old.order[r, k]
                read(r, s, tables)
    _copy(s.order, s.lengths, order, lengths)
    return best
