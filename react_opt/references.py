"""Rules of the instance files that span fields: unique ids, names that refer, order of batteries.

They work on plain data and skip what is malformed, so that a reader can report them together with faults of
the structure, all at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

Place = tuple[str, str]  # where, and what was expected


class ReferenceFaultsError(ValueError):
    """Several faults, each a place and a message."""

    def __init__(self, faults: list[Place]) -> None:
        self.faults = faults
        super().__init__("; ".join(f"{place}: {message}" for place, message in faults))


def reference_faults(data: dict[str, Any]) -> list[Place]:
    """Return the faults of one document as (place, message), in the order of the file.

    Parameters
    ----------
    data
        The document as plain data, keys as in the file; malformed parts are skipped.
    """
    rule = _RULES.get(data.get("kind", ""))
    return list(rule(data)) if rule else []


def _rows(data: dict[str, Any], key: str) -> Iterator[tuple[str, dict[str, Any]]]:
    rows = data.get(key)
    if isinstance(rows, list | tuple):
        for index, row in enumerate(rows):
            if isinstance(row, dict):
                yield f"{key}[{index}]", row


def _ids(data: dict[str, Any], key: str) -> set[str] | None:
    """Return the ids of a list, None where it is malformed: then nothing can be said of names that refer to it."""
    rows = data.get(key)
    if not isinstance(rows, list | tuple):
        return None
    ids = [row.get("id") if isinstance(row, dict) else None for row in rows]
    named = {name for name in ids if isinstance(name, str) and name}
    return named if all(isinstance(name, str) and name for name in ids) else None


def _unique(data: dict[str, Any], key: str, fields: tuple[str, ...] = ("id",)) -> Iterator[Place]:
    seen: dict[tuple[Any, ...], str] = {}
    for place, row in _rows(data, key):
        value = tuple(row.get(field) for field in fields)
        if not all(isinstance(part, str) or part is None for part in value) or value[0] is None:
            continue
        if value in seen:
            shown = ", ".join(repr(part) for part in value if part is not None)
            where = f"{place}.{fields[0]}" if len(fields) == 1 else place
            yield where, f"expected unique {' and '.join(fields)}, {shown} is already at {seen[value]}"
        else:
            seen[value] = place


def _refers(row: dict[str, Any], place: str, field: str, known: set[str] | None, what: str) -> Iterator[Place]:
    value = row.get(field)
    if known is not None and isinstance(value, str) and value and value not in known:
        yield f"{place}.{field}", f"expected the id of a {what}, found {value!r}"


def _batteries(row: dict[str, Any], place: str) -> Iterator[Place]:
    battery, reserve, capacity = (row.get(k) for k in ("battery_j", "reserve_j", "capacity_j"))
    numbers = (int, float)
    if isinstance(battery, numbers) and isinstance(reserve, numbers) and reserve > battery:
        yield f"{place}.reserve_j", f"expected reserve_j <= battery_j = {battery:g}, found {reserve:g}"
    if isinstance(battery, numbers) and isinstance(capacity, numbers) and battery > capacity:
        yield f"{place}.battery_j", f"expected battery_j <= capacity_j = {capacity:g}, found {battery:g}"


def _some(data: dict[str, Any], *keys: str) -> Iterator[Place]:
    for key in keys:
        rows = data.get(key)
        if isinstance(rows, list | tuple | dict) and not rows:
            yield key, "expected at least one"


def _oros(data: dict[str, Any]) -> Iterator[Place]:
    cells = _ids(data, "cells")
    yield from _unique(data, "cells")
    for place, row in _rows(data, "travel"):
        yield from _refers(row, place, "from", cells, "cell")
        yield from _refers(row, place, "to", cells, "cell")
        if isinstance(row.get("from"), str) and row.get("from") == row.get("to"):
            yield f"{place}.to", f"expected a cell other than from = {row['from']!r}"
    horizon = data.get("horizon_steps")
    yield from _unique(data, "robots")
    for place, row in _rows(data, "robots"):
        yield from _refers(row, place, "start", cells, "cell")
        yield from _refers(row, place, "return_to", cells, "cell")
        yield from _batteries(row, place)
        start = row.get("start_step")
        if isinstance(horizon, int) and isinstance(start, int) and start > horizon > 0:
            yield f"{place}.start_step", f"expected at most horizon_steps = {horizon}, found {start}"
    yield from _unique(data, "chargers", ("cell",))
    for place, row in _rows(data, "chargers"):
        yield from _refers(row, place, "cell", cells, "cell")


def _assignment(data: dict[str, Any]) -> Iterator[Place]:
    robots, targets = _ids(data, "robots"), _ids(data, "targets")
    yield from _unique(data, "robots")
    for place, row in _rows(data, "robots"):
        yield from _batteries(row, place)
        zone = row.get("zone")
        if targets is not None and isinstance(zone, list | tuple):
            for index, target in enumerate(zone):
                if isinstance(target, str) and target and target not in targets:
                    yield f"{place}.zone[{index}]", f"expected the id of a target, found {target!r}"
    yield from _unique(data, "targets")
    for place, row in _rows(data, "costs"):
        yield from _refers(row, place, "robot", robots, "robot")
        yield from _refers(row, place, "target", targets, "target")
    yield from _unique(data, "costs", ("robot", "target"))
    conflicts = data.get("conflicts")
    if isinstance(conflicts, list | tuple):
        for index, pair in enumerate(conflicts):
            if not isinstance(pair, list | tuple) or len(pair) != 2:
                continue
            for side, target in enumerate(pair):
                if targets is not None and isinstance(target, str) and target and target not in targets:
                    yield f"conflicts[{index}][{side}]", f"expected the id of a target, found {target!r}"
            if isinstance(pair[0], str) and pair[0] == pair[1]:
                yield f"conflicts[{index}]", f"expected two different targets, found {pair[0]!r} twice"


def _inspection(data: dict[str, Any]) -> Iterator[Place]:
    robots = _ids(data, "robots")
    yield from _unique(data, "robots")
    for place, row in _rows(data, "robots"):
        yield from _batteries(row, place)
    yield from _unique(data, "targets")
    for place, row in _rows(data, "travel"):
        yield from _refers(row, place, "robot", robots, "robot")
    yield from _unique(data, "travel", ("from", "to", "robot"))


def _fleet(data: dict[str, Any]) -> Iterator[Place]:
    profiles = data.get("profiles")
    yield from _some(data, "profiles", "robots")
    if isinstance(profiles, dict):
        for name, row in profiles.items():
            if isinstance(row, dict):
                place = f"profiles.{name}"
                yield from _batteries(row, place)
                slow, fast = row.get("speed_min_m_s"), row.get("speed_max_m_s")
                if isinstance(slow, int | float) and isinstance(fast, int | float) and slow > fast:
                    yield (
                        f"{place}.speed_min_m_s",
                        f"expected at most speed_max_m_s = {fast:g}, found {slow:g}",
                    )
    yield from _unique(data, "robots")
    for place, row in _rows(data, "robots"):
        yield from _refers(
            row, place, "profile", set(profiles) if isinstance(profiles, dict) and profiles else None, "profile"
        )


def _mission(data: dict[str, Any]) -> Iterator[Place]:
    yield from _fleet(data)
    robots = _ids(data, "robots")
    for place, row in _rows(data, "failures"):
        yield from _refers(row, place, "robot", robots, "robot")


_RULES: dict[str, Callable[[dict[str, Any]], Iterator[Place]]] = {
    "oros": _oros,
    "assignment": _assignment,
    "inspection": _inspection,
    "fleet": _fleet,
    "mission": _mission,
}
