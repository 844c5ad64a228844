import signal
import subprocess
import sys
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from clearance import along, clearances
from hypothesis import given, settings
from hypothesis import strategies as st
from test_energy import ROBOT

from react_opt.errors import MissingPartError, UsageError
from react_opt.geometry.inflation import Footprint, FreeSpace, inflate
from react_opt.geometry.occupancy import FREE, OccupancyMap
from react_opt.paths.exact import exact_costs
from react_opt.paths.ompl_ import PLANNERS, quiet
from react_opt.paths.ompl_costs import OmplPathCosts
from react_opt.paths.protocol import PathCosts
from react_opt.paths.visibility import VisibilityCosts


def rooms() -> OccupancyMap:
    """Return 12 m x 8 m at 0.1 m: two rooms joined by a gap of 0.9 m, each with a box, and a sealed closet."""
    cells = np.zeros((80, 120), np.uint8)
    cells[[0, -1]] = 1
    cells[:, [0, -1]] = 1
    cells[:, 60:62] = 1
    cells[50:59, 60:62] = 0
    cells[20:45, 20:40] = 1
    cells[30:60, 80:95] = 1
    cells[1:15, 104:106] = cells[13:15, 104:119] = 1
    return OccupancyMap(cells, 0.1)


def free_points(space: FreeSpace, count: int, seed: int) -> np.ndarray:
    rows, cols = np.nonzero(space.blocked == 0)
    pick = np.random.default_rng(seed).integers(rows.size, size=count)
    return space.to_world(np.stack((cols[pick] + 0.5, rows[pick] + 0.5), axis=1))


@pytest.fixture(scope="module")
def space() -> FreeSpace:
    return inflate(rooms(), Footprint(0.3))


def test_no_pair_is_missing_and_none_is_shorter_than_exact_or_much_longer(space: FreeSpace) -> None:
    points = np.concatenate((free_points(space, 20, 1), [(11.2, 0.7)]))  # the last one is in the closet
    exact = VisibilityCosts(space, ROBOT).cost_table(points)
    found = OmplPathCosts(space, ROBOT, samples=300).cost_table(points)
    assert np.array_equal(found.reachable, exact.reachable)
    assert not exact.reachable.all()
    there = exact.reachable & (exact.length_m > 0)
    ratio = found.length_m[there] / exact.length_m[there]
    assert ratio.min() >= 1 - 1e-6
    assert ratio.max() <= 1.15
    assert ratio.mean() <= 1.03
    assert np.isnan(found.time_s[~found.reachable]).all()
    assert np.array_equal(found.length_m, found.length_m.T, equal_nan=True)
    assert "PRMstar" in found.method


def test_least_time_takes_the_way_that_is_faster_though_longer(space: FreeSpace) -> None:
    points = free_points(space, 12, 4)
    short, fast = (
        OmplPathCosts(space, ROBOT, samples=400, minimise=what).cost_table(points) for what in ("length", "time")
    )
    best = exact_costs(space, ROBOT, method="fastest16").cost_table(points)
    there = short.reachable & (short.length_m > 0)
    assert np.array_equal(short.reachable, fast.reachable)
    assert fast.time_s[there].mean() < 0.97 * short.time_s[there].mean()
    assert fast.length_m[there].mean() > short.length_m[there].mean()
    assert fast.time_s[there].mean() < 1.08 * best.time_s[there].mean()


def test_same_seed_same_table_and_another_seed_another(space: FreeSpace) -> None:
    points = free_points(space, 8, 2)
    one, same, other = (OmplPathCosts(space, ROBOT, samples=150, seed=s).cost_table(points) for s in (5, 5, 6))
    for name in ("length_m", "time_s", "energy_j"):
        assert np.array_equal(getattr(one, name), getattr(same, name), equal_nan=True)
    assert not np.array_equal(one.length_m, other.length_m, equal_nan=True)


