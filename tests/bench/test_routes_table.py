"""The table of the decomposition: results are kept and not made again, wrong names are refused."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import pytest

BENCHMARKS = Path(__file__).resolve().parent.parent.parent / "benchmarks"


@pytest.fixture
def table(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return importlib.import_module("routes")


def test_what_is_kept_is_not_run_again(
    table: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run that was cut off while it was written down is made anew; the others are read, and the ratios are theirs."""
    file, made = tmp_path / "results.jsonl", []
    times = {"routes": 2.0, "highs": 8.0, "scip": 32.0}

    def solve(name: str) -> Any:
        made.append(name)
        return table.Outcome("optimal", 5.0, 5.0, times[name])

    monkeypatch.setattr(table, "warm_up", lambda kind, _: made.append(f"warm-up of {kind}"))
    monkeypatch.setattr(table, "decomposed", lambda row, *_: solve("routes"))
    monkeypatch.setattr(table, "by_peer", lambda name, row, *_: solve(name))
    monkeypatch.setattr(table, "TABLE", [row for row in table.TABLE if row.group == "large"])
    words = ["routes.py", "--groups", "large", "--peers", "highs", "scip", "--results", str(file)]
    monkeypatch.setattr("sys.argv", words)
    table.main()
    assert made == ["warm-up of oros", "routes", "highs", "scip"]
    printed = capsys.readouterr().out
    assert "best peer: 4.0 times" in printed
    assert "scip: 16.0 times" in printed
    file.write_text(file.read_text()[:-9])
    made.clear()
    table.main()
    assert made == ["scip"]
    assert capsys.readouterr().out == printed
    assert len(file.read_text().splitlines()) == 3


def test_a_group_that_does_not_exist_is_refused(
    table: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["routes.py", "--groups", "smal"])
    with pytest.raises(SystemExit) as ended:
        table.main()
    assert ended.value.code == 2
    assert "invalid choice: 'smal'" in capsys.readouterr().err
