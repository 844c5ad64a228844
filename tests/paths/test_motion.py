import numpy as np
import pytest
from scipy.integrate import quad
from test_energy import ROBOT

from react_opt.errors import ReactError
from react_opt.geometry.inflation import Footprint, inflate
from react_opt.geometry.occupancy import OCCUPIED, UNKNOWN, OccupancyMap
from react_opt.paths.motion import drive

# A hall of 10 m x 6 m at 0.1 m with a wall below row 0; nothing else blocks.
HALL = np.zeros((61, 100), np.uint8)
HALL[0] = OCCUPIED
SPACE = inflate(OccupancyMap(HALL, 0.1, 0.0, -0.1), Footprint(0.5), unknown="free", refine=1)


def test_far_from_walls_time_is_length_over_full_speed() -> None:
    path = drive(SPACE, ROBOT, [(1.0, 3.0), (4.0, 3.0), (4.0, 5.0)])
    # 5 m at 1 m/s, and a right angle at 0.5 rad/s; 2 W x 5 s + 7 J/m x 5 m, and (2 + 4) W while turning
    assert path.length_m == pytest.approx(5.0)
    assert path.time_s == pytest.approx(5.0 + np.pi)
    assert path.energy_j == pytest.approx(45.0 + 6 * np.pi)
    assert path.min_clearance_m == pytest.approx(3.0, abs=1e-6)


def test_along_a_wall_speed_is_that_of_the_clearance_between_pixels_too() -> None:
    for clearance in (0.5, 0.63, 0.7, 0.85):
        path = drive(SPACE, ROBOT, [(1.0, clearance), (9.0, clearance)])
        speed = 0.2 + 0.8 * (clearance - 0.5) / 0.4
        assert path.time_s == pytest.approx(8.0 / speed, rel=1e-5)
        assert path.min_clearance_m == pytest.approx(clearance, abs=1e-5)


def test_towards_a_wall_the_midpoint_rule_comes_close_to_the_integral() -> None:
    path = drive(SPACE, ROBOT, [(2.0, 2.0), (5.0, 0.5)])
    slope = np.hypot(3.0, 1.5) / 1.5
    exact = quad(lambda y: slope / float(ROBOT.speed_m_s(y)), 0.5, 2.0, points=[0.9])[0]
    assert path.time_s == pytest.approx(exact, rel=0.01)
    back = drive(SPACE, ROBOT, [(5.0, 0.5), (2.0, 2.0)])
    assert (back.time_s, back.energy_j) == (path.time_s, path.energy_j)


def test_unknown_space_slows_down_where_it_is_costlier() -> None:
    cells = np.zeros((20, 40), np.uint8)
    cells[:, 10:20] = UNKNOWN
    map_ = OccupancyMap(cells, 0.1)
    space = inflate(map_, Footprint(0.2), unknown="costlier", unknown_speed_factor=0.25, refine=1)
    path = drive(space, ROBOT, [(0.5, 1.0), (3.5, 1.0)])
    assert path.time_s == pytest.approx(2.0 + 1.0 / 0.25)  # 1 m of the 3 m is unknown


def test_a_path_through_a_wall_is_never_measured() -> None:
    with pytest.raises(ReactError, match="footprint"):
        drive(SPACE, ROBOT, [(1.0, 3.0), (1.0, 0.3)])


def test_a_path_of_one_point_takes_no_time() -> None:
    path = drive(SPACE, ROBOT, [(1.0, 3.0)])
    assert (path.length_m, path.time_s, path.energy_j) == (0.0, 0.0, 0.0)
    twice = drive(SPACE, ROBOT, [(1.0, 3.0), (1.0, 3.0)])
    assert (twice.length_m, twice.time_s, twice.energy_j) == (0.0, 0.0, 0.0)
