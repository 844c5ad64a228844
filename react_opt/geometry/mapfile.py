"""Maps by file name: which format a suffix stands for. A new format is one file and one line here."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from react_opt.errors import InputError, UsageError
from react_opt.geometry.movingai import read_movingai_map, write_movingai_map
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.geometry.rosmap import read_ros_map, write_ros_map

_READERS: dict[str, Callable[[Path], OccupancyMap]] = {
    ".yaml": read_ros_map,
    ".yml": read_ros_map,
    ".map": read_movingai_map,
}
_WRITERS: dict[str, Callable[[OccupancyMap, Path], None]] = {
    ".yaml": write_ros_map,
    ".yml": write_ros_map,
    ".map": write_movingai_map,
}


def load_map(path: str | Path) -> OccupancyMap:
    """Read a map: ``.yaml`` or ``.yml`` is ROS map_server's, ``.map`` is MovingAI's (1 m per pixel).

    Raises
    ------
    InputError
        Where the suffix is not known or the file is not good; it names every fault.
    """
    reader = _READERS.get(Path(path).suffix.lower())
    if reader is None:
        raise InputError.single(str(path), "", f"expected a map ({', '.join(_READERS)}), found another suffix")
    return reader(Path(path))


def save_map(map_: OccupancyMap, path: str | Path) -> None:
    """Write a map in the format that its suffix stands for, with that format's defaults.

    Raises
    ------
    UsageError
        Where the suffix is not known, or the format cannot hold the map.
    InputError
        Where a file cannot be written.
    """
    writer = _WRITERS.get(Path(path).suffix.lower())
    if writer is None:
        raise UsageError(f"a map is written as {', '.join(_WRITERS)}, not {Path(path).name}")
    writer(map_, Path(path))
