from fractions import Fraction

import exact_sight
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from react_opt.geometry.sight import point_free_px, segment_free_px


def padded(rows: list[str]) -> np.ndarray:
    """Return a padded grid drawn from the top down, ``#`` blocked."""
    grid = np.array([[c == "#" for c in row] for row in rows[::-1]], dtype=np.uint8)
    return np.pad(grid, 1, constant_values=1)


BLOCK = padded(["....", ".##.", ".##.", "...."])  # a 2 x 2 block in a 4 x 4 room: it spans [1, 3] on both axes


@pytest.mark.parametrize(
    ("ends", "free", "why"),
    [
        ((0.5, 0.5, 3.5, 0.5), True, "below the block"),
        ((0.5, 0.5, 3.5, 3.5), False, "straight through the block"),
        ((0.0, 1.0, 4.0, 1.0), True, "along the block's lower side, touching it"),
        ((0.0, 2.0, 2.0, 0.0), True, "grazing the corner (1, 1)"),
        ((0.0, 2.1, 2.1, 0.0), False, "0.05 pixels inside the corner (1, 1)"),
        ((0.0, 2.0000001, 2.0, 0.0), True, "a ten-millionth of a pixel inside counts as touching"),
        ((1.0, 0.0, 1.0, 4.0), True, "along the block's left side"),
        ((0.0, 0.0, 4.0, 0.0), True, "along the rim of the map"),
        ((0.5, 0.5, 4.5, 0.5), False, "off the map"),
        ((2.0, 2.0, 2.0, 2.0), False, "standing inside the block"),
        ((1.0, 1.0, 1.0, 1.0), True, "standing on the block's corner"),
        ((1.0, 1.0, 1.0, 3.0), True, "from corner to corner along a side"),
        ((1.0, 1.0, 3.0, 3.0), False, "the block's own diagonal"),
    ],
)
def test_known_segments(ends: tuple[float, ...], free: bool, why: str) -> None:
    x0, y0, x1, y1 = ends
    assert segment_free_px(BLOCK, x0, y0, x1, y1) is free, why
    assert segment_free_px(BLOCK, x1, y1, x0, y0) is free, f"{why}, backwards"


def test_nothing_slips_between_two_pixels_that_touch_at_a_corner() -> None:
    pinch = padded([".#", "#."])  # free: lower right and upper left; they meet at (1, 1) alone
    assert not segment_free_px(pinch, 0.5, 1.5, 1.5, 0.5)
    assert not point_free_px(pinch, 1.0, 1.0)
    assert not segment_free_px(pinch, 0.5, 1.5, 1.0, 1.0)
    line = padded(["..##", "##.."])  # along y = 1 the free side changes at x = 2
    assert not segment_free_px(line, 0.0, 1.0, 4.0, 1.0)
    assert segment_free_px(line, 0.0, 1.0, 1.9, 1.0)


def test_between_two_blocked_pixels_there_is_no_way_along_the_line() -> None:
    wall = padded(["....", "####", "####", "...."])
    assert not segment_free_px(wall, 0.0, 2.0, 4.0, 2.0)


quarters = st.integers(0, 24).map(lambda n: Fraction(n, 4))


@settings(derandomize=True, deadline=None, max_examples=400)
@given(
    cells=st.lists(st.lists(st.booleans(), min_size=6, max_size=6), min_size=6, max_size=6),
    ends=st.tuples(quarters, quarters, quarters, quarters),
)
def test_agrees_with_rational_arithmetic(cells: list[list[bool]], ends: tuple[Fraction, ...]) -> None:
    blocked = np.array(cells)
    grid = np.pad(blocked.astype(np.uint8), 1, constant_values=1)
    x0, y0, x1, y1 = ends
    expected = exact_sight.segment_free(blocked, (x0, y0), (x1, y1))
    assert segment_free_px(grid, float(x0), float(y0), float(x1), float(y1)) == expected
    assert point_free_px(grid, float(x0), float(y0)) == exact_sight.point_free(blocked, x0, y0)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(seed=st.integers(0, 10_000), share=st.sampled_from((0.02, 0.1, 0.3)))
def test_long_segments_agree_with_rational_arithmetic(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    blocked = rng.random((30, 50)) < share
    grid = np.pad(blocked.astype(np.uint8), 1, constant_values=1)
    for _ in range(8):
        x0, x1 = (Fraction(int(n), 8) for n in rng.integers(0, 401, 2))
        y0, y1 = (Fraction(int(n), 8) for n in rng.integers(0, 241, 2))
        expected = exact_sight.segment_free(blocked, (x0, y0), (x1, y1))
        assert segment_free_px(grid, float(x0), float(y0), float(x1), float(y1)) == expected
