"""Files of neighbouring problems as instances of our kinds, so that who has the files can run them here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from benchmarks.readers import gap, movingai, orienteering, repairman, tsplib
from react_opt import jsonio
from react_opt.errors import UsageError

FORMATS: dict[str, tuple[Callable[[str], list[dict[str, Any]]], str]] = {
    "tsplib": (tsplib.read, "TSPLIB, as a minimum latency problem (oros)"),
    "mrpp": (repairman.read, "multi-repairman problems with profits (oros)"),
    "chao": (orienteering.read, "Chao's team orienteering (inspection)"),
    "gap": (gap.read_min, "OR-Library generalised assignment, minimised: gapa to gapd (assignment)"),
    "gap-max": (gap.read_max, "OR-Library generalised assignment, maximised: gap1 to gap12 (assignment)"),
    "movingai": (movingai.read, "a MovingAI scenario with its map beside it (inspection)"),
}
"""Name of a format, what reads a file of it, and what it is."""


def documents(format: str, file: str) -> list[Any]:
    """Return the instances of a file.

    Parameters
    ----------
    format
        One of :data:`FORMATS`, or ``json`` for our own.
    file
        Its path.

    Raises
    ------
    UsageError
        Where there is no such format.
    InputError
        Where the file is not of this format: its place and what was expected there.
    """
    if format == "json":
        return [jsonio.load(file)]
    if format not in FORMATS:
        raise UsageError(f"format: expected one of json, {', '.join(FORMATS)}, found {format!r}")
    return [jsonio.parse(data, file=file) for data in FORMATS[format][0](file)]


def read(format: str, file: str, number: int = 0) -> Any:
    """Return one instance of a file, by its number."""
    return documents(format, file)[number]
