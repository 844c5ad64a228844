"""The independent check of a proven bound: compute it again from its certificate.

A certificate holds prices. For any prices that are not negative

    bound = sum_i pi_i + sum_c price_c rhs_c + sum_k robots_k * best_k

is above every plan of the instance, where ``best_k`` is the most that one robot of class k can be worth once it
pays the prices, even if it may collect a cell again after forgetting it (standing in cell j it remembers the
cells of ``memory[j]``).

A certificate of a tree asks questions, "is the cell collected by this instant?" or "by one of these robots?". A plan
that senses no cell in vain answers each with yes or no, so the largest bound of the leaves holds for all plans. In
a leaf only the collections are priced that its answers leave, and the price of a cell that is collected in any case
may be negative.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from react_opt.certify_bound_best import best_route
from react_opt.certify_bound_choice import best_of, repriced
from react_opt.certify_bound_enumerate import worthwhile_routes
from react_opt.certify_bound_route import Prices, lowest_prices
from react_opt.errors import UsageError
from react_opt.instance import OrosInstance, OrosRobot

RULES = ("robots_per_cell", "sensing_robots_per_step", "charging_slots")


@dataclass(frozen=True)
class _Part:
    """Plans in which each robot collects each cell within a window of instants only, and some cells in any case."""

    first: NDArray[np.int64]  # (n_robots, n_cells)
    last: NDArray[np.int64]
    must: NDArray[np.bool_]  # (n_cells,)

    def side(self, question: Mapping[str, Any], yes: bool) -> _Part:
        """Return the plans of this part that answer a question with yes or no."""
        i = int(question["cell"])
        first, last, must = self.first.copy(), self.last.copy(), self.must.copy()
        must[i] |= yes
        if "by" in question:
            t = int(question["by"])
            if yes:
                last[:, i] = np.minimum(last[:, i], t)
            else:
                first[:, i] = np.maximum(first[:, i], t + 1)
        else:
            named = np.isin(np.arange(len(first)), [int(r) for r in question["robots"]])
            last[~named if yes else named, i] = -1
        return _Part(first, last, must)


def recompute_bound(
    instance: OrosInstance, certificate: Mapping[str, Any], tell: Callable[[float], None] = lambda share: None
) -> float:
    """Return the bound that a certificate proves for an instance.

    Parameters
    ----------
    instance
        The instance that the certificate is about.
    certificate
        As written by the route decomposition (``claim.certificate``).
    tell
        Called now and then with the share of the work that is done, from 0 to 1.

    Raises
    ------
    UsageError
        If the certificate does not fit the instance or is of an unknown kind.
    """
    try:
        return _recomputed(instance, certificate, tell)
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as fault:
        raise UsageError(f"the certificate cannot be read: {type(fault).__name__}: {fault}") from fault


def _recomputed(instance: OrosInstance, certificate: Mapping[str, Any], tell: Callable[[float], None]) -> float:
    kind = certificate.get("kind")
    if kind not in ("lagrangian", "tree"):
        raise UsageError("the certificate is of an unknown kind; expected 'lagrangian' or 'tree'")
    shape = (len(instance.robots), len(instance.cells))
    whole = _Part(
        np.zeros(shape, dtype=np.int64),
        np.full(shape, instance.horizon_steps, dtype=np.int64),
        np.zeros(shape[1], dtype=np.bool_),
    )
    memory = _memory(instance, certificate)
    if kind == "lagrangian":
        bound = _bound_of(instance, certificate, memory, whole, tell)
    else:
        bound = _bound_of_tree(instance, certificate["tree"], memory, whole, tell)
    if not math.isfinite(bound):
        raise UsageError("the certificate proves no number")
    return _explored_value(instance) + _rounded(instance, bound)


def _bound_of_tree(
    instance: OrosInstance,
    tree: list[Mapping[str, Any]],
    memory: list[list[int]],
    whole: _Part,
    tell: Callable[[float], None],
) -> float:
    """Return the largest bound of the leaves; a node's answers stand after it in the list, each asked about once."""
    part_of, worst = {0: whole}, -math.inf
    for place, node in enumerate(tree):
        if place not in part_of:
            raise UsageError("the certificate's tree is none: nothing leads to one of its parts")
        part = part_of.pop(place)
        if "cell" not in node:
            worst = max(worst, _bound_of(instance, node, memory, part, lambda share: None))
            tell((place + 1) / len(tree))
            continue
        if not 0 <= int(node["cell"]) < len(instance.cells):
            raise UsageError("the certificate's tree asks about a cell that the instance does not have")
        for side in ("yes", "no"):
            answer = int(node[side])
            if not place < answer < len(tree) or answer in part_of:
                raise UsageError("the certificate's tree is none: an answer is before its question or used twice")
            part_of[answer] = part.side(node, side == "yes")
    return worst


