from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.cluster.hierarchy import DisjointSet

from react_opt.areas import lay_grid
from react_opt.build import BuildReport, build
from react_opt.errors import InputError, UsageError
from react_opt.geometry.inflation import Footprint, inflate
from react_opt.geometry.occupancy import OCCUPIED, UNKNOWN, OccupancyMap
from react_opt.instance import Fleet

# 0.3 m x 0.4 m: a disc of 0.25 m radius. 1 m/s at any clearance, 7 J per metre and 2 W always; turns take no time.
PROFILE = {
    "length_m": 0.3,
    "width_m": 0.4,
    "speed_max_m_s": 1.0,
    "speed_min_m_s": 1.0,
    "full_speed_clearance_m": 0.5,
    "accel_m_s2": 1.0,
    "turn_rad_s": 1e9,
    "idle_w": 2.0,
    "motion_w": 7.0,
    "turn_w": 5.0,
    "sensing_w": 17.0,
    "battery_j": 900.0,
    "capacity_j": 1000.0,
    "reserve_j": 10.0,
    "lidar_range_m": 8.0,
    "lidar_rays": 90,
}
both = pytest.mark.parametrize("paths", ["exact", "ompl"])
Builder = Callable[..., BuildReport]


def fleet(*poses: tuple[float, float], chargers: tuple = (), **changes: float) -> Fleet:
    return Fleet.model_validate(
        {
            "kind": "fleet",
            "name": "hand-made",
            "profiles": {"p": {**PROFILE, **changes}},
            "robots": [{"id": f"r{k}", "profile": "p", "x_m": x, "y_m": y} for k, (x, y) in enumerate(poses)],
            "chargers": [{"x_m": x, "y_m": y, "power_w": power, "slots": 1} for x, y, power in chargers],
        }
    )


def floor(width_m: float, height_m: float, *walls: tuple[float, float, float, float], value: int = OCCUPIED):
    """Return an open floor from (0, 0), 0.1 m per pixel, with walls (x from, y from, x to, y to)."""
    cells = np.zeros((round(height_m * 10), round(width_m * 10)), np.uint8)
    for x0, y0, x1, y1 in walls:
        cells[round(y0 * 10) : round(y1 * 10), round(x0 * 10) : round(x1 * 10)] = value
    return OccupancyMap(cells, 0.1)


def arcs(report: BuildReport) -> dict[tuple[str, str], list[tuple[int, float]]]:
    found: dict[tuple[str, str], list[tuple[int, float]]] = {}
    for arc in report.instance.travel:
        found.setdefault((arc.from_, arc.to), []).append((arc.steps, arc.energy_j))
    return found


def links(report: BuildReport) -> set[tuple[str, str]]:
    return {(one, other) for one, other in arcs(report) if one < other}


@both
def test_ten_metres_take_ten_seconds_rounded_up_to_steps_and_joules_of_motion_and_idling(paths: str) -> None:
    # 20 m x 10 m: two cells, 10 m between their centres, from where the robot starts
    source, robot = floor(20, 10), fleet((5, 5))
    for step_s, steps in ((10.0, 1), (4.0, 3), (100.0, 1)):
        report = build(source, robot, cell_m=10, horizon_s=240, step_s=step_s, paths=paths)
        # 7 J/m over 10 m, and 2 W for all of the steps: early arrival is standing
        expected = 7 * 10 + 2 * steps * step_s
        assert arcs(report) == {
            ("g0_0", "g1_0"): [(steps, pytest.approx(expected))],
            ("g1_0", "g0_0"): [(steps, pytest.approx(expected))],
        }
        assert report.instance.horizon_steps == 240 // step_s
        assert report.instance.travel[0].speed_m_s == pytest.approx(1.0)
    assert [(cell.id, cell.x_m, cell.y_m) for cell in report.instance.cells] == [
        ("g0_0", pytest.approx(5, abs=1e-6), pytest.approx(5, abs=1e-6)),
        ("g1_0", pytest.approx(15, abs=1e-6), pytest.approx(5, abs=1e-6)),
    ]
    assert report.instance.robots[0].model_dump() == {
        "id": "r0",
        "start": "g0_0",
        "start_step": 0,
        "battery_j": 900.0,
        "capacity_j": 1000.0,
        "reserve_j": 10.0,
        "idle_w": 2.0,
        "sensing_w": 17.0,
        "return_to": None,
    }
    assert report.dropped == []


