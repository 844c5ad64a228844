"""The paper's figures: what they are made of, and that a campaign takes up where it was stopped."""

from __future__ import annotations

import numpy as np
import pytest
from small_trace import scripted

from benchmarks import paper
from react_opt import save
from react_opt.instance import Mission
from react_opt.report.paper_figures import energies, energy_table, on_common_times


def told(run: paper.Run, until_s: float = 60.0):
    """Return a trace that stands in for a run: the scripted one, with the run's mission."""
    trace = scripted(until_s=until_s)
    return trace.model_copy(
        update={"mission": trace.mission.model_copy(update=run._asdict() | {"robots": trace.mission.robots})}
    )


def test_a_campaign_has_what_every_figure_needs(tmp_path):
    wanted = paper.runs(seeds=2, most=2)
    assert len(wanted) == len(set(wanted)) == 2 * 2 * 2 + 2 + 2 * 2
    assert len({run.name for run in wanted}) == len(wanted)
    files = paper.draw({run: told(run) for run in wanted}, tmp_path, ".svg")
    assert all(file.stat().st_size > 100 for file in files)
    again = paper.draw({run: told(run) for run in wanted}, tmp_path, ".svg")
    assert [file.read_bytes() for file in files] == [file.read_bytes() for file in again]


def test_a_mission_that_has_been_simulated_is_not_simulated_again(tmp_path, monkeypatch):
    run = paper.Run("react", 2, 1)
    mission = run.mission()
    assert isinstance(mission, Mission)
    trace = scripted().model_copy(update={"mission": mission})
    save(trace, tmp_path / run.name)
    monkeypatch.setattr(paper, "simulate", lambda *_: pytest.fail("simulated"))
    assert paper.trace_of(run, tmp_path).mission == mission
    other = run._replace(seed=2)
    save(trace, tmp_path / other.name)  # the file of another mission
    with pytest.raises(pytest.fail.Exception):
        paper.trace_of(other, tmp_path)


def test_coverage_is_compared_at_common_times_and_stays_when_a_mission_ends():
    short, long = scripted(until_s=20.0), scripted()
    times, known = on_common_times([short, long])
    assert times.tolist() == list(range(61))
    assert known[0, 20:].tolist() == [short.frames[-1].coverage] * 41
    assert known[1, 30] == next(frame.coverage for frame in long.frames if frame.t_s == 30.0)
    assert (np.diff(known) >= 0).all()


def test_energies_are_what_the_batteries_lost():
    trace = scripted()
    rows = energies([(trace, trace)])
    assert [row.robot for row in rows] == ["r1", "r2"]
    assert rows[0].switched_j == pytest.approx(60 * (9.0 + 16.9))
    assert rows[1].switched_j == pytest.approx(60 * 9.0 + 48 * 16.9)  # 12 s with sensors off
    assert rows[0].saving == 0
    assert energy_table(rows).splitlines()[2] == "| react | 2 | r1 | 1554 | 1554 | 0 | 0.0% |"
