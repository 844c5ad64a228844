"""MovingAI benchmark maps (``.map``): ``.``, ``G``, ``S`` passable, ``@``, ``O``, ``T``, ``W`` blocked."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from react_opt.errors import Fault, InputError, UsageError
from react_opt.geometry.occupancy import FREE, MAX_PIXELS, OCCUPIED, UNKNOWN, OccupancyMap
from react_opt.jsonio import write_bytes

_PASSABLE = ".GS"
_BLOCKED = "@OTW"
_OTHER = 255
_CLASSES = np.full(256, _OTHER, dtype=np.uint8)
_CLASSES[[ord(c) for c in _PASSABLE]] = FREE
_CLASSES[[ord(c) for c in _BLOCKED]] = OCCUPIED


def read_movingai_map(path: str | Path, *, resolution_m: float = 1.0) -> OccupancyMap:
    """Read a MovingAI map.

    Parameters
    ----------
    path
        The ``.map`` file.
    resolution_m
        Side of a pixel, m; the format has none.

    Returns
    -------
    OccupancyMap
        With its origin at (0, 0); the file's first row is the northernmost one.

    Raises
    ------
    InputError
        With every fault of the file at once (of bad rows, the first ten).
    """
    path = Path(path)
    try:
        if path.stat().st_size > 2 * MAX_PIXELS:
            raise InputError.single(str(path), "", f"expected at most {MAX_PIXELS} pixels")
        lines = path.read_bytes().splitlines()
    except OSError as error:
        raise InputError.single(str(path), "", f"cannot be read: {error.strerror}") from error
    faults: list[Fault] = []
    sizes = {b"height": 0, b"width": 0}
    start = next((n for n, line in enumerate(lines[:16]) if line.strip() == b"map"), None)
    if start is None:
        raise InputError.single(str(path), "", "expected a MovingAI map with type, height, width and map lines")
    header = {words[0]: words[1] for words in (line.split() for line in lines[:start]) if len(words) == 2}
    for key in sizes:
        text = header.get(key, b"")
        if text.isdigit() and len(text) < 10 and int(text) > 0:
            sizes[key] = int(text)
        else:
            found = text.decode("ascii", "replace")
            faults.append(Fault(str(path), key.decode(), f"expected a positive whole number, found {found!r}"))
    if faults:
        raise InputError(faults)
    height, width = sizes[b"height"], sizes[b"width"]
    rows = lines[start + 1 :]
    while len(rows) > height and not rows[-1].strip():
        rows.pop()
    if len(rows) != height:
        faults.append(Fault(str(path), "height", f"expected {height} rows, found {len(rows)}"))
    for n, row in enumerate(rows[:height]):
        place = f"line {start + 2 + n}"
        if len(row) != width:
            faults.append(Fault(str(path), place, f"expected {width} characters, found {len(row)}"))
        elif _OTHER in (classes := _CLASSES[np.frombuffer(row, dtype=np.uint8)]):
            column = int(np.argmax(classes == _OTHER))
            found = chr(row[column])
            message = f"expected one of {_PASSABLE}{_BLOCKED} in column {column + 1}, found {found!r}"
            faults.append(Fault(str(path), place, message))
        if len(faults) >= 10:
            break
    if faults:
        raise InputError(faults)
    cells = _CLASSES[np.frombuffer(b"".join(rows), dtype=np.uint8).reshape(height, width)]
    try:
        return OccupancyMap(cells[::-1], resolution_m)
    except ValueError as error:
        raise UsageError(str(error)) from error


def write_movingai_map(
    map_: OccupancyMap, path: str | Path, *, unknown: Literal["refuse", "blocked", "free"] = "refuse"
) -> None:
    """Write a MovingAI map of ``.`` and ``@``; resolution and origin are not kept, the format has neither.

    Parameters
    ----------
    map_
        The map.
    path
        The ``.map`` file, replaced whole.
    unknown
        The format has no unknown pixels: refuse a map that has some, or write them as blocked or free.

    Raises
    ------
    UsageError
        Where unknown pixels are refused.
    InputError
        Where the file cannot be written.
    """
    if unknown not in ("refuse", "blocked", "free"):
        raise UsageError(f"unknown pixels are refused, blocked or free, not {unknown!r}")
    if unknown == "refuse" and bool((map_.cells == UNKNOWN).any()):
        raise UsageError("a MovingAI map has no unknown pixels: say whether they are blocked or free")
    blocked = map_.cells == OCCUPIED if unknown == "free" else map_.cells != FREE
    letters = np.where(blocked, ord("@"), ord(".")).astype(np.uint8)[::-1]
    rows = b"".join(row.tobytes() + b"\n" for row in letters)
    head = f"type octile\nheight {map_.rows}\nwidth {map_.cols}\nmap\n"
    write_bytes(head.encode() + rows, path)
