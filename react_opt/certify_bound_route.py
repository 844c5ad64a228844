"""The most that one robot can be worth once it pays the prices of a certificate: a plain dynamic programme.

It runs over instants, cells, memories and cut states, and shares nothing with the solver that made the claim: the
motion, the battery and the rewards are stated again, on purpose.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.certify_bound_charge import Charging
from react_opt.instance import OrosInstance, OrosRobot

Floats = NDArray[np.float64]
Words = NDArray[np.uint64]
Rests = list[tuple[float, Floats]]
NEVER = -np.inf
ONE = np.uint64(1)
MARGIN = 1e-9
UNREACHED = 10**6  # more steps than a horizon has


class States(NamedTuple):
    """Partial routes in one cell at one instant: value after prices, memory, cut states, energy used."""

    value: Floats
    memory: Words
    cuts: Words
    used_j: Floats


class Prices(NamedTuple):
    """Prices of a certificate, in the words of the instance.

    ``potential``, ``(n_cells,)`` or empty, are prices that bound the rest of a route alone, where all is remembered: it
    is worth no more than it would be at these prices, and those of the cells that are left.
    """

    cell: Floats
    memory: list[list[int]]
    cut_cells: list[set[int]]
    cut_memory: list[set[int]]
    cut_price: list[float]
    stand: dict[tuple[int, int], float]
    sense: dict[int, float]
    slot: dict[tuple[int, int], float]
    rows_worth: float
    potential: Floats


class Moves(NamedTuple):
    """Arcs by the cell they leave: (to, steps, energy)."""

    out: list[list[tuple[int, int, float]]]
    idle_j: float
    sense_j: float


def lowest_prices(instance: OrosInstance, must: NDArray[np.bool_]) -> Floats:
    """Return ``(n_cells,)`` the least price that counts of each cell: below 0 for those collected in any case alone.

    Far below minus the value of any plan nothing would be left of values beside prices: `MARGIN` grows with them.
    """
    most = instance.horizon_steps * sum(cell.weight for cell in instance.cells)
    most += instance.sigma * sum(robot.capacity_j for robot in instance.robots)
    return np.where(must, -100.0 * (1.0 + most), 0.0)


def moves_of(instance: OrosInstance, robot: OrosRobot) -> Moves:
    """Return the moves of a robot."""
    index = {cell.id: i for i, cell in enumerate(instance.cells)}
    moves = Moves([[] for _ in index], robot.idle_w * instance.step_s, robot.sensing_w * instance.step_s)
    for arc in instance.travel:
        moves.out[index[arc.from_]].append((index[arc.to], arc.steps, arc.energy_j))
    return moves


def gains(
    instance: OrosInstance,
    prices: Prices,
    robot: OrosRobot,
    first: NDArray[np.int64],
    last_of: NDArray[np.int64],
    *,
    charges: bool = False,
) -> Floats:
    """Return ``(T + 1, n)``: what sensing is worth after prices; minus infinity where it is out of the question.

    A best plan leaves out what costs more than it earns before prices, so that is not priced either; but for a
    robot that charges, which may get for nothing what sensing costs.
    """
    last = instance.horizon_steps
    weight = np.array([0.0 if cell.explored else cell.weight for cell in instance.cells])
    deadline = np.array(
        [last if cell.deadline_step is None else min(cell.deadline_step, last) for cell in instance.cells]
    )
    instant = np.arange(last + 1)[:, None]
    earned = weight * (deadline - instant + 1) - instance.sigma * robot.sensing_w * instance.step_s
    sense = np.zeros(last + 1)
    sense[list(prices.sense)] = list(prices.sense.values())
    open_now = (instant >= max(1, robot.start_step)) & (instant <= deadline) & (weight > 0) & ((earned > 0) | charges)
    open_now &= (instant >= first) & (instant <= last_of)
    return np.where(open_now, earned - prices.cell - sense[:, None], NEVER)


def distances(moves: Moves, cell: int, targets: list[int]) -> NDArray[np.int64]:
    """Return the fewest steps from a cell to others, at least 1 (a cell cannot be sensed anew at once)."""
    known, missing = {cell: 0}, set(targets)
    queue = [(0, cell)]
    while queue and missing:
        distance, i = heapq.heappop(queue)
        if distance > known[i]:
            continue
        missing.discard(i)
        for j, steps, _ in moves.out[i]:
            if distance + steps < known.get(j, UNREACHED):
                known[j] = distance + steps
                heapq.heappush(queue, (distance + steps, j))
    return np.array([max(1, known.get(target, UNREACHED)) for target in targets], dtype=np.int64)


def can_run_dry(instance: OrosInstance, robot: OrosRobot, moves: Moves, budget: float) -> bool:
    """Return whether the battery could limit a robot: moving at the highest power and sensing at each instant."""
    power = max([moves.idle_j, *(energy / d for out in moves.out for _, d, energy in out)])
    last = instance.horizon_steps
    senses = min(len(instance.cells), last - max(1, robot.start_step) + 1)
    return bool(power * (last - robot.start_step) + moves.sense_j * senses > budget)


def rests_of(
    instance: OrosInstance,
    robot: OrosRobot,
    prices: Prices,
    moves: Moves,
    gain: Floats,
    end: int | None,
    joule_price: float,
    charging: Charging | None = None,
) -> Rests:
    """Return bounds without memory on the rest of a route, each with the price of a joule at which it holds.

    With chargers one of them takes the battery to be full at the end: its price of a joule is minus sigma.
    """
    rates = [0.0, joule_price] if joule_price > 0 else [0.0]
    rates += [] if charging is None else [-instance.sigma]
    return [(rate, _rest(instance, robot, prices, moves, gain, end, rate, charging)) for rate in rates]


def _rest(
    instance: OrosInstance,
    robot: OrosRobot,
    prices: Prices,
    moves: Moves,
    gain: Floats,
    end: int | None,
    rate: float,
    charging: Charging | None,
) -> Floats:
    """Return ``(T + 1, n)``: most that is earned from an arrival on, without memory, each joule costing ``rate``.

    Joules charged earn as much as others cost, whether there is room for them or not.
    """
    n, last = len(instance.cells), instance.horizon_steps
    joule = instance.sigma + rate
    arc_from = np.array([i for i in range(n) for _ in moves.out[i]], dtype=np.int64)
    arc_to = np.array([j for i in range(n) for j, _, _ in moves.out[i]], dtype=np.int64)
    steps = np.array([d for i in range(n) for _, d, _ in moves.out[i]], dtype=np.int64)
    energy = np.array([q for i in range(n) for _, _, q in moves.out[i]])
    rest = np.full((last + 1, n), NEVER)
    rest[last] = 0.0 if end is None else NEVER
    if end is not None:
        rest[last, end] = 0.0
    entry = np.zeros((last + 1, n))
    for (t, i), price in prices.stand.items():
        entry[t, i] = price
    credit = np.zeros((last + 1, n))
    if charging is not None:
        credit[:] = joule * charging.amount
        for (t, i), price in prices.slot.items():
            credit[t, i] = max(0.0, credit[t, i] - price)
    for t in range(last, robot.start_step - 1, -1):
        if t < last:
            rest[t] = rest[t + 1] - entry[t + 1] - joule * moves.idle_j + credit[t + 1]
            fits = t + steps <= last
            there = rest[t + steps[fits], arc_to[fits]] - entry[t + steps[fits], arc_to[fits]]
            np.maximum.at(rest[t], arc_from[fits], there - joule * energy[fits])
        rest[t] += np.maximum(0.0, gain[t] - rate * moves.sense_j)
    return rest


def sensed(states: States, cell: int, gain: float, sense_j: float, prices: Prices) -> States:
    """Return the states and, where the cell is not remembered, their twins that collect it."""
    if gain == NEVER:
        return states
    bit = ONE << np.uint64(prices.memory[cell].index(cell))
    fresh = pick(states, (states.memory & bit) == 0)
    value, cuts = fresh.value + gain, fresh.cuts
    for k, cells in enumerate(prices.cut_cells):
        if cell in cells:
            mark = ONE << np.uint64(k)
            value = value - prices.cut_price[k] * ((cuts & mark) != 0)
            cuts = cuts ^ mark
    twins = States(value, fresh.memory | bit, cuts, fresh.used_j + sense_j)
    return joined([states, twins])


def remembered(memory: Words, here: list[int], there: list[int]) -> Words:
    """Return memories carried from one place to another: what is remembered in both."""
    if here == there:
        return memory
    position = {cell: k for k, cell in enumerate(there)}
    carried = np.zeros_like(memory)
    for k, cell in enumerate(here):
        if cell in position:
            carried |= ((memory >> np.uint64(k)) & ONE) << np.uint64(position[cell])
    return carried


def cut_mask(prices: Prices, cell: int) -> np.uint64:
    """Return the cuts whose state survives in a cell."""
    mask = 0
    for k, cells in enumerate(prices.cut_memory):
        if cell in cells:
            mask |= 1 << k
    return np.uint64(mask)


def pick(states: States, keep: NDArray[np.bool_] | NDArray[np.int64]) -> States:
    """Return some of the states."""
    return States(states.value[keep], states.memory[keep], states.cuts[keep], states.used_j[keep])


def joined(parts: list[States]) -> States:
    """Return several batches of states as one."""
    return States(
        np.concatenate([part.value for part in parts]),
        np.concatenate([part.memory for part in parts]),
        np.concatenate([part.cuts for part in parts]),
        np.concatenate([part.used_j for part in parts]),
    )
