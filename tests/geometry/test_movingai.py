from pathlib import Path

import numpy as np
import pytest

from react_opt.errors import InputError, UsageError
from react_opt.geometry import OccupancyMap, load_map
from react_opt.geometry.movingai import read_movingai_map, write_movingai_map

GOOD = "type octile\nheight 2\nwidth 4\nmap\n.GS@\nOTW.\n"


def test_letters_and_the_direction_of_rows(tmp_path: Path) -> None:
    path = tmp_path / "a.map"
    path.write_text(GOOD)
    map_ = load_map(path)
    np.testing.assert_array_equal(map_.cells, [[1, 1, 1, 0], [0, 0, 0, 1]])
    assert (map_.resolution_m, map_.origin_x_m) == (1.0, 0.0)
    path.write_bytes(GOOD.replace("\n", "\r\n").encode())
    np.testing.assert_array_equal(read_movingai_map(path, resolution_m=0.2).cells, map_.cells)


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    cells = np.random.default_rng(1).integers(0, 2, (7, 5)).astype(np.uint8)
    write_movingai_map(OccupancyMap(cells, 1.0), tmp_path / "a.map")
    np.testing.assert_array_equal(load_map(tmp_path / "a.map").cells, cells)


def test_unknown_pixels_are_never_lost_silently(tmp_path: Path) -> None:
    map_ = OccupancyMap(np.array([[0, 1, 2]], np.uint8), 1.0)
    with pytest.raises(UsageError, match="unknown"):
        write_movingai_map(map_, tmp_path / "a.map")
    for unknown, expected in (("blocked", [[0, 1, 1]]), ("free", [[0, 1, 0]])):
        write_movingai_map(map_, tmp_path / "a.map", unknown=unknown)
        np.testing.assert_array_equal(load_map(tmp_path / "a.map").cells, expected)


@pytest.mark.parametrize(
    ("text", "places"),
    [
        (GOOD.replace("height 2", "height 3"), ["height"]),
        (GOOD.replace("height 2", "height x").replace("width 4", "width 0"), ["height", "width"]),
        (GOOD.replace("OTW.", "OT"), ["line 6"]),
        (GOOD.replace(".GS@", ".GSx").replace("OTW.", "OT"), ["line 5", "line 6"]),
        ("no map at all", [""]),
        ("type octile\nheight 2\nwidth 4\nmap\n", ["height"]),
        ("type octile\nheight 999999999\nwidth 999999999\nmap\n....", ["height", "line 5"]),
    ],
)
def test_every_fault_has_its_place(tmp_path: Path, text: str, places: list[str]) -> None:
    path = tmp_path / "a.map"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_map(path)
    assert [fault.place for fault in caught.value.faults] == places
