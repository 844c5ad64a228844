"""``show``: every kind of file has a picture, the same on every run, and what it says is true."""

from __future__ import annotations

import json
import math
import re

import pytest
from documents import document
from small_trace import FACTORY, ROOT, scripted

from react_opt import InputError, UsageError, load, parse, save, solve
from react_opt.report.layout import layout, walls
from react_opt.report.show import show
from react_opt.report.timeline import coverage, coverage_limit, spans
from react_opt.report.tracks import target_states, tracks
from react_opt.trace import TraceEvent

MAGIC = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF", ".html": b"<!DOCTYPE html>"}
KINDS = ["oros", "assignment", "inspection", "fleet", "oros_plan", "assignment_plan", "inspection_plan"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Write one file of every kind, plans beside their instances, and a trace."""
    folder = tmp_path_factory.mktemp("files")
    for kind in KINDS:
        if not kind.endswith("_plan"):
            save(parse(document(kind)), folder / f"{kind}.json")
    save(parse(document("oros_plan")), folder / "oros_plan.json")
    for kind in ("assignment", "inspection"):
        save(solve(parse(document(kind))), folder / f"{kind}_plan.json")
    mission = document("mission") | {"map": str(FACTORY), "prior_map": None}
    save(parse(mission), folder / "mission.json")
    save(scripted(), folder / "trace.json")
    return folder


@pytest.mark.parametrize("kind", [*KINDS, "mission", "trace"])
def test_every_kind_of_file_has_pictures_that_are_the_same_on_every_run(kind, folder, tmp_path):
    for suffix, magic in MAGIC.items():
        for run in "ab":
            show([folder / f"{kind}.json"], tmp_path / f"{run}{suffix}")
        first, second = ((tmp_path / f"{run}{suffix}").read_bytes() for run in "ab")
        assert first.startswith(magic)
        assert first == second


def test_a_plan_is_drawn_with_the_instance_beside_it(folder, tmp_path):
    notes = show([folder / "oros_plan.json"], tmp_path / "plan.svg")
    assert notes == [f"{folder / 'oros_plan.json'}: drawn with its instance {folder / 'oros.json'}"]


def test_a_plan_without_its_instance_is_drawn_all_the_same(folder, tmp_path):
    (tmp_path / "plan.json").write_bytes((folder / "oros_plan.json").read_bytes())
    notes = show([tmp_path / "plan.json"], tmp_path / "plan.png")
    assert len(notes) == 1
    assert "--instance" in notes[0]
    assert (tmp_path / "plan.png").read_bytes() != b""


def test_an_instance_of_another_plan_is_refused(folder, tmp_path):
    other = tmp_path / "other.json"
    save(parse(document("oros") | {"name": "other"}), other)
    with pytest.raises(InputError, match="found another one"):
        show([folder / "oros_plan.json"], tmp_path / "plan.png", instance=other)
    assert not (tmp_path / "plan.png").exists()


@pytest.mark.parametrize(
    ("files", "options", "output", "message"),
    [
        (["oros.json"], {}, "out.jpg", "expected a file that ends in"),
        (["oros.json"], {"instance": "oros.json"}, "out.png", "--instance: expected with a plan"),
        (["trace.json"], {"map_file": str(FACTORY)}, "out.png", "--map"),
        (["trace.json", "trace.json"], {}, "out.png", r"expected -o to end in .html"),
        (["trace.json", "trace.json", "trace.json"], {}, "out.html", "found 3 files"),
    ],
)
def test_what_makes_no_sense_is_refused(files, options, output, message, folder, tmp_path):
    with pytest.raises(UsageError, match=re.escape(message).replace(r"\.html", ".html")):
        show([folder / name for name in files], tmp_path / output, **options)
    assert not (tmp_path / output).exists()


def test_a_plan_that_holds_no_routes_says_why(folder, tmp_path):
    data = json.loads((folder / "oros_plan.json").read_text())
    claim = {"status": "infeasible", "reason": "r1: battery too low <b>&"}
    data |= {"robots": [], "explored": [], "objective": None, "claim": claim}
    (tmp_path / "none.json").write_text(json.dumps(data))
    show([tmp_path / "none.json"], tmp_path / "none.html")
    page = (tmp_path / "none.html").read_text()
    assert "battery too low &lt;b&gt;&amp;" in page


def test_names_from_files_are_text_and_nothing_else(tmp_path):
    evil = '</title><script>alert("x")</script> $\\frac{'
    data = document("oros") | {"name": evil}
    data["robots"][0]["id"] = "_$\\oops$ <script>"
    save(parse(data), tmp_path / "evil.json")
    show([tmp_path / "evil.json"], tmp_path / "evil.html")
    assert "<script" not in (tmp_path / "evil.html").read_text()


# --- what the pictures say ---


def test_cells_of_the_factory_are_its_areas_of_10_metres():
    instance = load(ROOT / "examples" / "factory" / "factory_3_10m.json")
    grid = layout(instance.cells)
    assert grid is not None
    assert grid.boxes["g0_0"] == (0, 0, 10, 10)
    assert grid.boxes["g1_4"] == (10, 40, 20, 50)
    inner = {
        frozenset((one, other))
        for one, other, *ends in grid.sides
        if other and tuple(ends) in set(walls(instance, grid))
    }
    assert inner == {frozenset(pair) for pair in (("g0_0", "g1_0"), ("g0_1", "g1_1"), ("g1_2", "g1_3"))}


def test_places_alone_make_a_grid_too_and_scattered_places_make_none():
    data = document("oros")
    assert layout(parse(data).cells).boxes["b"].x0 == 5.0  # half way between a at 0 m and b at 10 m
    for k, cell in enumerate(data["cells"]):
        cell["x_m"], cell["y_m"] = 1.0 + k % 2, 1.0 + k % 2
    assert layout(parse(data).cells) is None


def test_strips_say_what_the_plan_says():
    plan = parse(document("oros_plan"))
    assert [tuple(span) for span in spans(plan.robots[0])] == [
        ("moving", 0, 1),
        ("charging", 1, 2),
        ("moving", 2, 4),
        ("moving", 4, 6),
    ]
    assert [span.what for span in spans(plan.robots[1])] == ["waiting", "moving", "waiting"]


def test_the_coverage_curve_stays_below_its_limit_and_both_are_known_by_hand():
    instance, plan = parse(document("oros")), parse(document("oros_plan"))
    # a is known (1); at t = 1 r1 can be in b (1) and r2 is in c (2); d (1) is one step from c: 5 from t = 2 on
    assert coverage_limit(instance) == [1, 4, 5, 5, 5, 5, 5]
    assert coverage(instance, plan)[1] == [1, 4, 4, 4, 4, 5, 5]


def test_coverage_of_good_plans_is_below_the_limit():
    instance = load(ROOT / "examples" / "factory" / "factory_1_10m.json")
    plan = solve(instance, time_limit_s=5)
    for reached, limit in zip(coverage(instance, plan)[1], coverage_limit(instance), strict=True):
        assert reached <= limit


def test_tracks_and_target_states_are_those_of_the_trace():
    trace = scripted()
    paths = tracks(trace)
    assert paths.robots == ("r1", "r2")
    assert paths.t_s[-1] == 60.0
    frame = trace.frames[50]
    assert paths.x_m[50].tolist() == [robot.x_m for robot in frame.robots]
    assert paths.sensing[50].tolist() == [True, True]
    assert not paths.sensing[30, 1]
    assert {name: state for name, (_, _, state) in target_states(trace).items()} == {
        "t1": "inspected",
        "t2": "postponed",
    }
    assert target_states(trace, until_s=5.0)["t1"] == (18.0, 15.0, "taken")


def test_a_target_left_for_another_waits_again():
    trace = scripted()
    taken = [TraceEvent(t_s=1.0, type="target_taken", robot="r1", target=name, x_m=1.0, y_m=1.0) for name in ("a", "b")]
    states = target_states(trace.model_copy(update={"events": (*taken,)}))
    assert {name: state for name, (_, _, state) in states.items()} == {"a": "new", "b": "taken"}


def test_a_turned_map_is_shown_in_its_own_frame():
    trace = scripted()
    turned = {"origin_x_m": 2.0, "origin_y_m": 1.0, "origin_yaw_rad": math.pi / 2}
    grid = trace.known.model_copy(update=turned)
    paths = tracks(trace.model_copy(update={"known": grid}))
    robot = trace.frames[50].robots[0]  # along the map's columns is the world's y, along its rows minus the world's x
    assert paths.x_m[50, 0] == pytest.approx(2.0 + (robot.y_m - 1.0))
    assert paths.y_m[50, 0] == pytest.approx(1.0 - (robot.x_m - 2.0))
    assert paths.yaw_rad[50, 0] == pytest.approx(robot.yaw_rad - math.pi / 2)
