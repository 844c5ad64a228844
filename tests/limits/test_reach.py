"""Certified lower bounds on driving time: never above what a real path takes, and close to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from react_opt.limits.reach import excess, reach_s, tile_reach_s


def shortest_over_tiles(step: np.ndarray, start: tuple[int, int]) -> np.ndarray:
    """Times from tile centre to tile centre over sides and corners: paths that can be driven, so never too short."""
    rows, cols = step.shape
    time = np.full(step.shape, np.inf)
    time[start] = 0.0
    for _ in range(step.size):
        before = time.copy()
        for r in range(rows):
            for c in range(cols):
                for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
                    i, j = r + dr, c + dc
                    if 0 <= i < rows and 0 <= j < cols and np.isfinite(step[i, j]) and np.isfinite(step[r, c]):
                        cost = np.hypot(dr, dc) * (step[r, c] + step[i, j]) / 2
                        time[i, j] = min(time[i, j], time[r, c] + cost)
        if np.array_equal(before, time):
            return time
    return time


@settings(derandomize=True, max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_never_longer_than_a_path_that_exists(seed: int) -> None:
    rng = np.random.default_rng(seed)
    step = rng.choice([0.1, 0.2, 0.5, np.inf], size=(7, 8), p=[0.4, 0.2, 0.1, 0.3])
    step[3, 3] = 0.1
    source = np.zeros(step.shape, dtype=bool)
    source[3, 3] = True
    reached = reach_s(step, source)
    assert excess(step, reached) <= 1 + 1e-9
    times = shortest_over_tiles(step, (3, 3))
    low = tile_reach_s(reached)
    assert np.all(low[np.isfinite(step)] <= times[np.isfinite(step)] + 1e-9)


def test_in_the_open_the_bound_is_the_distance_but_for_little() -> None:
    side, at = 121, 60
    step = np.full((side, side), 0.1)
    source = np.zeros(step.shape, dtype=bool)
    source[at, at] = True
    reached = reach_s(step, source)
    row, col = np.mgrid[0 : side + 1, 0 : side + 1]
    gap = np.hypot(np.maximum(np.maximum(at - row, row - at - 1), 0), np.maximum(np.maximum(at - col, col - at - 1), 0))
    assert np.all(reached <= 0.1 * gap + 1e-9)
    assert np.max(0.1 * gap - reached) < 0.12  # one tile and a bit, over 6 m


def test_a_wall_is_driven_around() -> None:
    """A wall of eight tiles between two neighbours: at least up along it and down again."""
    step = np.full((10, 5), 1.0)
    step[:8, 2] = np.inf
    source = np.zeros(step.shape, dtype=bool)
    source[0, 0] = True
    assert tile_reach_s(reach_s(step, source))[0, 4] > 13


def test_a_potential_that_climbs_too_fast_is_exposed() -> None:
    step = np.full((3, 3), 1.0)
    source = np.zeros(step.shape, dtype=bool)
    source[0, 0] = True
    reached = reach_s(step, source)
    reached[3, 3] += 1.0
    assert excess(step, reached) > 1.2


@pytest.mark.parametrize("blocked", [(0, 1), (1, 0)])
def test_what_nothing_leads_to_is_never_reached(blocked: tuple[int, int]) -> None:
    step = np.full((2, 2), 1.0)
    step[0, 1] = step[1, 0] = step[1, 1] = np.inf
    source = np.zeros(step.shape, dtype=bool)
    source[0, 0] = True
    assert np.isinf(reach_s(step, source)[2, 2])
    assert np.isfinite(reach_s(step, source)[blocked])
