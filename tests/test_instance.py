"""Every rule of the instance files broken once: one fault, at its place, saying what was expected."""

from __future__ import annotations

from typing import Any

import pytest
from documents import DELETE, KINDS, PROFILE, Data, document, put

from react_opt.errors import Fault, InputError
from react_opt.instance import Document, OrosInstance
from react_opt.jsonio import parse, sha256

NAN, INF = float("nan"), float("inf")


def faults(data: Any) -> list[Fault]:
    """Return the faults of a document, empty where there are none."""
    try:
        parse(data)
    except InputError as error:
        return list(error.faults)
    return []


# kind, where a value is put, the value, where the fault must be (None: there), and words of its message
BROKEN: list[tuple[str, str, Any, str | None, str]] = [
    # the document as a whole
    ("oros", "kind", "orus", None, "expected one of oros, assignment"),
    ("oros", "kind", DELETE, None, "expected one of oros"),
    ("oros", "kind", ["oros"], None, "expected one of oros"),
    ("oros", "schema_version", 2, None, "expected 1, found 2"),
    ("oros", "name", DELETE, None, "required, but missing"),
    ("oros", "name", 7, None, "expected a string, found 7"),
    ("oros", "weather", "fair", None, "unknown field"),
    ("oros", "robot", [], None, "did you mean 'robots'"),
    # numbers so large or small that sums, products or quotients of a whole instance would overflow
    ("oros", "cells[0].weight", 1e308, None, "expected a number <= 1e+30, found 1e+308"),
    ("oros", "robots[0].capacity_j", 1.7e308, None, "expected a number <= 1e+30"),
    ("oros", "robots[0].idle_w", 1e200, None, "expected a number <= 1e+30"),
    ("oros", "step_s", 1e308, None, "expected a number <= 1e+30"),
    ("oros", "cells[0].x_m", -1e308, None, "expected a number >= -1e+30"),
    ("assignment", "weights.time_ref_s", 1e-300, None, "expected a number > 1e-30"),
    # whole numbers
    ("oros", "horizon_steps", 0, None, "expected a number >= 1, found 0"),
    ("oros", "horizon_steps", -3, None, "expected a number >= 1"),
    ("oros", "horizon_steps", 10**9, None, "expected a number <= 100000, found 1000000000"),
    ("oros", "horizon_steps", 100_001, None, "expected a number <= 100000"),
    ("oros", "horizon_steps", 6.0, None, "expected a whole number, found 6.0"),
    ("oros", "horizon_steps", "6", None, "expected a whole number"),
    ("oros", "horizon_steps", True, None, "expected a whole number, found true"),
    ("oros", "horizon_steps", None, None, "expected a whole number, found null"),
    ("oros", "horizon_steps", DELETE, None, "required, but missing"),
    ("oros", "travel[0].steps", 0, None, "expected a number >= 1"),
    ("oros", "travel[0].steps", 10**30, None, "expected a number <= 9223372036854775807"),
    ("oros", "cells[0].deadline_step", -1, None, "expected a number >= 0"),
    ("oros", "robots[1].start_step", -1, None, "expected a number >= 0"),
    ("oros", "robots[1].start_step", 7, None, "expected at most horizon_steps = 6, found 7"),
    ("oros", "chargers[0].slots", -1, None, "expected a number >= 0"),
    ("oros", "limits.robots_per_cell", -1, None, "expected a number >= 0"),
    ("oros", "limits.sensing_robots_per_step", 0.5, None, "expected a whole number"),
    # numbers: finite, not negative, numbers at all
    ("oros", "step_s", 0.0, None, "expected a number > 0"),
    ("oros", "step_s", -10.0, None, "expected a number > 0, found -10.0"),
    ("oros", "step_s", NAN, None, "expected a finite number, found NaN"),
    ("oros", "step_s", INF, None, "expected a finite number, found Infinity"),
    ("oros", "step_s", "10", None, 'expected a number, found "10"'),
    ("oros", "step_s", True, None, "expected a number, found true"),
    ("oros", "cells[1].x_m", NAN, None, "expected a finite number"),
    ("oros", "cells[1].weight", -1.0, None, "expected a number >= 0"),
    ("oros", "travel[2].energy_j", -0.1, None, "expected a number >= 0, found -0.1"),
    ("oros", "travel[2].speed_m_s", -1.0, None, "expected a number >= 0"),
    ("oros", "robots[0].idle_w", -1.0, None, "expected a number >= 0"),
    ("oros", "robots[0].sensing_w", INF, None, "expected a finite number"),
    ("oros", "chargers[0].power_w", -1.0, None, "expected a number >= 0"),
    ("oros", "objective.sigma", -1.0, None, "expected a number >= 0"),
    ("oros", "objective.sigma", 10**400, None, "expected a"),
    # flags, lists, groups
    ("oros", "cells[1].explored", 1, None, "expected true or false, found 1"),
    ("oros", "limits.forbid_swaps", "yes", None, "expected true or false"),
    ("oros", "cells", {}, None, "expected a list, found an object"),
    ("oros", "robots", "r1", None, "expected a list"),
    ("oros", "limits", [], None, "expected an object, found a list"),
    ("oros", "cells[0]", "a", None, 'expected an object, found "a"'),
    ("oros", "robots", DELETE, None, "required, but missing"),
    ("oros", "cells[0].colour", "red", None, "unknown field"),
    # ids and references
    ("oros", "cells[0].id", "", None, "expected a non-empty string"),
    ("oros", "cells[0].id", 3, None, "expected a string, found 3"),
    (
        "oros",
        "cells[4]",
        {"id": "a", "x_m": 0.0, "y_m": 0.0},
        "cells[4].id",
        "expected unique id, 'a' is already at cells[0]",
    ),
    ("oros", "robots[1].id", "r1", None, "expected unique id, 'r1' is already at robots[0]"),
    ("oros", "robots[1].start", "z", None, "expected the id of a cell, found 'z'"),
    ("oros", "robots[1].return_to", "z", None, "expected the id of a cell"),
    ("oros", "travel[3].from", "z", None, "expected the id of a cell"),
    ("oros", "travel[3].to", "z", None, "expected the id of a cell"),
    ("oros", "travel[3].to", "c", None, "expected a cell other than from = 'c'"),
    ("oros", "chargers[0].cell", "z", None, "expected the id of a cell"),
    ("oros", "chargers[1]", {"cell": "b", "power_w": 1.0}, "chargers[1].cell", "'b' is already at chargers[0]"),
    # batteries
    ("oros", "robots[0].reserve_j", 400.5, None, "expected reserve_j <= battery_j = 400, found 400.5"),
    ("oros", "robots[0].battery_j", 501.0, None, "expected battery_j <= capacity_j = 500, found 501"),
    # assignment
    ("assignment", "robots[0].reserve_j", 101.0, None, "expected reserve_j <= battery_j"),
    ("assignment", "robots[2]", {"id": "r1", "battery_j": 1.0}, "robots[2].id", "expected unique id"),
    ("assignment", "robots[0].capacity", -1, None, "expected a number >= 0"),
    ("assignment", "robots[0].zone[1]", "t9", None, "expected the id of a target"),
    ("assignment", "targets[2]", {"id": "t1", "gain": 1.0}, "targets[2].id", "expected unique id"),
    ("assignment", "targets[0].gain", -1.0, None, "expected a number >= 0"),
    ("assignment", "costs[0].robot", "r9", None, "expected the id of a robot"),
    ("assignment", "costs[0].target", "t9", None, "expected the id of a target"),
    ("assignment", "costs[0].time_s", -1.0, None, "expected a number >= 0"),
    (
        "assignment",
        "costs[1]",
        {"robot": "r1", "target": "t1", "time_s": 1.0, "energy_j": 1.0},
        None,
        "already at costs[0]",
    ),
    ("assignment", "conflicts[0][1]", "t9", None, "expected the id of a target"),
    ("assignment", "conflicts[0][1]", "t1", "conflicts[0]", "expected two different targets"),
    ("assignment", "conflicts[0]", ["t1"], "conflicts[0][1]", "required, but missing"),
    ("assignment", "weights.alpha", -1.0, None, "expected a number >= 0"),
    ("assignment", "weights.time_ref_s", 0.0, None, "expected a number > 1e-30"),
    # inspection
    ("inspection", "time_left_s", -1.0, None, "expected a number >= 0"),
    ("inspection", "robots[0].reserve_j", 101.0, None, "expected reserve_j <= battery_j"),
    ("inspection", "targets[0].service_s", -1.0, None, "expected a number >= 0"),
    ("inspection", "targets[1]", {"id": "t1"}, "targets[1].id", "expected unique id"),
    ("inspection", "travel[0].time_s", NAN, None, "expected a finite number"),
    ("inspection", "travel[2].robot", "r9", None, "expected the id of a robot"),
    (
        "inspection",
        "travel[3]",
        {"from": "dock", "to": "t1", "time_s": 1.0, "energy_j": 1.0},
        None,
        "already at travel[0]",
    ),
    ("inspection", "minimise", "money", None, "expected 'time' or 'energy'"),
    # fleet
    ("fleet", "profiles", {}, None, "expected at least one"),
    ("fleet", "robots", [], None, "expected at least one"),
    ("fleet", "robots[0].profile", "husky", None, "expected the id of a profile"),
    (
        "fleet",
        "robots[1]",
        {"id": "r1", "profile": "jackal", "x_m": 0.0, "y_m": 0.0},
        "robots[1].id",
        "expected unique id",
    ),
    ("fleet", "profiles.jackal.length_m", 0.0, None, "expected a number > 0"),
    ("fleet", "profiles.jackal.lidar_rays", 0, None, "expected a number >= 1"),
    ("fleet", "profiles.jackal.battery_j", 9500.0, None, "expected battery_j <= capacity_j"),
    ("fleet", "profiles.jackal.reserve_j", 8500.0, None, "expected reserve_j <= battery_j"),
    ("fleet", "profiles.jackal.speed_min_m_s", 1.0, None, "expected at most speed_max_m_s"),
    ("fleet", "profiles.jackal.wheels", 4, None, "unknown field"),
    ("fleet", "chargers[0].slots", -1, None, "expected a number >= 0"),
    # mission
    ("mission", "map", "", None, "expected a non-empty string"),
    ("mission", "delta", 1.1, None, "expected a number <= 1"),
    ("mission", "delta", -0.1, None, "expected a number >= 0"),
    ("mission", "window_steps", 0, None, "expected a number >= 1"),
    ("mission", "seed", -1, None, "expected a number >= 0"),
    ("mission", "robots[0].profile", "husky", None, "expected the id of a profile"),
    ("mission", "noise.speed", -0.1, None, "expected a number >= 0"),
    ("mission", "link.rate_bit_s", 0.0, None, "expected a number > 0"),
    ("mission", "always_on", "no", None, "expected true or false"),
]


