"""The belief, fed by hand: shares, local targets, sketches that are wrong, buildings that turn out larger, costs."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from scipy import ndimage

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyMap
from react_opt.orchestrator.belief import RobotView
from react_opt.orchestrator.fleet_belief import FleetBelief

PROFILE = RobotProfile(
    length_m=0.508, width_m=0.43, speed_max_m_s=0.89, speed_min_m_s=0.3, full_speed_clearance_m=0.6, accel_m_s2=1.0,
    turn_rad_s=1.5, idle_w=2.0, motion_w=7.0, turn_w=9.0, sensing_w=16.9, battery_j=8245.96, capacity_j=8245.96,
    reserve_j=0.0, lidar_range_m=8.0, lidar_rays=360,
)  # fmt: skip


def truth_of(rows: int = 100, cols: int = 200) -> OccupancyMap:
    """Return a hall of 20 m x 10 m with walls around, at 0.1 m."""
    cells = np.zeros((rows, cols), dtype=np.uint8)
    cells[[0, -1], :] = 1
    cells[:, [0, -1]] = 1
    return OccupancyMap(cells, 0.1)


def robot_at(x_m: float, y_m: float, name: str = "r1") -> RobotView:
    return RobotView(name, PROFILE, x_m, y_m, 0.0, 8000.0, "idle", None, True, 0.0)


def belief_of(truth: OccupancyMap, **changes: object) -> FleetBelief:
    values: dict[str, object] = {"extent_m": (0.0, 0.0, 20.0, 10.0), "cell_m": 10.0, "profiles": [PROFILE], **changes}
    return FleetBelief(truth, **values)  # type: ignore[arg-type]


def shown(belief: FleetBelief, truth: OccupancyMap, low: int, high: int) -> None:
    """Show the belief the columns of pixels from ``low`` to below ``high``."""
    part = np.full_like(truth.cells, UNKNOWN)
    part[:, low:high] = truth.cells[:, low:high]
    belief.merge_map(belief.t_s + 1.0, OccupancyMap(part, truth.resolution_m))


def test_shares_are_known_over_known_plus_connected_unknown() -> None:
    truth = truth_of()
    belief = belief_of(truth)
    belief.report(robot_at(2.0, 5.0))
    shown(belief, truth, 0, 60)
    left, right = belief.areas
    assert (left.id, right.id) == ("0,0", "1,0")
    assert left.known_share == pytest.approx(6 / 10)  # 60 of 100 columns; the rest connects through unknown
    assert right.known_share == 0
    shown(belief, truth, 60, 200)
    assert [area.known_share for area in belief.areas] == [1.0, 1.0]
    assert belief.targets == ()


def test_what_lies_inside_walls_does_not_count() -> None:
    cells = truth_of().cells.copy()
    cells[30:60, 30:60] = 1
    part = cells.copy()
    part[31:59, 31:59] = UNKNOWN  # only the outer pixels of a machine are ever seen
    belief = belief_of(truth_of())
    belief.report(robot_at(2.0, 5.0))
    belief.merge_map(1.0, OccupancyMap(part, 0.1))
    assert [area.known_share for area in belief.areas] == [1.0, 1.0]
    part[40, 30] = UNKNOWN  # nor does one pixel that is missing in its face open it
    belief = belief_of(truth_of())
    belief.report(robot_at(2.0, 5.0))
    belief.merge_map(1.0, OccupancyMap(part, 0.1))
    assert belief.targets == ()
    part[40:43, 30] = UNKNOWN  # a hole does
    belief = belief_of(truth_of())
    belief.report(robot_at(2.0, 5.0))
    belief.merge_map(1.0, OccupancyMap(part, 0.1))
    (target,) = belief.targets
    assert target.size_m2 == pytest.approx(2.8 * 2.8, abs=0.1)


def test_targets_keep_their_names_while_they_shrink_and_go_when_seen() -> None:
    truth = truth_of()
    belief = belief_of(truth)
    belief.report(robot_at(2.0, 5.0))
    shown(belief, truth, 0, 50)
    before = {target.area: target for target in belief.targets}
    assert set(before) == {"0,0", "1,0"}
    assert before["0,0"].frontier_m == pytest.approx(9.8)
    assert before["0,0"].size_m2 == pytest.approx(50.0)
    assert before["0,0"].stand_m is not None
    assert before["0,0"].stand_m[0] < 5.0
    assert before["1,0"].stand_m is None, "it borders no known free space yet"
    shown(belief, truth, 50, 70)
    after = {target.area: target for target in belief.targets}
    assert after["0,0"].id == before["0,0"].id
    assert after["0,0"].size_m2 == pytest.approx(30.0)
    shown(belief, truth, 70, 120)
    assert {target.area for target in belief.targets} == {"1,0"}


def test_an_area_behind_walls_is_proved_unreachable() -> None:
    cells = truth_of().cells.copy()
    cells[:, 99:101] = 1
    belief = belief_of(truth_of())
    belief.report(robot_at(2.0, 5.0))
    left = cells.copy()
    left[:, 101:] = UNKNOWN
    belief.merge_map(1.0, OccupancyMap(left, 0.1))
    assert [area.unreachable for area in belief.areas] == [False, True]
    left[40:60, 99:101] = 0  # a gate
    belief.merge_map(2.0, OccupancyMap(left, 0.1))
    assert [area.unreachable for area in belief.areas] == [False, False]


def test_a_sketch_says_where_walls_are_until_somebody_sees_otherwise() -> None:
    sketch = np.zeros((50, 100), dtype=np.uint8)  # at 0.2 m, coarser than the robots' maps
    sketch[:, 50] = 1
    truth = truth_of()
    belief = belief_of(truth, prior=OccupancyMap(sketch, 0.2))
    robot = robot_at(2.0, 5.0)
    belief.report(robot)
    shown(belief, truth, 0, 80)
    goal = np.array([(15.0, 5.0)])
    assert np.isnan(belief.costs(robot, goal, optimistic=True)[0][0])
    assert belief.map.values_at((10.05, 5.0)) == UNKNOWN, "what is on a sketch has not been seen"
    shown(belief, truth, 80, 120)
    assert np.isfinite(belief.costs(robot, goal, optimistic=True)[0][0])


def test_the_grid_grows_with_the_building() -> None:
    truth = truth_of()
    belief = belief_of(truth, extent_m=(0.0, 0.0, 10.0, 10.0))
    belief.report(robot_at(2.0, 5.0))
    shown(belief, truth, 0, 95)
    assert [area.id for area in belief.areas] == ["0,0"]
    shown(belief, truth, 95, 130)
    assert [area.id for area in belief.areas] == ["0,0", "1,0"]
    assert belief.areas[1].known_share == pytest.approx(0.3, abs=0.05)
    shown(belief, truth, 130, 200)
    assert [area.known_share for area in belief.areas] == [1.0, 1.0]


def test_costs_and_paths_on_an_empty_hall_are_those_of_a_straight_drive() -> None:
    truth = truth_of()
    belief = belief_of(truth)
    robot = robot_at(2.05, 5.05)
    belief.report(robot)
    belief.merge_map(1.0, truth)
    times, joules = belief.costs(robot, np.array([(12.05, 5.05), (12.05, 8.05), (0.2, 0.2)]))
    assert times[0] == pytest.approx(10 / 0.89, rel=1e-6)
    assert joules[0] == pytest.approx((2.0 + 7.0) * 10 / 0.89, rel=1e-6)
    assert np.hypot(10, 3) / 0.89 <= times[1] <= 1.083 * np.hypot(10, 3) / 0.89
    assert np.isfinite(times[2]), "a point in the corner is driven to as near as the robot can stand"
    path = belief.path(robot, (12.05, 8.05))
    assert path[0] == (2.05, 5.05)
    assert path[-1] == pytest.approx((12.05, 8.05))
    length = sum(np.hypot(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(path))
    assert length == pytest.approx(np.hypot(10, 3), rel=0.02)
    table, _ = belief.table(PROFILE, np.array([(2.05, 5.05), (12.05, 5.05)]))
    assert table[0, 1] == pytest.approx(table[1, 0])


def test_known_space_ends_a_radius_before_the_unknown() -> None:
    truth = truth_of()
    belief = belief_of(truth)
    robot = robot_at(2.0, 5.0)
    belief.report(robot)
    shown(belief, truth, 0, 60)
    goals = np.array([(5.0, 5.0), (9.0, 5.0)])
    assert np.isnan(belief.costs(robot, goals)[0]).tolist() == [False, True]
    assert not np.isnan(belief.costs(robot, goals, optimistic=True)[0]).any()


@pytest.mark.parametrize("seed", range(4))
def test_layers_kept_up_to_date_are_those_worked_out_at_once(seed: int) -> None:
    """Shown piece by piece, with pixels that change their minds, or all at once: the same clearances and shares."""
    rng = np.random.default_rng(seed)
    truth = truth_of()
    cells = truth.cells.copy()
    for _ in range(12):
        r, c = rng.integers(5, 90), rng.integers(5, 190)
        cells[r : r + rng.integers(1, 12), c : c + rng.integers(1, 12)] = 1
    cells[48:53, 18:23] = 0
    slow, fast = belief_of(truth), belief_of(truth)
    for belief in (slow, fast):
        belief.report(robot_at(2.05, 5.05))
    rows, cols = np.nonzero(rng.random(cells.shape) < 0.2)
    slow.merge(0.5, rows, cols, rng.integers(0, 2, len(rows)))  # nonsense, all of it seen again below
    pixels = rng.permutation(cells.size)
    for part in np.array_split(pixels, 7):
        slow.merge(1.0, part // 200, part % 200, cells.ravel()[part])
        _ = slow.areas
    fast.merge_map(1.0, OccupancyMap(cells, 0.1))
    goals = np.stack((rng.uniform(0, 20, 40), rng.uniform(0, 10, 40)), axis=1)
    assert np.array_equal(
        slow.costs(robot_at(2.05, 5.05), goals)[0], fast.costs(robot_at(2.05, 5.05), goals)[0], equal_nan=True
    )
    assert [a.known_share for a in slow.areas] == [a.known_share for a in fast.areas]
    assert np.array_equal(slow.map.cells, fast.map.cells)


@pytest.mark.parametrize("seed", range(3))
def test_targets_found_step_by_step_are_those_found_at_once(seed: int) -> None:
    """But for their names: the same regions, looked at from the same places."""
    rng = np.random.default_rng(seed)
    cells = truth_of().cells.copy()
    for _ in range(15):
        r, c = rng.integers(2, 90), rng.integers(2, 190)
        cells[r : r + rng.integers(1, 14), c : c + rng.integers(1, 14)] = 1
    cells[46:55, 16:25] = 0
    unknown = ndimage.gaussian_filter(rng.random(cells.shape), 5) > 0.5
    unknown[40:60, 10:40] = False
    slow, fast = belief_of(truth_of(), cell_m=5.0), belief_of(truth_of(), cell_m=5.0)
    for belief in (slow, fast):
        belief.report(robot_at(2.05, 5.05))
    rows, cols = np.nonzero(~unknown)
    for part in np.array_split(rng.permutation(len(rows)), 6):
        slow.merge(1.0, rows[part], cols[part], cells[rows[part], cols[part]])
        _ = slow.targets
    fast.merge(1.0, rows, cols, cells[rows, cols])
    found = [sorted(repr(dataclasses.replace(target, id="")) for target in one.targets) for one in (slow, fast)]
    assert found[0] == found[1]
    assert sum(target.stand_m is not None for target in fast.targets) > 2
    assert [area.stand_m for area in slow.areas] == [area.stand_m for area in fast.areas]


def test_the_soonest_of_robots_is_there_first_on_every_map() -> None:
    """Two kinds of robots, asked anew after each change: the least of their own times, as of a belief made anew."""
    slim = dataclasses.replace(PROFILE, length_m=0.3, width_m=0.2, speed_max_m_s=0.6)
    truth = truth_of()
    cells = truth.cells.copy()
    cells[15:, 98:102] = 1
    cells[40:45, 98:102] = 0  # the slim one alone gets through
    robots = [
        robot_at(2.05, 5.05), robot_at(3.0, 8.0, "r2"), dataclasses.replace(robot_at(8.0, 4.2, "r3"), profile=slim)
    ]  # fmt: skip
    belief = belief_of(truth, profiles=[PROFILE, slim])
    goals = np.stack(np.meshgrid(np.linspace(0.5, 19.5, 12), np.linspace(0.5, 9.5, 6)), axis=-1).reshape(-1, 2)
    for low, high in ((0, 60), (60, 120), (120, 200)):
        shown(belief, OccupancyMap(cells, 0.1), low, high)
        anew = belief_of(truth, profiles=[PROFILE, slim])
        shown(anew, OccupancyMap(cells, 0.1), 0, high)
        soonest_s = belief.soonest_s(robots, goals)
        each = [anew.costs(robot, goals)[0] for robot in robots]
        np.testing.assert_array_equal(soonest_s, np.fmin.reduce(each))
        assert np.isfinite(soonest_s).sum() > high // 4
    before_s = belief.soonest_s(robots[:2], goals)
    belief.report(dataclasses.replace(robots[2], x_m=10.0, y_m=0.8, state="dead"))
    after_s = belief.soonest_s(robots[:2], goals)  # the map is the same, and the way below the wall is closed now
    assert np.isnan(after_s).sum() > np.isnan(before_s).sum()


def test_clearances_are_distances_to_the_nearest_occupied_pixel() -> None:
    rng = np.random.default_rng(3)
    cells = (rng.random((100, 200)) < 0.01).astype(np.uint8)
    belief = belief_of(truth_of())
    belief.merge_map(1.0, OccupancyMap(cells, 0.1))
    points = np.stack(np.meshgrid(np.arange(30, 170) + 0.5, np.arange(20, 80) + 0.5), axis=-1).reshape(-1, 2) / 10
    found = belief.clearance_m(points)
    near = ndimage.distance_transform_edt(cells == 0)[20:80, 30:170].ravel() * 0.1
    assert (found <= near + 1e-6).all()
    assert (found >= np.minimum(near, 0.9) - 0.0501 * np.sqrt(2)).all()


def test_a_scan_frees_the_ray_and_blocks_its_end() -> None:
    belief = belief_of(truth_of())
    belief.merge_scan(1.0, 5.05, 5.05, [0.0, np.pi / 2], [3.0, np.inf], 4.0)
    seen = belief.map
    assert seen.values_at((7.0, 5.05)) == FREE
    assert seen.values_at((8.05, 5.05)) == OCCUPIED
    assert seen.values_at((8.25, 5.05)) == UNKNOWN
    assert seen.values_at((5.05, 8.9)) == FREE
    assert seen.values_at((5.05, 9.15)) == UNKNOWN


def test_would_see_counts_what_a_scan_would_reveal() -> None:
    truth = truth_of()
    belief = belief_of(truth)
    belief.report(robot_at(2.0, 5.0))
    shown(belief, truth, 0, 60)
    assert belief.would_see((2.0, 5.0), 3.0) == 0
    assert belief.would_see((5.9, 5.0), 3.0) > 1000


def test_a_dead_robot_stands_in_the_way() -> None:
    """In a hall the way leads around it; in a corridor too narrow for two it is closed; a living one does not count."""
    truth = truth_of()
    belief = belief_of(truth)
    belief.report(robot_at(2.0, 5.0))
    belief.report(robot_at(10.0, 5.0, "r2"))
    shown(belief, truth, 0, 200)
    goal = np.array([[18.0, 5.0]])
    (before_s,), _ = belief.costs(belief.robots[0], goal)
    belief.report(dataclasses.replace(robot_at(10.0, 5.0, "r2"), state="dead"))
    (after_s,), _ = belief.costs(belief.robots[0], goal)
    assert after_s > before_s
    way = np.array(belief.path(belief.robots[0], (18.0, 5.0)))
    steps = [np.linspace(a, b, 50) for a, b in itertools.pairwise(way)]
    gap_m = min(float(np.hypot(*(step - (10.0, 5.0)).T).min()) for step in steps)
    assert gap_m >= 2 * PROFILE.radius_m

    cells = truth.cells.copy()
    cells[:45, 80:120] = cells[55:, 80:120] = 1  # 1 m wide, and two robots need 2 * 0.67 m
    narrow = OccupancyMap(cells, 0.1)
    for blocks in (True, False):
        belief = belief_of(narrow, bodies_block=blocks)
        belief.report(robot_at(2.0, 5.0))
        belief.report(robot_at(10.0, 5.0, "r2"))
        shown(belief, narrow, 0, 200)
        assert np.isfinite(belief.costs(belief.robots[0], goal)[0][0])
        belief.report(dataclasses.replace(robot_at(10.0, 5.0, "r2"), state="dead"))
        assert np.isfinite(belief.costs(belief.robots[0], goal)[0][0]) == (not blocks)
        assert (belief.path(belief.robots[0], (18.0, 5.0), optimistic=True) == ()) == blocks


def halved(gap: int) -> OccupancyMap:
    """Return the hall with a wall across, at x = 10 m, and a gap of so many pixels in its middle."""
    cells = truth_of().cells.copy()
    cells[:, 100] = OCCUPIED
    cells[50 - gap // 2 : 50 + gap // 2, 100] = FREE
    return OccupancyMap(cells, 0.1)


def test_a_robot_leaves_through_the_gap_that_it_came_in_by_and_no_other_one_enters() -> None:
    """A wall with a gap of 0.6 m: too narrow for the robot's disc (0.67 m), not for the robot (0.43 m)."""
    truth = halved(6)
    belief = belief_of(truth)
    belief.report(robot_at(5.0, 5.0))
    shown(belief, truth, 0, 200)
    assert belief.path(robot_at(5.0, 5.0), (15.0, 5.0)) == ()
    belief.report(robot_at(15.0, 5.0))  # it has slipped through before it knew how narrow the gap was
    back = belief.path(robot_at(15.0, 5.0), (5.0, 5.0))
    assert back[-1] == pytest.approx((5.0, 5.0), abs=0.1)
    assert all(abs(y - 5.0) < 0.2 for x, y in back if abs(x - 10.05) < 0.3)
    shown(belief, halved(0), 0, 200)
    assert belief.path(robot_at(15.0, 5.0), (5.0, 5.0)) == ()


def test_where_a_robot_came_from_is_not_out_of_reach() -> None:
    truth = halved(0)
    belief = belief_of(truth)
    belief.report(robot_at(5.0, 5.0))
    belief.report(robot_at(15.0, 5.0))
    shown(belief, truth, 20, 200)
    assert [area.unreachable for area in belief.areas] == [False, False]
