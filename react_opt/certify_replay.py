"""What an OROS plan says its robots do, laid out for the rules of :mod:`react_opt.certify_oros`.

Motion and battery are stated here anew, from the instance's own rows: nothing of the time graph, of the energy
law or of a model is used, so that an error there cannot hide itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from react_opt.certify_base import ABSOLUTE
from react_opt.instance import Cell, Charger, OrosInstance, OrosRobot, TravelArc
from react_opt.plan import OrosPlan, OrosStep


@dataclass(frozen=True)
class Walk:
    """One robot and the rows that the plan holds for it, one per instant start_step..T (at least one)."""

    robot: OrosRobot
    rows: tuple[OrosStep, ...]
    instance: OrosInstance

    def travel(self, row: OrosStep) -> TravelArc | None:
        """Return the arc that is started in a row, None where there is none or no such arc."""
        if row.arc is None or row.arc >= len(self.instance.travel):
            return None
        return self.instance.travel[row.arc]

    def pairs(self) -> Iterator[tuple[OrosStep, OrosStep]]:
        """Yield each row with the one before it, from the second row on."""
        return zip(self.rows, self.rows[1:], strict=False)

    def may_sense(self, row: OrosStep) -> bool:
        """Return whether sensing is possible at a row: standing, at t >= 1."""
        return row.cell is not None and row.t >= 1

    @cached_property
    def battery_j(self) -> tuple[float, ...]:
        """``b[r,t]`` per row, worked out from what the robot does.

        The energy of an arc or of a wait that starts at t is debited at t + 1 (a long arc's later steps cost
        nothing more, a wait costs its idle energy also while charging), sensing at t is debited at t, and
        what is charged is credited at t. A row that names an arc pays for the arc it names, also where a
        parallel arc of as many steps is cheaper.
        """
        idle_j = self.robot.idle_w * self.instance.step_s
        sensing_j = self.robot.sensing_w * self.instance.step_s
        level = self.robot.battery_j
        levels = []
        debit = 0.0
        for row in self.rows:
            level -= debit
            if row.sensing:
                level -= sensing_j
            level += row.charging_j
            levels.append(level)
            arc = self.travel(row)
            debit = arc.energy_j if arc is not None else idle_j if row.cell is not None else 0.0
        return tuple(levels)


@dataclass(frozen=True)
class Case:
    """An instance and a plan of it, with the look-ups that several rules need."""

    instance: OrosInstance
    plan: OrosPlan

    @cached_property
    def cells(self) -> dict[str, Cell]:
        """Cells by id."""
        return {cell.id: cell for cell in self.instance.cells}

    @cached_property
    def chargers(self) -> dict[str, Charger]:
        """Chargers by cell."""
        return {charger.cell: charger for charger in self.instance.chargers}

    @cached_property
    def walks(self) -> tuple[Walk, ...]:
        """The robots whose rows are all there and in order; the others break the rules ``robots`` or ``steps``."""
        robots = {robot.id: robot for robot in self.instance.robots}
        walks: dict[str, Walk] = {}
        for part in self.plan.robots:
            robot = robots.get(part.id)
            if robot is not None and part.id not in walks:
                instants = range(robot.start_step, self.instance.horizon_steps + 1)
                if len(part.steps) == len(instants) and all(
                    row.t == t for row, t in zip(part.steps, instants, strict=True)
                ):
                    walks[part.id] = Walk(robot, part.steps, self.instance)
        return tuple(walks.values())

    @property
    def whole(self) -> bool:
        """True where every robot of the instance has its walk, so that sums over the fleet mean something."""
        return len(self.walks) == len(self.instance.robots)

    def deadline(self, cell: Cell) -> int:
        """Return the last instant at which exploring a cell earns something; above T means T."""
        horizon = self.instance.horizon_steps
        return horizon if cell.deadline_step is None else min(cell.deadline_step, horizon)

    @cached_property
    def first_sensed(self) -> dict[str, tuple[int, set[str]]]:
        """Newly explored cells: the first instant at which a robot there senses, and every robot that does so then."""
        first: dict[str, tuple[int, set[str]]] = {}
        for walk in self.walks:
            for row in walk.rows:
                if not (row.sensing and walk.may_sense(row) and row.cell in self.cells):
                    continue
                assert row.cell is not None
                if self.cells[row.cell].explored:
                    continue
                step, robots = first.get(row.cell, (row.t, set()))
                if row.t < step:
                    step, robots = row.t, set()
                if row.t == step:
                    first[row.cell] = (step, robots | {walk.robot.id})
        return first

    def charging(self) -> Iterator[tuple[Walk, OrosStep, str | None]]:
        """Yield each row that charges, with the cell where the robot waited for it (None if it did not wait)."""
        for walk in self.walks:
            before: OrosStep | None = None
            for row in walk.rows:
                if abs(row.charging_j) > ABSOLUTE:
                    waited = before is not None and before.arc is None and before.cell == row.cell
                    yield walk, row, row.cell if waited else None
                before = row

    def coverage(self) -> float:
        """Return ``sum_{t=1..T} sum_i w_i e[i,t]``, for each cell only the t <= its deadline.

        A cell that is explored from the start is explored at every t, so it earns at every t.
        """
        total = 0.0
        for cell in self.instance.cells:
            if cell.explored:
                total += cell.weight * self.deadline(cell)
            elif cell.id in self.first_sensed:
                step, _ = self.first_sensed[cell.id]
                total += cell.weight * max(self.deadline(cell) - step + 1, 0)
        return total

    def battery_left_j(self) -> float:
        """Return ``sum_r b[r,T]``."""
        return sum(walk.battery_j[-1] for walk in self.walks)
