"""Every Python snippet of the README runs as written."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SNIPPETS = [part.split("```", 1)[0] for part in (ROOT / "README.md").read_text().split("```python\n")[1:]]


@pytest.mark.parametrize("number", range(len(SNIPPETS)))
def test_snippet_runs(number, tmp_path, monkeypatch):
    os.symlink(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    exec(compile(SNIPPETS[number], f"README snippet {number}", "exec"), {})


def test_there_are_snippets():
    assert len(SNIPPETS) == 2
