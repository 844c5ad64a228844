"""The assignment as arrays and as a program: values in words, what bars a pair, and the rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from react_opt import jsonio
from react_opt.models.assignment import build, is_feasible, objective_of, program, robot_of_targets

DATA: dict[str, Any] = {
    "kind": "assignment",
    "name": "two robots",
    "robots": [
        {"id": "a", "battery_j": 100.0, "reserve_j": 50.0, "capacity": 2},
        {"id": "b", "battery_j": 200.0, "zone": ["k0"]},
        {"id": "flat", "battery_j": 0.0},
    ],
    "targets": [{"id": "k0", "gain": 10.0}, {"id": "k1", "gain": 10.0}, {"id": "k2", "gain": 1.0}],
    "costs": [
        {"robot": "a", "target": "k0", "time_s": 4.0, "energy_j": 20.0},
        {"robot": "a", "target": "k1", "time_s": 4.0, "energy_j": 60.0},
        {"robot": "a", "target": "k2", "time_s": 8.0, "energy_j": 10.0},
        {"robot": "b", "target": "k0", "time_s": 6.0, "energy_j": 20.0},
        {"robot": "b", "target": "k1", "time_s": 0.0, "energy_j": 0.0},
        {"robot": "flat", "target": "k0", "time_s": 0.0, "energy_j": 0.0},
    ],
    "conflicts": [["k0", "k2"], ["k2", "k0"]],
    "weights": {"alpha": 2.0, "beta": 5.0, "time_ref_s": 4.0},
}


def test_values_are_gain_less_time_and_energy_and_barred_pairs_are_out() -> None:
    model = build(jsonio.parse(DATA))
    out = -np.inf
    # a to k0: 10 - 2 * 4/4 - 5 * 20/100 = 7; a to k1 needs 60 J of 50; a to k2: 1 - 4 - 0.5 = -3.5
    # b to k0: 10 - 3 - 0.5 = 6.5; b to k1 is outside its zone; the third robot has an empty battery
    assert model.arrays.value.tolist() == [[7.0, out, -3.5], [6.5, out, out], [out, out, out]]
    assert model.arrays.conflicts.tolist() == [[0, 2]]
    assert not model.arrays.plain


def test_no_weight_on_time_still_leaves_unreachable_pairs_out() -> None:
    data = {**DATA, "weights": {"alpha": 0.0, "beta": 0.0, "time_ref_s": 1.0}}
    value = build(jsonio.parse(data)).arrays.value
    assert value[0].tolist() == [10.0, -np.inf, 1.0]
    assert value[1].tolist() == [10.0, -np.inf, -np.inf]


def test_the_program_holds_the_pairs_that_gain_and_reads_back() -> None:
    arrays = build(jsonio.parse(DATA)).arrays
    model = program(arrays)
    assert model.columns["x"].keys.tolist() == [[0, 0], [1, 0]]
    assert {name: block.size for name, block in model.rows.items()} == {
        "target": 3, "capacity": 3, "energy": 3, "conflict": 1,
    }  # fmt: skip
    assert model.violation(np.array([1.0, 0.0])) == 0
    assert model.violation(np.array([1.0, 1.0])) == 1  # two robots on one target
    robot_of = robot_of_targets(model, np.array([0.0, 1.0]), 3)
    assert robot_of.tolist() == [1, -1, -1]
    assert objective_of(arrays, robot_of) == pytest.approx(model.objective(np.array([0.0, 1.0])))


@pytest.mark.parametrize(
    ("robot_of", "good"),
    [
        ([0, -1, -1], True),
        ([-1, -1, -1], True),
        ([0, -1, 0], False),  # in conflict
        ([-1, 0, -1], False),  # beyond the energy
        ([-1, 1, -1], False),  # outside the zone
    ],
)
def test_feasibility(robot_of: list[int], good: bool) -> None:
    assert is_feasible(build(jsonio.parse(DATA)).arrays, np.array(robot_of)) is good


def test_energies_of_a_robot_add_up() -> None:
    data = {**DATA, "conflicts": [], "costs": [dict(row, energy_j=26.0) for row in DATA["costs"]]}
    arrays = build(jsonio.parse(data)).arrays
    assert is_feasible(arrays, np.array([0, -1, -1]))
    assert not is_feasible(arrays, np.array([0, 0, -1]))  # 52 J of 50
