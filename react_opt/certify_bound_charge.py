"""What chargers change in the dynamic programme that recomputes a bound: batteries rise while a robot waits at one.

Charging as much as power and capacity allow is never worse; where charging has a price (slots are scarce) leaving it
is tried too. All energies are J, all times whole steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.instance import OrosInstance, OrosRobot

Floats = NDArray[np.float64]


class Charging(NamedTuple):
    """Chargers as one robot sees them.

    ``amount`` is what each cell gives in a step, ``floor`` the energy used when the battery is full (a negative number
    where there is room at the start), ``yet[t, i]`` the most that can be charged from an instant and a cell on, and
    whoever has used no more than ``rich[t, i]`` cannot run short any more.
    """

    amount: Floats
    floor: float
    yet: Floats
    rich: Floats


def charging_of(instance: OrosInstance, robot: OrosRobot) -> Charging | None:
    """Return the chargers for a robot, None if it cannot charge."""
    index = {cell.id: i for i, cell in enumerate(instance.cells)}
    n, last = len(index), instance.horizon_steps
    amount = np.zeros(n)
    for charger in instance.chargers:
        if charger.slots > 0:
            amount[index[charger.cell]] = charger.power_w * instance.step_s
    idle_j, sense_j = robot.idle_w * instance.step_s, robot.sensing_w * instance.step_s
    if not amount.any():
        return None
    arc_from = np.array([index[arc.from_] for arc in instance.travel], dtype=np.int64)
    arc_to = np.array([index[arc.to] for arc in instance.travel], dtype=np.int64)
    steps = np.array([arc.steps for arc in instance.travel], dtype=np.int64)
    energy_j = np.array([arc.energy_j for arc in instance.travel])
    yet, spent = np.zeros((last + 1, n)), np.zeros((last + 1, n))
    for t in range(last - 1, robot.start_step - 1, -1):
        yet[t] = yet[t + 1] + amount
        spent[t] = spent[t + 1] + idle_j + sense_j
        fits = t + steps <= last
        there = (t + steps[fits], arc_to[fits])
        np.maximum.at(yet[t], arc_from[fits], yet[there])
        np.maximum.at(spent[t], arc_from[fits], spent[there] + energy_j[fits] + sense_j)
    if yet[robot.start_step, index[robot.start]] <= 0.0:
        return None
    return Charging(amount, robot.battery_j - robot.capacity_j, yet, robot.battery_j - robot.reserve_j - spent)
