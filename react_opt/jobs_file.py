"""A file of JSON lines that one process at a time appends to, whole lines only."""

from __future__ import annotations

import contextlib
import fcntl
import json
import logging
import os
import stat
import time
from collections.abc import Iterator, Mapping
from typing import Any, BinaryIO

from react_opt.errors import InputError, UsageError


def read_lines(file: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """Return the lines of a results file; a broken one at its end is left out.

    Raises
    ------
    InputError
        Where the file cannot be read, or a line is no JSON object.
    """
    name = os.fspath(file)
    try:
        with open(name, "rb") as handle:
            return _parsed(handle.read(), name)[0]
    except OSError as error:
        raise InputError.single(name, "", f"cannot be read: {error.strerror or error}") from None


@contextlib.contextmanager
def opened(file: str | os.PathLike[str], kind: str | None = None) -> Iterator[tuple[BinaryIO, list[dict[str, Any]]]]:
    """Open a results file to append to, alone, and yield it with the lines that it holds.

    Parameters
    ----------
    file
        The file, which is made where there is none. A broken line at its end, which a kill or a full disk left behind,
        is cut off, and the ``react_opt`` logger says so.
    kind
        What the first line says of its ``kind``; None for anything.

    Raises
    ------
    UsageError
        Where another process has it open.
    InputError
        Where it cannot be read or written, or holds something else; it is then left as it was.
    """
    name = os.fspath(file)
    try:
        handle = open(name, "a+b", buffering=0)  # noqa: SIM115  (closed below)
        regular = stat.S_ISREG(os.fstat(handle.fileno()).st_mode)
    except OSError as error:
        raise InputError.single(name, "", f"cannot be written: {error.strerror or error}") from None
    with handle:
        if not regular:
            raise InputError.single(name, "", "cannot be written: expected a regular file")
        if not _locked(handle):
            raise UsageError(f"{name}: another process is working on it")
        handle.seek(0)
        content = handle.read()
        lines, whole = _parsed(content, name)
        if (content and not lines) or (lines and kind is not None and lines[0].get("kind") != kind):
            raise InputError.single(name, "", "holds something else than results: expected another file, or none")
        if whole < len(content):
            logging.getLogger("react_opt").warning(
                "%s: its last line is broken, as a kill may leave it: it is cut off, and its job runs again", name
            )
            handle.truncate(whole)
        yield handle, lines


def _locked(handle: BinaryIO) -> bool:
    """Lock a file. The worker that a process was about to start when it was killed holds the lock a moment longer."""
    for wait_s in (0.0, 0.05, 0.2, 0.5, 1.0):
        time.sleep(wait_s)
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
    return False


def append(handle: BinaryIO, line: Mapping[str, Any]) -> None:
    """Append one line in one write, and see that it is on the disk.

    Raises
    ------
    InputError
        Where it cannot be written, as on a full disk: what is there of the line is cut off at the next opening.
    """
    data = json.dumps(line, allow_nan=False).encode() + b"\n"
    try:
        while data:
            data = data[handle.write(data) :]
        os.fsync(handle.fileno())
    except OSError as error:
        text = f"cannot be written: {error.strerror or error}; the same command goes on from here"
        raise InputError.single(str(handle.name), "", text) from None


def _parsed(content: bytes, name: str) -> tuple[list[dict[str, Any]], int]:
    """Return the lines, and how many bytes they take; a last line that is no JSON, or lacks its end, is left out."""
    lines: list[dict[str, Any]] = []
    parts = content.split(b"\n")
    whole = 0
    for number, line in enumerate(parts[:-1], start=1):
        try:
            data = json.loads(line)
        except ValueError:
            if lines and not b"".join(parts[number:]):
                break
            data = None
        if not isinstance(data, dict):
            raise InputError.single(name, f"line {number}", "expected a JSON object")
        lines.append(data)
        whole += len(line) + 1
    return lines, whole
