"""Kernels of the smoothed pricing: sums over all routes instead of the best one, and routes drawn from that sum.

A route of reduced value v has the weight ``exp(v / temperature)``. One pass backwards over instants, cells and
memories gives the logarithms of the sums of weights of all completions; with these a route is a Markov chain, and
one pass forwards gives how often each cell is collected on average. Logarithms are kept state by state, because
the weights differ by hundreds of orders of magnitude when the temperature is low.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray

NEVER = -1e300
_NONE = -1e200  # below every logarithm of a weight, above sums with NEVER
_FAR = 37.0  # logarithms further below the largest do not change a sum in double precision
_FAINT = 1e-16  # probability of a state below which it is not followed


class SoftGraph(NamedTuple):
    """Arcs and the memories of each cell.

    Parameters
    ----------
    out_start, arc_to, arc_steps
        See `RouteProblem`.
    cost
        ``(n_arcs,)`` cost of an arc.
    first
        ``(n + 1,)``: the memories of cell j are states ``first[j]:first[j + 1]``, a power of two of them.
    own
        ``(n,)`` bit of the cell itself in its memories.
    carried, carry
        Memory m of an arc's tail becomes ``carried[carry[arc] + m]`` at its head.
    """

    out_start: IntArray
    arc_to: IntArray
    arc_steps: IntArray
    cost: FloatArray
    first: IntArray
    own: IntArray
    carried: NDArray[np.int32]
    carry: IntArray


class SoftRobot(NamedTuple):
    """A robot class and what it earns: where and when it begins and ends, and ``gain`` (T + 1, n) after prices."""

    start: int
    start_step: int
    return_to: int
    wait_cost: float
    gain: FloatArray


class SoftTables(NamedTuple):
    """Tables ``(T + 1, states)`` that the passes fill.

    ``ahead`` is the logarithm of the sum over completions on arrival, ``onward`` the same after having collected or
    not; ``chance`` the probability of arriving there.
    """

    ahead: FloatArray
    onward: FloatArray
    chance: FloatArray


@kernel(nogil=True)
def soft_pass(graph: SoftGraph, robot: SoftRobot, tables: SoftTables, temperature: float) -> tuple[float, FloatArray]:
    """Return ``temperature * log(sum over routes of exp(value / temperature))`` and the average collections.

    The first is above the value of the best route (prices deducted, battery at the start left out), ``NEVER`` if there
    is no route; its derivative with respect to the price of a cell is minus the second, ``(n,)``.

    Parameters
    ----------
    graph, robot
        What is summed over: every route that collects no cell it remembers, the battery ignored.
    tables
        Filled.
    temperature
        In units of the objective.
    """
    out_start, arc_to, arc_steps = graph.out_start, graph.arc_to, graph.arc_steps
    first, own, carried, carry = graph.first, graph.own, graph.carried, graph.carry
    ahead, onward, chance = tables.ahead, tables.onward, tables.chance
    gain = robot.gain
    horizon, n = len(gain) - 1, len(own)
    cost = graph.cost / temperature
    wait_cost = robot.wait_cost / temperature
    begin = robot.start_step
    most_arcs = 0
    for i in range(n):
        most_arcs = max(most_arcs, out_start[i + 1] - out_start[i])
    level = np.empty(most_arcs + 1)
    earliest = np.full(n, horizon + 1)
    earliest[robot.start] = begin
    for t in range(begin, horizon + 1):
        for i in range(n):
            if earliest[i] == t:
                for a in range(out_start[i], out_start[i + 1]):
                    earliest[arc_to[a]] = min(earliest[arc_to[a]], t + arc_steps[a])
    for t in range(horizon, begin - 1, -1):
        for i in range(n):
            if t < earliest[i]:
                continue
            low, count = first[i], first[i + 1] - first[i]
            if t == horizon:
                end = 0.0 if robot.return_to < 0 or robot.return_to == i else NEVER
                for m in range(count):
                    onward[t, low + m] = end
            else:
                for m in range(count):
                    top = ahead[t + 1, low + m] - wait_cost
                    level[0] = top
                    place = 0
                    for a in range(out_start[i], out_start[i + 1]):
                        place += 1
                        arrival = t + arc_steps[a]
                        if arrival > horizon:
                            level[place] = NEVER
                            continue
                        x = ahead[arrival, first[arc_to[a]] + carried[carry[a] + m]] - cost[a]
                        level[place] = x
                        if x > top:
                            top = x
                    if top <= _NONE:
                        onward[t, low + m] = NEVER
                        continue
                    total = 0.0
                    for k in range(place + 1):
                        x = level[k] - top
                        if x > -_FAR:
                            total += np.exp(x) if x < 0.0 else 1.0
                    onward[t, low + m] = top + np.log(total) if total > 1.0 else top
            earned = gain[t, i] / temperature if gain[t, i] > _NONE else NEVER
            for m in range(count):
                idle = onward[t, low + m]
                ahead[t, low + m] = idle
                if m & own[i] == 0 and earned > _NONE and onward[t, low + (m | own[i])] > _NONE:
                    x = onward[t, low + (m | own[i])] + earned
                    high, gap = max(x, idle), abs(x - idle)
                    ahead[t, low + m] = high + np.log1p(np.exp(-gap)) if gap < _FAR else high
    visits = np.zeros(n)
    if ahead[begin, first[robot.start]] <= _NONE:
        return NEVER, visits
    for t in range(begin, horizon + 1):
        for s in range(first[n]):
            chance[t, s] = 0.0
    chance[begin, first[robot.start]] = 1.0
    for t in range(begin, horizon + 1):
        for i in range(n):
            low = first[i]
            earned = gain[t, i] / temperature if gain[t, i] > _NONE else NEVER
            for m in range(first[i + 1] - low):
                here = chance[t, low + m]
                if here < _FAINT:
                    continue
                collecting = 0.0
                if m & own[i] == 0 and earned > _NONE and onward[t, low + (m | own[i])] > _NONE:
                    collecting = np.exp(earned + onward[t, low + (m | own[i])] - ahead[t, low + m])
                    visits[i] += here * collecting
                if t == horizon:
                    continue
                for taken in range(2):
                    part = here * collecting if taken else here * (1.0 - collecting)
                    if part < _FAINT:
                        continue
                    memory = m | own[i] if taken else m
                    base = onward[t, low + memory]
                    x = ahead[t + 1, low + memory] - wait_cost - base
                    if x > -_FAR:
                        chance[t + 1, low + memory] += part * np.exp(x)
                    for a in range(out_start[i], out_start[i + 1]):
                        arrival = t + arc_steps[a]
                        if arrival <= horizon:
                            state = first[arc_to[a]] + carried[carry[a] + memory]
                            x = ahead[arrival, state] - cost[a] - base
                            if x > -_FAR:
                                chance[arrival, state] += part * np.exp(x)
    return temperature * ahead[begin, first[robot.start]], visits


@kernel(nogil=True)
def draw_route(
    graph: SoftGraph, robot: SoftRobot, tables: SoftTables, temperature: float, random: FloatArray
) -> tuple[IntArray, IntArray, NDArray[np.bool_]]:
    """Return cell, arc started and sensing at each instant of a route drawn with probability by weight.

    Entries before the start, and cells while on an arc of several steps, are -1.

    Parameters
    ----------
    graph, robot, tables, temperature
        As the last pass had and left them.
    random
        ``(T + 1, 2)`` uniform numbers.
    """
    first, own = graph.first, graph.own
    ahead, onward = tables.ahead, tables.onward
    horizon = len(robot.gain) - 1
    cells = np.full(horizon + 1, -1, np.int64)
    arcs = np.full(horizon + 1, -1, np.int64)
    senses = np.zeros(horizon + 1, np.bool_)
    t, i, m = robot.start_step, robot.start, 0
    while True:
        cells[t] = i
        low = first[i]
        after = onward[t, low + (m | own[i])]
        if m & own[i] == 0 and robot.gain[t, i] > _NONE and after > _NONE:
            senses[t] = random[t, 0] < np.exp(robot.gain[t, i] / temperature + after - ahead[t, low + m])
        if senses[t]:
            m |= own[i]
        if t == horizon:
            return cells, arcs, senses
        left, base = random[t, 1], onward[t, low + m]
        left -= np.exp(ahead[t + 1, low + m] - robot.wait_cost / temperature - base)
        chosen = -1
        for a in range(graph.out_start[i], graph.out_start[i + 1]):
            arrival = t + graph.arc_steps[a]
            if left < 0.0:
                break
            if arrival <= horizon:
                state = first[graph.arc_to[a]] + graph.carried[graph.carry[a] + m]
                weight = np.exp(ahead[arrival, state] - graph.cost[a] / temperature - base)
                if weight > 0.0:
                    chosen = a
                    left -= weight
        if chosen < 0:
            t += 1
        else:
            arcs[t] = chosen
            m = int(graph.carried[graph.carry[chosen] + m])
            t += graph.arc_steps[chosen]
            i = graph.arc_to[chosen]
