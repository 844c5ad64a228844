"""Path costs side by side: against exact shortest paths, which nothing may undercut."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import path_trial
from benchmarks.report import Results
from react_opt.geometry.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyMap


def test_a_coarser_pixel_is_free_only_where_all_of_it_was() -> None:
    cells = np.full((4, 5), FREE, dtype=np.uint8)
    cells[0, 0], cells[3, 2] = OCCUPIED, UNKNOWN
    coarse = path_trial.coarser(OccupancyMap(cells, 0.05, 1.0, 2.0), 0.1)
    assert coarse.resolution_m == 0.1
    assert (coarse.origin_x_m, coarse.origin_y_m) == (1.0, 2.0)
    # The odd last column is filled up with walls: nothing is known beyond the map.
    assert coarse.cells.tolist() == [[OCCUPIED, FREE, OCCUPIED], [FREE, UNKNOWN, OCCUPIED]]


@pytest.mark.parametrize("method", ["visibility", "dijkstra8"])
def test_ratios_are_to_exact_shortest_paths(method: str) -> None:
    found = path_trial.run(0.2, 6, method, {}, seed=1)
    assert found["pairs"] == 15
    assert (found["missing"], found["impossible"]) == (0, 0)
    assert found["length_worst"] >= found["length_mean"] >= 1.0 - 1e-9
    if method == "visibility":
        assert found["length_worst"] == pytest.approx(1.0)
    else:
        assert 1.0 < found["length_mean"] < 1.1


def test_the_same_seed_gives_the_same_paths() -> None:
    pytest.importorskip("ompl")
    one, same = (path_trial.run(0.2, 4, "PRMstar", {"samples": 100}, seed=2) for _ in range(2))
    assert one["length_mean"] == same["length_mean"]
    assert one["length_mean"] >= 1.0 - 1e-9


def test_impossible_paths_are_exposed() -> None:
    runs = ({"what": "paths", "impossible": 0}, {"what": "paths", "impossible": 2})
    assert Results((), (), runs).impossible_paths == [runs[1]]
