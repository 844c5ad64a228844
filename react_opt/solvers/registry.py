"""The solvers by name, loaded when asked for; one that is missing is named, never replaced."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module

from react_opt.errors import MissingPartError, UsageError
from react_opt.solvers.backend import Abilities, Backend

DEFAULT = "highs"


@dataclass(frozen=True)
class Entry:
    """Where a backend is found.

    Parameters
    ----------
    library
        The module it cannot do without.
    install
        What to tell a user who has not got it.
    module, factory
        Module of react_opt and name of the class in it, called with the text behind the colon of the name, if
        any.
    variants
        Whether ``name:variant`` is a name too.
    """

    library: str
    install: str
    module: str
    factory: str
    variants: bool = False


BACKENDS = {
    "highs": Entry("highspy", "pip install highspy", "react_opt.solvers.highs_", "HighsBackend"),
}


@dataclass(frozen=True)
class Listing:
    """One line of the list of solvers.

    Parameters
    ----------
    name
        What to ask for.
    version
        Version of the library; None where it is missing.
    abilities
        What it can do; None where it is missing.
    missing
        What to do to have it; empty where it is there.
    """

    name: str
    version: str | None
    abilities: Abilities | None
    missing: str = ""


def backend(name: str = DEFAULT) -> Backend:
    """Return the backend of a name.

    Raises
    ------
    UsageError
        Where there is no such name.
    MissingPartError
        Where its library is not installed; the text says what to install.
    """
    base, colon, variant = name.partition(":")
    entry = BACKENDS.get(base)
    if entry is None or (colon and not (entry.variants and variant)):
        raise UsageError(f"there is no solver {name!r}; there are {', '.join(names())}")
    try:
        import_module(entry.library)
    except ImportError as error:
        raise MissingPartError(f"the solver {name!r} needs {entry.library}: {entry.install} ({error})") from error
    factory = getattr(import_module(entry.module), entry.factory)
    found: Backend = factory(variant) if colon else factory()
    return found


def names() -> list[str]:
    """Names of all solvers, installed or not."""
    return list(BACKENDS)


def installed() -> list[Listing]:
    """Return every solver with its version and abilities, or with what is missing."""
    listings = []
    for name in names():
        try:
            found = backend(name)
        except MissingPartError as error:
            listings.append(Listing(name, None, None, str(error)))
        else:
            listings.append(Listing(name, found.version, found.abilities))
    return listings
