import numpy as np
import pytest

from react_opt.energy import RobotProfile, speed_at
from react_opt.errors import UsageError

ROBOT = RobotProfile(
    length_m=0.6,
    width_m=0.8,
    speed_max_m_s=1.0,
    speed_min_m_s=0.2,
    full_speed_clearance_m=0.9,
    accel_m_s2=1.0,
    turn_rad_s=0.5,
    idle_w=2.0,
    motion_w=7.0,
    turn_w=4.0,
    sensing_w=16.9,
    battery_j=1000.0,
    capacity_j=1000.0,
    reserve_j=0.0,
    lidar_range_m=8.0,
    lidar_rays=360,
)


def test_the_disc_of_a_robot_is_half_its_diagonal() -> None:
    assert ROBOT.radius_m == pytest.approx(0.5)


def test_speed_falls_linearly_from_full_clearance_to_contact() -> None:
    # contact at 0.5 m (0.2 m/s), full speed from 0.9 m (1.0 m/s): 0.7 m is half way, 0.6 m a quarter
    clearance = [0.0, 0.5, 0.6, 0.7, 0.9, 5.0]
    expected = [0.2, 0.2, 0.4, 0.6, 1.0, 1.0]
    np.testing.assert_allclose(ROBOT.speed_m_s(clearance), expected)
    np.testing.assert_allclose([speed_at(c, 0.5, 0.9, 0.2, 1.0) for c in clearance], expected)
    np.testing.assert_allclose(ROBOT.speed_m_s([0.3, 0.6], radius_m=0.3), [0.2, 0.6])


def test_a_robot_that_touches_at_full_speed_never_slows_down() -> None:
    np.testing.assert_allclose(ROBOT.speed_m_s([0.1, 2.0], radius_m=0.9), 1.0)
    assert speed_at(0.1, 0.9, 0.9, 0.2, 1.0) == 1.0


def test_energies_by_hand() -> None:
    # 10 m in 10 s: 2 W x 10 s + 7 J/m x 10 m = 90 J; at half the speed the base load doubles, the metres do not
    assert float(ROBOT.drive_energy_j(10.0, 10.0)) == pytest.approx(90.0)
    assert float(ROBOT.drive_energy_j(10.0, 20.0)) == pytest.approx(110.0)
    # half a turn at 0.5 rad/s lasts 2 pi s at 2 + 4 W, to either side
    assert float(ROBOT.turn_time_s(-np.pi)) == pytest.approx(2 * np.pi)
    assert float(ROBOT.turn_energy_j(np.pi)) == pytest.approx(12 * np.pi)
    assert ROBOT.idle_energy_j(10.0) == 20.0
    assert ROBOT.sensing_energy_j(10.0) == pytest.approx(169.0)


@pytest.mark.parametrize("change", [{"speed_min_m_s": 0.0}, {"speed_max_m_s": 0.1}, {"turn_rad_s": 0.0}])
def test_a_robot_that_cannot_move_or_turn_is_refused(change: dict[str, float]) -> None:
    with pytest.raises(UsageError):
        RobotProfile(**(vars(ROBOT) | change))
