"""Solvers side by side: every file of this folder registers its own with :func:`~benchmarks.peers.registry.peer`.

A solver of your own is one file more: see ``docs/add_your_solver.md``.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.peers import monoliths, nearest_first, ours, pyvrp_, routing, scipy_
from benchmarks.peers.registry import PEERS, Limits, Peer, Tell, needs, peer
from react_opt.errors import InputError

__all__ = ["PEERS", "Limits", "Peer", "Tell", "load_peers", "needs", "peer"]

SHIPPED = (monoliths, nearest_first, ours, pyvrp_, routing, scipy_)


_loaded: dict[str, tuple[str, ...]] = {}


def load_peers(files: Sequence[str]) -> tuple[str, ...]:
    """Run files that register solvers, once each, and return the names that they registered.

    Raises
    ------
    InputError
        Where a file cannot be read or run, or registers nothing.
    """
    for file in files:
        if file not in _loaded:
            _loaded[file] = _registered(file, f"benchmarks_peer_{len(_loaded)}")
    return tuple(name for file in files for name in _loaded[file])


def _registered(file: str, module_name: str) -> tuple[str, ...]:
    if not Path(file).is_file():
        raise InputError.single(file, "", "expected a Python file that registers a solver")
    before = dict(PEERS)
    spec = importlib.util.spec_from_file_location(module_name, file)
    if spec is None or spec.loader is None:
        raise InputError.single(file, "", "expected a Python file (.py)")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever the user's file does wrong is said in one line
        raise InputError.single(file, "", f"cannot be run: {type(error).__name__}: {error}") from error
    names = tuple(name for name, entry in PEERS.items() if before.get(name) is not entry)
    if not names:
        raise InputError.single(file, "", "registers no solver: decorate a function with benchmarks.peers.peer")
    return names
