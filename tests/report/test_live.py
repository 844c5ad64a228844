import pytest

from react_opt.report.live import share_bar


def test_nobody_watches_where_there_is_no_terminal() -> None:
    with share_bar("recomputing the bound") as progress:
        assert progress is None


def test_a_bar_on_a_terminal_shows_the_share(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")
    with share_bar("recomputing the bound") as progress:
        assert progress is not None
        progress(0.25)
    assert "25 %" in capsys.readouterr().err
