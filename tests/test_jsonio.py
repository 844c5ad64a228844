"""Files: read back what was written, every malformed file told in one line per fault."""

from __future__ import annotations

import io
import json
import os
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from documents import KINDS, document, put
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import MIDDLE, random_oros, random_plan, seeds

from react_opt.errors import InputError
from react_opt.jsonio import dumps, json_schema, load, loads, parse, save, sha256
from react_opt.plan import Claim

calm = settings(derandomize=True, deadline=None, max_examples=40)


def only_fault(path: Path | str, **options: Any) -> tuple[str, str, str]:
    """Return file, place and message of the only fault of a file."""
    with pytest.raises(InputError) as caught:
        load(path, **options)
    (fault,) = caught.value.faults
    assert str(caught.value) == str(fault)
    assert "\n" not in str(fault)
    return fault.file, fault.place, fault.message


# --- round trips and the canonical form ---


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_reads_back_the_same(kind: str, tmp_path: Path) -> None:
    model = parse(document(kind))
    path = tmp_path / "file.json"
    save(model, path)
    again = load(path, kind=kind)
    assert again == model
    assert dumps(again) == dumps(model) == path.read_text()


@calm
@given(seeds())
def test_random_instances_and_plans_read_back_the_same(seed: int) -> None:
    instance = random_oros(seed, MIDDLE)
    assert loads(dumps(instance)) == instance
    plan = random_plan(instance, seed, tries=5)
    if plan is not None:
        assert loads(dumps(plan)) == plan


def test_the_sha256_ignores_layout_and_spelled_out_defaults() -> None:
    short, long = document("oros"), document("oros")
    put(long, "robots[0].start_step", 0)
    put(long, "cells[1].weight", 1)
    put(long, "schema_version", 1)
    shuffled = dict(reversed(list(long.items())))
    assert sha256(parse(short)) == sha256(loads(json.dumps(shuffled, indent=7)))


@pytest.mark.parametrize(("place", "value"), [("name", "other"), ("step_s", 10.000000001), ("cells[0].id", "ä")])
def test_the_sha256_sees_every_change(place: str, value: Any) -> None:
    data = document("oros")
    data["travel"], data["robots"] = [], data["robots"][1:]
    assert sha256(parse(put(json.loads(json.dumps(data)), place, value))) != sha256(parse(data))


def test_the_sha256_is_that_of_the_canonical_json() -> None:
    """Written out by hand, so that another program can work it out too."""
    text = (
        '{"cells":[],"chargers":[],"horizon_steps":1,"kind":"oros","limits":{"forbid_swaps":false,'
        '"robots_per_cell":null,"sensing_robots_per_step":null},"name":"\\u00e4","objective":{"sigma":null},'
        '"robots":[],"schema_version":1,"step_s":10.0,"travel":[]}'
    )
    import hashlib

    least = {"kind": "oros", "name": "ä", "horizon_steps": 1, "step_s": 10, "cells": [], "travel": [], "robots": []}
    assert sha256(parse(least)) == hashlib.sha256(text.encode()).hexdigest()


# --- published schemas ---


@pytest.mark.parametrize("kind", KINDS)
def test_the_published_schema_accepts_what_we_read_and_write(kind: str) -> None:
    """Tested with a reader that is not ours."""
    schema = json_schema(kind)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    assert list(validator.iter_errors(document(kind))) == []
    assert list(validator.iter_errors(json.loads(dumps(parse(document(kind)))))) == []


@pytest.mark.parametrize(
    ("kind", "place", "value"),
    [
        ("oros", "horizon_steps", 10**9),
        ("oros", "horizon_steps", 0),
        ("oros", "step_s", -1),
        ("oros", "kind", "fleet"),
        ("oros", "robots[0].hat", "red"),
        ("oros", "travel[0].steps", 0),
        ("oros", "cells[0].id", ""),
        ("assignment", "conflicts[0]", ["t1"]),
        ("inspection", "minimise", "money"),
        ("mission", "delta", 2),
        ("fleet", "profiles.jackal.lidar_rays", 0),
        ("oros_plan", "claim.status", "good"),
    ],
)
def test_the_published_schema_refuses_what_we_refuse(kind: str, place: str, value: Any) -> None:
    data = put(document(kind), place, value)
    assert not jsonschema.Draft202012Validator(json_schema(kind)).is_valid(data)
    with pytest.raises(InputError):
        parse(data)


