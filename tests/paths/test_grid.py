import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from test_energy import ROBOT

from react_opt.errors import UsageError
from react_opt.geometry.inflation import Footprint, FreeSpace, inflate
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.paths.exact import exact_costs
from react_opt.paths.grid import PixelCosts
from react_opt.paths.visibility import VisibilityCosts


def by_scipy(space: FreeSpace, start: tuple[int, int], connectivity: int, timed: bool) -> np.ndarray:
    """Return the costs from a pixel (column, row) by scipy's Dijkstra over edges listed one by one."""
    free = space.blocked == 0
    rows, cols = free.shape
    centres = np.stack(np.meshgrid(np.arange(cols) + 0.5, np.arange(rows) + 0.5), axis=-1)
    clearance = space.clearance_at(space.to_world(centres.reshape(-1, 2)))
    speed = ROBOT.speed_m_s(clearance, space.footprint.radius_m)
    speed[space.slow.ravel() == 1] *= space.unknown_speed_factor
    slowness = (1 / speed if timed else np.ones(rows * cols)).reshape(rows, cols)
    moves = [(1, 0), (0, 1), (1, 1), (1, -1)] + [(2, 1), (1, 2), (2, -1), (1, -2)] * (connectivity == 16)
    edges = []
    for r in range(rows):
        for c in range(cols):
            for dc, dr in moves:
                to_r, to_c = r + dr, c + dc
                if not (0 <= to_r < rows and 0 <= to_c < cols):
                    continue
                middle = space.to_world(((c + to_c + 1) / 2, (r + to_r + 1) / 2))
                ends = space.to_world([(c + 0.5, r + 0.5), (to_c + 0.5, to_r + 0.5)])
                if not (space.segment_free(ends[0], middle) and space.segment_free(middle, ends[1])):
                    continue
                mean = (slowness[r, c] + slowness[to_r, to_c]) / 2
                edges.append((r * cols + c, to_r * cols + to_c, np.hypot(dc, dr) * mean * space.resolution_m))
    one, two, cost = (np.array(column) for column in zip(*edges, strict=True))
    graph = coo_array((cost, (one.astype(int), two.astype(int))), shape=(rows * cols, rows * cols))
    return dijkstra(graph, directed=False, indices=start[1] * cols + start[0]).reshape(rows, cols)


@settings(derandomize=True, deadline=None, max_examples=15)
@given(
    seed=st.integers(0, 10_000),
    connectivity=st.sampled_from((8, 16)),
    timed=st.booleans(),
    share=st.sampled_from((0.05, 0.25)),
)
def test_costs_agree_with_scipy(seed: int, connectivity: int, timed: bool, share: float) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.choice(3, size=(10, 11), p=(0.9 - share, share, 0.1)).astype(np.uint8)
    cells[4, 5] = 0
    space = inflate(OccupancyMap(cells, 0.25), Footprint(0.0), unknown="costlier", refine=1)
    minimise = "time" if timed else "length"
    costs = PixelCosts(space, ROBOT, minimise=minimise, connectivity=connectivity)
    found = costs.costs_from(space.to_world((5.5, 4.5)))
    np.testing.assert_allclose(found, by_scipy(space, (5, 4), connectivity, timed), rtol=1e-9)


def gallery() -> FreeSpace:
    """Return a hall of 12 m x 6 m with a long block in the middle that a shortest path would scrape along."""
    cells = np.zeros((60, 120), np.uint8)
    cells[20:24, 30:90] = 1
    return inflate(OccupancyMap(cells, 0.1), Footprint(0.5))


def test_the_fastest_path_keeps_away_from_the_wall_that_the_shortest_one_touches() -> None:
    space = gallery()
    start, goal = (2.0, 2.2), (10.0, 2.2)
    shortest = VisibilityCosts(space, ROBOT).path(start, goal)
    fastest = PixelCosts(space, ROBOT).path(start, goal)
    assert shortest is not None
    assert fastest is not None
    assert fastest.length_m > shortest.length_m
    assert fastest.time_s < 0.6 * shortest.time_s
    assert fastest.min_clearance_m > 0.6 > shortest.min_clearance_m


def test_in_the_open_the_way_is_one_straight_segment() -> None:
    path = PixelCosts(gallery(), ROBOT).path((1.0, 3.7), (11.0, 5.0))
    assert path is not None
    assert path.points_m.tolist() == [[1.0, 3.7], [11.0, 5.0]]


def test_a_point_in_a_wall_reaches_nothing() -> None:
    costs = PixelCosts(gallery(), ROBOT)
    assert costs.path((5.0, 2.2), (1.0, 4.0)) is None
    assert not np.isfinite(costs.costs_from((5.0, 2.2))).any()
    assert not costs.cost_table([(5.0, 2.2), (1.0, 4.0)]).reachable[0].any()


@pytest.mark.parametrize(
    ("method", "name"),
    [
        ("auto", "visibility graph"),
        ("visibility", "visibility graph"),
        ("dijkstra8", "8 headings, least length"),
        ("dijkstra16", "16 headings, least length"),
        ("fastest8", "8 headings, least time"),
        ("fastest16", "16 headings, least time"),
    ],
)
def test_every_table_says_how_it_was_found(method: str, name: str) -> None:
    table = exact_costs(gallery(), ROBOT, method=method).cost_table([(1.0, 1.0), (11.0, 5.0)])
    assert name in table.method
    assert table.reachable.all()


def test_many_corners_are_left_to_pixels_only_by_auto() -> None:
    cells = (np.random.default_rng(0).random((200, 200)) < 0.2).astype(np.uint8)
    space = inflate(OccupancyMap(cells, 1.0), Footprint(0))
    assert "16 headings" in exact_costs(space, ROBOT).cost_table([(1.5, 1.5)]).method


def test_options_out_of_range_are_refused() -> None:
    for wrong in ({"minimise": "energy"}, {"connectivity": 4}):
        with pytest.raises(UsageError):
            PixelCosts(gallery(), ROBOT, **wrong)
    with pytest.raises(UsageError, match="visibility"):
        exact_costs(gallery(), ROBOT, method="astar")
