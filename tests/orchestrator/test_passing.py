"""What is seen of regions on the way to others: through doors, not through walls."""

from __future__ import annotations

import numpy as np
import pytest

from react_opt.orchestrator.passing import in_passing, look, seen_on_ways
from react_opt.orchestrator.regions import Regions
from react_opt.orchestrator.survey_kernels import HIDDEN, OPEN, SOLID
from tests.orchestrator.drawn import UNKNOWN, DrawnBelief, drawn, robot_at


def corridor() -> tuple[np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    """Return a corridor of 5 x 40 blocks along the bottom, hidden rooms above it, and which room each block is of.

    Room 0 has a wide door to the corridor, room 1 none; what is hidden at the end of the corridor is room 2.
    """
    ground = np.full((17, 44), OPEN, dtype=np.uint8)
    ground[5] = SOLID
    ground[5, 8:14] = OPEN
    ground[6:, :] = HIDDEN
    ground[6:, 20] = SOLID
    ground[:5, 40:] = HIDDEN
    owner = np.full(ground.shape, -1, dtype=np.int64)
    owner[6:, :20], owner[6:, 21:], owner[:5, 40:] = 0, 1, 2
    return ground, owner


def test_a_look_in_the_open_adds_up_the_disc_that_it_shows() -> None:
    ground, out = np.full((61, 61), HIDDEN, dtype=np.uint8), np.empty(1)
    look(ground, np.zeros((61, 61), dtype=np.int64), 30, 30, 20.0, 1.0, out)
    assert out[0] == pytest.approx(np.pi * 20.0**2, rel=0.02)
    clear = out[0]
    look(ground, np.zeros((61, 61), dtype=np.int64), 30, 30, 20.0, 0.9, out)
    assert out[0] < 0.6 * clear, "what lies deep in hidden space counts less"


def test_a_room_is_seen_through_its_door_in_passing_and_a_closed_one_is_not() -> None:
    ground, owner = corridor()
    views = np.array([[4, 10], [3, 30], [2, 38]])
    field = np.where(ground == OPEN, np.abs(np.arange(44) + 0.0)[None, :] * 0.2, np.inf)  # from the left end
    whole = np.zeros(3)
    shares = seen_on_ways(ground, owner, field[None], views, whole, 30.0, 0.97)
    assert shares.shape == (1, 3, 3)
    assert np.all(np.diagonal(shares[0]) == 1.0)
    assert shares[0, 2, 0] > 0.7, "the way to the end leads past the door"
    assert shares[0, 2, 1] == 0.0
    assert shares[0, 0, 2] < 0.5, "the end is far from the door"


def test_each_region_of_a_map_is_seen_on_the_way_to_itself() -> None:
    cells = drawn("""
        ####################
        #        #         #
        #        #         #
        #        #         #
        #                  #
        #        #         #
        ####################
    """)
    cells[20:, 50:] = UNKNOWN
    belief = DrawnBelief(cells, (robot_at("r1", 6.0, 1.0),))
    survey = belief.survey()
    field = survey.times_from(6.0, 1.0, optimistic=True)
    regions = Regions(4.0)
    found = regions.find(survey, belief.areas, field)
    assert found
    (shares,) = in_passing(survey, regions, found, [field[None]])
    assert shares.shape == (1, len(found), len(found))
    assert np.all(np.diagonal(shares[0]) == 1.0)
    assert shares.min() >= 0.0
    assert shares.max() == 1.0