def test_every_path_keeps_its_distance_and_agrees_with_the_table(space: FreeSpace) -> None:
    points = free_points(space, 8, 3)
    costs: PathCosts = OmplPathCosts(space, ROBOT, samples=150)
    table = costs.cost_table(points)
    solid = space.source.cells != FREE
    for i, j in combinations(range(len(points)), 2):
        path = costs.path(points[i], points[j])
        assert (path is None) == (not table.reachable[i, j])
        if path is not None:
            np.testing.assert_array_equal(path.points_m[[0, -1]], points[[i, j]])
            dense = space.source.world_to_pixel(along(path.points_m, 0.02))
            assert clearances(solid, dense, outside=True).min() * 0.1 >= 0.3 - 1e-6
            assert path.length_m == pytest.approx(table.length_m[i, j], rel=0.02)
            assert path.min_clearance_m >= 0.3 - 1e-6


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.floats(0.1, 0.45))
def test_reachable_is_exactly_what_the_pixels_connect(seed: int, share: float) -> None:
    # few samples on a cluttered map: whatever is joined is joined along pixel paths
    cells = (np.random.default_rng(seed).random((14, 18)) < share).astype(np.uint8)
    space = inflate(OccupancyMap(cells, 1.0), Footprint(0), refine=1)
    if space.regions.any():
        points = free_points(space, 8, seed)
        found = OmplPathCosts(space, ROBOT, samples=10, seed=seed).cost_table(points).reachable
        regions = space.regions_at(points)
        assert np.array_equal(found, regions[:, None] == regions[None])


def test_points_that_nobody_can_stand_on_reach_nothing(space: FreeSpace) -> None:
    costs = OmplPathCosts(space, ROBOT, samples=50)
    table = costs.cost_table(np.array([(1.0, 1.0), (3.0, 3.0), (-5.0, 0.0)]))
    assert table.reachable.tolist() == [[True, False, False], [False] * 3, [False] * 3]
    assert costs.path(np.array((1.0, 1.0)), np.array((3.0, 3.0))) is None
    assert costs.cost_table(np.empty((0, 2))).reachable.shape == (0, 0)


def test_a_map_without_free_space_has_no_paths() -> None:
    space = inflate(OccupancyMap(np.ones((5, 5), np.uint8), 1.0), Footprint(0.2))
    assert not OmplPathCosts(space, ROBOT).cost_table(np.array([(1.0, 1.0), (2.0, 2.0)])).reachable.any()


def rectangles_free(solid: np.ndarray, robot: tuple[float, float], poses: np.ndarray, resolution: float) -> bool:
    """Tell whether rectangles (length, width) at poses (x, y, yaw) cover no solid pixel: sampled, plain."""
    length, width = robot
    u, v = np.meshgrid(np.linspace(-length / 2, length / 2, 21), np.linspace(-width / 2, width / 2, 17))
    for x, y, yaw in poses:
        column = (x + u * np.cos(yaw) - v * np.sin(yaw)) / resolution
        row = (y + u * np.sin(yaw) + v * np.cos(yaw)) / resolution
        if solid[np.floor(row - 1e-9).astype(int), np.floor(column - 1e-9).astype(int)].any():
            return False
    return True


def test_a_rectangle_drives_straight_where_its_disc_is_too_wide() -> None:
    # rooms joined by a gap of 0.7 m: the disc around 0.7 m x 0.4 m (0.81 m across) is too wide, 0.4 m is not
    robot = replace(ROBOT, length_m=0.7, width_m=0.4)
    cells = np.zeros((60, 100), np.uint8)
    cells[:, 49:51] = 1
    cells[27:34, 49:51] = 0
    source = OccupancyMap(cells, 0.1)
    space = inflate(source, Footprint(robot.radius_m), refine=4)
    ends = np.array([(1.0, 5.0), (9.0, 1.0)])
    assert OmplPathCosts(space, robot, samples=200).path(*ends) is None
    path = OmplPathCosts(space, robot, samples=400, footprint="rectangle").path(*ends)
    assert path is not None
    for a, b in pairwise(path.points_m):
        heading = np.arctan2(*(b - a)[::-1])
        drive = [(x, y, heading) for x, y in along(np.array((a, b)), 0.03)]
        turn = [(*b, heading + angle) for angle in np.linspace(0, 2 * np.pi, 40)]
        assert rectangles_free(cells != FREE, (0.7, 0.4), np.array(drive + turn), 0.1)


