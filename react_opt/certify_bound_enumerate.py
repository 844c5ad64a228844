"""Bounds that rest on enumeration, computed again: every route that a better plan can hold.

A plain dynamic programme over exact sets of cells keeps the best route of each set (see `certify_bound_choice` for why
these suffice). A route counts as ended, by the way of least energy, with its last collection, so what has passed on
has to collect something more.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.certify_bound_route import (
    MARGIN,
    NEVER,
    ONE,
    Floats,
    Moves,
    Prices,
    States,
    Words,
    can_run_dry,
    cut_mask,
    distances,
    gains,
    joined,
    moves_of,
    pick,
    remembered,
    rests_of,
    sensed,
)
from react_opt.errors import UsageError
from react_opt.instance import OrosInstance, OrosRobot

MOST_BEGINNINGS = 50_000_000  # of routes; some minutes
REMEMBERED = 8  # cells that the rest of a route remembers at each place, for a bound on it


class Found(NamedTuple):
    """Routes: the cells each collects (64 to a word), its worth after prices, and its value in the objective."""

    sets: Words
    reduced: Floats
    value: Floats


class _Partial(NamedTuple):
    """Partial routes in one place: cells collected, worth after prices, cut prices paid, cut states, energy used."""

    sets: Words
    worth: Floats
    paid: Floats
    cuts: Words
    used_j: Floats


def worthwhile_routes(
    instance: OrosInstance,
    robot: OrosRobot,
    prices: Prices,
    least: float,
    joule_price: float,
    first: NDArray[np.int64],
    last_of: NDArray[np.int64],
) -> Found:
    """Return the best route for each set of cells among those that are worth ``least`` or more after prices.

    Parameters
    ----------
    instance, robot
        The instance, which has no limits between robots, and one of its robots.
    prices
        What the robot pays.
    least
        Worth after prices from which on a route counts.
    joule_price
        Price of a joule at which the battery is relaxed besides.
    first, last_of
        ``(n_cells,)`` instants between which it may collect each cell.

    Raises
    ------
    UsageError
        If there are more beginnings of routes than can be held.
    """
    n, last = len(instance.cells), instance.horizon_steps
    index = {cell.id: i for i, cell in enumerate(instance.cells)}
    moves = moves_of(instance, robot)
    end = None if robot.return_to is None else index[robot.return_to]
    budget = robot.battery_j - robot.reserve_j
    budget += 1e-9 * max(1.0, budget)
    gain = gains(instance, prices, robot, first, last_of)
    constant = instance.sigma * robot.battery_j
    floor = least - constant
    floor -= MARGIN * max(1.0, abs(floor))
    rests = rests_of(instance, robot, prices, moves, gain, end, joule_price)
    least_j = _least_to_end(instance, robot, moves, end)
    behind = _endings(instance, robot, prices, moves, gain, least_j, floor)
    nearby = _nearby(prices, moves)
    limited = can_run_dry(instance, robot, moves, budget)
    words = (n + 63) // 64
    waiting: list[dict[int, list[_Partial]]] = [{} for _ in range(last + 1)]
    none, zero = np.zeros(1, np.uint64), np.zeros(1)
    nowhere = _Partial(np.zeros((1, words), np.uint64), zero, zero, none, zero)
    waiting[robot.start_step][index[robot.start]] = [nowhere]
    ended = [_ended(nowhere, instance.sigma, float(least_j[robot.start_step, index[robot.start]]), budget, floor)]
    known = 0
    for t in range(robot.start_step, last + 1):
        for i, parts in waiting[t].items():
            here = _Partial(*(np.concatenate(column) for column in zip(*parts, strict=True)))
            keep = here.used_j <= budget
            for rate, rest in rests:
                keep &= here.worth + rest[t, i] + rate * (budget - here.used_j) >= floor
            here = _take(here, keep)
            if t > robot.start_step:
                here = _take(here, _completed(here, behind[t].get(i), nearby[i], prices, budget, floor))
            twins = _collected(here, i, gain[t, i], moves.sense_j, prices)
            ended.append(_ended(twins, instance.sigma, float(least_j[t, i]), budget, floor))
            here = _Partial(*(np.concatenate(pair) for pair in zip(here, twins, strict=True)))
            here = _one_per_set(here, limited)
            here = _take(here, here.used_j <= budget)
            known += len(here.worth)
            if known > MOST_BEGINNINGS:
                raise UsageError(
                    f"the certificate rests on routes with more than {MOST_BEGINNINGS} beginnings: too many to be "
                    "enumerated again"
                )
            if len(here.worth) == 0 or t == last:
                continue
            idle = moves.idle_j
            waiting[t + 1].setdefault(i, []).append(
                here._replace(worth=here.worth - instance.sigma * idle, used_j=here.used_j + idle)
            )
            for j, steps, energy in moves.out[i]:
                if t + steps <= last:
                    waiting[t + steps].setdefault(j, []).append(
                        here._replace(
                            worth=here.worth - instance.sigma * energy,
                            cuts=here.cuts & cut_mask(prices, j),
                            used_j=here.used_j + energy,
                        )
                    )
        waiting[t] = {}
    whole = _Partial(*(np.concatenate(column) for column in zip(*ended, strict=True)))
    whole = _one_per_set(whole, limited=False)
    inside = np.unpackbits(whole.sets.view(np.uint8), axis=1, bitorder="little")[:, :n]
    return Found(whole.sets, whole.worth + constant, whole.worth + whole.paid + constant + inside @ prices.cell)


def _nearby(prices: Prices, moves: Moves) -> list[list[int]]:
    """Return for each place the cells of its memory that are nearest to it, itself among them."""
    near = []
    for i, cells in enumerate(prices.memory):
        steps = distances(moves, i, cells)
        others = sorted((int(d), cell) for d, cell in zip(steps, cells, strict=True) if cell != i)
        near.append(sorted([i] + [cell for _, cell in others[: REMEMBERED - 1]]))
    return near


def _endings(
    instance: OrosInstance,
    robot: OrosRobot,
    prices: Prices,
    moves: Moves,
    gain: Floats,
    least_j: Floats,
    floor: float,
) -> list[dict[int, States]]:
    """Return for each instant and place the ways in which a route can collect something more, there included.

    After the last collection it ends with the least energy. They remember the nearest cells only: a relaxation. What
    no beginning could complete to ``floor`` is left out, and so is what another ending beats that remembers no more.
    """
    n, last = len(instance.cells), instance.horizon_steps
    near = _nearby(prices, moves)
    local = prices._replace(memory=near)
    into: list[list[tuple[int, int, float]]] = [[] for _ in range(n)]
    for i in range(n):
        for j, steps, energy in moves.out[i]:
            into[j].append((i, steps, energy))
    past = _beginnings(instance, robot, moves, gain)
    endings: list[dict[int, States]] = [{} for _ in range(last + 1)]
    waiting: list[dict[int, list[States]]] = [{} for _ in range(last + 1)]
    for t in range(last, robot.start_step - 1, -1):
        for i in range(n):
            if past[t, i] == NEVER:
                continue
            parts = waiting[t].get(i, [])
            parts = [sensed(joined(parts), i, gain[t, i], moves.sense_j, local)] if parts else []
            if gain[t, i] > NEVER and least_j[t, i] < np.inf:
                inside = sum(1 << k for k, cells in enumerate(prices.cut_cells) if i in cells)
                parts.append(
                    States(
                        np.array([gain[t, i] - instance.sigma * least_j[t, i]]),
                        np.array([1 << near[i].index(i)], dtype=np.uint64),
                        np.array([inside], dtype=np.uint64),
                        np.array([least_j[t, i] + moves.sense_j]),
                    )
                )
            if not parts:
                continue
            states = joined(parts)
            states = _least_memory(pick(states, states.value + past[t, i] >= floor), prices)
            if len(states.value) == 0:
                continue
            endings[t][i] = states
            if t > robot.start_step:
                waiting[t - 1].setdefault(i, []).append(
                    states._replace(
                        value=states.value - instance.sigma * moves.idle_j, used_j=states.used_j + moves.idle_j
                    )
                )
            for j, steps, energy in into[i]:
                if t - steps >= robot.start_step:
                    waiting[t - steps].setdefault(j, []).append(
                        States(
                            states.value - instance.sigma * energy,
                            remembered(states.memory, near[i], near[j]),
                            states.cuts & cut_mask(prices, j),
                            states.used_j + energy,
                        )
                    )
        waiting[t] = {}
    return endings


def _beginnings(instance: OrosInstance, robot: OrosRobot, moves: Moves, gain: Floats) -> Floats:
    """Return ``(T + 1, n)``: most that is earned before being in a place at an instant, without memory."""
    n, last = len(instance.cells), instance.horizon_steps
    best = np.full((last + 1, n), NEVER)
    start = next(i for i, cell in enumerate(instance.cells) if cell.id == robot.start)
    best[robot.start_step, start] = 0.0
    for t in range(robot.start_step, last):
        after = best[t] + np.maximum(0.0, gain[t])
        best[t + 1] = np.maximum(best[t + 1], after - instance.sigma * moves.idle_j)
        for i in np.flatnonzero(after > NEVER).tolist():
            for j, steps, energy in moves.out[i]:
                if t + steps <= last:
                    best[t + steps, j] = max(best[t + steps, j], after[i] - instance.sigma * energy)
    return best


def _least_to_end(instance: OrosInstance, robot: OrosRobot, moves: Moves, end: int | None) -> Floats:
    """Return ``(T + 1, n)``: least energy from an instant in a place to the end, infinite where there is no way."""
    n, last = len(instance.cells), instance.horizon_steps
    least = np.full((last + 1, n), np.inf)
    least[last] = 0.0 if end is None else np.inf
    if end is not None:
        least[last, end] = 0.0
    for t in range(last - 1, robot.start_step - 1, -1):
        for i in range(n):
            ways = [least[t + steps, j] + energy for j, steps, energy in moves.out[i] if t + steps <= last]
            least[t, i] = min([least[t + 1, i] + moves.idle_j, *ways])
    return least


def _ended(here: _Partial, sigma: float, least_j: float, budget: float, floor: float) -> _Partial:
    """Return the partial routes as whole ones that end with so much energy, if they are worth ``floor``."""
    if least_j == np.inf:
        return _take(here, np.zeros(len(here.worth), dtype=bool))
    ended = here._replace(worth=here.worth - sigma * least_j, used_j=here.used_j + least_j)
    return _take(ended, (ended.worth >= floor) & (ended.used_j <= budget))


def _least_memory(states: States, prices: Prices) -> States:
    """Return the states that no other beats which remembers no more; more odd cuts are bought off."""
    states = pick(states, np.lexsort((states.used_j, -states.value)))
    keep = np.ones(len(states.value), dtype=bool)
    for k in range(len(keep)):
        if not keep[k]:
            continue
        rest = slice(k + 1, None)
        lead = states.value[k] - states.value[rest]
        for cut, price in enumerate(prices.cut_price):
            if (states.cuts[k] >> np.uint64(cut)) & ONE:
                lead = lead - price * (((states.cuts[rest] >> np.uint64(cut)) & ONE) == 0)
        beaten = (lead >= 0.0) & ((states.memory[k] & ~states.memory[rest]) == 0)
        keep[rest] &= ~(beaten & (states.used_j[k] <= states.used_j[rest]))
    return pick(states, keep)


def _completed(
    here: _Partial, endings: States | None, near: list[int], prices: Prices, budget: float, floor: float
) -> NDArray[np.bool_]:
    """Return which partial routes some ending completes to ``floor``."""
    done = np.zeros(len(here.worth), dtype=bool)
    if endings is None:
        return done
    held = np.zeros(len(here.worth), dtype=np.uint64)  # what has been collected of the cells that endings remember
    for k, cell in enumerate(near):
        held |= ((here.sets[:, cell // 64] >> np.uint64(cell % 64)) & ONE) << np.uint64(k)
    for value, memory, cuts, used_j in zip(*endings, strict=True):
        left = np.flatnonzero(~done)
        total = here.worth[left] + value
        left = left[(total >= floor) & ((held[left] & memory) == 0) & (here.used_j[left] + used_j <= budget)]
        total = here.worth[left] + value
        for cut, price in enumerate(prices.cut_price):
            if (cuts >> np.uint64(cut)) & ONE:
                total = total - price * ((here.cuts[left] >> np.uint64(cut)) & ONE)
        done[left[total >= floor]] = True
        if done.all():
            break
    return done


def _collected(here: _Partial, cell: int, gain: float, sense_j: float, prices: Prices) -> _Partial:
    """Return the twins of partial routes that collect a cell, where they have not done so."""
    if gain == NEVER:
        return _take(here, np.zeros(len(here.worth), dtype=bool))
    word, bit = cell // 64, ONE << np.uint64(cell % 64)
    twin = _take(here, (here.sets[:, word] & bit) == 0)
    sets, cuts, due = twin.sets.copy(), twin.cuts, np.zeros(len(twin.worth))
    sets[:, word] |= bit
    for k, cells in enumerate(prices.cut_cells):
        if cell in cells:
            mark = ONE << np.uint64(k)
            due = due + prices.cut_price[k] * ((cuts & mark) != 0)
            cuts = cuts ^ mark
    return _Partial(sets, twin.worth + gain - due, twin.paid + due, cuts, twin.used_j + sense_j)


def _one_per_set(here: _Partial, limited: bool) -> _Partial:
    """Return for each set the most valuable partial route in the plan, and those that use less energy."""
    order = np.lexsort((here.used_j, -(here.worth + here.paid), *here.sets.T))
    here = _take(here, order)
    keep = np.ones(len(order), dtype=bool)
    same = np.all(here.sets[1:] == here.sets[:-1], axis=1)
    if not limited:
        keep[1:] = ~same
        return _take(here, keep)
    least_j = np.inf
    for k, used_j in enumerate(here.used_j.tolist()):
        if k and same[k - 1] and used_j >= least_j:
            keep[k] = False
        else:
            least_j = used_j
    return _take(here, keep)


def _take(here: _Partial, keep: Any) -> _Partial:
    return _Partial(*(column[keep] for column in here))
