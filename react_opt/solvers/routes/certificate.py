"""The certificate of a Lagrangian bound: all that is needed to compute it again, as plain JSON data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from react_opt.route_problem import RouteProblem
from react_opt.solvers.routes.cuts import SubsetRow
from react_opt.solvers.routes.finish import Finished
from react_opt.solvers.routes.generation import Multipliers
from react_opt.solvers.routes.memory import Memory
from react_opt.solvers.routes.rows import ChargeRow, SenseRow, StandRow
from react_opt.solvers.routes.tree import Part


def certificate(
    problem: RouteProblem,
    memory: Memory,
    best: Multipliers,
    joule_price: Sequence[float],
    enumerated: Finished | None = None,
) -> dict[str, Any]:
    """Return the certificate of a bound.

    ``bound = sum(cell_price) + sum(price * rhs) + sum_k robots_k * best_k``, where ``best_k`` is the most that a
    route of class k is worth after its prices when it may collect again what it has forgotten: standing in cell
    j it remembers the cells of ``memory[j]`` only. Cells are indices into ``cells[]``, robots into ``robots[]``.

    Parameters
    ----------
    problem
        The route problem.
    memory
        The ng-sets with which the bound was computed.
    best
        The multipliers, what they price, and the bound.
    joule_price
        For each class a price of a joule at which the battery may be relaxed; it speeds up the recomputation and
        is of no consequence for the bound.
    enumerated
        A smaller bound that rests on the enumeration of all routes that lose less than it lies below the
        multipliers' own, and on prices over these routes if there are any.
    """
    return {
        "kind": "lagrangian",
        **_prices(problem, best, joule_price, enumerated),
        "memory": _remembered(memory),
    }


def tree_certificate(problem: RouteProblem, memory: Memory, root: Part, joule_price: Sequence[float]) -> dict[str, Any]:
    """Return the certificate of a tree: its questions, and prices at each leaf.

    ``tree`` is a list that begins with the root. An inner node is ``{"cell", "by" | "robots", "yes", "no"}``: is the
    cell collected by that instant, or by one of those robots? ``yes`` and ``no`` are positions in the list, after that
    of the node (a tree may be deeper than JSON should be nested). A leaf holds what :func:`certificate` does but for
    the memory, which is the same everywhere.

    Parameters
    ----------
    problem
        The route problem.
    memory
        The ng-sets at the end; no bound of a leaf was computed with larger ones.
    root
        The whole tree.
    joule_price
        As for :func:`certificate`.
    """
    parts, nodes = [root], list[dict[str, Any]]()
    bound = -math.inf
    for part in parts:  # grows on the way
        split = part.split
        if split is not None and part.yes is not None and part.no is not None:
            robots = list(problem.classes[split.group].robots)
            question = {"robots": robots} if split.by is None else {"by": split.by}
            nodes.append({"cell": split.cell, **question, "yes": len(parts), "no": len(parts) + 1})
            parts += [part.yes, part.no]
            continue
        bound = max(bound, part.bound)
        if part.enumerated is not None and part.enumerated[1].bound <= part.bound:
            nodes.append(_prices(problem, part.enumerated[0], joule_price, part.enumerated[1]))
        else:
            nodes.append(_prices(problem, part.known, joule_price))
    return {"kind": "tree", "bound": bound, "memory": _remembered(memory), "tree": nodes}


def _remembered(memory: Memory) -> str | list[list[int]]:
    return "all" if memory.complete else [sorted(cells) for cells in memory.near]


def _prices(
    problem: RouteProblem, best: Multipliers, joule_price: Sequence[float], enumerated: Finished | None = None
) -> dict[str, Any]:
    """Return the prices of a bound."""
    priced_cuts = [
        {"cells": sorted(cut.cells), "memory": sorted(cut.memory), "price": float(price)}
        for cut, price in zip(best.cuts, best.duals.cut, strict=True)
        if price > 0 and isinstance(cut, SubsetRow)
    ]
    priced_rows: list[dict[str, Any]] = []
    for row, price in zip(best.rows, best.duals.row, strict=True):
        if price <= 0:
            continue
        if isinstance(row, StandRow):
            place = {"rule": "robots_per_cell", "cell": row.cell, "t": problem.horizon - row.from_end}
        elif isinstance(row, SenseRow):
            place = {"rule": "sensing_robots_per_step", "t": problem.horizon - row.from_end}
        elif isinstance(row, ChargeRow):
            place = {"rule": "charging_slots", "cell": row.cell, "t": problem.horizon - row.from_end}
        else:
            continue
        priced_rows.append({**place, "price": float(price)})
    return {
        **({"bound": float(best.bound)} if enumerated is None else _of_enumeration(enumerated)),
        "cell_price": [float(price) for price in best.duals.cell],
        "classes": [
            {"robots": list(group.robots), "best": float(worth), "joule_price": float(rate)}
            for group, worth, rate in zip(problem.classes, best.duals.group, joule_price, strict=True)
        ],
        "cuts": priced_cuts,
        "rows": priced_rows,
    }


def _of_enumeration(finished: Finished) -> dict[str, Any]:
    """Return a bound that rests on enumerated routes, and the prices over these."""
    said: dict[str, Any] = {"bound": float(finished.bound), "enumerated": True}
    if finished.stages:
        said["pool"] = [
            {
                "cell_price": [float(price) for price in stage.cell],
                "cuts": [
                    {"cells": list(cut.cells), "times": list(cut.times), "over": cut.over, "price": float(price)}
                    for cut, price in zip(stage.cuts, stage.price, strict=True)
                    if price > 0
                ],
            }
            for stage in finished.stages
        ]
    return said
