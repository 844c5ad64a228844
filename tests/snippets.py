"""Runs the commands and the Python snippets of a page as written.

The blocks of a page run in order in one folder, so a command may use what the one before it has written. What only
makes sense on somebody else's machine is not run and is listed here: installing, the README's first block (CI runs
it), and benchmarks, of which the options are tested and not the minutes.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from react_opt.cli import main

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NOT_RUN = ("pip install", "python3 -m venv", ".venv/bin/", "bash .ci/run", "cd ")
SHOWN_ONLY = {"bash", "text", "literalinclude", "image", "toctree", "eval"}


def blocks(page: Path) -> list[tuple[str, str]]:
    """Return language and text of the blocks of a page that run."""
    return [(language, text) for language, text in BLOCK.findall(page.read_text()) if language not in SHOWN_ONLY]


def run_page(page, folder, monkeypatch, capsys):
    """Run all blocks of a page in a folder."""
    for name in ("examples", "docs", "benchmarks"):
        os.symlink(ROOT / name, folder / name)
    monkeypatch.chdir(folder)
    names: dict[str, object] = {}
    for number, (language, text) in enumerate(blocks(page)):
        if language == "python" and re.match(
            r"# \w+\.py\n", text
        ):  # a file of its own, imported in a process of its own
            name = text[2 : text.index("\n")]
            (folder / name).write_text(text)
            subprocess.run(
                [sys.executable, "-c", f"import {name[:-3]}"], check=True, env=os.environ | {"PYTHONPATH": "."}
            )
        elif language == "python":
            exec(compile(text, f"{page.name}, block {number}", "exec"), names)
        elif language == "json":
            json.loads(text)
        else:
            assert language == "console", f"{page}: block {number} is {language!r}, which nobody runs"
            for line in text.replace("\\\n", " ").splitlines():
                run(line, monkeypatch, capsys)


def run(line, monkeypatch, capsys):
    """Run a line of a console block; react-opt runs in this process, which has loaded everything already."""
    words = shlex.split(line, comments=True)
    if not words or line.startswith(NOT_RUN):
        return
    if words[:2] == ["react-opt", "bench"]:
        assert set(options(words)) <= set(options(bench_help(monkeypatch, capsys).split())), line
    elif words[0] == "react-opt":
        monkeypatch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as end:
            main()
        captured = capsys.readouterr()
        assert end.value.code == 0, f"{line}\n{captured.err}"
    elif words[0] == "python" and words[1 + (words[1] == "-m")].startswith("benchmarks"):
        program = words[1:3] if words[1] == "-m" else words[1:2]
        done = subprocess.run([sys.executable, *program, "--help"], capture_output=True, text=True, check=True)
        assert set(options(words)) <= set(options(done.stdout.replace(",", " ").split())), line
    else:
        assert words[0] == "python", f"{line}: nobody runs this"
        done = subprocess.run([sys.executable, *words[1:]], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


def options(words):
    """Return the options among words."""
    return [word for word in words if word.startswith("--")]


def bench_help(monkeypatch, capsys):
    """Return what ``react-opt bench --help`` says."""
    monkeypatch.setattr(sys, "argv", ["react-opt", "bench", "--help"])
    with pytest.raises(SystemExit):
        main()
    return capsys.readouterr().out.replace(",", " ")
