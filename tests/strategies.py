"""Seeded random OROS instances that use every option, and random good plans of them.

Everything follows from a seed, so hypothesis (through :func:`seeds`) and plain parametrised tests share it. A
plan made here is right by construction and far from best; it owes nothing to the package's solvers or checker.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from hypothesis import strategies as st

from react_opt.instance import OrosInstance, OrosRobot
from react_opt.jsonio import parse, sha256
from react_opt.plan import OrosPlan

Rng = np.random.Generator


def seeds() -> st.SearchStrategy[int]:
    """Seeds for the generators of this module."""
    return st.integers(0, 2**32 - 1)


@dataclass(frozen=True)
class Size:
    """Ranges (inclusive) of a random instance."""

    cells: tuple[int, int] = (2, 4)
    horizon: tuple[int, int] = (1, 5)
    robots: tuple[int, int] = (1, 2)


TINY = Size()
MIDDLE = Size(cells=(3, 9), horizon=(3, 14), robots=(1, 4))


def random_oros(seed: int, size: Size = TINY) -> OrosInstance:
    """Return a random instance; about one in eight is infeasible by its batteries, limits or places of return."""
    rng = np.random.default_rng(seed)
    return parse(oros_data(rng, size, name=f"random {seed}"), kind="oros")


def oros_data(rng: Rng, size: Size = TINY, name: str = "random") -> dict[str, Any]:
    """Return a random instance as plain data, each option present with a fair chance."""
    n = _among(rng, size.cells)
    horizon = _among(rng, size.horizon)
    step_s = float(rng.choice([1.0, 2.5, 10.0]))
    ids = [f"c{i}" for i in range(n)]
    cells = [_cell(rng, ids[i], horizon) for i in range(n)]
    robots = [_robot(rng, f"r{k}", ids, horizon, step_s) for k in range(_among(rng, size.robots))]
    data: dict[str, Any] = {
        "kind": "oros",
        "schema_version": 1,
        "name": name,
        "horizon_steps": horizon,
        "step_s": step_s,
        "cells": cells,
        "travel": _travel(rng, ids, horizon),
        "robots": robots,
    }
    if rng.random() < 0.4:
        places = rng.choice(ids, size=min(n, int(rng.integers(1, 3))), replace=False)
        data["chargers"] = [
            {
                "cell": str(cell),
                "power_w": float(rng.choice([0.5, 3.0, 20.0, 200.0])),
                "slots": int(rng.choice([0, 1, 1, 2])),
            }
            for cell in places
        ]
    limits: dict[str, Any] = {}
    if rng.random() < 0.3:
        limits["robots_per_cell"] = int(rng.choice([1, 1, 2]))
    if rng.random() < 0.35:
        limits["forbid_swaps"] = True
    if rng.random() < 0.3:
        limits["sensing_robots_per_step"] = int(rng.choice([0, 1, 1, 1]))
    if limits:
        data["limits"] = limits
    sigma = rng.choice([-1.0, -1.0, 0.0, 1e-6, 0.01, 0.7])
    if sigma >= 0:
        data["objective"] = {"sigma": float(sigma)}
    return data


def _among(rng: Rng, ends: tuple[int, int]) -> int:
    return int(rng.integers(ends[0], ends[1] + 1))


def _cell(rng: Rng, name: str, horizon: int) -> dict[str, Any]:
    cell: dict[str, Any] = {"id": name, "x_m": float(rng.integers(0, 50)), "y_m": float(rng.integers(0, 50))}
    if rng.random() < 0.5:
        cell["weight"] = float(rng.choice([0.0, 0.5, 1.0, 2.0, 3.7]))
    if rng.random() < 0.4:
        cell["deadline_step"] = int(rng.integers(0, horizon + 3))
    if rng.random() < 0.12:
        cell["explored"] = True
    return cell


def _robot(rng: Rng, name: str, cells: list[str], horizon: int, step_s: float) -> dict[str, Any]:
    reserve = float(rng.choice([0.0, 0.0, 5.0, 12.5]))
    # J per second over the whole horizon: from nothing (waiting may be impossible) to plenty
    battery = reserve + float(rng.choice([0.0, 2.0, 5.0, 12.0, 12.0, 40.0, 150.0])) * step_s * horizon
    robot: dict[str, Any] = {
        "id": name,
        "start": str(rng.choice(cells)),
        "battery_j": battery,
        "capacity_j": battery + float(rng.choice([0.0, 7.0, 50.0])),
        "idle_w": float(rng.choice([0.0, 1.0, 2.0, 3.3])),
        "sensing_w": float(rng.choice([0.0, 3.0, 16.9])),
    }
    if reserve or rng.random() < 0.5:
        robot["reserve_j"] = reserve
    if rng.random() < 0.3:
        robot["start_step"] = int(rng.integers(0, horizon + 1))
    if rng.random() < 0.25:
        robot["return_to"] = str(rng.choice(cells))
    return robot


def _travel(rng: Rng, cells: list[str], horizon: int) -> list[dict[str, Any]]:
    """Return arcs along a random connected graph: mostly both ways, with speed modes and dearer duplicates."""
    edges = {(int(rng.integers(0, i)), i) for i in range(1, len(cells))}
    edges |= {(i, j) for i in range(len(cells)) for j in range(i + 1, len(cells)) if rng.random() < 0.2}
    rows: list[dict[str, Any]] = []
    for edge in sorted(edges):
        for i, j in (edge, edge[::-1]):
            if rng.random() < 0.1:
                continue
            steps = int(rng.choice([1, 1, 1, 2, 2, 3, horizon + 1]))
            joules = float(rng.choice([0.0, 10.0, 37.5, 70.0]))
            rows.append(_arc(rng, cells[i], cells[j], steps, joules))
            if rng.random() < 0.25:  # a slower, thriftier speed mode
                rows.append(_arc(rng, cells[i], cells[j], steps + 1, 0.6 * joules))
            if rng.random() < 0.15:  # a duplicate that costs more
                rows.append(_arc(rng, cells[i], cells[j], steps, joules + 5.0))
    rng.shuffle(rows)  # type: ignore[arg-type]
    return rows


def _arc(rng: Rng, i: str, j: str, steps: int, joules: float) -> dict[str, Any]:
    row: dict[str, Any] = {"from": i, "to": j, "steps": steps, "energy_j": joules}
    if rng.random() < 0.5:
        row["speed_m_s"] = round(10.0 / steps, 3)
    return row


# --- good plans ---


@dataclass
class _Drive:
    """A robot's rows while they are made; ``spent_j`` is the debit that leads to the row."""

    robot: OrosRobot
    cell: list[str | None] = field(default_factory=list)
    arc: list[int | None] = field(default_factory=list)
    charge_j: list[float] = field(default_factory=list)
    level_j: list[float] = field(default_factory=list)
    sensing: list[bool] = field(default_factory=list)


