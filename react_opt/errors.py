"""Errors a user can act on. Everything raised on purpose derives from :class:`ReactError`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class ReactError(Exception):
    """Base of every error that react_opt raises on purpose; its text is meant for the user."""


@dataclass(frozen=True)
class Fault:
    """One fault of one file.

    Parameters
    ----------
    file
        Name of the file, ``-`` for standard input, ``<data>`` for data that came from no file.
    place
        Where in the file, for instance ``robots[1].start``; empty for the file as a whole.
    message
        What was expected there, and what was found.
    """

    file: str
    place: str
    message: str

    def __str__(self) -> str:
        line = ": ".join(part for part in (self.file, self.place, self.message) if part)
        # Names in a file may hold line breaks or halves of surrogate pairs: shown escaped, a fault stays one line
        # that every terminal prints.
        return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in line)


class InputError(ReactError):
    """Bad input: every fault of a file at once, one line each.

    Parameters
    ----------
    faults
        The faults, at least one.
    """

    def __init__(self, faults: Sequence[Fault]) -> None:
        self.faults = tuple(faults)
        super().__init__("\n".join(str(fault) for fault in self.faults))

    @classmethod
    def single(cls, file: str, place: str, message: str) -> InputError:
        """Return an error with one fault."""
        return cls([Fault(file, place, message)])


class UsageError(ReactError):
    """The call itself makes no sense: an unknown option value, a combination that is not defined."""


class MissingPartError(ReactError):
    """An optional part is not installed; the text names what to install."""
