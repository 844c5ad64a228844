import numpy as np
import pytest
from clearance import clearances
from hypothesis import given, settings
from hypothesis import strategies as st

from react_opt.errors import UsageError
from react_opt.geometry.inflation import Footprint, FreeSpace, inflate
from react_opt.geometry.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyMap


def room(rows: list[str], resolution_m: float = 1.0, **origin: float) -> OccupancyMap:
    """Return a map drawn from the top down: ``#`` occupied, ``?`` unknown."""
    cells = [[{"#": OCCUPIED, "?": UNKNOWN}.get(c, FREE) for c in row] for row in rows[::-1]]
    return OccupancyMap(np.array(cells, np.uint8), resolution_m, **origin)


def test_discs_of_a_jackal() -> None:
    assert Footprint.circumscribed(0.508, 0.43).radius_m == pytest.approx(0.33278, abs=1e-5)  # half the diagonal
    assert Footprint.inscribed(0.508, 0.43).radius_m == 0.215
    with pytest.raises(UsageError):
        Footprint(-0.1)


def test_a_disc_of_one_pixel_keeps_one_pixel_from_a_lone_obstacle() -> None:
    cells = np.zeros((7, 7), np.uint8)
    cells[3, 3] = OCCUPIED
    space = inflate(OccupancyMap(cells, 1.0), Footprint(1.0), unknown="free", refine=1)
    # the 8 pixels around touch it (distance 0); the next ring is one pixel away, its corners sqrt(2)
    assert int(space.blocked.sum()) == 9
    assert int(inflate(OccupancyMap(cells, 1.0), Footprint(1.001), unknown="free", refine=1).blocked.sum()) == 21
    # by ROS's rule centres count: the 4 beside it are 1 away and stay free, as do the diagonal ones
    ros = inflate(OccupancyMap(cells, 1.0), Footprint(1.0), unknown="free", rule="centres")
    assert int(ros.blocked.sum()) == 1


def test_the_world_outside_is_unknown_too() -> None:
    empty = OccupancyMap(np.zeros((5, 5), np.uint8), 1.0)
    assert int((inflate(empty, Footprint(1.0), refine=1).blocked == 0).sum()) == 9
    assert int(inflate(empty, Footprint(1.0), unknown="free").blocked.sum()) == 0
    assert int(inflate(empty, Footprint(0.0)).blocked.sum()) == 0


def test_unknown_space_is_a_wall_free_or_slow() -> None:
    map_ = room(["..?.."])
    assert inflate(map_, Footprint(0)).blocked.tolist() == [[0, 0, 1, 0, 0]]
    assert inflate(map_, Footprint(0), unknown="free").blocked.tolist() == [[0, 0, 0, 0, 0]]
    slow = inflate(map_, Footprint(0), unknown="costlier", unknown_speed_factor=0.25)
    assert slow.blocked.tolist() == [[0] * 5]
    assert slow.slow.tolist() == [[0, 0, 1, 0, 0]]
    assert slow.unknown_speed_factor == 0.25


def test_a_corridor_just_wide_enough_opens_when_pixels_are_fine_enough() -> None:
    corridor = room(["#####", ".....", "#####"])
    strict = inflate(corridor, Footprint(0.25), unknown="free", refine=1)
    assert int((strict.blocked == 0).sum()) == 0  # a whole pixel cannot keep 0.25 from both walls
    fine = inflate(corridor, Footprint(0.25), unknown="free")
    assert fine.refine == 4
    assert fine.segment_free((0.0, 1.5), (5.0, 1.5))
    assert not inflate(corridor, Footprint(0.51), unknown="free").points_free([(2.5, 1.5)])[0]


def brute_space(space: FreeSpace, step: int = 5) -> np.ndarray:
    """Return the smallest true clearance (m) over a lattice of points of every pixel of an inflated map."""
    solid = space.source.cells != FREE if space.unknown == "blocked" else space.source.cells == OCCUPIED
    rows, cols = space.blocked.shape
    ticks = np.linspace(0, 1, step)
    lowest = np.full((rows, cols), np.inf)
    for u in ticks:
        for v in ticks:
            c, r = np.meshgrid(np.arange(cols) + u, np.arange(rows) + v)
            points = np.stack((c.ravel(), r.ravel()), axis=1) / space.refine
            found = clearances(solid, points, space.unknown == "blocked").reshape(rows, cols)
            lowest = np.minimum(lowest, found * space.source.resolution_m)
    return lowest


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    radius=st.sampled_from((0.0, 0.3, 0.5, 1.0, 1.3, 2.0)),
    unknown=st.sampled_from(("blocked", "free", "costlier")),
    refine=st.integers(1, 3),
)
def test_free_pixels_are_exactly_those_that_keep_the_radius(
    seed: int, radius: float, unknown: str, refine: int
) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.choice(3, size=(8, 9), p=(0.85, 0.1, 0.05)).astype(np.uint8)
    space = inflate(OccupancyMap(cells, 0.5), Footprint(radius), unknown=unknown, refine=refine)
    solid = cells != FREE if unknown == "blocked" else cells == OCCUPIED
    inside = np.repeat(np.repeat(solid, refine, 0), refine, 1)
    # corners are among the lattice points, and the clearance of a pixel is smallest at one of them
    np.testing.assert_array_equal(space.blocked != 0, (brute_space(space) < radius - 1e-9) | inside)