def _explored_value(instance: OrosInstance) -> float:
    """Return what cells that are explored from the start earn, in every plan; certificates leave it out."""
    last = instance.horizon_steps
    return sum(
        cell.weight * min(last, last if cell.deadline_step is None else cell.deadline_step)
        for cell in instance.cells
        if cell.explored
    )


def _bound_of(
    instance: OrosInstance,
    leaf: Mapping[str, Any],
    memory: list[list[int]],
    part: _Part,
    tell: Callable[[float], None],
) -> float:
    """Return the bound on the plans of a part that the prices of a leaf prove."""
    prices = _read(instance, leaf, memory, part)
    if leaf.get("enumerated", False):
        return _bound_of_choice(instance, leaf, prices, part)
    total = float(prices.cell.sum()) + sum(prices.cut_price) + prices.rows_worth
    classes = _classes(instance, leaf, part)
    for done, (group, robot, first, last) in enumerate(classes):
        best, rate = float(group["best"]), float(group.get("joule_price", 0))
        share = partial(_tell_part, tell, done, len(classes))
        total += len(group["robots"]) * best_route(instance, robot, prices, best, rate, first, last, share)
    return total


def _tell_part(tell: Callable[[float], None], done: int, parts: int, share: float) -> None:
    tell((done + share) / parts)


def _classes(
    instance: OrosInstance, leaf: Mapping[str, Any], part: _Part
) -> list[tuple[Mapping[str, Any], OrosRobot, NDArray[np.int64], NDArray[np.int64]]]:
    """Return each class of a leaf with one of its robots, and when that may collect each cell."""
    classes, seen = [], []
    for group in leaf["classes"]:
        index = [int(r) for r in group["robots"]]
        robots = [instance.robots[r] for r in index]
        if any(_data(robot) != _data(robots[0]) for robot in robots):
            raise UsageError("the certificate puts robots with different data into one class")
        first, last = part.first[index], part.last[index]
        if np.any(first != first[0]) or np.any(last != last[0]):
            raise UsageError("the certificate puts robots into one class about which its questions differ")
        seen += index
        classes.append((group, robots[0], first[0], last[0]))
    if sorted(seen) != list(range(len(instance.robots))):
        raise UsageError("the certificate does not name every robot once")
    return classes


def _bound_of_choice(instance: OrosInstance, leaf: Mapping[str, Any], prices: Prices, part: _Part) -> float:
    """Return the bound of a leaf that rests on enumeration: its own, or a choice of routes that exceeds it.

    Where a route is worth more after prices than its class's best is said to be, that value counts.
    """
    limits = instance.limits
    if limits.forbid_swaps or limits.robots_per_cell is not None or limits.sensing_robots_per_step is not None:
        raise UsageError("the certificate enumerates routes, which limits between robots do not allow")
    if instance.chargers:
        raise UsageError("the certificate enumerates routes, which chargers do not allow")
    classes, floor = _classes(instance, leaf, part), float(leaf["bound"])
    best = [float(group["best"]) for group, *_ in classes]
    counts = [len(group["robots"]) for group, *_ in classes]
    while True:
        total = float(prices.cell.sum()) + sum(prices.cut_price) + float(np.dot(counts, best))
        losable = max(0.0, total - floor)
        found = [
            worthwhile_routes(instance, robot, prices, most - losable, float(group.get("joule_price", 0)), first, last)
            for (group, robot, first, last), most in zip(classes, best, strict=True)
        ]
        above = [max(most, float(routes.reduced.max(initial=most))) for routes, most in zip(found, best, strict=True)]
        if np.allclose(above, best, rtol=1e-9, atol=1e-9):
            break
        best = above
    cell = prices.cell
    for stage in leaf.get("pool", []):
        if not all(len(routes.value) for routes in found):
            return floor
        found, best, cell, total = repriced(found, counts, stage, lowest_prices(instance, part.must), floor)
        losable = total - floor
        if losable <= 0.0:
            return floor
    return best_of(found, best, counts, np.where(part.must, np.inf, cell), losable, floor)


