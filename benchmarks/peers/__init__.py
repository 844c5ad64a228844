"""Solvers side by side: every file of this folder registers its own with :func:`~benchmarks.peers.registry.peer`.

A solver of your own is one file more: see ``docs/add_your_solver.md``.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from benchmarks.peers import monoliths, nearest_first, ours, pyvrp_, routing, scipy_
from benchmarks.peers.registry import PEERS, Limits, Peer, Tell, needs, peer
from react_opt.errors import InputError

__all__ = ["PEERS", "Limits", "Peer", "Tell", "load_peers", "needs", "peer"]

SHIPPED = (monoliths, nearest_first, ours, pyvrp_, routing, scipy_)


def load_peers(files: list[str]) -> None:
    """Run files that register solvers.

    Raises
    ------
    InputError
        Where a file cannot be read or run, or registers nothing.
    """
    for number, file in enumerate(files):
        name = f"benchmarks_peer_{number}_{Path(file).stem}"
        if not Path(file).is_file():
            raise InputError.single(file, "", "expected a Python file that registers a solver")
        if name in sys.modules:
            continue
        before = dict(PEERS)
        spec = importlib.util.spec_from_file_location(name, file)
        if spec is None or spec.loader is None:
            raise InputError.single(file, "", "expected a Python file (.py)")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except Exception as error:  # whatever the user's file does wrong is said in one line
            raise InputError.single(file, "", f"cannot be run: {type(error).__name__}: {error}") from error
        if before == PEERS:
            raise InputError.single(file, "", "registers no solver: decorate a function with benchmarks.peers.peer")