@pytest.mark.parametrize("kind", KINDS)
def test_the_good_documents_are_good(kind: str) -> None:
    assert faults(document(kind)) == []


@pytest.mark.parametrize(
    ("kind", "place", "value", "expected", "words"),
    [pytest.param(*row, id=f"{row[0]}-{row[1]}-{number}") for number, row in enumerate(BROKEN)],
)
def test_a_broken_rule_is_one_fault_at_its_place(
    kind: str, place: str, value: Any, expected: str | None, words: str
) -> None:
    found = faults(put(document(kind), place, value))
    assert [fault.place for fault in found] == [place if expected is None else expected], found
    assert words in found[0].message
    assert "\n" not in str(found[0])
    assert len(str(found[0])) < 200


def test_all_faults_of_a_file_are_told_at_once() -> None:
    """Faults of the structure and of the references, in one go."""
    data = document("oros")
    wrong = {
        "horizon_steps": 10**9,
        "step_s": NAN,
        "cells[3].id": "c",
        "cells[2].weight": -1.0,
        "travel[0].from": "nowhere",
        "travel[1].energy_j": "much",
        "robots[0].battery_j": 1e6,
        "robots[1].start": "nowhere",
        "robots[1].hat": "red",
        "chargers[0].cell": "nowhere",
        "limits.robots_per_cell": -1,
    }
    for place, value in wrong.items():
        put(data, place, value)
    found = {fault.place for fault in faults(data)}
    assert set(wrong) <= found
    assert found - set(wrong) == {"travel[4].to", "travel[5].from"}  # there is no d any more