@both
def test_a_wall_between_two_cells_means_no_arc_and_a_door_makes_one(paths: str) -> None:
    def joined(*walls: tuple[float, float, float, float]) -> set[tuple[str, str]]:
        report = build(floor(20, 20, *walls), fleet((5, 5)), cell_m=10, horizon_s=60, step_s=5, paths=paths)
        assert len(report.instance.cells) == 4
        assert report.notes == []
        return links(report)

    ring = {("g0_0", "g0_1"), ("g0_0", "g1_0"), ("g0_1", "g1_1"), ("g1_0", "g1_1")}
    assert joined() == ring
    assert joined((9.9, 0, 10.1, 10)) == ring - {("g0_0", "g1_0")}  # the way round through g0_1 is no arc
    assert joined((9.9, 0, 10.1, 4), (9.9, 5, 10.1, 10)) == ring  # a door of 1 m
    assert joined((9.9, 0, 10.1, 4), (9.9, 4.4, 10.1, 10)) == ring - {("g0_0", "g1_0")}  # 0.4 m: the robot needs 0.5


@both
def test_what_lies_behind_a_wall_is_dropped_and_named(paths: str) -> None:
    source = floor(20, 10, (9.9, 0, 10.1, 10))
    report = build(source, fleet((5, 5)), cell_m=10, horizon_s=60, step_s=5, paths=paths)
    assert [cell.id for cell in report.instance.cells] == ["g0_0"]
    assert report.instance.travel == ()
    report = build(source, fleet((5, 5), (15, 5), (3, 5)), cell_m=10, horizon_s=60, step_s=5, paths=paths)
    assert [robot.id for robot in report.instance.robots] == ["r0", "r2"]  # two robots against one
    assert [(drop.what, drop.place) for drop in report.dropped] == [("robot", "r1")]
    # an area within the grid that nobody can enter: the lower right one of four
    report = build(
        floor(20, 20, (9.9, 0, 10.1, 10.1), (9.9, 9.9, 20, 10.1)), fleet((5, 5)), cell_m=10, horizon_s=60, step_s=5
    )
    assert [(drop.what, drop.place) for drop in report.dropped] == [("cell", "g1_0")]
    assert "walled off" in report.dropped[0].why


def test_an_area_without_floor_is_dropped() -> None:
    report = build(floor(20, 20, (9, 9, 20, 20)), fleet((5, 5)), cell_m=10, horizon_s=60, step_s=5)
    assert [(drop.place, drop.why) for drop in report.dropped] == [("g1_1", "no free space")]
    assert links(report) == {("g0_0", "g0_1"), ("g0_0", "g1_0")}


@both
def test_unknown_space_is_blocked_free_or_slow(paths: str) -> None:
    source = floor(20, 10, (10, 0, 20, 10), value=UNKNOWN)

    def built(unknown: str) -> BuildReport:
        return build(source, fleet((5, 5)), cell_m=10, horizon_s=60, step_s=1, paths=paths, unknown=unknown)

    assert len(built("blocked").instance.cells) == 1
    assert {arc.steps for arc in built("free").instance.travel} == {10}
    # half of the 10 m at half the speed: 5 s + 10 s
    assert {arc.steps for arc in built("costlier").instance.travel} == {15}


@both
def test_arcs_that_leave_the_start_cell_are_timed_from_the_worst_start_pose(paths: str) -> None:
    report = build(floor(20, 10), fleet((1, 5)), cell_m=10, horizon_s=60, step_s=1, paths=paths)
    assert arcs(report) == {
        ("g0_0", "g1_0"): [(14, pytest.approx(7 * 14 + 2 * 14))],  # from x = 1 m
        ("g1_0", "g0_0"): [(10, pytest.approx(7 * 10 + 2 * 10))],  # to the standing point
    }
    near = build(floor(20, 10), fleet((9, 5)), cell_m=10, horizon_s=60, step_s=1, paths=paths)
    assert {steps for ((steps, _),) in arcs(near).values()} == {10}  # it may come back and leave from the centre


@both
def test_a_start_pose_behind_a_wall_in_its_area_counts_by_the_way_round(paths: str) -> None:
    # the pose lies in an alley 2 m wide that opens 14 m east, in the next area: on the way up the robot leaves both
    source = floor(20, 20, (0, 2, 14, 2.2))
    report = build(source, fleet((9, 1)), cell_m=10, horizon_s=60, step_s=1, paths=paths)
    ((up, _),), ((down, _),) = arcs(report)["g0_0", "g0_1"], arcs(report)["g0_1", "g0_0"]
    assert down == 10
    assert up >= 5 + np.hypot(9, 13)  # to the wall's end, then to (5, 15)


def test_a_robot_that_starts_in_a_wall_is_named_and_so_are_all_others() -> None:
    source = floor(20, 10, (3, 3, 4, 4), (10, 0, 20, 10))
    with pytest.raises(InputError) as caught:
        build(
            source,
            fleet((5, 5), (3.5, 3.5), (50, 5), (0.1, 5)),
            cell_m=10,
            horizon_s=60,
            step_s=5,
            map_file="m.yaml",
            fleet_file="f.json",
        )
    assert [fault.place for fault in caught.value.faults] == ["robots[1]", "robots[2]", "robots[3]"]
    assert all(fault.file == "f.json" and "m.yaml" in fault.message for fault in caught.value.faults)
    assert "inside an obstacle" in caught.value.faults[0].message
    assert "off the map" in caught.value.faults[1].message


