"""Campaigns of missions: what is run, the statistics, the verdicts, and going on where one was stopped."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from extras import need

from benchmarks.missions.__main__ import FACTORY, _options, main, settings_of
from benchmarks.missions.goals import goals
from benchmarks.missions.paper import Campaign, all_tables
from benchmarks.missions.runs import Setting
from benchmarks.missions.tables import Table, mean, spread
from react_opt.jsonio import load


def result(robots: int, scale: float, coverage: float = 1.0) -> dict[str, Any]:
    """A mission whose times are those of a base case, stretched; later shares are not reached below the coverage."""
    base = {0.80: 50.0, 0.88: 58.0, 0.90: 60.0, 0.95: 70.0, 0.97: 80.0, 0.99: 90.0}
    return {
        "reached": {f"{s:g}": [t * scale, 40 * t * scale] if s <= coverage else [None, None] for s, t in base.items()},
        "coverage": coverage,
        "end_s": 100.0,
        "last_s": 95.0 * scale,
        "curve": [min(coverage, 0.1 * n) for n in range(37)],
        "robots": [{"useful_s": 90.0, "energy_j": 850.0, "off_j": 150.0} for _ in range(robots)],
        "wall_s": 3.0,
        "events": {},
    }


@pytest.fixture
def campaign() -> Campaign:
    settings = [Setting(name, n) for name in ("oros", "react", "naive", "nearest") for n in (1, 3)]
    results: dict[str, Any] = {}
    for seed in (1, 2):
        for n in (1, 3):
            pace = 3.0 if n == 1 else 1.0
            results[Setting("oros", n).key(seed)] = result(n, pace, coverage=0.88)
            results[Setting("react", n).key(seed)] = result(n, pace)
            results[Setting("naive", n).key(seed)] = result(n, 1.05 * pace, coverage=0.90 if seed == 1 else 1.0)
            results[Setting("nearest", n).key(seed)] = result(n, 1.3 * pace)
    results["bounds"] = [{"robots": 3, "share": 0.97, "time_s": 55.0, "reachability_s": 50.0, "regions": 2}]
    results["full map x3 97%"] = {"time_s": 70.0, "planned_s": 69.0, "paths_m": {}}
    results["full map x3 99%"] = {"time_s": 68.0, "planned_s": 69.0, "paths_m": {}}
    return Campaign(settings, 2, results)


def test_verdicts(campaign: Campaign) -> None:
    rows = {(row[0], row[1]): (row[3], row[4]) for row in goals(campaign)}
    assert rows["OROS, final coverage", "1"] == ("88.0%", "met")
    assert rows["OROS, time falls with robots", "1 to 3"] == ("285.0 > 95.0", "met")
    # A plan that sees 99 % at 68 s sees 97 % by then, too.
    assert rows["react, 97% / full map", "3"] == (f"{80 / 68:.2f}", "met")
    assert rows["react, 99% / full map", "1"][1] == "unknown"
    assert rows["react, 90 % against the best frontier", "3"] == ("23% less", "met")
    assert rows["naive / react, 90%", "3"] == ("1.05", "NOT met")
    assert rows["naive / react, 95%", "3"] == ("not reached", "met")
    assert rows["OROS, saving by switching (area_explored)", "1"] == ("15.0%", "met")
    assert rows["proven bound / full map, 97 %", "3"] == (f"{55 / 68:.2f}", "met")


def test_every_table_has_rows_of_its_width_in_all_forms(campaign: Campaign) -> None:
    tables = all_tables(campaign)
    assert len(tables) >= 7
    for table in tables:
        assert all(len(row) == len(table.columns) for row in table.rows)
        assert table.markdown().startswith(f"## {table.title}")
        assert len(table.csv().splitlines()) == len(table.rows) + 1


def test_a_mean_over_runs_that_got_there_alone_is_not_given() -> None:
    assert mean([1.0, None]) is None
    assert spread([10.0, None]) == "1 of 2 reached, latest 10.0"
    # t quantile of one degree of freedom is 12.706, the standard error sqrt(2) / sqrt(2).
    assert spread([9.0, 11.0]) == "10.0 sd 1.4 ±12.7"
    assert spread([]) == "-"


def test_columns_line_up() -> None:
    lines = Table("t", ["a", "long"], [["word", "1"], ["x", "100"]]).text().splitlines()
    assert [line.index(end) + len(end) for line, end in zip(lines[2:], ("long", "1", "100"), strict=True)] == [
        10,
        10,
        10,
    ]


def test_settings_differ_in_their_keys_and_become_missions() -> None:
    settings = settings_of(_options([]), 4)
    keys = [setting.key(1) for setting in settings]
    assert len(set(keys)) == len(keys)
    mission = Setting("react", 3, blocking=False, horizon_s=360.0).mission(load(FACTORY, "mission"), 7)
    assert (len(mission.robots), mission.blocking, mission.horizon_s, mission.seed) == (3, False, 360.0, 7)


def test_variants_are_run_of_the_strategies_named_alone() -> None:
    """A team of three: two more switching rules, always on and, where it is rated, without blocking."""
    chosen = ["--strategies", "oros", "react_plus", "nearest", "--robots", "3"]
    all_of = settings_of(_options([*chosen, "--variants", "react_plus"]), 4)
    assert [setting.strategy for setting in all_of] == ["oros", "react_plus", "nearest"] + ["react_plus"] * 4
    assert len(settings_of(_options(chosen), 4)) == 3 + 3 + 4
    assert len(settings_of(_options([*chosen, "--quick"]), 4)) == 3


def test_a_campaign_runs_and_goes_on_where_it_was_stopped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, page = tmp_path / "out.jsonl", tmp_path / "page.md"
    options = [
        "--strategies",
        "nearest",
        "--robots",
        "1",
        "--quick",
        "--no-limits",
        "--horizon-s",
        "3",
        "-o",
        str(file),
    ]
    assert main([*options, "--seeds", "1"]) == 0
    first = file.read_text()
    assert main([*options, "--seeds", "2", "--markdown", str(page)]) == 0
    assert file.read_text().startswith(first)
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert [line["key"] for line in lines if "key" in line] == ["nearest x1 seed 1", "nearest x1 seed 2"]
    assert "Time to see a share" in capsys.readouterr().out
    assert "Generated by `python -m benchmarks.missions" in page.read_text()


@pytest.mark.extras
def test_a_campaign_on_a_ray_cluster_has_the_records_of_one_without(tmp_path: Path) -> None:
    """The same missions, but for the clock on the wall; and it goes on with what was run without the cluster."""
    need("ray", "ray")
    here, there = tmp_path / "here.jsonl", tmp_path / "there.jsonl"
    options = ["--strategies", "nearest", "--robots", "1", "--quick", "--no-limits", "--horizon-s", "3"]
    assert main([*options, "--seeds", "2", "-o", str(here)]) == 0
    assert main([*options, "--seeds", "1", "-o", str(there)]) == 0
    assert main([*options, "--seeds", "2", "-o", str(there), "--ray", "local", "--workers", "2"]) == 0
    found = []
    for file in (here, there):
        lines = [json.loads(line) for line in file.read_text().splitlines()]
        results = {line["key"]: line["result"] for line in lines if "key" in line}
        assert len(results) == len([line for line in lines if "key" in line]) == 2
        for result in results.values():
            result.pop("wall_s")
        found.append(results)
    assert found[0] == found[1]


def test_without_ray_a_campaign_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("react_opt.jobs_ray.util.find_spec", lambda name: None)
    assert main(["--quick", "--seeds", "1", "-o", str(tmp_path / "r.jsonl"), "--ray", "local"]) == 2
    assert capsys.readouterr().err == "a Ray cluster needs ray: pip install 'react_opt[ray]'\n"


def test_bad_input_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none.json")]) == 2
    assert "none.json" in capsys.readouterr().err
