"""What comes out: plans, each with the claim its solver makes, as frozen pydantic models."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from react_opt.instance import MAX_COUNT, Part

Status = Literal["optimal", "feasible", "infeasible", "no_plan"]
Limit = Literal["time", "memory", "work", "interrupt", "none"]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Index = Annotated[int, Field(strict=True, ge=0, le=MAX_COUNT)]
Name = Annotated[str, Field(strict=True)]
Flag = Annotated[bool, Field(strict=True)]
MAX_DEPTH = 50  # of the free-form parts of a claim


class InstanceRef(Part):
    """Which instance a plan belongs to: its name and the SHA-256 of its canonical JSON."""

    name: Name
    sha256: Name


class Claim(Part):
    """What a solver says of its own result; the checker decides whether it is true.

    Parameters
    ----------
    status
        ``optimal``, ``feasible`` (a plan, not proven best), ``infeasible`` (proven) or ``no_plan``.
    objective, bound
        Value of the plan and a proven upper bound on any plan's value; None where unknown.
    gap
        ``|bound - objective| / max(|objective|, 1e-9)``, a fraction; None where unknown.
    limit
        What stopped the search, ``none`` when nothing did.
    method
        How it was solved, and why where the choice was forced.
    solver, versions, seed, threads, settings
        What it was solved with.
    wall_s
        Seconds by phase: build, greedy, solve, check.
    certificate
        What ``check --bound`` needs to recompute the bound; None where there is none.
    reason
        For ``infeasible`` and ``no_plan``: which robot and which rule, in one line.
    """

    status: Status
    objective: Number | None = None
    bound: Number | None = None
    gap: Number | None = None
    limit: Limit = "none"
    method: Name = ""
    solver: Name = ""
    versions: dict[str, str] = {}
    seed: Annotated[int, Field(strict=True)] = 0
    threads: Annotated[int, Field(strict=True)] = 1
    settings: dict[str, Any] = {}
    wall_s: dict[str, Number] = {}
    certificate: dict[str, Any] | None = None
    reason: str | None = None

    @field_validator("settings", "certificate")
    @classmethod
    def _can_be_written(cls, value: dict[str, Any] | None) -> dict[str, Any] | None:
        _writable(value, MAX_DEPTH)
        return value


def _writable(value: Any, depth: int) -> None:
    """Refuse free-form data with a NaN or an infinity, which JSON cannot hold, or nested absurdly deep."""
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("expected finite numbers only")
    if isinstance(value, dict | list | tuple):
        if depth == 0:
            raise ValueError(f"expected at most {MAX_DEPTH} levels of nesting")
        for part in value.values() if isinstance(value, dict) else value:
            _writable(part, depth - 1)


def gap_of(objective: float | None, bound: float | None) -> float | None:
    """Return ``|bound - objective| / max(|objective|, 1e-9)``, None where either is unknown."""
    if objective is None or bound is None:
        return None
    return abs(bound - objective) / max(abs(objective), 1e-9)


class PlanDocument(Part):
    """Base of a plan file."""

    kind: str
    schema_version: Literal[1] = 1
    instance: InstanceRef
    claim: Claim


# --- oros ---


class OrosStep(Part):
    """One instant of one robot.

    ``cell`` is None while on an arc of several steps; ``arc`` is the index in ``travel[]`` of the arc started
    at ``t``; ``charging_j`` is credited at ``t``; ``battery_j`` is ``b[r,t]``.
    """

    t: Index
    cell: Name | None
    arc: Index | None = None
    speed_m_s: Number | None = None
    sensing: Flag = False
    charging_j: Number = 0.0
    battery_j: Number


class OrosRobotPlan(Part):
    """A robot's steps, one per t = start_step..T."""

    id: Name
    steps: tuple[OrosStep, ...]


class Explored(Part):
    """A newly explored cell: when, and by whom."""

    cell: Name
    step: Index
    robot: Name


class OrosPlanObjective(Part):
    """Parts of the objective: coverage, ``sigma * sum b[r,T]``, ``sum b[r,T]`` in J, and the total."""

    coverage: Number
    battery: Number
    battery_j: Number
    total: Number


class OrosPlan(PlanDocument):
    """A plan of an ``oros`` instance."""

    kind: Literal["oros_plan"] = "oros_plan"
    robots: tuple[OrosRobotPlan, ...] = ()
    explored: tuple[Explored, ...] = ()
    objective: OrosPlanObjective | None = None


# --- assignment ---

AssignmentReason = Literal["unreachable", "zone", "energy", "conflict", "outbid", "no_gain"]
SkipReason = Literal["time", "battery", "unreachable", "outbid"]


class Assigned(Part):
    """A robot takes a target."""

    robot: Name
    target: Name


class Deferred(Part):
    """A target that nobody takes now, why, and what forcing it in would lose (None where not tested)."""

    target: Name
    reason: AssignmentReason
    loss: Number | None = None


class AssignmentPlan(PlanDocument):
    """A plan of an ``assignment`` instance."""

    kind: Literal["assignment_plan"] = "assignment_plan"
    assigned: tuple[Assigned, ...] = ()
    deferred: tuple[Deferred, ...] = ()


# --- inspection ---


class Secondary(Part):
    """The second objective of an inspection: route time in s, or energy in J, summed over robots; minimised."""

    objective: Number | None = None
    bound: Number | None = None
    status: Status


class InspectionClaim(Claim):
    """A claim on the value visited, with the second objective beside it."""

    secondary: Secondary | None = None


class Stop(Part):
    """A visit: arrival and departure in s from now, battery on departure in J."""

    target: Name
    arrive_s: Number
    leave_s: Number
    battery_j: Number


class InspectionRoute(Part):
    """A robot's route: its stops in order, its end place, and when and with what battery it finishes."""

    robot: Name
    stops: tuple[Stop, ...]
    end: Name | None = None
    finish_s: Number
    finish_battery_j: Number


class Skipped(Part):
    """A target that is not visited, why, and what forcing it in would lose (None where not tested)."""

    target: Name
    reason: SkipReason
    loss: Number | None = None


class InspectionPlan(PlanDocument):
    """A plan of an ``inspection`` instance; ``t_dpi_s`` is the last finish, s."""

    kind: Literal["inspection_plan"] = "inspection_plan"
    claim: InspectionClaim
    routes: tuple[InspectionRoute, ...] = ()
    t_dpi_s: Number | None = None
    skipped: tuple[Skipped, ...] = ()


Plan = OrosPlan | AssignmentPlan | InspectionPlan
PLAN_KINDS: dict[str, type[PlanDocument]] = {
    "oros_plan": OrosPlan,
    "assignment_plan": AssignmentPlan,
    "inspection_plan": InspectionPlan,
}