def test_the_defaults_of_the_format() -> None:
    cell = {"id": "a", "x_m": 0.0, "y_m": 0.0}
    robot = {"id": "r", "start": "a", "battery_j": 1.0, "capacity_j": 1.0, "idle_w": 0.0, "sensing_w": 0.0}
    least = {"kind": "oros", "name": "least", "horizon_steps": 1, "step_s": 1.0}
    instance = parse(least | {"cells": [cell], "travel": [], "robots": [robot]})
    assert isinstance(instance, OrosInstance)
    assert instance.schema_version == 1
    assert instance.chargers == ()
    assert (instance.cells[0].weight, instance.cells[0].deadline_step, instance.cells[0].explored) == (1.0, None, False)
    assert (instance.robots[0].start_step, instance.robots[0].reserve_j, instance.robots[0].return_to) == (0, 0.0, None)
    assert (instance.limits.robots_per_cell, instance.limits.forbid_swaps) == (None, False)
    assert instance.limits.sensing_robots_per_step is None
    assert instance.objective.sigma is None


def test_whole_numbers_are_good_real_numbers() -> None:
    """JSON writers drop the ``.0``: 10 is as good a number of seconds as 10.0, also for the SHA-256."""
    data = put(document("oros"), "step_s", 10)
    assert sha256(parse(data)) == sha256(parse(document("oros")))


