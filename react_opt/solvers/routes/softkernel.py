"""Kernels of the smoothed pricing: sums over all routes instead of the best one, and routes drawn from that sum.

A route of reduced value v has the weight ``exp(v / temperature)``. One pass backwards over instants, cells and
memories gives the logarithms of the sums of weights of all completions; with these a route is a Markov chain, and
one pass forwards gives how often each cell is collected on average. Logarithms are kept state by state, because
the weights differ by hundreds of orders of magnitude when the temperature is low.

Logarithms are double precision; what is added to the largest of a sum is single precision (an error below 1e-6 in each
logarithm), in loops over memories that compile to vector instructions. Nothing that is claimed rests on it: bounds come
from the exact pricing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray
from react_opt.solvers.routes.ranking import inner

NEVER = -1e300
_NONE = -1e200  # below every logarithm of a weight, above sums with NEVER
_FAINT = 1e-12  # probability of a state below which it is not followed

_ONE, _HALF, _LOWEST = np.float32(1.0), np.float32(0.5), np.float32(-40.0)
_LOG2_E, _LOG_2 = np.float32(1.0 / math.log(2.0)), np.float32(math.log(2.0))
_E1, _E2, _E3, _E4, _E5, _E6 = (np.float32(math.log(2.0) ** k / math.factorial(k)) for k in range(1, 7))
_L1, _L3, _L5, _L7, _L9 = (np.float32(2.0 / k) for k in (1, 3, 5, 7, 9))
_EXPONENT, _BIAS, _ROOT_HALF = np.int32(23), np.int32(127), np.int32(0x3F3504F3)  # of single precision; sqrt(1/2)


class SoftGraph(NamedTuple):
    """Arcs and the memories of each cell.

    Parameters
    ----------
    out_start, arc_to, arc_steps
        See `RouteProblem`.
    cost
        ``(n_arcs,)`` cost of an arc.
    first
        ``(n + 1,)``: the memories of cell j are states ``first[j]:first[j + 1]``, a power of two of them; those of
        the upper half remember the cell itself.
    carried, carry
        Memory m of an arc's tail becomes ``carried[carry[arc] + m]`` at its head.
    """

    out_start: IntArray
    arc_to: IntArray
    arc_steps: IntArray
    cost: FloatArray
    first: IntArray
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

    ``ahead`` is the logarithm of the sum over completions on arrival; ``chance`` the probability of arriving there.
    """

    ahead: FloatArray
    chance: FloatArray


@kernel(nogil=True, inline="always")
def _exp(x: np.float32) -> np.float32:
    """Exponential of a number that is not positive; at least exp(-40), which changes no sum."""
    y = max(x, _LOWEST) * _LOG2_E
    whole = np.int32(y - _HALF)
    f = y - np.float32(whole)
    power = _ONE + f * (_E1 + f * (_E2 + f * (_E3 + f * (_E4 + f * (_E5 + f * _E6)))))
    result: np.float32 = power * np.int32((whole + _BIAS) << _EXPONENT).view(np.float32)
    return result


@kernel(nogil=True, inline="always")
def _log(x: np.float32) -> np.float32:
    """Logarithm of a positive number that is not tiny: of a mantissa around 1, and the exponent."""
    bits = np.float32(x).view(np.int32)
    whole = np.int32(bits - _ROOT_HALF) >> _EXPONENT
    mantissa = np.int32(bits - np.int32(whole << _EXPONENT)).view(np.float32)
    z = (mantissa - _ONE) / (mantissa + _ONE)
    q = z * z
    result: np.float32 = np.float32(whole) * _LOG_2 + z * (_L1 + q * (_L3 + q * (_L5 + q * (_L7 + q * _L9))))
    return result


@inner
def _reached(graph: SoftGraph, robot: SoftRobot) -> IntArray:
    """First instant at which the robot can be in each cell, beyond the horizon where there is none."""
    horizon, n = len(robot.gain) - 1, len(graph.first) - 1
    earliest = np.full(n, horizon + 1)
    earliest[robot.start] = robot.start_step
    for t in range(robot.start_step, horizon + 1):
        for i in range(n):
            if earliest[i] == t:
                for a in range(graph.out_start[i], graph.out_start[i + 1]):
                    j = graph.arc_to[a]
                    earliest[j] = min(earliest[j], t + graph.arc_steps[a])
    return earliest


