"""react_opt: planning engine for battery-powered robot fleets that explore a building against the clock.

``from react_opt import load, solve, check``: read an instance, solve it, replay the plan without any solver.
Importing the package loads no solver; each part comes with its first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from react_opt.certify import check
    from react_opt.errors import InputError, MissingPartError, ReactError, UsageError
    from react_opt.jsonio import json_schema, load, loads, parse, save
    from react_opt.planner import solve

_HOME = {
    "InputError": "errors",
    "MissingPartError": "errors",
    "ReactError": "errors",
    "UsageError": "errors",
    "check": "certify",
    "json_schema": "jsonio",
    "load": "jsonio",
    "loads": "jsonio",
    "parse": "jsonio",
    "save": "jsonio",
    "solve": "planner",
}

__all__ = [
    "InputError",
    "MissingPartError",
    "ReactError",
    "UsageError",
    "check",
    "json_schema",
    "load",
    "loads",
    "parse",
    "save",
    "solve",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"react_opt.{_HOME[name]}"), name)