@settings(derandomize=True, deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_clearance_is_exact_at_corners_and_close_between(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells = (rng.random((10, 12)) < 0.1).astype(np.uint8)
    map_ = OccupancyMap(cells, 0.1, 3.0, -2.0, 0.7)
    space = inflate(map_, Footprint(0.1), refine=2)
    corners = np.stack(np.meshgrid(np.arange(25), np.arange(21)), axis=-1).reshape(-1, 2)
    exact = clearances(cells != 0, corners / 2, True) * 0.1
    np.testing.assert_allclose(space.clearance_at(space.to_world(corners)), exact, atol=1e-6)
    between = rng.random((50, 2)) * (24, 20)
    found = space.clearance_at(space.to_world(between))
    # between corners: no more than half a pixel's diagonal off, distances being 1-Lipschitz
    np.testing.assert_allclose(found, clearances(cells != 0, between / 2, True) * 0.1, atol=0.05 * 0.71)
    assert space.clearance_at([(100.0, 100.0)])[0] == 0.0


def test_without_any_obstacle_clearance_is_finite() -> None:
    space = inflate(OccupancyMap(np.zeros((3, 4), np.uint8), 0.5), Footprint(0.1), unknown="free")
    assert np.isfinite(space.clearance_at([(1.0, 0.7)])).all()


def test_why_a_point_is_out_of_reach_and_where_the_nearest_is() -> None:
    map_ = room([".......", "...#..?", "......."], origin_x_m=10.0)
    space = inflate(map_, Footprint(0.6), unknown="blocked", refine=1)
    assert "off the map, which lies between (10, 0) and (17, 3) m" in str(space.why_not((0.0, 0.0)))
    assert "inside an obstacle" in str(space.why_not((13.5, 1.5)))
    assert "unknown" in str(space.why_not((16.5, 1.5)))
    assert "0.500 m from an obstacle, less than the footprint's 0.600 m" in str(space.why_not((10.5, 0.5)))
    np.testing.assert_allclose(space.nearest_free_point((10.5, 0.5)), (11.5, 1.5))  # a whole metre from all walls
    assert inflate(map_, Footprint(1.6)).nearest_free_point((10.5, 0.5)) is None  # the room is 3 m wide
    wide = inflate(map_, Footprint(0.2), unknown="free", refine=1)
    assert wide.why_not((10.5, 0.5)) is None
    np.testing.assert_allclose(wide.nearest_free_point((10.5, 0.5)), (10.5, 0.5))
    np.testing.assert_allclose(wide.nearest_free_point((0.0, 0.4)), (10.5, 0.5))


def test_regions_part_at_walls_and_at_pinched_corners() -> None:
    space = inflate(room(["..#..", "..#..", ".#..."]), Footprint(0))
    left, right, wall, pinch = space.regions_at([(0.5, 0.5), (4.5, 0.5), (2.5, 1.5), (2.0, 1.0)])
    assert left > 0
    assert right > 0
    assert left != right
    assert wall == 0
    assert pinch == 0
    assert space.regions_at([(1.0, 0.2)])[0] == left  # on the rim of the wall
    assert space.nearest_free_point((0.5, 0.5), region=int(right)) is not None
    assert space.regions_at(space.nearest_free_point((0.5, 0.5), region=int(right)))[0] == right


def test_paths_and_segments_are_tested_in_the_world_frame() -> None:
    map_ = room(["....", ".#..", "...."], origin_x_m=5.0, origin_y_m=1.0, origin_yaw_rad=np.pi / 2)
    space = inflate(map_, Footprint(0))
    corners = space.to_world([(0.5, 0.5), (3.5, 0.5), (3.5, 2.5), (0.5, 1.5)])
    assert space.segment_free(corners[0], corners[1])
    assert space.path_free(corners[:3])
    assert not space.path_free(corners[1:])
    assert not space.path_free(np.empty((0, 2)))
    assert space.path_free(corners[:1])


def test_options_out_of_range_are_refused() -> None:
    map_ = room(["..."])
    for wrong in (
        {"unknown": "maybe"},
        {"unknown_speed_factor": 0.0},
        {"refine": 0},
        {"refine": 9},
        {"rule": "loose"},
    ):
        with pytest.raises(UsageError):
            inflate(map_, Footprint(0), **wrong)
