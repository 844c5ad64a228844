"""Fields of drives: against plain Dijkstra, and the same whatever was asked before."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from react_opt.orchestrator.belief_paths import Field, Ground

SHAPE = (30, 40)
SIDE_M = 0.1
STARTS = (5 * 40 + 6, 22 * 40 + 31)


def drawn(seed: int) -> NDArray[np.float32]:
    """Return random slowness, some of it impassable; the starts are passable."""
    rng = np.random.default_rng(seed)
    slow = np.where(rng.random(SHAPE) < 0.25, 0.0, rng.choice([1.0, 1.0, 1.5, 3.0], SHAPE)).astype(np.float32)
    slow.ravel()[list(STARTS)] = 1.0
    return slow


def field_of(slow: NDArray[np.float32], *starts: int) -> Field:
    return Field(Ground(slow), starts, SIDE_M, 1.0)


@pytest.mark.parametrize("seed", range(4))
def test_times_are_those_of_plain_dijkstra_from_the_nearest_start(seed: int) -> None:
    slow = drawn(seed)
    edges = []
    for r, c in np.argwhere(slow > 0):
        for y, x in itertools.product(range(max(0, r - 1), min(30, r + 2)), range(max(0, c - 1), min(40, c + 2))):
            if slow[y, x] > 0 and (y, x) != (r, c) and slow[r, x] > 0 and slow[y, c] > 0:
                edges.append((r * 40 + c, y * 40 + x, np.hypot(y - r, x - c) * SIDE_M * (slow[r, c] + slow[y, x]) / 2))
    i, j, w = np.array(edges).T
    graph = coo_array((w, (i.astype(int), j.astype(int))), shape=(slow.size, slow.size)).tocsr()
    expected = dijkstra(graph, indices=list(STARTS)).min(axis=0)
    np.testing.assert_allclose(field_of(slow, *STARTS).all_times_s(), expected, rtol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_what_a_field_says_does_not_depend_on_what_it_was_asked_before(seed: int) -> None:
    slow = drawn(seed)
    whole, pieces = field_of(slow, STARTS[0]), field_of(slow, STARTS[0])
    times = whole.all_times_s()
    blocks = np.random.default_rng(seed).permutation(slow.size)
    for part in np.array_split(blocks, 30):
        np.testing.assert_array_equal(pieces.times_s(part), times[part])
        np.testing.assert_array_equal(pieces.lengths_m(part), whole.lengths_m(part))
        np.testing.assert_array_equal(pieces.way(int(part[0])), whole.way(int(part[0])))


def test_lengths_are_those_of_the_ways() -> None:
    slow = np.ones(SHAPE, dtype=np.float32)
    slow[10, :35] = 0
    field = field_of(slow, 0)
    around_m = 0.1 * (54 + 18 * np.sqrt(2))  # 9 blocks aslant on either side of the wall, and no corner cut at its end
    assert field.lengths_m([39, 20 * 40]).tolist() == pytest.approx([3.9, around_m])
    assert field.way(39).tolist() == [0, 39]
    assert field.times_s([39]).tolist() == pytest.approx([3.9])


def test_the_first_of_several_starts_counts() -> None:
    slow = drawn(0)
    each = [field_of(slow, start).all_times_s() for start in STARTS]
    np.testing.assert_array_equal(field_of(slow, *STARTS).all_times_s(), np.minimum(*each))


def test_a_robot_that_stands_where_it_may_not_gets_out_and_nowhere_else_is_that_possible() -> None:
    slow = np.ones(SHAPE, dtype=np.float32)
    slow[:, 3:6] = 0
    field = field_of(slow, 20 * 40 + 5)
    assert np.isfinite(field.times_s([20 * 40 + 6]))
    assert np.isinf(field.times_s([20 * 40 + 1]))
    assert field.way(20 * 40 + 1).size == 0
