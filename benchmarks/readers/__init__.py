"""Files of neighbouring problems as instances of our kinds, so that who has the files can run them here."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from benchmarks.readers import depots, gap, movingai, orienteering, repairman, tsplib
from react_opt import jsonio
from react_opt.errors import UsageError

FORMATS: dict[str, tuple[Callable[..., list[dict[str, Any]]], str]] = {
    "tsplib": (tsplib.read, "TSPLIB, as a minimum latency problem (oros)"),
    "depots": (depots.read, "multi-depot cumulative vehicle routing, capacities left out (oros)"),
    "mrpp": (repairman.read, "multi-repairman problems with profits (oros)"),
    "chao": (orienteering.read, "Chao's team orienteering (inspection)"),
    "gap": (gap.read_min, "OR-Library generalised assignment, minimised: gapa to gapd (assignment)"),
    "gap-max": (gap.read_max, "OR-Library generalised assignment, maximised: gap1 to gap12 (assignment)"),
    "movingai": (movingai.read, "a MovingAI scenario with its map beside it (inspection)"),
}
"""Name of a format, what reads a file of it, and what it is."""


def documents(format: str, file: str, **options: int) -> list[Any]:
    """Return the instances of a file.

    Parameters
    ----------
    format
        One of :data:`FORMATS`, or ``json`` for our own.
    file
        Its path.
    options
        ``robots`` (their number, of ``tsplib`` and ``depots``) and ``steps_per_unit`` (of length, of ``depots``).

    Raises
    ------
    UsageError
        Where there is no such format, or the format has no such option.
    InputError
        Where the file is not of this format: its place and what was expected there.
    """
    if format == "json":
        return [jsonio.load(file)]
    if format not in FORMATS:
        raise UsageError(f"format: expected one of json, {', '.join(FORMATS)}, found {format!r}")
    reader = FORMATS[format][0]
    for name, value in options.items():
        if name not in inspect.signature(reader).parameters:
            raise UsageError(f"{name}: the format {format} has no such option")
        if value < 1:
            raise UsageError(f"{name}: expected a whole number >= 1, found {value}")
    return [jsonio.parse(data, file=file) for data in reader(file, **options)]


def read(format: str, file: str, number: int = 0) -> Any:
    """Return one instance of a file, by its number."""
    return documents(format, file)[number]
