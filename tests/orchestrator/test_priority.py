"""What REACT postpones: the priority of a local target, one reason at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from react_opt.models.priorities import is_postponed
from react_opt.orchestrator.belief import LocalTarget
from react_opt.orchestrator.priority import priorities

TARGET = LocalTarget("k", "0,0", 5.0, 5.0, (4.0, 4.0), size_m2=3.0, opening_m2=10.0, frontier_m=1.5)


@pytest.mark.parametrize(
    "worse",
    [{"size_m2": 1.0}, {"opening_m2": 0.0}, {"frontier_m": 0.4}, {"stand_m": None}],
    ids=["smaller", "no unexplored neighbourhood", "seen through a slit", "not accessible"],
)
def test_of_two_targets_that_differ_in_one_thing_only_the_better_one_is_taken_now(worse: dict[str, object]) -> None:
    good, bad = priorities([TARGET, replace(TARGET, **worse)])  # type: ignore[arg-type]
    assert good > bad
    between = (good + bad) / 2
    assert is_postponed([good, bad], between).tolist() == [False, True]


def test_a_target_at_the_end_of_a_longer_way_waits() -> None:
    near, far, nowhere = priorities([TARGET] * 3, [2.0, 30.0, np.nan])
    assert near > far > nowhere == 0.0


def test_no_targets_have_no_priorities() -> None:
    assert priorities([]).shape == (0,)