@inner
def _sum_completions(
    graph: SoftGraph, robot: SoftRobot, ahead: FloatArray, earliest: IntArray, heat: float, stop: NDArray[np.uint8]
) -> bool:
    """Fill ``ahead``, from the horizon to the start; return whether it was not told to stop."""
    out_start, arc_to, arc_steps, first = graph.out_start, graph.arc_to, graph.arc_steps, graph.first
    horizon, n = len(robot.gain) - 1, len(first) - 1
    cost, wait_cost = graph.cost / heat, robot.wait_cost / heat
    ways = most = 1
    for i in range(n):
        ways = max(ways, 1 + out_start[i + 1] - out_start[i])
        most = max(most, first[i + 1] - first[i])
    level, top = np.empty((ways, most)), np.empty(most)
    total = np.empty(most, dtype=np.float32)
    for t in range(horizon, robot.start_step - 1, -1):
        if stop[0] != 0:
            return False
        for i in range(n):
            if t < earliest[i]:
                continue
            low, count = first[i], first[i + 1] - first[i]
            half = count // 2
            here = ahead[t, low : low + count]
            if t == horizon:
                end = 0.0 if robot.return_to < 0 or robot.return_to == i else NEVER
                for m in range(count):
                    top[m], total[m] = end, _ONE
            else:
                stay, line = ahead[t + 1, low : low + count], level[0]
                for m in range(count):
                    line[m] = stay[m] - wait_cost
                    top[m] = line[m]
                    total[m] = np.float32(0.0)
                place = 1
                for a in range(out_start[i], out_start[i + 1]):
                    arrival = t + arc_steps[a]
                    if arrival > horizon:
                        continue
                    there, line = ahead[arrival, first[arc_to[a]] :], level[place]
                    carried = graph.carried[graph.carry[a] : graph.carry[a] + count]
                    for m in range(count):
                        line[m] = there[carried[m]] - cost[a]
                        top[m] = max(top[m], line[m])
                    place += 1
                for k in range(place):
                    line = level[k]
                    for m in range(count):
                        total[m] += _exp(np.float32(line[m] - top[m]))
            earned = robot.gain[t, i] / heat if robot.gain[t, i] > _NONE else NEVER
            for m in range(half):
                collected, left = top[m + half] + earned, top[m]
                high = max(collected, left)
                both = total[m + half] * _exp(np.float32(collected - high)) + total[m] * _exp(np.float32(left - high))
                here[m] = high + _log(both)
            for m in range(half, count):
                here[m] = top[m] + _log(total[m])
    return True


@inner
def _count_visits(
    graph: SoftGraph, robot: SoftRobot, tables: SoftTables, heat: float, stop: NDArray[np.uint8]
) -> FloatArray:
    """Fill ``chance``, from the start to the horizon, and return how often each cell is collected on average."""
    out_start, arc_to, arc_steps, first = graph.out_start, graph.arc_to, graph.arc_steps, graph.first
    ahead, chance = tables.ahead, tables.chance
    horizon, n = len(robot.gain) - 1, len(first) - 1
    cost, wait_cost = graph.cost / heat, robot.wait_cost / heat
    visits = np.zeros(n)
    chance[robot.start_step :] = 0.0
    chance[robot.start_step, first[robot.start]] = 1.0
    for t in range(robot.start_step, horizon + 1):
        if stop[0] != 0:
            break
        for i in range(n):
            low, half = first[i], (first[i + 1] - first[i]) // 2
            earned = robot.gain[t, i] / heat if robot.gain[t, i] > _NONE else NEVER
            for m in range(2 * half):
                here = chance[t, low + m]
                if here < _FAINT:
                    continue
                for taken in range(2):
                    memory, base = m, ahead[t, low + m]
                    if taken:
                        if m >= half or earned <= _NONE:
                            break
                        memory, base = m + half, base - earned
                        visits[i] += here * _exp(np.float32(min(0.0, ahead[t, low + memory] - base)))
                    if t == horizon or ahead[t, low + memory] - base < _LOWEST:
                        continue
                    x = ahead[t + 1, low + memory] - wait_cost - base
                    chance[t + 1, low + memory] += here * _exp(np.float32(min(0.0, x)))
                    for a in range(out_start[i], out_start[i + 1]):
                        arrival = t + arc_steps[a]
                        if arrival <= horizon:
                            state = first[arc_to[a]] + graph.carried[graph.carry[a] + memory]
                            x = ahead[arrival, state] - cost[a] - base
                            chance[arrival, state] += here * _exp(np.float32(min(0.0, x)))
    return visits


@kernel(nogil=True)
def soft_pass(
    graph: SoftGraph, robot: SoftRobot, tables: SoftTables, temperature: float, stop: NDArray[np.uint8]
) -> tuple[float, FloatArray]:
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
    stop
        ``(1,)`` flag; once it is not 0 the pass is given up and what it returns means nothing.
    """
    if not _sum_completions(graph, robot, tables.ahead, _reached(graph, robot), temperature, stop):
        return NEVER, np.zeros(len(graph.first) - 1)
    whole = tables.ahead[robot.start_step, graph.first[robot.start]]
    if whole <= _NONE:
        return NEVER, np.zeros(len(graph.first) - 1)
    return temperature * whole, _count_visits(graph, robot, tables, temperature, stop)


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
    first, ahead = graph.first, tables.ahead
    horizon = len(robot.gain) - 1
    cells = np.full(horizon + 1, -1, np.int64)
    arcs = np.full(horizon + 1, -1, np.int64)
    senses = np.zeros(horizon + 1, np.bool_)
    t, i, m = robot.start_step, robot.start, 0
    while True:
        cells[t] = i
        collecting = 0.0
        low, half = first[i], (first[i + 1] - first[i]) // 2
        base = ahead[t, low + m]
        if m < half and robot.gain[t, i] > _NONE:
            earned = robot.gain[t, i] / temperature
            collecting = np.exp(min(0.0, earned + ahead[t, low + m + half] - base))
            senses[t] = random[t, 0] < collecting
            if senses[t]:
                m += half
                base -= earned
        if t == horizon:
            return cells, arcs, senses
        left = random[t, 1] * (collecting if senses[t] else 1.0 - collecting)
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
