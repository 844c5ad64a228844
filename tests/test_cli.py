"""The command line: exit codes, one line per fault, nothing written on bad input."""

import json
import os
import signal
import subprocess
import sys

import pytest

from benchmarks.families import walled_grid
from react_opt import check, load, parse, save, solve
from react_opt.cli import main


@pytest.fixture
def run(monkeypatch, capsys):
    """Run the command line in this process; return exit code, standard output and standard error."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["react-opt", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        captured = capsys.readouterr()
        return end.value.code, captured.out, captured.err

    return call


@pytest.fixture
def files(tmp_path):
    """Write a small instance and a plan of it."""
    instance = parse(walled_grid(2, 3, 2, 8, seed=1))
    save(instance, tmp_path / "instance.json")
    save(solve(instance), tmp_path / "plan.json")
    return tmp_path


def spoilt(folder, change):
    """Write a copy of the instance that is spoilt by a function."""
    data = json.loads((folder / "instance.json").read_text())
    change(data)
    path = folder / "spoilt.json"
    path.write_text(json.dumps(data))
    return path


def test_solve_prints_a_table(run, files):
    code, out, err = run("solve", files / "instance.json")
    assert code == 0
    assert "optimal" in out
    assert "who explores what, when" in out
    assert err == ""


def test_solve_writes_a_plan_that_passes_the_check(run, files):
    code, out, err = run("solve", files / "instance.json", "-o", files / "new.json")
    assert (code, out) == (0, "")
    assert "optimal" in err
    assert run("check", files / "instance.json", files / "new.json")[0] == 0


def test_json_on_standard_output_is_the_plan(run, files):
    code, out, _ = run("solve", files / "instance.json", "--json")
    assert code == 0
    assert json.loads(out)["kind"] == "oros_plan"
    assert run("solve", files / "instance.json", "-o", "-")[1].startswith("{")


def test_check_prints_every_violation_and_exits_with_1(run, files):
    data = json.loads((files / "plan.json").read_text())
    data["robots"][0]["steps"][3]["battery_j"] += 5
    data["objective"]["coverage"] += 1
    (files / "bad.json").write_text(json.dumps(data))
    code, out, _ = run("check", files / "instance.json", files / "bad.json")
    assert code == 1
    assert "battery" in out
    assert "step 3" in out
    assert "coverage" in out


def test_a_plan_of_another_instance_is_a_violation(run, files):
    save(parse(walled_grid(2, 3, 2, 8, seed=2)), files / "other.json")
    code, out, _ = run("check", files / "other.json", files / "plan.json")
    assert code == 1
    assert len(out.splitlines()) == 1
    assert "another instance" in out


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (lambda data: data.update(horizon_steps=10**9), "horizon_steps"),
        (lambda data: data["robots"][0].update(start="nowhere"), "robots[0].start"),
        (lambda data: data["travel"][0].update(energy_j=-1), "travel[0].energy_j"),
        (lambda data: data["travel"][0].update(energy_j=float("nan")), "travel[0].energy_j"),
        (lambda data: data["cells"][1].update(id=data["cells"][0]["id"]), "cells[1].id"),
        (lambda data: data.update(horizont=3), "horizont"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(run, files, change, place):
    path = spoilt(files, change)
    code, out, err = run("solve", path, "-o", files / "never.json")
    assert (code, out) == (2, "")
    assert f"{path}: {place}: " in err
    assert "Traceback" not in err
    assert not (files / "never.json").exists()


def test_several_faults_are_several_lines(run, files):
    def spoil(data):
        data["step_s"] = -1
        data["robots"][1]["start"] = "nowhere"
        data["travel"][2]["steps"] = 0

    code, _, err = run("solve", spoilt(files, spoil))
    assert code == 2
    assert len(err.splitlines()) == 3


@pytest.mark.parametrize(
    "arguments",
    [
        ["solve"],
        ["solve", "missing.json"],
        ["nonsuch"],
        ["solve", "instance.json", "--time-limit", "soon"],
        ["solve", "instance.json", "--time-limit", "-3"],
        ["solve", "instance.json", "--method", "magic"],
        ["solve", "instance.json", "--solver", "magic"],
        ["solve", "instance.json", "--at-step", "1"],
        ["solve", "instance.json", "-o", "no/such/folder/plan.json"],
        ["solve", "plan.json"],
        ["check", "instance.json", "instance.json"],
        ["check", "plan.json", "plan.json"],
        ["schema", "magic"],
        ["show", "plan.json"],
        ["show", "plan.json", "-o", "plan.jpg"],
        ["show", "missing.json", "-o", "plan.png"],
    ],
)
def test_bad_usage_is_one_line_with_exit_code_2(run, files, monkeypatch, arguments):
    monkeypatch.chdir(files)
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1


def test_truncated_json_names_the_place(run, files):
    text = (files / "instance.json").read_text()
    (files / "cut.json").write_text(text[: len(text) // 2])
    code, _, err = run("solve", files / "cut.json")
    assert code == 2
    assert "line " in err
    assert len(err.splitlines()) == 1


def test_infeasible_exits_with_3_and_still_writes_its_claim(run, files):
    path = spoilt(files, lambda data: data["robots"][1].update(battery_j=1.0))
    code, _, err = run("solve", path, "-o", files / "none.json")
    assert code == 3
    assert data_of(files / "none.json")["claim"]["status"] == "infeasible"
    assert data_of(files / "none.json")["robots"] == []
    assert "battery" in err
    assert run("check", path, files / "none.json")[0] == 0


def data_of(path):
    """Return a file's JSON."""
    return json.loads(path.read_text())


