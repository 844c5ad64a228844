"""Which tiles can see which: whatever a ray shows is found, and walls hide."""

from __future__ import annotations

import numpy as np

from react_opt.geometry.raycast import ray_table, scan_px
from react_opt.limits.sightlines import memory, tiles_in_sight


def sight(opaque: np.ndarray, row: int, col: int, reach: float) -> set[int]:
    found = np.empty(5 * opaque.size, dtype=np.int64)
    return set(found[: tiles_in_sight(opaque, row, col, reach, memory(), found)].tolist())


def test_every_pixel_that_a_lidar_shows_is_found() -> None:
    rng = np.random.default_rng(5)
    for _ in range(30):
        opaque = (rng.random((15, 17)) < 0.2).astype(np.uint8)
        row, col = int(rng.integers(15)), int(rng.integers(17))
        opaque[row, col] = 0
        found = sight(opaque, row, col, 6.5)
        for _ in range(40):
            known = np.full(opaque.shape, 2, dtype=np.uint8)
            x, y, yaw = col + rng.random(), row + rng.random(), 7 * rng.random()
            fresh = np.empty(opaque.size, dtype=np.int64)
            scan_px(opaque, known, x, y, np.cos(yaw), np.sin(yaw), ray_table(360), 6.5, fresh)
            assert set(np.flatnonzero(known != 2).tolist()) <= found


def test_sight_is_mutual_and_ends_at_walls_and_at_the_range() -> None:
    opaque = np.zeros((9, 30), dtype=np.uint8)
    opaque[:, 4] = 1
    found = sight(opaque, 4, 1, 5.0)
    assert {4 * 30 + 4, 4 * 30 + 3} <= found  # the wall itself, and what stands before it
    assert not any(k % 30 > 4 for k in found)
    assert 4 * 30 + 10 in sight(opaque, 4, 5, 5.0)
    assert 4 * 30 + 11 not in sight(opaque, 4, 5, 5.0)  # 5 tiles of gap
    rng = np.random.default_rng(1)
    opaque = (rng.random((9, 9)) < 0.3).astype(np.uint8)
    free = np.flatnonzero(opaque == 0).tolist()
    seen = {k: sight(opaque, k // 9, k % 9, 20.0) for k in free}
    assert all((a in seen[b]) == (b in seen[a]) for a in free for b in free)