def test_a_schema_of_an_unknown_kind_lists_the_kinds() -> None:
    with pytest.raises(InputError, match="oros, assignment, inspection, fleet, mission, oros_plan"):
        json_schema("orus")


# --- bad files ---


def write(tmp_path: Path, content: bytes | str) -> Path:
    path = tmp_path / "bad.json"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize(
    ("content", "place", "words"),
    [
        ("", "line 1 column 1", "expected JSON: expecting value"),
        ("   \n\n", "line 3 column 1", "expected JSON"),
        ('{"kind": "oros", "name": "cut', "line 1 column 26", "unterminated string"),
        ('{"kind": "oros",\n "cells": [{"id": "a"}, ', "line 2 column 25", "expected JSON"),
        ('{"kind": "oros"} {}', "line 1 column 18", "extra data"),
        ("{'kind': 'oros'}", "line 1 column 2", "property name"),
        ("[]", "", "expected a JSON object, found a list"),
        ("3", "", "expected a JSON object, found 3"),
        ("null", "", "expected a JSON object, found null"),
        ('"oros"', "", 'expected a JSON object, found "oros"'),
        ("{}", "kind", "expected one of oros"),
        (b"\xff\xfe{\x00}\x00", "byte 0", "expected UTF-8"),
        (b'{"kind": "or\xe4s"}', "byte 12", "expected UTF-8"),
        (b"\x89PNG\r\n\x1a\n", "byte 0", "expected UTF-8"),
        ("[" * 100_000, "", "nested too deeply"),
        ('{"a":' * 100_000, "", "nested too deeply"),
        ('{"kind": "oros", "horizon_steps": ' + "9" * 5000 + "}", "", "expected JSON"),
        ('{"kind": "oros", "name": "a", "name": "b"}', "name", "expected each key once"),
    ],
)
def test_a_file_that_is_no_document_is_told_in_one_line(
    content: bytes | str, place: str, words: str, tmp_path: Path
) -> None:
    path = write(tmp_path, content)
    file, found, message = only_fault(path)
    assert (file, found) == (str(path), place)
    assert words in message
    assert len(message) < 200


def test_a_key_repeated_deep_inside_is_found(tmp_path: Path) -> None:
    text = dumps(parse(document("oros"))).replace('"id": "a",', '"id": "a", "x_m": 1.0,', 1)
    assert only_fault(write(tmp_path, text))[1:] == ("x_m", "expected each key once in an object")


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    path = write(tmp_path, b"\xef\xbb\xbf" + dumps(parse(document("oros"))).encode())
    assert load(path) == parse(document("oros"))


def test_nan_in_a_file_is_told_with_its_place(tmp_path: Path) -> None:
    text = json.dumps(put(document("oros"), "robots[1].idle_w", float("nan")))
    assert only_fault(write(tmp_path, text))[1:] == ("robots[1].idle_w", "expected a finite number, found NaN")


@pytest.mark.parametrize("value", [float("nan"), float("-inf"), [1, {"a": float("nan")}]])
@pytest.mark.parametrize("group", ["settings", "certificate"])
def test_free_form_parts_of_a_claim_hold_finite_numbers_too(group: str, value: Any) -> None:
    """JSON cannot hold the others, so they must not get in by a file or by a solver."""
    data = put(document("oros_plan"), f"claim.{group}", {"x": value})
    with pytest.raises(InputError, match="expected finite numbers only") as caught:
        parse(data)
    assert [fault.place for fault in caught.value.faults] == [f"claim.{group}"]


def test_free_form_parts_of_a_claim_are_not_nested_for_ever() -> None:
    deep: Any = 0
    for _ in range(400):
        deep = [deep]
    with pytest.raises(InputError, match="levels of nesting"):
        parse(put(document("oros_plan"), "claim.settings", {"x": deep}))
    with pytest.raises(ValueError, match="finite"):
        Claim(status="no_plan", wall_s={"solve": float("inf")})


def test_a_missing_file_a_folder_and_a_file_of_another_kind(tmp_path: Path) -> None:
    missing = tmp_path / "missing.json"
    assert only_fault(missing) == (str(missing), "", "cannot be read: No such file or directory")
    assert only_fault(tmp_path) == (str(tmp_path), "", "cannot be read: Is a directory")
    fleet = write(tmp_path, json.dumps(document("fleet")))
    assert only_fault(fleet, kind="oros")[1:] == ("kind", "expected 'oros', found 'fleet'")


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
def test_a_file_that_may_not_be_read(tmp_path: Path) -> None:
    path = write(tmp_path, "{}")
    path.chmod(0)
    assert only_fault(path)[2] == "cannot be read: Permission denied"