@pytest.mark.parametrize("planner", [each for each in PLANNERS if each != "PRMstar"])
def test_single_query_planners_answer_from_a_child_process(space: FreeSpace, planner: str) -> None:
    points = np.array([(1.0, 1.0), (5.0, 7.0), (11.0, 7.0)])
    exact = VisibilityCosts(space, ROBOT).cost_table(points)
    costs = OmplPathCosts(space, ROBOT, planner=planner, iterations=3000)
    tables = [costs.cost_table(points) for _ in range(2)]
    assert np.array_equal(tables[0].length_m, tables[1].length_m, equal_nan=True)
    found = tables[0].reachable & (exact.length_m > 0)
    assert found.any()
    assert (tables[0].length_m[found] >= exact.length_m[found] * (1 - 1e-6)).all()


def test_parameters_of_a_planner_reach_it_and_wrong_ones_are_named(space: FreeSpace) -> None:
    points = np.array([(1.0, 1.0), (5.0, 7.0)])
    lengths = []
    for chosen in ({}, {"SamplesPerBatch": 37}):
        costs = OmplPathCosts(space, ROBOT, planner="BITstar", iterations=2000, parameters=chosen)
        lengths.append(costs.cost_table(points).length_m[0, 1])
    assert lengths[0] != lengths[1]
    for wrong, message in (({"Samples": 3}, "SamplesPerBatch"), ({"SamplesPerBatch": "many"}, "does not take")):
        with pytest.raises(UsageError, match=message):
            OmplPathCosts(space, ROBOT, planner="BITstar", parameters=wrong)


def test_a_planner_that_does_not_answer_is_killed_and_the_next_query_works(space: FreeSpace) -> None:
    points = np.array([(1.0, 1.0), (11.0, 7.0)])
    costs = OmplPathCosts(space, ROBOT, planner="RRTstar", iterations=10**12, patience_s=0.5)
    table = costs.cost_table(points)
    assert not table.reachable[0, 1]
    assert "1 queries killed" in table.method
    assert costs.cost_table(points[:1]).reachable.all()


def test_options_that_make_no_sense_are_refused(space: FreeSpace) -> None:
    for options in (
        {"planner": "SORRTstar"},
        {"footprint": "point"},
        {"samples": 0},
        {"seed": -1},
        {"iterations": 0},
        {"minimise": "energy"},
    ):
        with pytest.raises(UsageError):
            OmplPathCosts(space, ROBOT, **options)


def test_without_ompl_the_error_names_what_to_install(space: FreeSpace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ompl", None)
    with pytest.raises(MissingPartError, match="pip install ompl"):
        OmplPathCosts(space, ROBOT)


def test_importing_the_module_does_not_import_ompl() -> None:
    code = "import sys, react_opt.paths.ompl_costs; sys.exit('ompl' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_an_interrupt_waits_for_the_planner_and_is_not_lost() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background may have been started without
    # raised inside one of OMPL's callbacks it would abort the whole process
    done = []

    def interrupted() -> None:
        with quiet():
            signal.raise_signal(signal.SIGINT)
            done.append("the planner's work")

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_nothing_is_printed(space: FreeSpace, capfd: pytest.CaptureFixture[str]) -> None:
    for seed in (1, 1):
        OmplPathCosts(space, ROBOT, samples=50, seed=seed).cost_table(free_points(space, 4, 1))
    assert capfd.readouterr() == ("", "")