def test_a_robot_whose_outline_may_fit_is_moved_to_where_it_can_turn() -> None:
    # 0.2 m from the wall: half its length of 0.3 m fits, its disc of 0.25 m does not
    report = build(floor(20, 10), fleet((0.2, 5)), cell_m=10, horizon_s=60, step_s=5)
    assert report.instance.robots[0].start == "g0_0"
    assert len(report.notes) == 1
    assert "r0" in report.notes[0]


@both
def test_an_area_that_a_wall_divides_is_joined_by_a_way_through_others_and_noted(paths: str) -> None:
    # Two cells above one another, the lower one cut in two by a wall from below to its upper edge and beyond; its
    # smaller part (right) leads to the cell beside it, its larger part to the one above.
    source = floor(20, 20, (6, 0, 6.2, 10.5), (9.9, 10, 10.1, 20), (10, 9.9, 20, 10.1))
    report = build(source, fleet((3, 15)), cell_m=10, horizon_s=60, step_s=1, paths=paths)
    assert ("g0_0", "g1_0") in links(report)
    assert [note.split(":")[0] for note in report.notes] == ["g0_0 and g1_0"]
    ((steps, _),) = arcs(report)["g1_0", "g0_0"]
    assert steps > 15  # over the wall's upper end, through g0_1


@both
def test_several_profiles_take_the_worst_of_each(paths: str) -> None:
    data = fleet((5, 5), (5, 5)).model_dump(by_alias=True)
    data["profiles"]["slow"] = {**PROFILE, "speed_max_m_s": 0.5, "speed_min_m_s": 0.5, "motion_w": 1.0, "idle_w": 1.0}
    data["robots"][1]["profile"] = "slow"
    report = build(floor(20, 10), Fleet.model_validate(data), cell_m=10, horizon_s=60, step_s=1, paths=paths)
    # 20 s at 0.5 m/s; p: 70 J + 2 W * 20 s = 110 J, slow: 2 J/m * 10 m + 1 W * 20 s = 40 J
    assert arcs(report)["g0_0", "g1_0"] == [(20, pytest.approx(110))]
    assert "2 profiles" in report.notes[0]


def test_chargers_go_to_their_cells_where_robots_stand_beside_them() -> None:
    chargers = ((2.0, 2.0, 50.0), (1.0, 8.0, 40.0), (15.0, 5.0, 60.0), (19.0, 25.0, 60.0))
    report = build(floor(20, 10), fleet((5, 5), chargers=chargers), cell_m=10, horizon_s=60, step_s=5)
    found = [(charger.cell, charger.power_w, charger.slots) for charger in report.instance.chargers]
    assert found == [("g0_0", 40.0, 2), ("g1_0", 60.0, 1)]
    assert [(drop.what, drop.place) for drop in report.dropped] == [("charger", "chargers[3]")]
    assert (report.instance.cells[0].x_m, report.instance.cells[0].y_m) == pytest.approx((2, 2), abs=1e-6)


def test_a_rotated_map_gives_the_same_instance_elsewhere() -> None:
    plain = floor(20, 20, (9.9, 0, 10.1, 4), (9.9, 5, 10.1, 10))
    turned = OccupancyMap(plain.cells, 0.1, 3.0, -2.0, 0.7)
    poses = np.array([(5.0, 5.0), (12.0, 17.0)])
    there = turned.pixel_to_world(plain.world_to_pixel(poses))
    one = build(plain, fleet(*poses), cell_m=10, horizon_s=60, step_s=1).instance
    two = build(turned, fleet(*there), cell_m=10, horizon_s=60, step_s=1).instance
    assert [(arc.from_, arc.to, arc.steps) for arc in one.travel] == [(a.from_, a.to, a.steps) for a in two.travel]
    assert [robot.start for robot in one.robots] == [robot.start for robot in two.robots]
    moved = turned.pixel_to_world(plain.world_to_pixel([(cell.x_m, cell.y_m) for cell in one.cells]))
    np.testing.assert_allclose(moved, [(cell.x_m, cell.y_m) for cell in two.cells], atol=1e-5)


