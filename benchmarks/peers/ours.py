"""react_opt itself, as ``react-opt solve`` runs it."""

from __future__ import annotations

from typing import Any

from benchmarks.peers.registry import Limits, Tell, peer
from react_opt import solve


@peer("react_opt", ("oros", "assignment", "inspection"), about="this package, its own methods", package="react_opt")
def react_opt(instance: Any, limits: Limits, tell: Tell) -> Any:
    """Solve with the method that the package chooses."""
    return solve(
        instance, time_limit_s=limits.time_s, threads=limits.threads, seed=limits.seed, gap=limits.gap or None,
        explain=False, on_progress=tell,
    )  # fmt: skip
