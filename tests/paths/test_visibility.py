from fractions import Fraction
from itertools import pairwise

import exact_sight
import numpy as np
import pytest
from clearance import along, clearances
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from test_energy import ROBOT

from react_opt.geometry.inflation import Footprint, FreeSpace, inflate
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.geometry.sight import segment_free_px
from react_opt.paths.grid import PixelCosts
from react_opt.paths.protocol import PathCosts
from react_opt.paths.tautgraph import corners_of
from react_opt.paths.visibility import VisibilityCosts

seeds = st.integers(0, 10_000)


def scattered(seed: int, rows: int, cols: int, share: float, radius: float = 0.0, refine: int = 1) -> FreeSpace:
    """Return an inflated map of random obstacles, 1 m per pixel."""
    cells = (np.random.default_rng(seed).random((rows, cols)) < share).astype(np.uint8)
    return inflate(OccupancyMap(cells, 1.0), Footprint(radius), refine=refine)


def brute_lengths(blocked: np.ndarray, points: list[tuple[Fraction, Fraction]]) -> np.ndarray:
    """Return any-angle shortest lengths: every grid corner is a node, every line of sight is in rational numbers."""
    height, width = blocked.shape
    grid = [(Fraction(c), Fraction(r)) for r in range(height + 1) for c in range(width + 1)]
    nodes = points + [p for p in grid if exact_sight.point_free(blocked, *p)]
    length = np.zeros((len(nodes), len(nodes)))
    for i, a in enumerate(nodes):
        for j in range(i):
            if exact_sight.segment_free(blocked, a, nodes[j]):
                apart = np.hypot(float(a[0] - nodes[j][0]), float(a[1] - nodes[j][1]))
                length[i, j] = length[j, i] = max(apart, 1e-12)  # a sparse matrix has no edges of length 0
    return dijkstra(csr_array(length), indices=range(len(points)))[:, : len(points)]


def test_around_a_box_by_the_shorter_side() -> None:
    cells = np.zeros((10, 12), np.uint8)
    cells[2:8, 4:9] = 1  # the box spans [4, 9] x [2, 8] m
    costs = VisibilityCosts(inflate(OccupancyMap(cells, 1.0), Footprint(0)), ROBOT)
    path = costs.path((2.0, 4.0), (11.0, 4.0))
    assert path is not None
    # below it: two slanted legs of hypot(2, 2) and 5 m along the lower side (above it would be hypot(2, 4) each)
    assert path.length_m == pytest.approx(5 + 4 * np.sqrt(2))
    np.testing.assert_allclose(path.points_m, [(2, 4), (4, 2), (9, 2), (11, 4)])
    table = costs.cost_table([(2.0, 4.0), (11.0, 4.0), (6.0, 5.0)])
    assert table.length_m[0, 1] == pytest.approx(path.length_m)
    assert table.time_s[0, 1] == pytest.approx(path.time_s)
    assert table.energy_j[0, 1] == pytest.approx(path.energy_j)
    assert table.reachable.tolist() == [[True, True, False], [True, True, False], [False, False, False]]
    assert np.isnan(table.length_m[0, 2])
    assert "visibility" in table.method


def test_around_an_inflated_pixel_the_path_keeps_the_radius() -> None:
    cells = np.zeros((21, 41), np.uint8)
    cells[10, 20] = 1
    space = inflate(OccupancyMap(cells, 0.1), Footprint(0.3))
    path = VisibilityCosts(space, ROBOT).path((0.55, 1.05), (3.55, 1.05))
    assert path is not None
    # the obstacle's square grown by 0.3 m is at least 0.35 m off the line, at most a fine pixel more
    tight = 2 * np.hypot(1.45, 0.35) + 0.1
    assert tight - 0.1 <= path.length_m <= tight + 0.1
    found = clearances(cells != 0, along(path.points_m / 0.1, 0.05), False) * 0.1
    assert found.min() >= 0.3 - 1e-9


