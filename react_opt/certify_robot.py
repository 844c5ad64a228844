"""The rules of an OROS plan that concern one robot: its rows, its motion, its sensing and its battery."""

from __future__ import annotations

from collections.abc import Iterator

from react_opt.certify_base import Violation, agree, shown, slack
from react_opt.certify_replay import Case, Walk
from react_opt.plan import OrosStep


def _at(rule: str, walk: Walk, row: OrosStep, message: str, amount: float | None = None) -> Violation:
    return Violation(rule, walk.robot.id, row.t, amount, message)


def steps(case: Case) -> Iterator[Violation]:
    """A robot has one row per instant t = start_step..T, in order."""
    start = {robot.id: robot.start_step for robot in case.instance.robots}
    horizon = case.instance.horizon_steps
    for part in case.plan.robots:
        if part.id not in start:
            continue
        expected = start[part.id]
        for row in part.steps:
            if row.t != expected:
                break
            expected += 1
        else:
            if expected == horizon + 1:
                continue
        found = part.steps[expected - start[part.id]].t if expected - start[part.id] < len(part.steps) else None
        wanted = f"t = {expected}" if expected <= horizon else f"no row after t = {horizon}"
        text = f"expected rows for t = {start[part.id]}..{horizon}: {wanted}, found {shown(found)}"
        yield Violation("steps", part.id, expected, None, text)


def start(case: Case) -> Iterator[Violation]:
    """At start_step a robot stands at its start."""
    for walk in case.walks:
        if walk.rows[0].cell != walk.robot.start:
            text = f"expected cell {shown(walk.robot.start)}, found {_cell(walk.rows[0].cell)}"
            yield _at("start", walk, walk.rows[0], text)


def arc(case: Case) -> Iterator[Violation]:
    """An arc that is started exists, and leaves the cell where the robot stands."""
    for walk in case.walks:
        for row in walk.rows:
            if row.arc is None:
                continue
            travel = walk.travel(row)
            if travel is None:
                text = f"expected an index below {len(case.instance.travel)} in travel, found {shown(row.arc)}"
                yield _at("arc", walk, row, text)
            elif row.cell is None:
                yield _at("arc", walk, row, f"expected no arc while under way, found {shown(row.arc)}")
            elif travel.from_ != row.cell:
                text = f"arc {row.arc} leaves {shown(travel.from_)}, but the robot stands at {_cell(row.cell)}"
                yield _at("arc", walk, row, text)


def motion(case: Case) -> Iterator[Violation]:
    """After a wait a robot stands where it stood; an arc keeps it out of all cells until it arrives where it leads."""
    for walk in case.walks:
        place, arrives = walk.rows[0].cell, walk.rows[0].t
        for row in walk.rows:
            if row.t < arrives:
                if row.cell is not None:
                    text = f"expected no cell before the arrival at t = {shown(arrives)}, found {shown(row.cell)}"
                    yield _at("motion", walk, row, text)
                    place, arrives = row.cell, row.t
            elif row.cell != place:
                yield _at("motion", walk, row, f"expected cell {_cell(place)}, found {_cell(row.cell)}")
                place = row.cell
            elif row.cell is not None and row.cell not in case.cells:
                yield _at("motion", walk, row, f"expected the id of a cell, found {shown(row.cell)}")
            travel = walk.travel(row)
            if row.cell is not None and travel is not None:
                place, arrives = travel.to, row.t + travel.steps


def horizon(case: Case) -> Iterator[Violation]:
    """An arc ends by T."""
    for walk in case.walks:
        for row in walk.rows:
            travel = walk.travel(row) if row.arc is not None else None
            if travel is not None and row.t + travel.steps > case.instance.horizon_steps:
                text = (
                    f"arc {row.arc} takes {shown(travel.steps)} steps and ends after T = {case.instance.horizon_steps}"
                )
                yield _at("horizon", walk, row, text)


def speed(case: Case) -> Iterator[Violation]:
    """The speed is that of the arc started, and absent where none is started."""
    for walk in case.walks:
        for row in walk.rows:
            travel = walk.travel(row) if row.arc is not None else None
            expected = travel.speed_m_s if travel is not None else None
            if row.speed_m_s is None and expected is None:
                continue
            if row.speed_m_s is None or expected is None or not agree(row.speed_m_s, expected):
                text = f"expected speed_m_s {shown(expected)}, found {shown(row.speed_m_s)}"
                yield _at("speed", walk, row, text)


