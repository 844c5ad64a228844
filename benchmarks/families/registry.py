"""Where instance families put themselves: one decorator, seeded, with named sizes from tiny to thousands of cells."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol


class Maker(Protocol):
    """Makes an instance, as the JSON of its kind, from a seed and the family's parameters."""

    def __call__(self, *, seed: int, **parameters: Any) -> dict[str, Any]: ...


@dataclass(frozen=True)
class Family:
    """A family of instances.

    Parameters
    ----------
    name, kind
        Its name, and the kind of its instances: ``oros``, ``assignment`` or ``inspection``.
    make
        Makes one.
    sizes
        Parameters by the name of a size, small ones first.
    about
        What is hard in it, in one line.
    """

    name: str
    kind: str
    make: Maker
    sizes: Mapping[str, Mapping[str, Any]]
    about: str


FAMILIES: dict[str, Family] = {}


def family(
    kind: str, about: str, **sizes: Mapping[str, Any]
) -> Callable[[Callable[..., dict[str, Any]]], Callable[..., dict[str, Any]]]:
    """Register a function ``(..., seed)`` that returns an instance as JSON data under its own name.

    Parameters
    ----------
    kind
        Kind of the instances.
    about
        What is hard in them, in one line.
    **sizes
        Parameters of the function by the name of a size, small ones first.
    """

    def register(make: Callable[..., dict[str, Any]]) -> Callable[..., dict[str, Any]]:
        name = make.__name__
        if name in FAMILIES:
            raise ValueError(f"there are two families {name!r}")
        FAMILIES[name] = Family(name, kind, make, sizes, about)
        return make

    return register
