"""What the other robots leave to one robot: residual rewards, places, arcs and charging slots.

A *leftover* holds everything that the best response of one robot needs to know of the others' fixed routes. From
it follow `survival` (the least battery that still reaches the horizon, an exact test of feasibility) and the
Lagrangian potential that guides and bounds the beam search (`shape_prices`, `potential`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.models.replay import first_sensed
from react_opt.route_problem import FloatArray, IntArray, Route, RouteProblem

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Leftover:
    """What the fixed routes leave to one robot more.

    Parameters
    ----------
    gain
        ``(n_cells, horizon + 1)``: what sensing cell i at t adds to the coverage, 0 where it adds nothing or
        where no sensing slot is left.
    stand
        ``(horizon + 1, n_cells)`` True where the robot may stand; empty where every place is free.
    drive
        ``(horizon + 1, n_arcs)`` True where the arc may be started; empty where every arc is free.
    charge_j
        ``(horizon + 1, n_cells)`` most that may be credited at t, J; empty where nothing can be charged.
    """

    gain: FloatArray
    stand: Mask
    drive: Mask
    charge_j: FloatArray

    @property
    def unhindered(self) -> bool:
        """Whether neither places nor arcs are taken and nothing can be charged."""
        return not (self.stand.size or self.drive.size or self.charge_j.size)


def leftover(problem: RouteProblem, others: Sequence[Route]) -> Leftover:
    """What a set of fixed routes leaves to another robot.

    Sensing a cell before the others do earns the difference of the two rewards; afterwards nothing.

    Parameters
    ----------
    problem
        The problem.
    others
        The fixed routes, at most one per other robot.
    """
    horizon = problem.horizon
    first = first_sensed(problem, others)
    gain = np.maximum(problem.reward, 0.0)
    gain[:, 0] = 0.0
    for cell in np.flatnonzero(first <= horizon):
        at = first[cell]
        gain[cell] = np.maximum(gain[cell] - gain[cell, at], 0.0)
        gain[cell, at:] = 0.0
    if problem.sensing_robots_per_step is not None:
        sensing = np.zeros(horizon + 1, dtype=np.int64)
        for route in others:
            sensing[np.flatnonzero(route.sense) + problem.classes[route.robot_class].start_step] += 1
        gain[:, sensing >= problem.sensing_robots_per_step] = 0.0
    return Leftover(gain, _stand(problem, others), _drive(problem, others), _charge(problem, others))


def _stand(problem: RouteProblem, others: Sequence[Route]) -> Mask:
    if problem.robots_per_cell is None or problem.n_robots <= problem.robots_per_cell:
        return np.ones((0, 0), dtype=bool)
    standing = np.zeros((problem.horizon + 1, problem.n_cells), dtype=np.int64)
    for route in others:
        at = np.flatnonzero(route.cell >= 0)
        standing[at + problem.classes[route.robot_class].start_step, route.cell[at]] += 1
    free: Mask = standing < problem.robots_per_cell
    free[0] = True
    return free


def _drive(problem: RouteProblem, others: Sequence[Route]) -> Mask:
    if not problem.forbid_swaps or problem.n_robots == 1:
        return np.ones((0, 0), dtype=bool)
    free = np.ones((problem.horizon + 1, problem.n_arcs), dtype=bool)
    for route in others:
        start_step = problem.classes[route.robot_class].start_step
        for k in np.flatnonzero(route.arc >= 0):
            arc = route.arc[k]
            begin, back = int(k) + start_step, int(problem.arc_from[arc])
            end = begin + int(problem.arc_steps[arc])
            there = int(problem.arc_to[arc])
            for mine in range(problem.out_start[there], problem.out_start[there + 1]):
                if problem.arc_to[mine] == back:
                    free[max(0, begin - int(problem.arc_steps[mine]) + 1) : end, mine] = False
    return free


def _charge(problem: RouteProblem, others: Sequence[Route]) -> FloatArray:
    if not problem.charger_j.any():
        return np.zeros((0, 0))
    charge_j = np.tile(problem.charger_j, (problem.horizon + 1, 1))
    used = np.zeros(charge_j.shape, dtype=np.int64)
    for route in others:
        at = np.flatnonzero(route.charge_j > 0.0)
        used[at + problem.classes[route.robot_class].start_step, route.cell[at]] += 1
    charge_j[used >= problem.charger_slots] = 0.0
    return charge_j


@kernel(nogil=True)
def survival(
    out_start: IntArray,
    arc_to: IntArray,
    arc_steps: IntArray,
    arc_energy_j: FloatArray,
    limits: FloatArray,
    return_to: int,
    start_step: int,
    n_cells: int,
    horizon: int,
    stand: Mask,
    drive: Mask,
    charge_j: FloatArray,
) -> FloatArray:
    """Least battery after sensing at (t, i) with which the horizon can still be reached, J; inf where none does.

    It only grows with what a robot has to spend, so a label survives exactly when its battery is at least this.

    Parameters
    ----------
    out_start, arc_to, arc_steps, arc_energy_j
        Arcs of the problem.
    limits
        Reserve, capacity and energy of a waiting step, J.
    return_to
        Cell to stand in at the horizon, or -1.
    start_step, n_cells, horizon
        Sizes.
    stand, drive, charge_j
        See `Leftover`.
    """
    reserve, capacity, wait_j = limits[0], limits[1], limits[2]
    need = np.full((horizon + 1, n_cells), np.inf)
    for i in range(n_cells):
        if return_to < 0 or return_to == i:
            need[horizon, i] = reserve
    if stand.size > 0 and horizon > 0:
        for i in range(n_cells):
            if not stand[horizon, i]:
                need[horizon, i] = np.inf
    for t in range(horizon - 1, start_step - 1, -1):
        for i in range(n_cells):
            if stand.size > 0 and not stand[t, i]:
                continue
            best = np.inf
            if need[t + 1, i] <= capacity:
                best = need[t + 1, i] + wait_j
                if charge_j.size > 0:
                    best -= charge_j[t + 1, i]
            for a in range(out_start[i], out_start[i + 1]):
                arrival = t + arc_steps[a]
                if arrival > horizon or (drive.size > 0 and not drive[t, a]):
                    continue
                best = min(best, need[arrival, arc_to[a]] + arc_energy_j[a])
            need[t, i] = max(best, reserve)
    return need


@kernel(nogil=True)
def potential(
    out_start: IntArray,
    arc_to: IntArray,
    arc_steps: IntArray,
    arc_energy_j: FloatArray,
    start_step: int,
    wait_j: float,
    sense_j: float,
    joule: float,
    gain: FloatArray,
    price: FloatArray,
    need: FloatArray,
    drive: Mask,
    charge_j: FloatArray,
    choice: NDArray[np.int32],
) -> FloatArray:
    """Most that can still be earned from (t, i) on when a cell costs its price each time and may earn again.

    With multipliers ``price >= 0`` of "no cell is collected twice", value so far + potential + the prices of the
    cells not yet collected is an upper bound of every completion (Lagrangian relaxation).

    Parameters
    ----------
    out_start, arc_to, arc_steps, arc_energy_j, start_step, wait_j, sense_j, need, drive, charge_j
        See `survival`.
    joule
        Weight of one joule: sigma and the multiplier of the battery's floor.
    gain
        See `Leftover`.
    price
        ``(n_cells,)`` price of collecting each cell.
    choice
        ``(horizon + 1, n_cells)``, filled: the arc of the best continuation, -1 to wait.
    """
    horizon, n_cells = gain.shape[1] - 1, gain.shape[0]
    best_of = np.full((horizon + 1, n_cells), -np.inf)
    arrive = np.full((horizon + 1, n_cells), -np.inf)  # with what sensing on arrival adds
    for t in range(horizon, start_step - 1, -1):
        for i in range(n_cells):
            if need[t, i] == np.inf:
                continue
            best, taken = -np.inf, -1
            if t == horizon:
                best = 0.0
            else:
                if arrive[t + 1, i] > -np.inf:
                    best = arrive[t + 1, i] - joule * wait_j
                    if charge_j.size > 0:
                        best += joule * charge_j[t + 1, i]
                for a in range(out_start[i], out_start[i + 1]):
                    arrival = t + arc_steps[a]
                    if arrival > horizon or (drive.size > 0 and not drive[t, a]):
                        continue
                    score = arrive[arrival, arc_to[a]] - joule * arc_energy_j[a]
                    if score > best:
                        best, taken = score, a
            best_of[t, i] = best
            choice[t, i] = taken
            sensed = gain[i, t] - joule * sense_j - price[i]
            arrive[t, i] = best + sensed if gain[i, t] > 0.0 and sensed > 0.0 else best
    return best_of


@kernel(nogil=True)
def shape_prices(
    out_start: IntArray,
    arc_to: IntArray,
    arc_steps: IntArray,
    arc_energy_j: FloatArray,
    start: int,
    start_step: int,
    wait_j: float,
    sense_j: float,
    sigma: float,
    spare_j: float,
    gain: FloatArray,
    price: FloatArray,
    need: FloatArray,
    drive: Mask,
    charge_j: FloatArray,
    floor: float,
    iterations: int,
) -> tuple[FloatArray, float, float]:
    """Lower the Lagrangian bound of one robot's best response by a few subgradient steps.

    Parameters
    ----------
    out_start, arc_to, arc_steps, arc_energy_j, start_step, wait_j, sense_j, gain, need, drive, charge_j
        See `potential`.
    start
        Cell of the start.
    sigma
        Weight of a joule.
    spare_j
        Battery above the reserve at the start, J; negative where the battery cannot bind (it is not priced).
    price
        ``(n_cells,)`` prices to begin with.
    floor
        A value (coverage gained less sigma times the energy spent) that a route is known to reach.
    iterations
        Subgradient steps.

    Returns
    -------
    price
        Best prices found.
    floor_price
        Multiplier of the battery's floor.
    bound
        Upper bound of coverage gained less sigma times energy spent over all routes.
    """
    horizon, n_cells = gain.shape[1] - 1, gain.shape[0]
    choice = np.empty((horizon + 1, n_cells), dtype=np.int32)
    given, price, best_price = price, np.empty(n_cells), np.empty(n_cells)
    visits = np.zeros(n_cells)
    for j in range(n_cells):
        price[j] = best_price[j] = given[j]
    extra = 0.0
    best_extra, best_bound = 0.0, np.inf
    theta = 1.0
    stale = 0
    for _ in range(max(1, iterations)):
        joule = sigma + extra
        values = potential(
            out_start, arc_to, arc_steps, arc_energy_j, start_step, wait_j, sense_j, joule, gain, price, need,
            drive, charge_j, choice,
        )  # fmt: skip
        spent = 0.0
        t, i = start_step, start
        bound = values[t, i] + extra * max(spare_j, 0.0)
        for j in range(n_cells):
            visits[j] = 0.0
            bound += price[j]
        first = gain[i, t] - joule * sense_j - price[i]
        if gain[i, t] > 0.0 and first > 0.0:
            bound += first
        if bound < best_bound - 1e-9 * abs(best_bound):
            stale = 0
        else:
            stale += 1
            if stale >= 4:
                theta *= 0.6
                stale = 0
        if bound < best_bound:
            best_bound, best_extra = bound, extra
            for j in range(n_cells):
                best_price[j] = price[j]
        if bound <= floor or values[t, i] == -np.inf:
            break
        while True:
            if gain[i, t] > 0.0 and gain[i, t] - joule * sense_j - price[i] > 0.0:
                visits[i] += 1.0
                spent += sense_j
            if t == horizon:
                break
            a = choice[t, i]
            if a < 0:
                spent += wait_j
                t += 1
            else:
                spent += arc_energy_j[a]
                t += arc_steps[a]
                i = arc_to[a]
        norm = 0.0
        for j in range(n_cells):
            slope = visits[j] - 1.0
            if slope > 0.0 or (slope < 0.0 and price[j] > 0.0):
                norm += slope * slope
        over = spent - spare_j
        scale = 1.0 / max(1.0, spare_j)  # joules and visits are made comparable
        priced = spare_j >= 0.0 and (over > 0.0 or extra > 0.0)
        if priced:
            norm += (over * scale) ** 2
        if norm == 0.0:
            break
        step = theta * max(bound - floor, 1e-6 * abs(bound)) / norm
        for j in range(n_cells):
            slope = visits[j] - 1.0
            if slope > 0.0 or (slope < 0.0 and price[j] > 0.0):
                price[j] = max(0.0, price[j] + step * slope)
        if priced:
            extra = max(0.0, extra + step * over * scale * scale)
    return best_price, best_extra, best_bound
