"""The most that one robot can be worth once it pays the prices of a certificate: a plain dynamic programme.

It runs over instants, cells, memories and cut states, and shares nothing with the solver that made the claim: the
motion, the battery and the rewards are stated again, on purpose.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.certify_bound_charge import Charging, charging_of
from react_opt.instance import OrosInstance, OrosRobot

Floats = NDArray[np.float64]
Words = NDArray[np.uint64]
Rests = list[tuple[float, Floats]]
NEVER = -np.inf
ONE = np.uint64(1)
MARGIN = 1e-9
FAR = 12


class States(NamedTuple):
    """Partial routes in one cell at one instant: value after prices, memory, cut states, energy used."""

    value: Floats
    memory: Words
    cuts: Words
    used_j: Floats


class Prices(NamedTuple):
    """Prices of a certificate, in the words of the instance."""

    cell: Floats
    memory: list[list[int]]
    cut_cells: list[set[int]]
    cut_memory: list[set[int]]
    cut_price: list[float]
    stand: dict[tuple[int, int], float]
    sense: dict[int, float]
    slot: dict[tuple[int, int], float]
    rows_worth: float


class Moves(NamedTuple):
    """Arcs by the cell they leave: (to, steps, energy)."""

    out: list[list[tuple[int, int, float]]]
    idle_j: float
    sense_j: float


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
    """Return ``(T + 1, n)``: what sensing is worth after prices; minus infinity where it is out of the question."""
    n, last = len(instance.cells), instance.horizon_steps
    gain = np.array([[_gain(instance, prices, robot, i, t, charges) for i in range(n)] for t in range(last + 1)])
    instant = np.arange(last + 1)[:, None]
    allowed: Floats = np.where((instant < first) | (instant > last_of), NEVER, gain)
    return allowed


def _gain(instance: OrosInstance, prices: Prices, robot: OrosRobot, cell: int, t: int, charges: bool) -> float:
    """Return what sensing a cell at an instant is worth after prices; minus infinity where it earns nothing.

    A best plan leaves out what costs more than it earns before prices, so that is not priced either; but for a
    robot that charges, which may get for nothing what sensing costs.
    """
    data = instance.cells[cell]
    deadline = instance.horizon_steps if data.deadline_step is None else min(data.deadline_step, instance.horizon_steps)
    if data.explored or t < max(1, robot.start_step) or t > deadline or data.weight <= 0:
        return NEVER
    earned = data.weight * (deadline - t + 1) - instance.sigma * robot.sensing_w * instance.step_s
    if earned <= 0 and not charges:
        return NEVER
    return earned - float(prices.cell[cell]) - prices.sense.get(t, 0.0)


def best_route(
    instance: OrosInstance,
    robot: OrosRobot,
    prices: Prices,
    claimed: float,
    joule_price: float,
    first: NDArray[np.int64],
    last_of: NDArray[np.int64],
) -> float:
    """Return the most that a robot is worth after prices, or ``claimed`` if it is no more than that.

    Partial routes that cannot end above ``claimed`` by a bound without memory are dropped; if any ends above
    it the search has found the larger value.

    Parameters
    ----------
    instance, robot
        The instance and one of its robots.
    prices
        What the robot pays.
    claimed
        What it is said to be worth at most.
    joule_price
        Price of a joule at which the battery is relaxed besides; it only speeds up the search.
    first, last_of
        ``(n_cells,)`` instants between which it may collect each cell.
    """
    n, last = len(instance.cells), instance.horizon_steps
    index = {cell.id: i for i, cell in enumerate(instance.cells)}
    moves = moves_of(instance, robot)
    end = None if robot.return_to is None else index[robot.return_to]
    budget = robot.battery_j - robot.reserve_j
    budget += 1e-9 * max(1.0, budget)
    charging = charging_of(instance, robot)
    gain = gains(instance, prices, robot, first, last_of, charges=charging is not None)
    later = np.zeros((last + 2, n))
    later[: last + 1] = np.maximum.accumulate(np.maximum(gain, 0.0)[::-1])[::-1]
    ahead = [distances(moves, i, near) for i, near in enumerate(prices.memory)]
    constant = instance.sigma * robot.battery_j
    cutoff = claimed - constant
    rests = rests_of(instance, robot, prices, moves, gain, end, joule_price, charging)
    full = 0.0 if charging is None else charging.floor
    waiting: list[dict[int, list[States]]] = [{} for _ in range(last + 1)]
    stayed: list[dict[int, States]] = [{} for _ in range(last + 1)]  # waited at a charger since the instant before
    nothing = np.zeros(1, dtype=np.uint64)
    start = States(np.zeros(1), nothing, nothing, np.zeros(1))
    waiting[robot.start_step][index[robot.start]] = [start]
    best = cutoff
    for t in range(robot.start_step, last + 1):
        for i, parts in waiting[t].items():
            states = joined(parts)
            states = states._replace(value=states.value - prices.stand.get((t, i), 0.0))
            states = _hopeful(states, t, i, rests, budget, best, full)
            states = sensed(states, i, gain[t, i], moves.sense_j, prices)
            if charging is not None and i in stayed[t]:
                kept = stayed[t][i]._replace(value=stayed[t][i].value - prices.stand.get((t, i), 0.0))
                kept = sensed(kept, i, gain[t, i], moves.sense_j, prices)
                kept = _charged(kept, charging, instance.sigma, i, prices.slot.get((t, i), 0.0))
                states = joined([states, _hopeful(kept, t, i, rests, budget, best, full)])
            states = _undominated(
                states,
                later[np.minimum(t + ahead[i], last + 1), prices.memory[i]],
                prices,
                *((moves.sense_j, instance.sigma, charging.yet[t, i], charging.rich[t, i]) if charging else ()),
            )
            states = pick(states, states.used_j <= budget)
            if len(states.value) == 0:
                continue
            if t == last:
                if end is None or end == i:
                    best = max(best, float(states.value.max()))
                continue
            idle = States(
                states.value - instance.sigma * moves.idle_j, states.memory, states.cuts, states.used_j + moves.idle_j
            )
            if charging is not None and charging.amount[i] > 0.0:
                stayed[t + 1][i] = idle
                idle = pick(idle, idle.used_j < -np.inf)
            waiting[t + 1].setdefault(i, []).append(idle)
            for j, steps, energy in moves.out[i]:
                if t + steps <= last:
                    waiting[t + steps].setdefault(j, []).append(
                        States(
                            states.value - instance.sigma * energy,
                            remembered(states.memory, prices.memory[i], prices.memory[j]),
                            states.cuts & cut_mask(prices, j),
                            states.used_j + energy,
                        )
                    )
        waiting[t], stayed[t] = {}, {}
    return best + constant


def _charged(states: States, charging: Charging, sigma: float, cell: int, price: float) -> States:
    """Return states that waited at a charger after charging, and where that has a price, those that do not charge."""
    credit = np.maximum(0.0, np.minimum(charging.amount[cell], states.used_j - charging.floor))
    more = states._replace(value=states.value + sigma * credit - price * (credit > 0.0), used_j=states.used_j - credit)
    return more if price == 0.0 else joined([more, states])


def distances(moves: Moves, cell: int, targets: list[int]) -> NDArray[np.int64]:
    """Return the fewest steps from a cell to others, at least 1 (a cell cannot be sensed anew at once)."""
    known = {cell: 0}
    queue = [(0, cell)]
    while queue:
        distance, i = heapq.heappop(queue)
        if distance > known[i] or distance > FAR:
            continue
        for j, steps, _ in moves.out[i]:
            if distance + steps < known.get(j, FAR + 1):
                known[j] = distance + steps
                heapq.heappush(queue, (distance + steps, j))
    return np.array([max(1, known.get(target, FAR + 1)) for target in targets], dtype=np.int64)


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


def _hopeful(states: States, t: int, cell: int, rests: Rests, budget: float, best: float, full: float) -> States:
    """Return the states that may still end above ``best``; ``full`` is the energy used when the battery is full."""
    keep = np.ones(len(states.value), dtype=bool)
    for rate, rest in rests:
        left_j = (budget if rate >= 0.0 else full) - states.used_j
        keep &= states.value + rest[t, cell] + rate * left_j > best + MARGIN * max(1.0, abs(best))
    return pick(states, keep & (states.used_j <= budget))


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


def _undominated(
    states: States,
    later: Floats,
    prices: Prices,
    sense_j: float = 0.0,
    sigma: float = 0.0,
    yet: float = 0.0,
    rich: float = -np.inf,
) -> States:
    """Return the states that no other beats whatever comes next.

    A state that remembers more, or has more odd cuts, still beats another if it is ahead by all that the other
    could gain from that: ``later`` is the most that each remembered cell can still earn. Where ``yet`` joules can be
    charged, the other may make up by them for having less battery, and for sensing what the first leaves out. A state
    that has used no more than ``rich`` cannot run short, so that it need not have more battery than the other.
    """
    order = np.lexsort((states.used_j, -states.value))
    states = pick(states, order)
    keep = np.ones(len(order), dtype=bool)
    for k in range(len(order)):
        if not keep[k]:
            continue
        rest = slice(k + 1, None)
        lead = states.value[k] - states.value[rest]
        ahead_j = np.maximum(0.0, states.used_j[rest] - states.used_j[k])
        for position in np.flatnonzero((states.memory[k] >> np.arange(len(later), dtype=np.uint64)) & ONE):
            alone = ((states.memory[rest] >> np.uint64(position)) & ONE) == 0
            lead = lead - later[position] * alone
            ahead_j = ahead_j + sense_j * alone
        for cut, price in enumerate(prices.cut_price):
            if (states.cuts[k] >> np.uint64(cut)) & ONE:
                lead = lead - price * (((states.cuts[rest] >> np.uint64(cut)) & ONE) == 0)
        as_full = (states.used_j[k] <= states.used_j[rest]) | (states.used_j[k] <= rich)
        keep[rest] &= ~((lead >= sigma * np.minimum(ahead_j, yet)) & as_full)
    return pick(states, keep)


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