@settings(derandomize=True, deadline=None, max_examples=20)
@given(seed=seeds, share=st.sampled_from((0.15, 0.3, 0.45)))
def test_lengths_are_those_of_a_brute_force_any_angle_search(seed: int, share: float) -> None:
    space = scattered(seed, 5, 6, share)
    rng = np.random.default_rng(seed)
    corners = [(Fraction(int(c)), Fraction(int(r))) for c, r in rng.integers(0, (7, 6), (2, 2))]
    points = corners + [(Fraction(int(c), 4), Fraction(int(r), 4)) for c, r in rng.integers(0, (25, 21), (3, 2))]
    blocked = space.blocked != 0
    expected = brute_lengths(blocked, points)
    free = [exact_sight.point_free(blocked, *p) for p in points]
    expected[~np.outer(free, free)] = np.inf
    table = VisibilityCosts(space, ROBOT).cost_table(np.array(points, dtype=float))
    np.testing.assert_array_equal(table.reachable, np.isfinite(expected))
    np.testing.assert_allclose(table.length_m[table.reachable], expected[table.reachable], rtol=1e-9, atol=1e-9)


@settings(derandomize=True, deadline=None, max_examples=12)
@given(seed=seeds, radius=st.sampled_from((3.0, 6.5, 11.0)))
def test_on_round_corners_nothing_is_lost_by_leaving_out_untaut_segments(seed: int, radius: float) -> None:
    # inflated discs are staircases of many corners, most pairs of which are never traced
    rng = np.random.default_rng(seed)
    cells = np.zeros((70, 80), np.uint8)
    cells[rng.integers(0, 70, 6), rng.integers(0, 80, 6)] = 1
    space = inflate(OccupancyMap(cells, 1.0), Footprint(radius), unknown="free", refine=1)
    rows, cols = np.nonzero(space.blocked == 0)
    picked = rng.choice(rows.size, 12)
    points = np.stack((cols[picked], rows[picked]), axis=1) + rng.random((12, 2))
    nodes = np.concatenate((points, corners_of(space)[:, :2]))
    length = np.zeros((len(nodes), len(nodes)))
    for i, a in enumerate(nodes):
        for j in range(i):
            if segment_free_px(space.padded, *a, *nodes[j]):
                length[i, j] = length[j, i] = np.hypot(*(a - nodes[j]))
    expected = dijkstra(csr_array(length), indices=range(12))[:, :12]
    found = VisibilityCosts(space, ROBOT).cost_table(points)
    np.testing.assert_array_equal(found.reachable, np.isfinite(expected))
    np.testing.assert_allclose(found.length_m[found.reachable], expected[found.reachable], rtol=1e-9)


def check_costs(costs: PathCosts, space: FreeSpace, points: np.ndarray, metric: bool) -> None:
    """Assert what any cost table promises, and that every path keeps the footprint's radius."""
    table = costs.cost_table(points)
    for values in (table.length_m, table.time_s, table.energy_j):
        np.testing.assert_array_equal(values, values.T)
        np.testing.assert_array_equal(np.isnan(values), ~table.reachable)
    regions = space.regions_at(points)
    np.testing.assert_array_equal(table.reachable, (regions[:, None] == regions) & (regions > 0))
    crow = np.hypot(*(points[:, None] - points).T)
    assert (table.length_m >= crow - 1e-9)[table.reachable].all()
    assert (table.time_s >= table.length_m / ROBOT.speed_max_m_s - 1e-9)[table.reachable].all()
    if metric:
        length = np.nan_to_num(table.length_m, nan=np.inf)
        through = np.min(length[:, :, None] + length[None], axis=1)  # the triangle inequality
        assert (length <= through + 1e-9).all()
    solid = space.source.cells != 0
    scale = space.source.resolution_m
    for start, goal in pairwise(points):
        path = costs.path(start, goal)
        i, j = (int(np.flatnonzero((points == p).all(axis=1))[0]) for p in (start, goal))
        assert (path is not None) == table.reachable[i, j]
        if path is None:
            continue
        np.testing.assert_array_equal(path.points_m[[0, -1]], [start, goal])
        assert path.length_m == pytest.approx(table.length_m[i, j])
        assert path.time_s == pytest.approx(table.time_s[i, j])
        assert path.energy_j == pytest.approx(table.energy_j[i, j])
        dense = space.source.world_to_pixel(along(path.points_m, 0.02 * scale))
        found = clearances(solid, dense, True) * scale
        assert found.min() >= space.footprint.radius_m - 1e-6 * scale
        assert path.min_clearance_m >= space.footprint.radius_m - 1e-4