def test_a_mission_points_to_simulate(run, tmp_path):
    names = (
        "length_m width_m speed_max_m_s speed_min_m_s full_speed_clearance_m accel_m_s2 turn_rad_s "
        "idle_w motion_w turn_w sensing_w battery_j capacity_j lidar_range_m"
    )
    profile = dict.fromkeys(names.split(), 1.0)
    mission = {
        "kind": "mission", "schema_version": 1, "name": "m", "map": "m.yaml", "cell_m": 10.0, "horizon_s": 240.0,
        "step_s": 10.0, "profiles": {"p": {**profile, "lidar_rays": 360}}, "delta": 0.9, "strategy": "react",
        "robots": [{"id": "r", "profile": "p", "x_m": 0.0, "y_m": 0.0}], "postpone_below": 1.0, "seed": 0,
    }  # fmt: skip
    (tmp_path / "mission.json").write_text(json.dumps(mission))
    code, _, err = run("solve", tmp_path / "mission.json")
    assert code == 2
    assert "simulate" in err


def test_start_and_at_step(run, files):
    code, _, _ = run(
        "solve", files / "instance.json", "--start", files / "plan.json", "--at-step", 3, "-o", files / "again.json"
    )
    assert code == 0
    before, after = load(files / "plan.json"), load(files / "again.json")
    assert after.objective.total >= before.objective.total - 1e-9
    assert [r.steps[2] for r in after.robots] == [r.steps[2] for r in before.robots]


def test_schema_describes_the_file(run, files):
    jsonschema = pytest.importorskip("jsonschema")
    code, out, _ = run("schema", "oros")
    assert code == 0
    jsonschema.validate(data_of(files / "instance.json"), json.loads(out))
    data = data_of(files / "instance.json")
    del data["cells"]
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data, json.loads(out))


def test_solvers_lists_what_is_there(run):
    code, out, _ = run("solvers")
    assert code == 0
    for name in ("highs", "cp-sat", "scip", "cvxpy:HIGHS"):  # whole, even where a terminal has 80 columns
        assert name in out


def test_ctrl_c_writes_the_best_plan_so_far(tmp_path):
    pty = pytest.importorskip("pty")
    instance = parse(walled_grid(12, 12, 4, 60, seed=1))
    save(instance, tmp_path / "large.json")
    command = [sys.executable, "-m", "react_opt.cli", "solve", "large.json", "--time-limit", "300", "-o", "plan.json"]
    master, slave = pty.openpty()  # standard error is a terminal: a live line shows time, plan, bound and gap
    process = subprocess.Popen(command, cwd=tmp_path, stderr=slave)
    os.close(slave)
    seen = b""
    while b"best" not in seen:
        seen += os.read(master, 4096)
    process.send_signal(signal.SIGINT)
    while process.poll() is None:
        try:
            seen += os.read(master, 4096)
        except OSError:  # the other end is closed
            process.wait(timeout=60)
    os.close(master)
    assert process.returncode == 130, seen[-500:]
    assert b"bound" in seen
    assert b"interrupted" in seen
    plan = load(tmp_path / "plan.json")
    assert plan.claim.limit == "interrupt"
    assert check(instance, plan).ok


def test_show_draws_a_plan_with_the_instance_beside_it(run, files):
    code, out, err = run("show", files / "plan.json", "-o", files / "plan.svg")
    assert (code, out) == (0, "")
    assert "instance.json" in err
    assert (files / "plan.svg").read_text().startswith("<?xml")


def test_show_without_matplotlib_names_what_to_install(run, files, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    code, out, err = run("show", files / "plan.json", "-o", files / "none.png")
    assert (code, out) == (2, "")
    assert err == "figures need matplotlib: pip install 'react_opt[plot]'\n"
    assert not (files / "none.png").exists()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a device that is always full is a Linux thing")
@pytest.mark.parametrize("command", [["schema", "oros"], ["check", "instance.json", "plan.json"]])
def test_standard_output_on_a_full_disk_is_one_line(command, files):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "react_opt.cli", *command], cwd=files, stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 2
    assert done.stderr.splitlines() == ["react-opt: standard output cannot be written: No space left on device"]


@pytest.mark.skipif(os.name == "nt", reason="needs a POSIX shell")
def test_standard_output_may_be_closed(files):
    command = f"{sys.executable} -m react_opt.cli check instance.json plan.json >&-"
    done = subprocess.run(["sh", "-c", command], cwd=files, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_bad_plan_to_start_from_is_named(run, files):
    other = spoilt(files, lambda data: data.update(name="another"))
    code, out, err = run("solve", other, "--start", files / "plan.json")
    assert (code, out) == (2, "")
    assert err.startswith(f"{files / 'plan.json'}: expected a valid plan of this instance")
    assert err.count("\n") == 1
