"""Files are written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from react_opt import jsonio
from react_opt.errors import InputError
from react_opt.jsonio import write_bytes, write_text


def test_a_failing_rename_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "plan.json"
    path.write_text("old")

    def fail(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(jsonio.os, "replace", fail)
    with pytest.raises(InputError, match=r"plan\.json: cannot be written: No space left on device"):
        write_text("new", path)
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["plan.json"]


def test_a_failing_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "plan.json"
    path.write_text("old")

    def fail(*_: Any) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(jsonio.os, "fsync", fail)
    with pytest.raises(InputError, match="Input/output error"):
        write_bytes(b"new", path)
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["plan.json"]


def test_an_existing_file_is_replaced_and_readable_by_others(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text("old")
    mask = os.umask(0o022)
    try:
        write_text("new", path)
    finally:
        os.umask(mask)
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == 0o644


def test_what_cannot_be_written_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot be written: No such file or directory"):
        write_text("x", tmp_path / "no" / "where.json")
    with pytest.raises(InputError, match="cannot be written: is a directory"):
        write_text("x", tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written: Not a directory"):
        write_text("x", tmp_path / "file" / "x.json")


def test_a_device_is_written_to_and_not_replaced() -> None:
    write_text("x", os.devnull)
    assert not Path(os.devnull).is_file()


def test_writing_to_a_link_writes_what_it_leads_to(tmp_path):
    # Run as root, a rename over the link made /dev/stdout a plain file.
    (tmp_path / "file").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "file")
    write_text("new", tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_text() == "new"
