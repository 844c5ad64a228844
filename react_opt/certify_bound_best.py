"""The most that one robot can be worth once it pays the prices of a certificate: a plain dynamic programme.

It runs over instants, cells, memories and cut states (`certify_bound_kernel`), and shares nothing with the solver that
made the claim: the motion, the battery and the rewards are stated again, on purpose.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from react_opt.certify_bound_charge import Charging, charging_of
from react_opt.certify_bound_kernel import Battery, Layers, Memory, Ways, Worth, advance
from react_opt.certify_bound_route import (
    Floats,
    Moves,
    Prices,
    can_run_dry,
    cut_mask,
    distances,
    gains,
    moves_of,
    rests_of,
)
from react_opt.instance import OrosInstance, OrosRobot

ROUNDS = 50  # times that progress is told


def best_route(
    instance: OrosInstance,
    robot: OrosRobot,
    prices: Prices,
    claimed: float,
    joule_price: float,
    first: NDArray[np.int64],
    last_of: NDArray[np.int64],
    tell: Callable[[float], None] = lambda share: None,
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
    tell
        Called now and then with the share of the instants that are done.
    """
    n, last = len(instance.cells), instance.horizon_steps
    index = {cell.id: i for i, cell in enumerate(instance.cells)}
    moves = moves_of(instance, robot)
    goal = None if robot.return_to is None else index[robot.return_to]
    charging = charging_of(instance, robot)
    gain = gains(instance, prices, robot, first, last_of, charges=charging is not None)
    dear = gain - prices.potential if len(prices.potential) else gain
    battery = _battery(instance, robot, moves, charging)
    rests = rests_of(instance, robot, prices, moves, dear, goal, joule_price if battery.limited else 0.0, charging)
    later = np.zeros((last + 2, n))
    later[: last + 1] = np.maximum.accumulate(np.maximum(gain, 0.0)[::-1])[::-1]
    worth = Worth(
        gain,
        later,
        _dense(prices.stand, last + 1, n),
        _dense(prices.slot, last + 1, n),
        np.array([rest for _, rest in rests]),
        np.array([rate for rate, _ in rests]),
        np.array(prices.cut_price, dtype=np.float64),
        prices.potential,
    )
    ways, memory = _ways(moves, prices), _memory(moves, prices)
    layers, fill = _nothing(last + 1, n), 0
    constant = instance.sigma * robot.battery_j
    best = claimed - constant
    stops = np.unique(np.linspace(robot.start_step, last + 1, ROUNDS + 1, dtype=np.int64)).tolist()
    for from_t, to_t in pairwise(stops):
        best, layers, fill = advance(
            from_t, to_t, index[robot.start], robot.start_step, -1 if goal is None else goal, best, ways, memory, worth,
            battery, layers, fill,
        )  # fmt: skip
        tell((to_t - stops[0]) / (stops[-1] - stops[0]))
    return float(best) + constant


def _dense(price: dict[tuple[int, int], float], rows: int, n: int) -> Floats:
    table = np.zeros((rows, n))
    for place, value in price.items():
        table[place] = value
    return table


def _ways(moves: Moves, prices: Prices) -> Ways:
    """Return the arcs by the cell that they lead to, with the bits of what is remembered at both ends."""
    arcs = sorted((j, i, steps, energy) for i, out in enumerate(moves.out) for j, steps, energy in out)
    to = np.array([arc[0] for arc in arcs], dtype=np.int64)
    bit = [{cell: k for k, cell in enumerate(near)} for near in prices.memory]
    carried = [[(bit[i][cell], k) for cell, k in bit[j].items() if cell in bit[i]] for j, i, _, _ in arcs]
    pairs = np.array([pair for both in carried for pair in both], dtype=np.int64).reshape(-1, 2)
    return Ways(
        np.searchsorted(to, np.arange(len(moves.out) + 1)).astype(np.int64),
        np.array([arc[1] for arc in arcs], dtype=np.int64),
        np.array([arc[2] for arc in arcs], dtype=np.int64),
        np.array([arc[3] for arc in arcs], dtype=np.float64),
        np.cumsum([0, *map(len, carried)], dtype=np.int64),
        np.ascontiguousarray(pairs[:, 0]),
        np.ascontiguousarray(pairs[:, 1]),
    )


def _memory(moves: Moves, prices: Prices) -> Memory:
    near, cells = prices.memory, range(len(prices.memory))
    inside = [sum(1 << k for k, cut in enumerate(prices.cut_cells) if i in cut) for i in cells]
    return Memory(
        np.cumsum([0, *map(len, near)], dtype=np.int64),
        np.array([cell for remembered in near for cell in remembered], dtype=np.int64),
        np.concatenate([distances(moves, i, near[i]) for i in cells]),
        np.array([near[i].index(i) for i in cells], dtype=np.int64),
        np.array([cut_mask(prices, i) for i in cells], dtype=np.uint64).view(np.int64),
        np.array(inside, dtype=np.uint64).view(np.int64),
    )


def _battery(instance: OrosInstance, robot: OrosRobot, moves: Moves, charging: Charging | None) -> Battery:
    budget = robot.battery_j - robot.reserve_j
    budget += 1e-9 * max(1.0, budget)
    none = np.zeros((0, 0))
    limited = charging is not None or can_run_dry(instance, robot, moves, budget)
    if not limited:
        # partial routes that collect a cell again may use more than any route; one dropped for that could have
        # displaced one that uses less
        budget = sys.float_info.max
    return Battery(
        instance.sigma,
        moves.idle_j,
        moves.sense_j,
        budget,
        0.0 if charging is None else charging.floor,
        limited,
        np.zeros(len(instance.cells)) if charging is None else charging.amount,
        none if charging is None else charging.yet,
        none if charging is None else charging.rich,
    )


def _nothing(rows: int, n: int) -> Layers:
    none, words = np.zeros(1024), np.zeros(1024, dtype=np.int64)
    begin = np.zeros((rows, n), dtype=np.int64)
    return Layers(begin, begin.copy(), none, words, words.copy(), none.copy())
