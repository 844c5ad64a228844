"""Mission files to traces: options, going on with a stopped trace, the summary, and the command."""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from react_opt.cli import app, main
from react_opt.errors import ReactError, UsageError
from react_opt.geometry import save_map
from react_opt.instance import Mission, Noise
from react_opt.jsonio import load, save
from react_opt.orchestrator.strategy import Note
from react_opt.plan import InspectionClaim, Secondary
from react_opt.sim import run
from react_opt.sim.loop import Simulation
from react_opt.sim.run import simulate, with_options
from react_opt.sim.summary import Summary, summarise
from react_opt.trace import Trace
from tests.sim.missions import TWO_ROOMS, mission


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("two_rooms")
    save_map(TWO_ROOMS, place / "two_rooms.yaml")
    save(MISSION, place / "mission.json")
    return place


MISSION: Mission = mission([(1.5, 1.5), (1.5, 4.0)], noise=Noise(speed=0.05, waiting_s=0.3, power=0.02))


def told(trace: Trace) -> dict[str, Any]:
    return trace.model_dump(mode="json", exclude={"wall_s", "decisions_wall_s"})


def stop_after(polls: int) -> Any:
    left = iter(range(polls))
    return lambda: next(left, None) is None


@pytest.mark.parametrize("ticks", np.random.default_rng(7).integers(1, 100, size=4).tolist())
def test_stopped_at_any_tick_and_resumed_gives_the_same_trace(folder: Path, ticks: int) -> None:
    whole = simulate(MISSION, folder)
    stopped = simulate(MISSION, folder, should_stop=stop_after(ticks))
    assert stopped.status == "stopped"
    assert told(simulate(MISSION, folder, resume=Trace.model_validate_json(stopped.model_dump_json()))) == told(whole)


def test_a_trace_of_another_mission_or_another_run_is_not_gone_on_with(folder: Path) -> None:
    stopped = simulate(MISSION, folder, should_stop=stop_after(60))
    with pytest.raises(UsageError, match="another mission"):
        simulate(with_options(MISSION, seed=5), folder, resume=stopped)
    frames = list(stopped.frames)
    frames[3] = frames[3].model_copy(update={"coverage": 0.123})
    with pytest.raises(ReactError, match="cannot be reproduced"):
        simulate(MISSION, folder, resume=stopped.model_copy(update={"frames": tuple(frames)}))


def test_options_of_the_command_line() -> None:
    changed = with_options(MISSION, strategy="hungarian", robots=1, seed=9, always_on=True)
    assert (changed.strategy, len(changed.robots), changed.seed, changed.always_on) == ("hungarian", 1, 9, True)
    with pytest.raises(UsageError, match="expected 1 to 2, found 3"):
        with_options(MISSION, robots=3)


def test_the_summary_is_worked_out_from_the_trace(folder: Path) -> None:
    trace = simulate(MISSION, folder)
    summary = summarise(trace)
    for row in summary.milestones:
        later = [frame for frame in trace.frames if frame.coverage >= row.coverage]
        assert (row.t_s is None) == (not later)
        if row.t_s is not None:
            assert later[0].t_s - 1.0 <= row.t_s <= later[0].t_s
    start, end = trace.frames[0], trace.frames[-1]
    for robot, first, last in zip(summary.robots, start.robots, end.robots, strict=True):
        assert robot.energy_j == pytest.approx(first.battery_j - last.battery_j, abs=0.02)
    assert summary.events["mission_end"] == 1


def test_simulate_then_check_then_corrupt(folder: Path) -> None:
    runner, of, out = CliRunner(), str(folder / "mission.json"), folder / "trace.json"
    done = runner.invoke(app, ["simulate", of, "-o", str(out), "--json"])
    assert done.exit_code == 0
    summary = Summary.model_validate_json(done.stdout)
    assert summary.coverage == pytest.approx(load(out).frames[-1].coverage, abs=1e-5)
    assert runner.invoke(app, ["check", of, str(out)], standalone_mode=False).return_value == 0
    data = json.loads(out.read_text())
    data["frames"][5]["robots"][0]["battery_j"] += 100
    out.write_text(json.dumps(data))
    bad = runner.invoke(app, ["check", of, str(out)], standalone_mode=False)
    assert bad.return_value == 1
    assert "battery: r1" in bad.stdout


def test_always_on_costs_more_and_never_switches(folder: Path) -> None:
    saving = summarise(simulate(MISSION, folder))
    always = summarise(simulate(with_options(MISSION, always_on=True), folder))
    assert "sensing_off" not in always.events
    assert all(robot.sensing_s == pytest.approx(always.end_s, abs=0.5) for robot in always.robots)
    assert sum(robot.sensing_s for robot in saving.robots) < sum(robot.sensing_s for robot in always.robots)


@pytest.mark.parametrize("rule", ["no_new_pixel", "small_gain", "area_explored"])
def test_every_switching_rule_gets_there_and_saves(folder: Path, rule: str) -> None:
    summary = summarise(simulate(MISSION.model_copy(update={"switching": rule}), folder))
    assert summary.coverage > 0.97
    assert sum(robot.sensing_s for robot in summary.robots) < 2 * summary.end_s


def test_a_claim_of_an_inspection_is_the_same_after_reading_the_trace_again(tmp_path: Path) -> None:
    """An inspection claims more than other solvers do; what the format does not hold of it is not in memory either."""
    simulation = Simulation(MISSION, TWO_ROOMS)
    second = Secondary(objective=1.0, status="optimal")
    claim = InspectionClaim(status="optimal", objective=2.0, bound=2.0, secondary=second)
    simulation.record.note(0.5, Note("replan", reason="inspection", claim=claim))
    told = simulation.record.trace(finished=True, scan_s=0.25)
    save(told, tmp_path / "trace.json")
    assert load(tmp_path / "trace.json").events == told.events


@pytest.mark.parametrize("kept", [True, False])
def test_ctrl_c_says_what_becomes_of_the_trace(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], kept: bool
) -> None:
    def interrupted(*arguments: Any, **options: Any) -> Trace:
        signal.raise_signal(signal.SIGINT)
        return simulate(*arguments, **options)

    monkeypatch.setattr(run, "simulate", interrupted)
    out = folder / "interrupted.json"
    words = ["react-opt", "simulate", str(folder / "mission.json"), *(["-o", str(out)] if kept else [])]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 130
    said = capsys.readouterr().err
    assert "best plan" not in said
    assert ("the trace so far is written and can be resumed" in said) is kept
    assert ("no trace is kept without -o" in said) is not kept
    if kept:
        stopped = load(str(out), "trace")
        assert stopped.status == "stopped"
        assert told(simulate(MISSION, folder, resume=stopped)) == told(simulate(MISSION, folder))