@pytest.mark.parametrize(
    ("weights", "capacities", "sigma"),
    [([1.0], [9.0], 0.1), ([2.0, 0.5, 0.0], [3.0, 6.0], 0.05), ([0.0], [1.0], 0.5), ([], [], 1.0)],
)
def test_sigma_defaults_to_the_smallest_positive_weight_over_one_plus_all_capacities(
    weights: list[float], capacities: list[float], sigma: float
) -> None:
    cells = [{"id": f"c{i}", "x_m": 0.0, "y_m": 0.0, "weight": w} for i, w in enumerate(weights)]
    robots = [
        {"id": f"r{i}", "start": "c0", "battery_j": 0.0, "capacity_j": c, "idle_w": 0.0, "sensing_w": 0.0}
        for i, c in enumerate(capacities)
    ]
    head = {"kind": "oros", "name": "s", "horizon_steps": 1, "step_s": 1.0}
    instance = parse(head | {"cells": cells, "travel": [], "robots": robots})
    assert instance.sigma == pytest.approx(sigma)
    given: Data = {"objective": {"sigma": 0.0}}
    assert parse(head | {"cells": cells, "travel": [], "robots": robots} | given).sigma == 0.0


def test_a_document_cannot_be_changed() -> None:
    instance = parse(document("oros"))
    with pytest.raises(ValueError, match="frozen"):
        instance.name = "other"


def test_python_users_may_write_the_fields_by_name() -> None:
    data = document("oros")
    data["travel"] = [
        {"from_" if key == "from" else key: value for key, value in row.items()} for row in data["travel"]
    ]
    assert sha256(parse(data)) == sha256(parse(document("oros")))


def test_the_models_hold_the_rules_without_a_file_too() -> None:
    """Building a model in Python passes the same rules as reading it."""
    with pytest.raises(ValueError, match="expected the id of a cell"):
        OrosInstance(**put(document("oros"), "robots[0].start", "z"))


def test_profiles_have_exactly_the_fields_of_the_format() -> None:
    for name in PROFILE:
        found = faults(put(document("fleet"), f"profiles.jackal.{name}", DELETE))
        assert [fault.place for fault in found] == ([] if name == "reserve_j" else [f"profiles.jackal.{name}"])


def test_every_kind_is_a_document_with_a_name() -> None:
    for kind in ("oros", "assignment", "inspection", "fleet", "mission"):
        model = parse(document(kind))
        assert isinstance(model, Document)
        assert (model.kind, model.schema_version, model.name) == (kind, 1, document(kind)["name"])