def test_a_path_with_a_null_byte() -> None:
    with pytest.raises(InputError, match="cannot be read"):
        load("a\0b")


def test_standard_input_is_named_by_a_dash(monkeypatch: pytest.MonkeyPatch) -> None:
    class Input:
        buffer = io.BytesIO(b"{")

    monkeypatch.setattr(sys, "stdin", Input)
    assert only_fault("-")[:2] == ("-", "line 1 column 2")


def test_standard_output_is_named_by_a_dash(capsys: pytest.CaptureFixture[str]) -> None:
    save(parse(document("fleet")), "-")
    assert loads(capsys.readouterr().out) == parse(document("fleet"))


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**25), 10**25) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=12,
)


@settings(derandomize=True, deadline=None, max_examples=150)
@given(st.sampled_from(KINDS), st.data())
def test_whatever_is_put_anywhere_is_read_or_told(kind: str, data: st.DataObject) -> None:
    """Any JSON value at any place: a document or faults with places, never another error."""
    content = document(kind)
    place: Any = content
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = data.draw(st.sampled_from(keys))
        if isinstance(place[key], dict | list) and place[key] and data.draw(st.booleans()):
            place = place[key]
            continue
        place[key] = data.draw(JSON)
        break
    try:
        model = parse(content, file="f")
    except InputError as error:
        told = [str(fault) for fault in error.faults]
    else:
        told = ["read"]
        assert loads(dumps(model)) == model
    assert told
    assert all("\n" not in line and len(line) < 400 for line in told)


@pytest.mark.parametrize("name", ["a\nb", "\ud800", "x" * 1000])
def test_a_strange_name_stays_one_printable_line(name: str) -> None:
    content = document("oros") | {name: 1}
    with pytest.raises(InputError) as told:
        parse(content, file="f")
    (line,) = str(told.value).splitlines()
    assert line.isprintable()
    assert len(line) < 150


# --- size ---


def big(robots: int, side: int, arcs: int) -> dict[str, Any]:
    rng = np.random.default_rng(0)
    cells = [{"id": f"c{k}", "x_m": 10.0 * (k % side), "y_m": 10.0 * (k // side)} for k in range(side * side)]
    ends = rng.integers(0, side * side - 1, size=(arcs, 2))
    travel = [
        {"from": f"c{i}", "to": f"c{j if j != i else i + 1}", "steps": 1, "energy_j": 70.0} for i, j in ends.tolist()
    ]
    fleet = [
        {"id": f"r{k}", "start": "c0", "battery_j": 1e6, "capacity_j": 1e6, "idle_w": 2.0, "sensing_w": 16.9}
        for k in range(robots)
    ]
    head = {"kind": "oros", "name": "big", "horizon_steps": 100_000, "step_s": 10.0}
    return head | {"cells": cells, "travel": travel, "robots": fleet}


def test_a_hundred_robots_ten_thousand_cells_and_a_hundred_thousand_arcs_load(tmp_path: Path) -> None:
    path = write(tmp_path, json.dumps(big(100, 100, 100_000)))
    instance = load(path)
    assert (len(instance.robots), len(instance.cells), len(instance.travel)) == (100, 10_000, 100_000)
    assert len(sha256(instance)) == 64


def test_absurd_sizes_eat_no_memory(tmp_path: Path) -> None:
    """10^9 steps and a file full of faults are told within 1 GB."""
    data = big(2, 30, 20_000) | {"horizon_steps": 10**9}
    for row in data["travel"]:
        row["energy_j"] = -1.0
        row["energy"] = 1.0
    path = write(tmp_path, json.dumps(data))
    script = (
        "import sys; from react_opt import load, InputError\n"
        "try: load(sys.argv[1])\nexcept InputError as error: print(len(error.faults))"
    )

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30))

    done = subprocess.run(
        [sys.executable, "-c", script, str(path)],
        capture_output=True,
        text=True,
        timeout=120,
        preexec_fn=limit,
        check=True,
    )
    assert int(done.stdout) == 40_001