def random_plan(instance: OrosInstance, seed: int, tries: int = 60) -> OrosPlan | None:
    """Return a random good plan, claimed ``feasible`` without a bound; None where no try led to one."""
    rng = np.random.default_rng(seed)
    for _ in range(tries):
        drives: list[_Drive] = []
        for robot in instance.robots:
            drive = _random_drive(instance, robot, drives, rng)
            if drive is None:
                break
            drives.append(drive)
        else:
            explored = _sense(instance, drives, rng)
            return _as_plan(instance, drives, explored)
    return None


def _random_drive(instance: OrosInstance, robot: OrosRobot, others: list[_Drive], rng: Rng) -> _Drive | None:
    limits, horizon = instance.limits, instance.horizon_steps
    chargers = {charger.cell: charger for charger in instance.chargers}

    def full(t: int, cell: str) -> bool:
        if limits.robots_per_cell is None or t < 1:
            return False
        return sum(_at(other, t) == cell for other in others) >= limits.robots_per_cell

    def swaps(t: int, index: int) -> bool:
        mine = instance.travel[index]
        for other in others:
            for k, theirs in enumerate(other.arc):
                if theirs is not None and limits.forbid_swaps:
                    arc, begin = instance.travel[theirs], other.robot.start_step + k
                    opposite = (arc.from_, arc.to) == (mine.to, mine.from_)
                    if opposite and max(begin, t) < min(begin + arc.steps, t + mine.steps):
                        return True
        return False

    t, cell, level = robot.start_step, robot.start, robot.battery_j
    if full(t, cell):
        return None
    drive = _Drive(robot)
    charge = 0.0
    while True:
        drive.cell.append(cell)
        drive.charge_j.append(charge)
        drive.level_j.append(level)
        drive.sensing.append(False)
        if t == horizon:
            drive.arc.append(None)
            break
        moves: list[int | None] = [
            index
            for index, arc in enumerate(instance.travel)
            if arc.from_ == cell
            and t + arc.steps <= horizon
            and level - arc.energy_j >= robot.reserve_j
            and not full(t + arc.steps, arc.to)
            and not swaps(t, index)
        ]
        idle_j = robot.idle_w * instance.step_s
        charger, most = chargers.get(cell), 0.0
        if charger is not None:
            users = sum(
                _at(o, t + 1) == cell and o.charge_j[t + 1 - o.robot.start_step] > 0 for o in others if _at(o, t + 1)
            )
            if users < charger.slots:
                most = min(charger.power_w * instance.step_s, robot.capacity_j - level + idle_j)
        if level - idle_j + most >= robot.reserve_j and not full(t + 1, cell):
            moves.append(None)
        if not moves:
            return None
        move = moves[int(rng.integers(len(moves)))]
        drive.arc.append(move)
        if move is None:
            least = max(0.0, robot.reserve_j - (level - idle_j))
            charge = max(least, float(rng.choice([0.0, 0.5, 1.0])) * most)
            level += charge - idle_j
            t += 1
        else:
            arc = instance.travel[move]
            level -= arc.energy_j
            for _ in range(arc.steps - 1):
                drive.cell.append(None)
                drive.arc.append(None)
                drive.charge_j.append(0.0)
                drive.level_j.append(level)
                drive.sensing.append(False)
            t, cell, charge = t + arc.steps, arc.to, 0.0
    return drive if robot.return_to in (None, cell) else None


