"""What the answers of all solvers, side by side, say of each: no claim is believed that another answer contradicts.

Every plan has been replayed by the checker, so its value is a fact. A bound below it, or a proof that no plan
exists, is then false, whoever made it.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.trial import agreed

Run = Mapping[str, Any]
SOLVED = ("optimal", "infeasible")


@dataclass(frozen=True)
class Exposure:
    """An answer that is wrong.

    Parameters
    ----------
    peer, instance
        Whose, and where.
    fault
        ``plan`` (breaks a rule), ``bound`` (beaten by a checked plan, or not proven by its own certificate),
        ``infeasible`` (a checked plan exists), ``optimal`` (another plan is better) or ``path``.
    text
        What is wrong, with the numbers.
    """

    peer: str
    instance: str
    fault: str
    text: str

    def __str__(self) -> str:
        return f"{self.peer} on {self.instance}: {self.fault}: {self.text}"


@dataclass(frozen=True)
class Truth:
    """What is known of an instance from all answers together.

    Parameters
    ----------
    best, by
        Value of the best checked plan, and who found it first in time; None where there is none.
    bound
        The tightest bound that no checked plan contradicts; None where there is none.
    optimal
        Whether some solver proved its plan optimal and nobody contradicts it.
    infeasible
        Whether some solver proved that no plan exists and nobody contradicts it.
    """

    best: float | None
    by: str
    bound: float | None
    optimal: bool
    infeasible: bool


def is_right(run: Run) -> bool:
    """Whether a run holds a plan that the checker accepts."""
    return run.get("objective") is not None and not run["violations"] and run["status"] in ("optimal", "feasible")


def case_of(run: Run) -> str:
    """Return what tells an instance from others: where it came from."""
    return json.dumps(run["case"], sort_keys=True)


def by_instance(runs: Iterable[Run]) -> dict[str, list[Run]]:
    """Return the runs on each instance under whatever limits: what one of them found is held against all."""
    groups: dict[str, list[Run]] = defaultdict(list)
    for run in runs:
        groups[case_of(run)].append(run)
    return groups


def meetings(runs: Iterable[Run]) -> list[list[Run]]:
    """Return the runs that met on an instance under the same limits: what can be compared."""
    groups: dict[str, list[Run]] = defaultdict(list)
    for run in runs:
        limits = [run.get(key) for key in ("gap_asked", "limit_s", "threads", "seed")]
        groups[json.dumps([case_of(run), *limits])].append(run)
    return list(groups.values())


def truths_of(runs: Iterable[Run]) -> dict[str, Truth]:
    """Return what all answers establish of each instance, by :func:`case_of`."""
    return {case: truth_of(group) for case, group in by_instance(runs).items()}


def truth_of(runs: Sequence[Run]) -> Truth:
    """Return what all answers to one instance establish."""
    plans = [run for run in runs if is_right(run)]
    best = max((run["objective"] for run in plans), default=None)
    bounds = [run["bound"] for run in runs if run.get("bound") is not None]
    if best is None:
        return Truth(None, "", min(bounds, default=None), False, any(run["status"] == "infeasible" for run in runs))
    slack = agreed(best, plans[0]["tolerance"])
    near = [run for run in plans if run["objective"] >= best - slack]
    first = min(near, key=lambda run: run["wall_s"])
    standing = [bound for bound in bounds if bound >= best - slack]
    proven = any(run["status"] == "optimal" for run in near)
    return Truth(best, first["peer"], min(standing, default=None), proven, False)


def exposures(runs: Iterable[Run]) -> list[Exposure]:
    """Return everything that is wrong in a set of runs, in the order of the instances."""
    found: list[Exposure] = []
    for group in by_instance(runs).values():
        truth = truth_of(group)
        for run in group:
            found += [Exposure(run["peer"], run["instance"], *fault) for fault in _faults(run, group, truth)]
    return found


def _faults(run: Run, group: Sequence[Run], truth: Truth) -> list[tuple[str, str]]:
    faults = [("plan", text) for text in run.get("violations", [])[:1]]
    if truth.best is not None:
        slack = agreed(truth.best, run["tolerance"])
        if run["status"] == "infeasible":
            faults.append(("infeasible", f"{truth.by} has a checked plan of value {truth.best:.9g}"))
        bounds = [bound for _, _, bound in run.get("trajectory", []) if bound is not None]
        bounds += [run["bound"]] if run.get("bound") is not None else []
        if bounds and min(bounds) < truth.best - slack:
            faults.append(("bound", f"{min(bounds):.9g} is beaten by a checked plan of {truth.by}: {truth.best:.9g}"))
        elif run["status"] == "optimal" and is_right(run) and run["objective"] < truth.best - slack:
            faults.append(("optimal", f"{run['objective']:.9g} is beaten by {truth.by}: {truth.best:.9g}"))
        faults += _secondary(run, group, slack)
    if confirmation(run) == "refuted":
        proven = run["certified"]["bound"]
        text = f"its certificate proves {proven}, not the {run['bound']:.9g} that it claims"
        faults.append(("bound", text))
    return faults


def confirmation(run: Run) -> str:
    """Return what became of a bound's certificate.

    ``confirmed``: recomputed, and no worse than claimed. ``partly``: weaker than claimed, but the claim's notes say
    that the bound also rests on an enumeration that its certificate does not hold. ``refuted``: weaker, and nothing
    else was given. ``not recomputed``: not within its time. ``none``: no certificate.
    """
    certified, bound = run.get("certified"), run.get("bound")
    if not certified or bound is None:
        return "none"
    if certified["bound"] is None:
        return "refuted" if "certificate" in certified["why"] else "not recomputed"
    if certified["bound"] <= bound + 2 * agreed(bound, run["tolerance"]):
        return "confirmed"
    return "partly" if any("enumeration" in note for note in run.get("notes", [])) else "refuted"


def _secondary(run: Run, group: Sequence[Run], slack: float) -> list[tuple[str, str]]:
    """Of plans of the same value, the second objective of one that calls it least may not be undercut."""
    second = run.get("secondary")
    if not second or second["bound"] is None or not is_right(run) or run["status"] != "optimal":
        return []
    for other in group:
        theirs = other.get("secondary")
        if theirs and is_right(other) and theirs["objective"] is not None:
            same = abs(other["objective"] - run["objective"]) <= slack
            if same and theirs["objective"] < second["bound"] - 1e-6 * max(1.0, abs(second["bound"])):
                text = f"{second['bound']:.9g} is undercut by {other['peer']}: {theirs['objective']:.9g}"
                return [("second objective", text)]
    return []
