"""Every command and every Python snippet of the README runs as written."""

from snippets import ROOT, blocks, run_page

README = ROOT / "README.md"


def test_the_readme_runs(tmp_path, monkeypatch, capsys):
    run_page(README, tmp_path, monkeypatch, capsys)


def test_there_are_snippets():
    assert [language for language, _ in blocks(README)].count("python") == 2
    assert [language for language, _ in blocks(README)].count("console") >= 2
