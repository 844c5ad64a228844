"""Reading other people's text files: every fault names the file, the line and what was expected."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from react_opt.errors import InputError

MAX_BYTES = 100_000_000


def lines_of(file: str) -> list[str]:
    """Return the lines of a text file.

    Raises
    ------
    InputError
        Where it cannot be read.
    """
    try:
        path = Path(file)
        if path.stat().st_size > MAX_BYTES:
            raise InputError.single(file, "", f"expected at most {MAX_BYTES} bytes")
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise InputError.single(file, "", f"cannot be read: {error.strerror or error}") from None


def fault(file: str, place: str, message: str) -> NoReturn:
    """Raise the one fault of a file."""
    raise InputError.single(file, place, message)


def number(file: str, place: str, text: str) -> float:
    """Return a finite number, or say where none stands."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        fault(file, place, f"expected a number, found {text[:40]!r}")
    return value


@dataclass
class Words:
    """The words of a file one after the other, as formats without lines have them."""

    file: str
    words: list[tuple[int, str]]
    at: int = 0

    @classmethod
    def of(cls, file: str) -> Words:
        """Return the words of a file."""
        lines = lines_of(file)
        return cls(file, [(k, word) for k, line in enumerate(lines, start=1) for word in line.split()])

    def next(self, what: str) -> float:
        """Return the next number, which is ``what``."""
        if self.at >= len(self.words):
            fault(self.file, "end of file", f"expected {what}, found nothing more")
        line, word = self.words[self.at]
        self.at += 1
        return number(self.file, f"line {line}", word)

    def count(self, what: str, least: int = 1) -> int:
        """Return the next number, a whole one."""
        value = self.next(what)
        if value != int(value) or value < least:
            line = self.words[self.at - 1][0]
            fault(self.file, f"line {line}", f"expected {what}, a whole number >= {least}, found {value:g}")
        return int(value)
