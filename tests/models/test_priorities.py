"""Priorities: they grow with both areas, saturate, and their weights are data."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from react_opt.errors import UsageError
from react_opt.models.priorities import PriorityWeights, is_postponed, target_gains

areas = st.floats(0, 1e4)


@given(areas, areas, areas)
@settings(derandomize=True, deadline=None, max_examples=60)
def test_a_gain_grows_with_either_area_and_stays_below_the_sum_of_the_weights(a: float, b: float, c: float) -> None:
    weights = PriorityWeights(size=2.0, opening=3.0, floor=0.5)
    low, high = sorted((a, b))
    assert target_gains([low], [c], weights) <= target_gains([high], [c], weights)
    assert target_gains([c], [low], weights) <= target_gains([c], [high], weights)
    assert 0.5 <= target_gains([a], [b], weights)[0] <= 5.5


def test_known_values() -> None:
    weights = PriorityWeights(size=2.0, opening=10.0, area_ref_m2=4.0, neighbourhood_ref_m2=40.0, floor=1.0)
    # At the reference areas each term has reached 1 - 1/e of its weight.
    assert target_gains([0.0, 4.0], [0.0, 40.0], weights) == pytest.approx([1.0, 1.0 + 12.0 * (1 - np.exp(-1))])


def test_a_target_below_the_threshold_is_postponed() -> None:
    assert is_postponed([0.1, 0.5, 0.9], 0.5).tolist() == [True, False, False]


@pytest.mark.parametrize("bad", [{"size": -1.0}, {"area_ref_m2": 0.0}, {"opening": float("nan")}])
def test_weights_that_make_no_sense_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(UsageError, match=next(iter(bad))):
        PriorityWeights(**bad)


def test_negative_areas_are_refused() -> None:
    with pytest.raises(UsageError, match="areas"):
        target_gains([-1.0], [0.0])
