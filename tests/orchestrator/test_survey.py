"""The survey of a belief's map: clearances and drive times against plain computations, frontiers and views by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from react_opt.geometry.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyMap
from react_opt.orchestrator.survey import COARSE, Survey
from react_opt.orchestrator.survey_drives import drive_times, ground_of, ways_out
from react_opt.orchestrator.survey_kernels import HIDDEN, OPEN, SOLID, count_solids, sight_codes
from react_opt.orchestrator.views import count_seen

from .drawn import PROFILE


def survey_of(cells: np.ndarray, survey: Survey | None = None, version: int = 0) -> Survey:  # type: ignore[type-arg]
    survey = survey or Survey([PROFILE])
    survey.update(OccupancyMap(cells, 0.1), version)
    return survey


@pytest.mark.parametrize("seed", range(5))
def test_drive_times_are_those_of_plain_dijkstra(seed: int) -> None:
    rng = np.random.default_rng(seed)
    passable, slowness = rng.random((12, 15)) < 0.7, rng.uniform(0.2, 1.0, (12, 15))
    passable[3, 4] = True
    rows, cols = passable.shape
    edges = []
    for r, c in np.argwhere(passable):
        for dr in (-1, 0, 1):
            for dc in (-1, 0, 1):
                y, x = r + dr, c + dc
                if (dr, dc) == (0, 0) or not (0 <= y < rows and 0 <= x < cols and passable[y, x]):
                    continue
                if dr and dc and not (passable[r, x] or passable[y, c]):
                    continue
                edges.append((r * cols + c, y * cols + x, np.hypot(dr, dc) * (slowness[r, c] + slowness[y, x]) / 2))
    i, j, w = np.array(edges).T
    graph = coo_array((w, (i.astype(int), j.astype(int))), shape=(rows * cols, rows * cols)).tocsr()
    expected = dijkstra(graph, indices=3 * cols + 4).reshape(rows, cols)
    np.testing.assert_allclose(drive_times(ground_of(passable, slowness), np.array([[3, 4]])), expected, rtol=1e-12)


def test_times_from_several_points_are_those_from_the_nearest() -> None:
    cells = np.full((60, 60), FREE, dtype=np.uint8)
    cells[28:32, 5:] = OCCUPIED
    survey, points = survey_of(cells), [(1.0, 1.0), (5.0, 5.0), (4.0, 1.5)]
    each = [survey.times_from(*point, optimistic=False) for point in points]
    np.testing.assert_array_equal(survey.times_from_nearest(points, optimistic=False), np.min(each, axis=0))
    assert np.isinf(survey.times_from_nearest([], optimistic=True)).all()


def test_updates_give_what_a_new_survey_of_the_last_map_gives() -> None:
    rng = np.random.default_rng(3)
    cells = np.full((60, 50), UNKNOWN, dtype=np.uint8)
    survey = survey_of(cells.copy())
    for version in range(1, 5):
        low_row, low_col = rng.integers(0, 40, 2)
        cells[low_row : low_row + 20, low_col : low_col + 20] = FREE
        cells[rng.integers(0, 60, 20), rng.integers(0, 50, 20)] = OCCUPIED
        survey_of(cells.copy(), survey, version)
    fresh = survey_of(cells)
    for name in ("blocks", "known", "may", "border", "hidden", "best", "slowness", "solids"):
        np.testing.assert_array_equal(getattr(survey, name), getattr(fresh, name), err_msg=name)


def test_single_unseen_pixels_between_rays_are_no_frontier() -> None:
    cells = np.full((40, 40), FREE, dtype=np.uint8)
    cells[10::7, 5:35:3] = UNKNOWN
    assert survey_of(cells).clusters(0.0) == []
    cells[20:30, 20:30] = UNKNOWN  # a square of 1 m: its border is 4 m of open blocks beside it
    (cluster,) = survey_of(cells).clusters(0.5)
    assert cluster.length_m == pytest.approx(4.0, abs=0.3)


def test_long_frontiers_are_cut() -> None:
    cells = np.full((80, 100), FREE, dtype=np.uint8)
    cells[40:] = UNKNOWN
    assert len(survey_of(cells).clusters(0.3)) == 1
    pieces = survey_of(cells).clusters(0.3, 4.0)
    assert len(pieces) > 2
    assert sum(piece.length_m for piece in pieces) == pytest.approx(10.0, abs=0.3)


def test_what_stands_behind_a_wall_is_not_seen() -> None:
    blocks = np.zeros((20, 20), dtype=np.uint8)
    blocks[:15, 10] = OCCUPIED  # a wall with an opening above
    targets = np.array([[2, 8], [9, 8]])  # coarse blocks: below, and level with the opening
    assert count_seen(blocks, count_solids(blocks), 2, 2, targets, COARSE, 40.0, 0.0) == 0
    assert count_seen(blocks, count_solids(blocks), 9, 2, targets, COARSE, 40.0, 0.0) == 1


def test_a_gap_narrower_than_the_robot_is_no_way() -> None:
    cells = np.full((60, 60), FREE, dtype=np.uint8)
    cells[30:32] = OCCUPIED
    cells[30:32, 20:23] = FREE  # 0.3 m; the robot is 0.42 m across
    assert not np.isfinite(survey_of(cells).times_from(3.0, 1.0, optimistic=True)[25, 10])
    cells[30:32, 20:27] = FREE
    assert np.isfinite(survey_of(cells).times_from(3.0, 1.0, optimistic=True)[25, 10])
    assert ndimage.label(survey_of(cells).may)[1] == 1


def test_the_way_out_leads_around_a_wall_and_a_near_place_is_its_own() -> None:
    """From (4, 1) the place (4, 5) lies behind a wall that is open at the lower end alone: one sets out downwards."""
    passable = np.ones((7, 7), dtype=bool)
    passable[1:, 3] = False
    cost = drive_times(ground_of(passable, np.ones(passable.shape)), np.array([[4, 1]]))
    places = np.array([[4, 5], [4, 2], [6, 3]])
    out = ways_out(cost, places, 2.0)
    assert out[0].tolist() == [2, 1] or out[0].tolist() == [2, 2]
    assert out[1].tolist() == [4, 2]
    assert out[2].tolist() == [6, 3], "there is no way there"


def test_a_robot_that_is_closed_in_starts_from_the_nearest_place_that_leads_on() -> None:
    """A cell of 2 m walled off in a hall of 20 m: the hall is most of what can be driven over."""
    cells = np.zeros((100, 200), dtype=np.uint8)
    cells[[0, -1]] = cells[:, [0, -1]] = OCCUPIED
    cells[:31, 30], cells[30, :31] = OCCUPIED, OCCUPIED
    times = survey_of(cells).times_from(1.0, 1.0, optimistic=True)
    assert np.isfinite(times[40, 50])


def test_blocks_together_are_solid_by_half_and_hidden_by_one() -> None:
    """Five columns in pairs: the last one is half off the map, where one solid block is not half of four."""
    blocks = np.full((2, 5), OPEN, dtype=np.uint8)
    blocks[0, 0] = blocks[1, 1] = SOLID
    blocks[0, 2], blocks[1, 3] = SOLID, HIDDEN
    blocks[1, 4] = SOLID
    assert sight_codes(blocks, 2).tolist() == [[SOLID, HIDDEN, OPEN]]