def _rounded(instance: OrosInstance, bound: float) -> float:
    """Return the largest value not above a bound that a plan can have, where weights and energies are whole.

    Coverage is then a multiple of the weights' common divisor, and the battery at the end lies a multiple of the
    energies' common divisor below that at the start; with chargers, which are best used for what power and capacity
    allow, below the capacities.
    """
    bound += 1e-10 * abs(bound)
    weights = [cell.weight for cell in instance.cells if cell.weight > 0 and not cell.explored]
    energies = [arc.energy_j for arc in instance.travel]
    energies += [charger.power_w * instance.step_s for charger in instance.chargers]
    for robot in instance.robots:
        energies += [robot.idle_w * instance.step_s, robot.sensing_w * instance.step_s]
        energies += [robot.capacity_j - robot.battery_j] if instance.chargers else []
    if any(x != int(x) or x > 2**52 for x in weights):
        return bound
    unit = math.gcd(*(int(w) for w in weights)) if weights else 1
    whole = all(x == int(x) and x <= 2**52 for x in energies)
    quantum = math.gcd(*(int(q) for q in energies)) if whole else 0
    most = sum(robot.capacity_j if instance.chargers else robot.battery_j for robot in instance.robots)
    least = sum(robot.reserve_j for robot in instance.robots)
    if instance.sigma == 0:
        return float(unit * math.floor(bound / unit))
    best, coverage = -math.inf, unit * math.floor((bound - instance.sigma * least) / unit)
    for _ in range(100_000):
        if coverage < 0 or coverage + instance.sigma * most <= best:
            break
        battery = min(most, (bound - coverage) / instance.sigma)
        if quantum and battery < most:
            battery = most - quantum * math.ceil((most - battery) / quantum - 1e-7)
        if battery >= least - 1e-7:
            best = max(best, coverage + instance.sigma * battery)
        coverage -= unit
    return bound if best == -math.inf else min(bound, best + 1e-10 * abs(best))


def _data(robot: OrosRobot) -> dict[str, Any]:
    return robot.model_dump(exclude={"id"})


def _memory(instance: OrosInstance, certificate: Mapping[str, Any]) -> list[list[int]]:
    """Return what is remembered in each cell."""
    n, memory = len(instance.cells), certificate["memory"]
    memory = [list(range(n))] * n if memory == "all" else [sorted({int(c) for c in near}) for near in memory]
    if len(memory) != n or any(len(near) > 64 for near in memory):
        raise UsageError(f"the certificate does not remember at most 64 cells in each of {n} places")
    if any(not 0 <= cell < n for near in memory for cell in near) or any(
        i not in near for i, near in enumerate(memory)
    ):
        raise UsageError("the certificate's memory of a place lacks the place or names cells that do not exist")
    return memory


def _read(instance: OrosInstance, certificate: Mapping[str, Any], memory: list[list[int]], part: _Part) -> Prices:
    """Return prices, negative ones raised to 0 but for cells that are collected in any case."""
    n = len(instance.cells)
    cell = np.array(certificate["cell_price"], dtype=np.float64)
    if len(cell) != n or not np.all(np.isfinite(cell)):
        raise UsageError(f"the certificate prices {len(cell)} cells, the instance has {n}; prices are finite numbers")
    cell = np.maximum(cell, lowest_prices(instance, part.must))
    if len(certificate["cuts"]) > 64:
        raise UsageError("the certificate has more than 64 cuts")
    if any(len({int(c) for c in cut["cells"]}) > 3 for cut in certificate["cuts"]):
        raise UsageError("the certificate has a cut over more than three cells")
    stand: dict[tuple[int, int], float] = {}
    sense: dict[int, float] = {}
    slot: dict[tuple[int, int], float] = {}
    slots = {charger.cell: charger.slots for charger in instance.chargers}
    worth = 0.0
    for row in certificate["rows"]:
        price = max(0.0, float(row["price"]))
        if row["rule"] not in RULES:
            raise UsageError("the certificate prices a rule that is none of " + ", ".join(RULES))
        charges = row["rule"] == "charging_slots"
        limit = slots.get(instance.cells[int(row["cell"])].id) if charges else getattr(instance.limits, row["rule"])
        if limit is None:
            raise UsageError(f"the certificate uses the limit {row['rule']}, which the instance does not have")
        worth += price * limit
        t = int(row["t"])
        if t < 1:
            raise UsageError("the certificate limits standing or sensing at t = 0, which nothing does")
        if charges:
            slot[t, int(row["cell"])] = slot.get((t, int(row["cell"])), 0.0) + price
        elif row["rule"] == "robots_per_cell":
            stand[t, int(row["cell"])] = stand.get((t, int(row["cell"])), 0.0) + price
        else:
            sense[t] = sense.get(t, 0.0) + price
    return Prices(
        cell,
        memory,
        [{int(c) for c in cut["cells"]} for cut in certificate["cuts"]],
        [{int(c) for c in cut["memory"]} for cut in certificate["cuts"]],
        [max(0.0, float(cut["price"])) for cut in certificate["cuts"]],
        stand,
        sense,
        slot,
        worth,
        _potential(certificate, memory),
    )


def _potential(leaf: Mapping[str, Any], memory: list[list[int]]) -> NDArray[np.float64]:
    """Return the prices that only bound the rest of a route; only where everything is remembered are there any."""
    given = np.maximum(0.0, np.array(leaf.get("potential", []), dtype=np.float64))
    if len(given) and (len(given) != len(memory) or any(len(near) != len(memory) for near in memory)):
        raise UsageError("the certificate bounds the rest of a route by prices without remembering all cells")
    if not np.all(np.isfinite(given)):
        raise UsageError("the certificate bounds the rest of a route by prices that are no finite numbers")
    return given