def _at(drive: _Drive, t: int) -> str | None:
    """Return the cell where a robot stands at t, None where it stands in none."""
    k = t - drive.robot.start_step
    return drive.cell[k] if 0 <= k < len(drive.cell) else None


def _sense(instance: OrosInstance, drives: list[_Drive], rng: Rng) -> list[dict[str, Any]]:
    """Switch sensing on at random where it earns something and the battery allows; return what is explored."""
    horizon = instance.horizon_steps
    cells = {cell.id: cell for cell in instance.cells}
    most = instance.limits.sensing_robots_per_step
    explored: dict[str, dict[str, Any]] = {}
    for t in range(1, horizon + 1):
        users = 0
        for drive in drives:
            name, k = _at(drive, t), t - drive.robot.start_step
            if name is None or name in explored or (most is not None and users >= most):
                continue
            cell, joules = cells[name], drive.robot.sensing_w * instance.step_s
            deadline = horizon if cell.deadline_step is None else cell.deadline_step
            spare = min(drive.level_j[k:]) - drive.robot.reserve_j
            if cell.explored or cell.weight == 0 or t > deadline or spare < joules or rng.random() < 0.2:
                continue
            drive.sensing[k] = True
            drive.level_j[k:] = [level - joules for level in drive.level_j[k:]]
            users += 1
            explored[name] = {"cell": name, "step": t, "robot": drive.robot.id}
    return list(explored.values())


def _as_plan(instance: OrosInstance, drives: list[_Drive], explored: list[dict[str, Any]]) -> OrosPlan:
    robots = []
    for drive in drives:
        steps = []
        for k, cell in enumerate(drive.cell):
            index = drive.arc[k]
            speed = None if index is None else instance.travel[index].speed_m_s
            steps.append(
                {"t": drive.robot.start_step + k, "cell": cell, "arc": index, "speed_m_s": speed}
                | {"sensing": drive.sensing[k], "charging_j": drive.charge_j[k], "battery_j": drive.level_j[k]}
            )
        robots.append({"id": drive.robot.id, "steps": steps})
    when = {row["cell"]: row["step"] for row in explored}
    coverage = 0.0
    for t in range(1, instance.horizon_steps + 1):
        for cell in instance.cells:
            if cell.deadline_step is None or t <= cell.deadline_step:
                coverage += cell.weight * (cell.explored or when.get(cell.id, math.inf) <= t)
    left_j = sum(drive.level_j[-1] for drive in drives)
    total = coverage + instance.sigma * left_j
    return parse(
        {
            "kind": "oros_plan",
            "instance": {"name": instance.name, "sha256": sha256(instance)},
            "claim": {"status": "feasible", "objective": total},
            "robots": robots,
            "explored": explored,
            "objective": {
                "coverage": coverage,
                "battery": instance.sigma * left_j,
                "battery_j": left_j,
                "total": total,
            },
        }
    )
