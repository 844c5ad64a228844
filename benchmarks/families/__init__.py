"""Seeded families of instances, as JSON dictionaries of the kinds ``oros``, ``assignment`` and ``inspection``.

Every file of this folder registers its families with :func:`~benchmarks.families.registry.family`. But for the
factory, which is built from a map, nothing of react_opt is imported: they can be handed to any other solver.
"""

from __future__ import annotations

from .assignments import conflicts, generalised, plain
from .factory import factory
from .floors import corridor, tree
from .graphs import metric_complete
from .grids import chargers, tight_grid, walled_grid
from .inspections import inspection_floor, inspection_tight
from .registry import FAMILIES, Family, family

__all__ = [
    "FAMILIES",
    "Family",
    "chargers",
    "conflicts",
    "corridor",
    "factory",
    "family",
    "generalised",
    "inspection_floor",
    "inspection_tight",
    "metric_complete",
    "plain",
    "tight_grid",
    "tree",
    "walled_grid",
]
