"""The command line explains itself: examples that hold, and completion of commands, options and values."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys

import pytest

from react_opt.cli import main

COMMANDS = ["build", "solve", "check", "simulate", "show", "bench", "schema", "solvers"]


def help_of(command, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["react-opt", command, "--help"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_examples_whose_options_exist(command, monkeypatch, capsys):
    text = help_of(command, monkeypatch, capsys)
    examples = re.findall(rf"react-opt {command}.*$", text.split("Example", 1)[1], re.MULTILINE)
    assert examples
    for example in examples:
        for word in shlex.split(example)[2:]:
            if word.startswith("-"):
                assert re.search(rf"^\s+.*{word}\b", text.split("Options:")[1].split("Examples:")[0], re.MULTILINE), (
                    word
                )


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("react-opt si", {"simulate"}),
        ("react-opt show --in", {"--instance"}),
        ("react-opt schema oros", {"oros", "oros_plan"}),
        ("react-opt simulate --strategy rea", {"react"}),
        ("react-opt solve --solver hi", {"highs"}),
    ],
)
def test_the_shell_completes_what_is_typed(typed, expected):
    words = typed.split()
    environment = os.environ | {
        "_REACT_OPT_COMPLETE": "complete_bash",
        "COMP_WORDS": typed,
        "COMP_CWORD": str(len(words) - 1),
    }
    script = "import sys; sys.argv = ['react-opt']; from react_opt.cli import app; app(prog_name='react-opt')"
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True)
    found = {line.split(",")[-1] for line in done.stdout.split()}
    assert expected <= found, done.stderr
