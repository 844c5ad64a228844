"""Optimum of a tiny OROS instance by trying everything: no solver, no model, no time graph.

All fleets' states are carried forward one instant at a time: where each robot stands or which arc it is on, the
batteries and the explored cells. Every joint choice of moves, of sensing and of who uses a charger is tried; equal
states keep the best coverage, nothing else is pruned.

How much to charge needs no choice: charging as much as power and capacity allow gives the highest battery at
every later instant (a robot that is full simply charges less), so it is never worse for reserve or objective.
Only who gets a slot is a choice, and that is tried.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from react_opt.instance import OrosInstance, OrosRobot

EPSILON_J = 1e-9


@dataclass(frozen=True)
class Place:
    """A robot that stands at ``cell``, or is on arc ``arc`` until it arrives at instant ``arrives``."""

    cell: str | None
    arc: int | None = None
    arrives: int = 0


@dataclass(frozen=True)
class State:
    """Places (None before start_step) and batteries by robot, and the explored cells."""

    places: tuple[Place | None, ...]
    levels_j: tuple[float, ...]
    explored: frozenset[str]


def brute_force(instance: OrosInstance) -> float | None:
    """Return the optimal objective of a tiny instance, None where it is infeasible."""
    start = State(
        tuple(None for _ in instance.robots),
        tuple(robot.battery_j for robot in instance.robots),
        frozenset(cell.id for cell in instance.cells if cell.explored),
    )
    best = {start: 0.0}
    for t in range(instance.horizon_steps + 1):
        following: dict[State, float] = {}
        for state, coverage in best.items():
            for arrived, slots in _moved(instance, state, t):
                for sensed in _sensed(instance, arrived, slots, t):
                    value = coverage + _earned(instance, sensed.explored, t)
                    if value > following.get(sensed, -1.0):
                        following[sensed] = value
        best = following
    totals = [
        coverage + instance.sigma * sum(state.levels_j)
        for state, coverage in best.items()
        if all(map(_is_home, instance.robots, state.places))
    ]
    return max(totals, default=None)


def _is_home(robot: OrosRobot, place: Place | None) -> bool:
    assert place is not None
    return place.cell is not None and robot.return_to in (None, place.cell)


def _earned(instance: OrosInstance, explored: frozenset[str], t: int) -> float:
    """What one instant earns: the weight of every explored cell whose deadline has not passed."""
    if t == 0:
        return 0.0
    due = [cell for cell in instance.cells if cell.deadline_step is None or t <= cell.deadline_step]
    return sum(cell.weight for cell in due if cell.id in explored)


def _moved(instance: OrosInstance, state: State, t: int) -> Iterator[tuple[State, dict[int, float]]]:
    """Yield every state at instant t before sensing and charging, with who may charge how much, J."""
    options = [list(_own_moves(instance, k, state, t)) for k in range(len(instance.robots))]
    for joint in itertools.product(*options):
        places = tuple(place for place, _, _ in joint)
        if _crowded(instance, places, t) or _swapping(instance, state, places, t):
            continue
        levels = tuple(state.levels_j[k] - debit for k, (_, debit, _) in enumerate(joint))
        for slots in _slot_uses(instance, [waited for _, _, waited in joint]):
            yield State(places, levels, state.explored), slots


def _own_moves(
    instance: OrosInstance, k: int, state: State, t: int
) -> Iterator[tuple[Place | None, float, str | None]]:
    """Yield where a robot can be at t, what is debited for it at t, and the cell where it waited for that step."""
    robot, place = instance.robots[k], state.places[k]
    if t < robot.start_step:
        yield None, 0.0, None
    elif t == robot.start_step:
        yield Place(robot.start), 0.0, None
    elif place is not None and place.cell is None:
        assert place.arc is not None
        yield (Place(instance.travel[place.arc].to) if place.arrives == t else place), 0.0, None
    elif place is not None:
        yield place, robot.idle_w * instance.step_s, place.cell
        for index, arc in enumerate(instance.travel):
            if arc.from_ == place.cell:
                on = Place(arc.to) if arc.steps == 1 else Place(None, index, t - 1 + arc.steps)
                yield on, arc.energy_j, None


def _crowded(instance: OrosInstance, places: tuple[Place | None, ...], t: int) -> bool:
    most = instance.limits.robots_per_cell
    standing = [place.cell for place in places if place is not None and place.cell is not None]
    return most is not None and t >= 1 and any(standing.count(cell) > most for cell in standing)


def _swapping(instance: OrosInstance, state: State, places: tuple[Place | None, ...], t: int) -> bool:
    """Whether two robots are on opposite arcs of the same two cells during the step from t - 1 to t."""
    if not instance.limits.forbid_swaps:
        return False
    drives = set()
    for before, after in zip(state.places, places, strict=True):
        if before is None or after is None or (before.cell is not None and before.cell == after.cell):
            continue
        index = after.arc if after.arc is not None else before.arc
        arc = instance.travel[index] if index is not None else None
        drives.add((arc.from_, arc.to) if arc is not None else (before.cell, after.cell))
    return any((j, i) in drives for i, j in drives)


def _slot_uses(instance: OrosInstance, waited: list[str | None]) -> Iterator[dict[int, float]]:
    """Yield every way to share the chargers' slots: robot and the most it may charge in this step, J."""
    groups = []
    for charger in instance.chargers:
        waiting = [k for k, cell in enumerate(waited) if cell == charger.cell]
        chosen = itertools.combinations(waiting, min(charger.slots, len(waiting)))
        joules = charger.power_w * instance.step_s
        groups.append([dict.fromkeys(users, joules) for users in chosen])
    for joint in itertools.product(*groups):
        yield {k: joules for users in joint for k, joules in users.items()}


def _sensed(instance: OrosInstance, state: State, slots: dict[int, float], t: int) -> Iterator[State]:
    """Yield every state after sensing and charging at t that keeps reserves and capacities.

    Only the battery after both is limited: what sensing takes at t makes room for what is charged at t.
    """
    able = [k for k, place in enumerate(state.places) if t >= 1 and place is not None and place.cell is not None]
    able = [k for k in able if state.places[k].cell not in state.explored]  # type: ignore[union-attr]
    most = instance.limits.sensing_robots_per_step
    for count in range(len(able) + 1 if most is None else min(most, len(able)) + 1):
        for users in itertools.combinations(able, count):
            levels = []
            for k, robot in enumerate(instance.robots):
                level = state.levels_j[k] - (robot.sensing_w * instance.step_s if k in users else 0.0)
                levels.append(round(level + min(slots.get(k, 0.0), robot.capacity_j - level), 9))
            explored = state.explored | {state.places[k].cell for k in users}  # type: ignore[union-attr]
            if all(
                state.places[k] is None or robot.reserve_j - EPSILON_J <= levels[k]
                for k, robot in enumerate(instance.robots)
            ):
                yield State(state.places, tuple(levels), frozenset(explored))
