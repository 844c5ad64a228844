import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from react_opt.geometry import OccupancyMap
from react_opt.geometry.occupancy import FREE, OCCUPIED, UNKNOWN

CELLS = np.array([[FREE, OCCUPIED, UNKNOWN], [FREE, FREE, FREE]], dtype=np.uint8)


def test_a_pixel_lies_where_its_indices_say() -> None:
    map_ = OccupancyMap(CELLS, 0.5, 10.0, 20.0)
    np.testing.assert_allclose(map_.pixel_to_world((2.5, 0.5)), (11.25, 20.25))  # centre of row 0, column 2
    np.testing.assert_array_equal(map_.values_at([(11.25, 20.25), (10.75, 20.25), (9.9, 20.0)]), [2, 1, 2])


def test_a_quarter_turn_lays_columns_along_y() -> None:
    map_ = OccupancyMap(CELLS, 1.0, 5.0, 5.0, np.pi / 2)
    np.testing.assert_allclose(map_.pixel_to_world([(1, 0), (0, 1)]), [(5, 6), (4, 5)], atol=1e-12)
    assert map_.values_at((5 - 0.5, 5 + 1.5)) == OCCUPIED  # row 0, column 1


@settings(derandomize=True, deadline=None, max_examples=50)
@given(
    yaw=st.floats(-10, 10),
    origin=st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)),
    point=st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)),
)
def test_frames_are_inverse(yaw: float, origin: tuple[float, float], point: tuple[float, float]) -> None:
    map_ = OccupancyMap(CELLS, 0.05, *origin, yaw)
    np.testing.assert_allclose(map_.world_to_pixel(map_.pixel_to_world(point)), point, atol=1e-6)


def test_what_makes_no_map_is_refused() -> None:
    for cells, resolution in (
        (np.zeros(3, np.uint8), 1.0),
        (np.zeros((0, 3), np.uint8), 1.0),
        (np.full((2, 2), 3, np.uint8), 1.0),
        (CELLS, 0.0),
        (CELLS, float("nan")),
    ):
        with pytest.raises(ValueError, match=r"map|pixel|resolution"):
            OccupancyMap(cells, resolution)


def test_cells_are_read_only_and_the_callers_array_is_not() -> None:
    mine = CELLS.copy()
    map_ = OccupancyMap(mine, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        map_.cells[0, 0] = OCCUPIED
    mine[1, 1] = OCCUPIED
