"""The solvers by name, loaded when asked for; one that is missing is named, never replaced."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module, metadata, util

from react_opt.errors import MissingPartError, UsageError
from react_opt.solvers.backend import Abilities, Backend

DEFAULT = "highs"


def _highs(variant: str) -> Backend:
    try:
        import_module("highspy")
    except ImportError as error:
        # OR-tools, loaded first, brings a libhighs.so.1 that highspy 1.15 and later cannot use.
        raise MissingPartError(
            f"highspy is installed but does not load: pip install 'highspy<1.15' ({error})"
        ) from error
    from react_opt.solvers.highs_ import HighsBackend

    return HighsBackend()


def _cp_sat(variant: str) -> Backend:
    from react_opt.solvers.cp_sat_ import ABILITIES
    from react_opt.solvers.worker_backend import WorkerBackend

    return WorkerBackend("cp-sat", metadata.version("ortools"), ABILITIES, "react_opt.solvers.cp_sat_:run")


def _scip(variant: str) -> Backend:
    from react_opt.solvers.ortools_ import ABILITIES
    from react_opt.solvers.worker_backend import WorkerBackend

    return WorkerBackend("scip", metadata.version("ortools"), ABILITIES, "react_opt.solvers.ortools_:run")


def _cvxpy(variant: str) -> Backend:
    from react_opt.solvers.cvxpy_ import ABILITIES, chosen
    from react_opt.solvers.worker_backend import WorkerBackend

    solver = chosen(variant)
    version = metadata.version("cvxpy")
    return WorkerBackend(f"cvxpy:{solver}", version, ABILITIES, "react_opt.solvers.cvxpy_:run", (solver,))


@dataclass(frozen=True)
class Entry:
    """Where a backend is found.

    Parameters
    ----------
    library
        The module that it cannot do without.
    install
        What to tell a user who has not got it.
    make
        Makes the backend from the text behind the colon of its name, empty for none.
    variants
        Whether ``name:variant`` is a name too.
    """

    library: str
    install: str
    make: Callable[[str], Backend]
    variants: bool = False


BACKENDS = {
    "highs": Entry("highspy", "pip install highspy", _highs),
    "cp-sat": Entry("ortools", "pip install ortools", _cp_sat),
    "scip": Entry("ortools", "pip install ortools", _scip),
    "cvxpy": Entry("cvxpy", "pip install cvxpy", _cvxpy, variants=True),
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

    Parameters
    ----------
    name
        One of :func:`names`; ``cvxpy`` alone is the first mixed-integer solver that cvxpy finds, and the backend's
        own name says which.

    Raises
    ------
    UsageError
        Where there is no such name.
    MissingPartError
        Where what it needs is not installed; the text says what to install.
    """
    base, colon, variant = name.partition(":")
    entry = BACKENDS.get(base)
    if entry is None or (colon and not (entry.variants and variant)):
        raise UsageError(f"there is no solver {name!r}; there are {', '.join(names())}")
    if util.find_spec(entry.library) is None:
        raise MissingPartError(f"the solver {name!r} needs {entry.library}: {entry.install}")
    return entry.make(variant)


def names() -> list[str]:
    """Names of the solvers, installed or not; ``cvxpy`` stands for ``cvxpy:NAME`` with a solver of cvxpy too."""
    return list(BACKENDS)


def installed() -> list[Listing]:
    """Return every solver with its version and abilities, or with what is missing; imports cvxpy."""
    listings = []
    for name in names():
        try:
            found = backend(name)
        except MissingPartError as error:
            listings.append(Listing(name, None, None, str(error)))
        else:
            listings.append(Listing(name, found.version, found.abilities))
            if name == "cvxpy":
                from react_opt.solvers.cvxpy_ import mip_solvers

                listings += [Listing(f"cvxpy:{s}", found.version, found.abilities) for s in mip_solvers()]
    return listings
