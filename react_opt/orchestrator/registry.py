"""The strategies by name. A new strategy is one file and one line here."""

from __future__ import annotations

from importlib import import_module

from react_opt.errors import UsageError
from react_opt.orchestrator.strategy import Strategy, StrategyOptions

STRATEGIES: dict[str, str] = {
    "oros": "oros:Oros",
    "react": "react:React",
    "react_plus": "react_plus:ReactPlus",
    "naive": "naive:Naive",
    "nearest": "nearest:Nearest",
    "nearest_areas": "nearest:NearestAreas",
    "cost_utility": "cost_utility:CostUtility",
    "cost_utility_areas": "cost_utility:CostUtilityAreas",
    "hungarian": "hungarian:Hungarian",
    "hungarian_areas": "hungarian:HungarianAreas",
    "market": "market:Market",
    "market_areas": "market:MarketAreas",
}
"""Per name the module of this package and the class, loaded when asked for."""


def strategy_names() -> tuple[str, ...]:
    """Return the names of all strategies."""
    return tuple(STRATEGIES)


def make_strategy(name: str, options: StrategyOptions) -> Strategy:
    """Return a new strategy for one mission.

    Parameters
    ----------
    name
        One of :func:`strategy_names`.
    options
        What it is told about the mission besides the belief.

    Raises
    ------
    UsageError
        Where there is no such strategy.
    """
    if name not in STRATEGIES:
        raise UsageError(f"strategy: expected one of {', '.join(STRATEGIES)}, found {name!r}")
    module, attribute = STRATEGIES[name].split(":")
    made: Strategy = getattr(import_module(f"react_opt.orchestrator.{module}"), attribute)(options)
    return made