@settings(derandomize=True, deadline=None, max_examples=15)
@given(
    seed=seeds,
    radius=st.sampled_from((0.0, 0.8, 1.5)),
    refine=st.integers(1, 2),
    pose=st.sampled_from(((0.0, 0.0, 0.0), (-3.0, 40.0, 0.7), (5e5, 4e6, -2.0))),  # the last as in UTM
)
def test_promises_of_every_table_and_path(
    seed: int, radius: float, refine: int, pose: tuple[float, float, float]
) -> None:
    rng = np.random.default_rng(seed)
    cells = (rng.random((25, 30)) < 0.06).astype(np.uint8)
    map_ = OccupancyMap(cells, 0.5, *pose)
    space = inflate(map_, Footprint(radius * 0.5), refine=refine)
    points = map_.pixel_to_world(rng.random((8, 2)) * (30, 25))
    check_costs(VisibilityCosts(space, ROBOT), space, points, metric=True)
    for minimise in ("time", "length"):
        for connectivity in (8, 16):
            pixel = PixelCosts(space, ROBOT, minimise=minimise, connectivity=connectivity)
            check_costs(pixel, space, points, metric=False)


def test_of_two_equally_long_paths_table_and_path_hold_the_same() -> None:
    # here two paths are equally long up to rounding, which differs by direction, and turn differently
    rng = np.random.default_rng(427)
    map_ = OccupancyMap((rng.random((25, 30)) < 0.06).astype(np.uint8), 0.5, 5e5, 4e6, -2.0)
    points = map_.pixel_to_world(rng.random((8, 2)) * (30, 25))
    space = inflate(map_, Footprint(0.4))
    costs = VisibilityCosts(space, ROBOT)
    check_costs(costs, space, points, metric=True)
    again = costs.cost_table(points[::-1])
    np.testing.assert_array_equal(again.time_s[::-1, ::-1], costs.cost_table(points).time_s)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(seed=seeds, share=st.sampled_from((0.05, 0.2, 0.35)))
def test_never_longer_than_over_pixels_and_at_best_a_little_shorter(seed: int, share: float) -> None:
    space = scattered(seed, 30, 40, share)
    rows, cols = np.nonzero(space.blocked == 0)
    picked = np.random.default_rng(seed).choice(rows.size, 6)
    points = np.stack((cols[picked], rows[picked]), axis=1) + 0.5
    exact = VisibilityCosts(space, ROBOT).cost_table(points)
    pixels = PixelCosts(space, ROBOT, minimise="length").cost_table(points)
    np.testing.assert_array_equal(exact.reachable, pixels.reachable)
    assert (exact.length_m <= pixels.length_m + 1e-9)[exact.reachable].all()


def test_points_on_corners_rims_and_on_each_other() -> None:
    cells = np.zeros((6, 6), np.uint8)
    cells[2:4, 2:4] = 1
    costs = VisibilityCosts(inflate(OccupancyMap(cells, 1.0), Footprint(0)), ROBOT)
    points = np.array([(2.0, 2.0), (4.0, 4.0), (2.0, 2.0), (3.0, 2.0), (3.0, 4.0)])
    table = costs.cost_table(points)
    assert table.length_m[0, 2] == 0.0
    assert table.length_m[0, 1] == pytest.approx(4.0)  # round the block's corner, along two of its sides
    assert table.length_m[0, 3] == pytest.approx(1.0)
    assert table.length_m[3, 4] == pytest.approx(4.0)  # half a side, a side, half a side
    assert costs.cost_table(np.empty((0, 2))).length_m.shape == (0, 0)


def test_the_same_twice() -> None:
    space = scattered(3, 30, 40, 0.2, radius=0.2)
    points = np.random.default_rng(0).random((12, 2)) * (40, 30)
    one, two = (VisibilityCosts(space, ROBOT).cost_table(points) for _ in range(2))
    np.testing.assert_array_equal(one.time_s, two.time_s)