def sensing(case: Case) -> Iterator[Violation]:
    """A robot senses only while it stands in a cell, and not before t = 1."""
    for walk in case.walks:
        for row in walk.rows:
            if row.sensing and not walk.may_sense(row):
                text = "expected no sensing while under way" if row.cell is None else "expected no sensing at t = 0"
                yield _at("sensing", walk, row, text)


def useful_sensing(case: Case) -> Iterator[Violation]:
    """No robot senses where it earns nothing."""
    for walk in case.walks:
        for row in walk.rows:
            if not (row.sensing and walk.may_sense(row) and row.cell in case.cells):
                continue
            assert row.cell is not None
            cell = case.cells[row.cell]
            reason = ""
            if cell.explored:
                reason = "is explored from the start"
            elif row.t > case.first_sensed[cell.id][0]:
                reason = f"is explored since t = {case.first_sensed[cell.id][0]}"
            elif row.t > case.deadline(cell):
                reason = f"earns nothing after t = {case.deadline(cell)}"
            elif cell.weight == 0:
                reason = "has no weight"
            if reason:
                yield _at("useful_sensing", walk, row, f"sensing earns nothing: cell {shown(cell.id)} {reason}")


def battery(case: Case) -> Iterator[Violation]:
    """The battery stated is the battery worked out step by step; told again only where the difference changes."""
    for walk in case.walks:
        told = 0.0
        for row, level in zip(walk.rows, walk.battery_j, strict=True):
            off = row.battery_j - level
            if agree(row.battery_j, level):
                told = 0.0
            elif not agree(row.battery_j, level + told):
                told = off
                text = f"expected battery_j {shown(level)}, found {shown(row.battery_j)}"
                yield _at("battery", walk, row, text, off)


def reserve(case: Case) -> Iterator[Violation]:
    """The battery, worked out anew, is never below the reserve; told once per spell."""
    for walk in case.walks:
        floor, below = walk.robot.reserve_j, False
        for row, level in zip(walk.rows, walk.battery_j, strict=True):
            was, below = below, not level >= floor - slack(level, floor)
            if below and not was:
                text = f"battery {shown(level)} J is below the reserve of {shown(floor)} J"
                yield _at("reserve", walk, row, text, floor - level)


def capacity(case: Case) -> Iterator[Violation]:
    """The battery, worked out anew, is never above the capacity; told once per spell."""
    for walk in case.walks:
        ceiling, above = walk.robot.capacity_j, False
        for row, level in zip(walk.rows, walk.battery_j, strict=True):
            was, above = above, not level <= ceiling + slack(level, ceiling)
            if above and not was:
                text = f"battery {shown(level)} J is above the capacity of {shown(ceiling)} J"
                yield _at("capacity", walk, row, text, level - ceiling)


def charging_place(case: Case) -> Iterator[Violation]:
    """A robot charges only while it waits, from t - 1 to t, at a charger."""
    for walk, row, cell in case.charging():
        if cell is None:
            yield _at("charging_place", walk, row, "expected charging only after a wait in the same cell")
        elif cell not in case.chargers:
            yield _at("charging_place", walk, row, f"there is no charger in cell {shown(cell)}")


def charging_power(case: Case) -> Iterator[Violation]:
    """In one step a charger gives between nothing and power times step."""
    for walk, row, cell in case.charging():
        if row.charging_j < 0:
            yield _at("charging_power", walk, row, "expected charging_j >= 0", -row.charging_j)
        elif cell in case.chargers:
            most = case.chargers[cell].power_w * case.instance.step_s
            if row.charging_j > most + slack(most):
                text = f"charged {shown(row.charging_j)} J, at most {shown(most)} J in one step"
                yield _at("charging_power", walk, row, text, row.charging_j - most)


def return_to(case: Case) -> Iterator[Violation]:
    """A robot with ``return_to`` stands there at T."""
    for walk in case.walks:
        goal = walk.robot.return_to
        if goal is not None and walk.rows[-1].cell != goal:
            text = f"expected cell {shown(goal)} at T, found {_cell(walk.rows[-1].cell)}"
            yield _at("return_to", walk, walk.rows[-1], text)


def _cell(name: str | None) -> str:
    return "none" if name is None else shown(name)
