"""The example factory: rebuilt files equal the committed ones, and the building is what its script says."""

import json
import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from react_opt.geometry import load_map
from react_opt.geometry.inflation import Footprint, inflate
from react_opt.jsonio import load

FOLDER = Path(__file__).resolve().parent.parent / "examples" / "factory"


@pytest.fixture(scope="module")
def rebuilt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("factory")
    before = list(sys.path)
    sys.path.insert(0, str(FOLDER))
    try:
        runpy.run_path(str(FOLDER / "make_examples.py"))["main"](folder)
    finally:
        sys.path[:] = before
    return folder


def assert_same(one: Any, other: Any) -> None:
    """Assert equal data; numbers may differ in the last digit, as mathematical libraries do."""
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            assert_same(one[key], other[key])
    elif isinstance(one, list):
        assert len(one) == len(other)
        for left, right in zip(one, other, strict=True):
            assert_same(left, right)
    elif isinstance(one, float):
        assert one == pytest.approx(other, rel=1e-6, abs=1e-6)
    else:
        assert one == other


def test_everything_here_is_what_the_scripts_make(rebuilt: Path) -> None:
    committed = {path.name for path in FOLDER.iterdir() if path.suffix in {".pgm", ".yaml", ".json"}}
    assert {path.name for path in rebuilt.iterdir()} == committed
    for name in committed:
        if name.endswith(".json"):
            assert_same(*(json.loads((folder / name).read_text()) for folder in (rebuilt, FOLDER)))
        else:
            assert (rebuilt / name).read_bytes() == (FOLDER / name).read_bytes()


def test_the_map_is_20_by_50_metres_at_5_centimetres_in_unknown_space() -> None:
    source = load_map(FOLDER / "factory.yaml")
    assert (source.cols, source.rows, source.resolution_m) == (440, 1040, 0.05)
    rows, cols = np.nonzero(source.cells != 2)
    low, high = source.pixel_to_world((cols.min(), rows.min())), source.pixel_to_world((cols.max() + 1, rows.max() + 1))
    np.testing.assert_allclose([low, high], [(0, 0), (20, 50)])


def test_a_jackal_reaches_all_of_the_floor_and_passages_of_80_centimetres_matter() -> None:
    source = load_map(FOLDER / "factory.yaml")
    sizes = []
    for radius_m in (0.333, 0.42):  # a Jackal's disc, and one too wide for the passages
        regions = inflate(source, Footprint(radius_m), refine=2).regions
        areas = np.sort(np.bincount(regions.ravel())[1:] * 0.025**2)[::-1]
        sizes.append(areas[areas > 1].tolist())
    assert len(sizes[0]) == 1
    assert len(sizes[1]) == 6  # stores and offices in L0, R0, R1, L4 and R4 are cut off


@pytest.mark.parametrize(("robots", "cell_m"), [(n, size) for n in range(1, 5) for size in ("10", "5", "2.5")])
def test_the_instances_hold_all_cells_and_connect_them(robots: int, cell_m: str) -> None:
    instance = load(FOLDER / f"factory_{robots}_{cell_m}m.json", "oros")
    assert len(instance.robots) == robots
    assert len(instance.cells) == 20 * 50 / float(cell_m) ** 2
    assert instance.horizon_steps * instance.step_s == 240
    reached, front = {instance.robots[0].start}, [instance.robots[0].start]
    while front:
        at = front.pop()
        for arc in instance.travel:
            if arc.from_ == at and arc.to not in reached:
                reached.add(arc.to)
                front.append(arc.to)
    assert len(reached) == len(instance.cells)


def test_the_walls_force_robots_back_through_known_cells() -> None:
    instance = load(FOLDER / "factory_1_10m.json", "oros")
    links = {frozenset((arc.from_, arc.to)) for arc in instance.travel}
    expected = "10-11 11-12 12-02 02-01 01-00 02-03 03-04 04-14 14-13 13-03"  # column and row of each cell
    assert links == {frozenset(f"g{end[0]}_{end[1]}" for end in link.split("-")) for link in expected.split()}
    # the lower left is a dead end of two cells: whoever explores it and what lies above crosses g0_1 and g0_2 again
    assert sum("g0_0" in link for link in links) == 1
