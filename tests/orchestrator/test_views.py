"""Places to look from, against looking from every one of them along every line."""

from __future__ import annotations

import numpy as np
import pytest

from react_opt.geometry.occupancy import OCCUPIED
from react_opt.orchestrator.survey import COARSE
from react_opt.orchestrator.survey_kernels import OPEN, SOLID, count_solids
from react_opt.orchestrator.views import ENOUGH, NEAREST_BLOCKS, best_view, count_seen

REACH = 24.0


def looked(blocks: np.ndarray, place: tuple[int, int], targets: np.ndarray) -> int:  # type: ignore[type-arg]
    """Return how many targets are seen from a place, step by step along each line."""
    y0, x0 = (np.array(place) + 0.5) * COARSE
    seen = 0
    for y1, x1 in (targets + 0.5) * COARSE:
        pieces = int(np.hypot(y1 - y0, x1 - x0)) + 1
        line = [(int(y0 + (y1 - y0) * p / pieces), int(x0 + (x1 - x0) * p / pieces)) for p in range(1, pieces)]
        seen += np.hypot(y1 - y0, x1 - x0) <= REACH and all(blocks[at] != OCCUPIED for at in line)
    return seen


@pytest.mark.parametrize("seed", range(6))
def test_the_soonest_place_that_sees_enough_is_chosen(seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocks = np.where(rng.random((60, 60)) < 0.01 * seed, OCCUPIED, 0).astype(np.uint8)
    time_s = rng.uniform(0.0, 9.0, (30, 30)).round()  # some places are equally near
    stand = rng.random(time_s.shape) < 0.5
    targets = np.argwhere(rng.random(time_s.shape) < 0.1)
    offsets = rng.uniform(-6.0, 6.0, (20, 2))
    row, col = 14.3, 17.8
    places = [(int(row + dr), int(col + dc)) for dr, dc in offsets]
    around = np.argwhere(stand)
    around = around[np.abs(around - (14, 17)).max(axis=1) <= NEAREST_BLOCKS]
    nearest = around[np.argmin(((around - (14, 17)) ** 2).sum(axis=1))]
    places = list(dict.fromkeys([place for place in places if stand[place]] + [(int(nearest[0]), int(nearest[1]))]))
    seen = [looked(blocks, place, targets) for place in places]
    good = [n for n in range(len(places)) if seen[n] >= ENOUGH * max(seen)]
    best = min(good, key=lambda n: float(time_s[places[n]]))
    found = best_view(blocks, count_solids(blocks), time_s, stand, row, col, offsets, targets, COARSE, REACH)
    assert found == (*places[best], seen[best])


def test_where_nothing_is_seen_or_nobody_can_stand_there_is_no_view() -> None:
    blocks, time_s = np.zeros((20, 20), dtype=np.uint8), np.zeros((10, 10))
    targets, offsets = np.array([[8, 8]]), np.zeros((1, 2))
    view = (offsets, targets, COARSE, 4.0)
    assert best_view(blocks, count_solids(blocks), time_s, np.ones((10, 10), dtype=bool), 1.0, 1.0, *view) == (
        -1,
        -1,
        0,
    ), "too far away"
    assert best_view(blocks, count_solids(blocks), time_s, np.zeros((10, 10), dtype=bool), 8.0, 8.0, *view) == (
        -1,
        -1,
        0,
    )


def test_a_count_ends_where_it_cannot_be_enough_any_more() -> None:
    blocks = np.zeros((20, 20), dtype=np.uint8)
    blocks[8:10] = OCCUPIED
    targets = np.array([[7, 1], [7, 2], [1, 1], [1, 2], [1, 3]])
    assert count_seen(blocks, count_solids(blocks), 2, 2, targets, COARSE, 40.0, 0.0) == 3
    assert count_seen(blocks, count_solids(blocks), 2, 2, targets, COARSE, 40.0, 3.0) == 3
    assert count_seen(blocks, count_solids(blocks), 2, 2, targets, COARSE, 40.0, 4.0) < 4


def test_nothing_beyond_the_last_block_is_looked_at() -> None:
    """Five blocks a side are two coarse ones of four: the middle of the last one is not on the map."""
    around = np.full(50, SOLID, dtype=np.uint8)
    blocks = around[:25].reshape(5, 5)
    blocks[:] = OPEN
    counts = np.arange(72, dtype=np.int32) ** 2
    solids = counts[:36].reshape(6, 6)
    solids[:] = 0
    targets = np.array([[1, 1], [0, 1], [1, 0]])
    assert count_seen(blocks, solids, 0, 0, targets, 4, 20.0, 0.0) == 3
    assert count_seen(blocks, solids, 1, 1, targets, 4, 20.0, 0.0) == 3
