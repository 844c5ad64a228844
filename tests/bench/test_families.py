"""Instance families: valid, seeded, from tiny to thousands of cells, and nothing of react_opt in them."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from benchmarks.families import FAMILIES
from benchmarks.suites import SUITES
from benchmarks.trial import instance_of
from react_opt import jsonio

FOLDER = Path(__file__).parents[2] / "benchmarks" / "families"
QUICK = [name for name in FAMILIES if name != "factory"]  # which compiles the kernels of the map


@pytest.mark.parametrize("name", QUICK)
def test_the_same_seed_gives_the_same_instance_and_another_seed_another(name: str) -> None:
    family = FAMILIES[name]
    parameters = family.sizes["tiny"]
    one, same, other = (family.make(seed=seed, **parameters) for seed in (1, 1, 2))
    assert one == same
    assert {**other, "name": one["name"]} != one
    assert other["name"] != one["name"]
    assert jsonio.parse(one).kind == family.kind


@pytest.mark.parametrize("name", QUICK)
def test_every_size_is_valid_and_sizes_grow(name: str) -> None:
    family = FAMILIES[name]
    counts = []
    for size in list(family.sizes)[:4]:
        instance = jsonio.parse(family.make(seed=0, **family.sizes[size]))
        counts.append(len(instance.cells if family.kind == "oros" else instance.targets))
    assert counts == sorted(counts)
    assert counts[0] <= 20


@pytest.mark.parametrize("name", FAMILIES)
def test_every_size_of_every_suite_is_valid_and_has_a_name_of_its_own(name: str) -> None:
    """Files of ``--export``, and the rows of a report, are told apart by their names."""
    cases = [dict(entry.case) for suite in SUITES.values() for entry in suite.entries if entry.case["family"] == name]
    different = {json.dumps(case["parameters"], sort_keys=True): case for case in cases}
    digests = {}
    for case in different.values():  # one seed of each; that seeds differ is another test
        instance = instance_of(case)
        assert instance.kind == FAMILIES[name].kind
        digests[instance.name] = jsonio.sha256(instance)
    assert len(digests) == len(set(digests.values())) == len(different)
    assert {json.dumps(size, sort_keys=True) for size in FAMILIES[name].sizes.values()} <= set(different)


def test_there_are_instances_with_thousands_of_cells() -> None:
    assert len(FAMILIES["walled_grid"].make(seed=0, **FAMILIES["walled_grid"].sizes["colossal"])["cells"]) == 3600
    assert len(FAMILIES["tree"].make(seed=0, **FAMILIES["tree"].sizes["huge"])["cells"]) == 1000


@pytest.mark.parametrize("name", ["walled_grid", "tight_grid", "chargers", "corridor", "tree", "metric_complete"])
def test_every_cell_can_be_reached(name: str) -> None:
    data = FAMILIES[name].make(seed=3, **FAMILIES[name].sizes["small"])
    at = {cell["id"]: k for k, cell in enumerate(data["cells"])}
    rows, columns = zip(*((at[arc["from"]], at[arc["to"]]) for arc in data["travel"]), strict=True)
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(at), len(at)))
    assert connected_components(graph, directed=True, connection="strong")[0] == 1


def test_a_tree_has_no_way_round_and_a_corridor_has_dead_ends() -> None:
    tree = FAMILIES["tree"].make(seed=0, **FAMILIES["tree"].sizes["small"])
    assert len(tree["travel"]) == 2 * (len(tree["cells"]) - 1)
    corridor = FAMILIES["corridor"].make(seed=0, **FAMILIES["corridor"].sizes["small"])
    rooms = {cell["id"] for cell in corridor["cells"] if cell["id"][0] in "ab"}
    assert all(sum(arc["from"] == room for arc in corridor["travel"]) == 1 for room in rooms)


def test_generalised_assignments_have_the_classical_budgets() -> None:
    """Type C: four fifths of the mean load of an agent that took every target in turn."""
    data = FAMILIES["generalised"].make(seed=5, robots=4, targets=20, type="C")
    for robot in data["robots"]:
        load = sum(row["energy_j"] for row in data["costs"] if row["robot"] == robot["id"])
        assert robot["battery_j"] == np.floor(0.8 * load / 4)
    with pytest.raises(ValueError, match="type A, B, C or D"):
        FAMILIES["generalised"].make(seed=5, robots=4, targets=20, type="E")


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.name)
def test_families_can_be_handed_to_others(path: Path) -> None:
    """But for the factory, which is built from a map, they import nothing of react_opt."""
    named = {node.module or "" for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)}
    assert path.name == "factory.py" or not [name for name in named if name.startswith("react_opt")]