def test_speed_modes_are_worth_having() -> None:
    # a slot of 0.6 m is the short way, 0.2 m/s slow at its narrowest; round it, the robot drives 1 m/s
    walls = ((9, 0, 11, 4.7), (9, 5.3, 11, 8.5))
    robot = fleet((5, 5), speed_min_m_s=0.05)
    report = build(floor(20, 10, *walls), robot, cell_m=10, horizon_s=100, step_s=5)
    (fast, slow) = arcs(report)["g0_0", "g1_0"]
    assert fast[0] < slow[0]
    assert slow[1] < fast[1] + 2.0 * 5 * (slow[0] - fast[0])  # more than waiting would spend


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    st.integers(0, 10_000), st.floats(0.0, 0.3), st.sampled_from([2.0, 3.0, 5.0]), st.sampled_from(["exact", "ompl"])
)
def test_on_any_map_cells_hang_together_and_arcs_take_what_they_must(
    seed: int, share: float, cell_m: float, paths: str
) -> None:
    rng = np.random.default_rng(seed)
    cells = (rng.random((8, 10)) < share).astype(np.uint8)
    source = OccupancyMap(np.repeat(np.repeat(cells, 4, 0), 4, 1), 0.25, *rng.uniform(-20, 20, 2))  # 10 m x 8 m
    space = inflate(source, Footprint(0.25))
    rows, cols = np.nonzero(space.blocked == 0)
    if not rows.size:
        return
    pick = rng.integers(rows.size, size=2)
    starts = space.to_world(np.stack((cols[pick], rows[pick]), axis=1) + 0.5)
    report = build(source, fleet(*starts), cell_m=cell_m, horizon_s=100, step_s=3, paths=paths)
    instance = report.instance
    place = {cell.id: np.array((cell.x_m, cell.y_m)) for cell in instance.cells}
    assert space.points_free(np.array(list(place.values()))).all()
    together = DisjointSet(place)
    for arc in instance.travel:
        together.merge(arc.from_, arc.to)
        (a, b), (c, d) = (tuple(map(int, end[1:].split("_"))) for end in (arc.from_, arc.to))
        assert abs(a - c) + abs(b - d) == 1
        metres = np.hypot(*(place[arc.from_] - place[arc.to]))
        assert arc.steps >= metres / 3 - 1e-6  # 1 m/s, steps of 3 s
        assert arc.energy_j >= 7 * metres + 2 * 3 * arc.steps - 1e-4
    assert together.n_subsets == 1
    assert {(arc.from_, arc.to) for arc in instance.travel} == {(arc.to, arc.from_) for arc in instance.travel}
    assert {robot.start for robot in instance.robots} <= set(place)
    assert len(instance.robots) + sum(drop.what == "robot" for drop in report.dropped) == 2


def test_grid_lines_are_multiples_where_that_needs_no_more_areas() -> None:
    def lines(source: OccupancyMap) -> list[float]:
        space = inflate(source, Footprint(0.25))
        grid = lay_grid(space, 1, 10.0)
        columns = grid.col_edges * space.resolution_m + source.origin_x_m
        return [*columns, *(grid.row_edges * space.resolution_m + source.origin_y_m)]

    walls = ((0, 0, 20, 0.2), (0, 0, 0.2, 20), (19.8, 0, 20, 20), (0, 19.8, 20, 20))
    assert lines(floor(20, 20, *walls)) == pytest.approx([0, 10, 20, 0, 10, 20])
    shifted = OccupancyMap(floor(20, 20, *walls).cells, 0.1, -5.0, 100.0)
    # from -4.8 to 14.8 m two areas do, lines at -10, 0, 10 and 20 would make three: centred instead
    assert lines(shifted) == pytest.approx([-5, 5, 15, 100, 110, 120])


def test_tiny_maps_and_tiny_cells() -> None:
    small = fleet((0.5, 0.5), length_m=0.1, width_m=0.1)
    report = build(floor(1, 1), small, cell_m=10, horizon_s=60, step_s=5)
    assert [cell.id for cell in report.instance.cells] == ["g0_0"]
    with pytest.raises(UsageError, match="pixel"):
        build(floor(1, 1), small, cell_m=0.05, horizon_s=60, step_s=5)
    with pytest.raises(InputError, match=r"m\.yaml: expected free space"):
        build(floor(1, 1, (0, 0, 1, 1)), small, cell_m=1, horizon_s=60, step_s=5, map_file="m.yaml")


@pytest.mark.parametrize(
    "options",
    [
        {"cell_m": 0},
        {"cell_m": float("nan")},
        {"step_s": -1},
        {"horizon_s": float("inf")},
        {"step_s": 61},
        {"step_s": 1e-9},
        {"paths": "crow"},
    ],
)
def test_numbers_that_make_no_sense_are_refused(options: dict) -> None:
    with pytest.raises(UsageError):
        build(floor(5, 5), fleet((2, 2)), **{"cell_m": 5, "horizon_s": 60, "step_s": 5, **options})


def test_the_rest_of_the_horizon_is_noted() -> None:
    report = build(floor(5, 5), fleet((2, 2)), cell_m=5, horizon_s=64, step_s=10)
    assert report.instance.horizon_steps == 6
    assert "4 s" in report.notes[0]
