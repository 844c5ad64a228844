"""The role of a strategy: from the belief to orders, whenever there is something new."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from react_opt.orchestrator.belief import Belief
from react_opt.plan import Claim

Point = tuple[float, float]


@dataclass(frozen=True)
class Order:
    """What one robot is to do until it gets another order; it stays in force when no new one comes.

    Parameters
    ----------
    robot
        Its id.
    path_m
        Way points from where the robot is to its goal, m; empty to stand still.
    target
        Id of the local target or area this serves, None for none.
    sensing
        Whether the sensors may be on at all; the switching rule of the mission decides within that.
    """

    robot: str
    path_m: tuple[Point, ...] = ()
    target: str | None = None
    sensing: bool = True


@dataclass(frozen=True)
class Note:
    """An entry for the trace: the fields of :class:`react_opt.trace.TraceEvent` but the time."""

    type: str
    robot: str | None = None
    target: str | None = None
    reason: str | None = None
    x_m: float | None = None
    y_m: float | None = None
    size_m2: float | None = None
    claim: Claim | None = None


@dataclass(frozen=True)
class Decision:
    """New orders, for the robots whose orders change, and what there is to record.

    ``done`` is True when the strategy has nothing left to do: the mission may end once all robots stand.
    """

    orders: Sequence[Order] = ()
    notes: Sequence[Note] = ()
    done: bool = False


class Strategy(Protocol):
    """Decides from the belief alone. It may keep a state of its own; it is created anew for each mission.

    Decisions must not depend on the clock of the machine: solvers are called with work limits and one thread,
    so that the same mission gives the same trace.
    """

    def decide(self, belief: Belief) -> Decision:
        """Return what changes now.

        The simulator calls it at most once a second while the map changes, at once when a robot arrives, gets stuck or
        dies or its link comes back, and every 5 s as long as a robot stands idle and the
        last decision was not ``done``.
        """
        ...


@dataclass
class StrategyOptions:
    """What every strategy is told about the mission besides the belief.

    Parameters
    ----------
    delta
        Share of an area at which it counts as explored.
    step_s, horizon_s
        Step of the high-level plan and time of the whole mission, s.
    window_steps
        Steps that OROS plans ahead, None for all that are left.
    postpone_below
        Local targets with a smaller priority are put off to the inspection.
    seed
        Seed of everything random.
    """

    delta: float
    step_s: float
    horizon_s: float
    window_steps: int | None
    postpone_below: float
    seed: int = 0
    extra: dict[str, float] = field(default_factory=dict)
