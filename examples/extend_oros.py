"""Extend the OROS model by an equation of your own: two robots in sight of each other whenever one of them senses.

After a collapse nobody should work alone: where robot r senses in cell i at instant t, some other robot must stand in
i or in a cell with a passage to i. In the model, for every r, i, t::

    s[r,i,t] <= sum over the other robots q and over j in {i} + neighbours of i of y[q,j,t]

Run ``python examples/extend_oros.py``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from react_opt import load
from react_opt.instance import OrosInstance
from react_opt.models.oros import OrosModel, oros_model
from react_opt.route_problem import Route
from react_opt.solvers.outcome import Outcome, Request
from react_opt.solvers.registry import backend

FACTORY = Path(__file__).parent / "factory"


def neighbours(model: OrosModel) -> list[list[int]]:
    """Return for each cell itself and the cells that an arc leads to."""
    problem = model.problem
    near = [{i} for i in range(problem.n_cells)]
    for i, j in zip(problem.arc_from.tolist(), problem.arc_to.tolist(), strict=True):
        near[i].add(j)
    return [sorted(each) for each in near]


def buddies(model: OrosModel) -> None:
    """Add the equation, one row for every place and instant at which a robot may sense."""
    near = neighbours(model)
    for robot in model.robots:
        nodes = np.argwhere(robot.s >= 0)
        row, column, value = [], [], []
        for m, (i, t) in enumerate(nodes.tolist()):
            row.append(m)
            column.append(int(robot.s[i, t]))
            value.append(1.0)
            for other in model.robots:
                for j in near[i] if other.index != robot.index else ():
                    if other.y[j, t] >= 0:
                        row.append(m)
                        column.append(int(other.y[j, t]))
                        value.append(-1.0)
        model.program.add_rows(f"buddy{robot.index}", nodes, row=row, column=column, value=value, upper=0.0)


def solve_with_buddies(instance: OrosInstance, time_limit_s: float) -> tuple[Outcome, list[Route]]:
    """Solve the extended model with HiGHS and read the routes back."""
    model = oros_model(instance)
    buddies(model)
    outcome = backend("highs").solve(model.program, Request(time_limit_s=time_limit_s))
    return outcome, [] if outcome.x is None else model.routes(outcome.x)


if __name__ == "__main__":
    factory = load(FACTORY / "factory_2_10m.json")
    alone = backend("highs").solve(oros_model(factory).program, Request(time_limit_s=20))
    together, routes = solve_with_buddies(factory, 20)
    print(f"alone    {alone.status:>9}: {alone.objective:.2f} of at most {alone.bound:.2f}")
    print(f"together {together.status:>9}: {together.objective:.2f} of at most {together.bound:.2f}")
    for robot, route in zip(factory.robots, routes, strict=True):
        print(robot.id, " > ".join(factory.cells[i].id for i in route.cell.tolist() if i >= 0))
