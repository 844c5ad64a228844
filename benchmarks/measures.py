"""Numbers that compare solvers fairly: what was not solved counts at the limit, nothing is averaged over the rest."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.verdicts import SOLVED, Exposure, Truth, case_of, is_right, meetings, truths_of

SHIFT_S = 1.0
GAP_POINTS = 60
Run = Mapping[str, Any]


def is_solved(run: Run, wrong: set[tuple[str, str]]) -> bool:
    """Whether a run ended with a proof (or the gap asked for) that nothing contradicts, within its limit."""
    if (run["peer"], run["instance"]) in wrong or run["status"] not in (*SOLVED, "feasible"):
        return False
    if run["status"] == "feasible":
        gap, asked = gap_of(run), run["gap_asked"]
        return is_right(run) and asked > 0 and gap is not None and gap <= asked * (1 + 1e-6)
    return run["status"] == "infeasible" or is_right(run)


def gap_of(run: Run) -> float | None:
    """Return the gap of a run's last plan and bound, None where either is unknown."""
    if run.get("objective") is None or run.get("bound") is None:
        return None
    return float(abs(run["bound"] - run["objective"]) / max(abs(run["objective"]), 1e-9))


def counted_s(run: Run, wrong: set[tuple[str, str]]) -> float:
    """Return the time of a solved run, the limit of any other, s."""
    return min(float(run["wall_s"]), float(run["limit_s"])) if is_solved(run, wrong) else float(run["limit_s"])


def shifted_mean(values: Sequence[float], shift: float = SHIFT_S) -> float:
    """Return ``exp(mean(log(x + shift))) - shift``, the shifted geometric mean."""
    return math.exp(sum(math.log(value + shift) for value in values) / len(values)) - shift


@dataclass(frozen=True)
class Standing:
    """How one solver did on a set of instances.

    Parameters
    ----------
    peer, version
        The solver.
    runs, solved
        Instances it met, and those it solved.
    best
        Instances on which no other solver has a better plan.
    without
        Instances on which it has no plan at all (refused, killed, nothing found).
    mean_s
        Shifted geometric mean of the times, unsolved ones at the limit, s.
    primal
        Shifted geometric mean of the primal integrals, as shares of the limit (shift 0.01); None where no
        instance has a plan.
    wrong
        Its instances on which an answer was exposed.
    late
        Runs that returned after 1.1 times the limit and 0.1 s.
    """

    peer: str
    version: str
    runs: int
    solved: int
    best: int
    without: int
    mean_s: float
    primal: float | None
    wrong: int
    late: int


def standings(runs: Sequence[Run], exposed: Sequence[Exposure]) -> list[Standing]:
    """Return how each solver did, the one that solved most (then the fastest) first."""
    met = {(run["peer"], run["instance"]) for run in runs}
    exposed = [item for item in exposed if (item.peer, item.instance) in met]
    wrong = {(item.peer, item.instance) for item in exposed}
    truths = truths_of(runs)
    rows = []
    for peer in dict.fromkeys(run["peer"] for run in runs):
        mine: list[tuple[Run, Truth]] = [(run, truths[case_of(run)]) for run in runs if run["peer"] == peer]
        integrals = [value for run, truth in mine if (value := primal_integral(run, truth.best)) is not None]
        rows.append(
            Standing(
                peer=peer,
                version=next((run["version"] for run, _ in mine if run.get("version")), "unknown"),
                runs=len(mine),
                solved=sum(is_solved(run, wrong) for run, _ in mine),
                best=sum(has_best(run, truth) for run, truth in mine),
                without=sum(not is_right(run) and run["status"] != "infeasible" for run, _ in mine),
                mean_s=shifted_mean([counted_s(run, wrong) for run, _ in mine]),
                primal=shifted_mean(integrals, 0.01) if integrals else None,
                wrong=sum(name == peer for name, _ in wrong),
                late=sum(run.get("wall_s", 0.0) > 1.1 * run["limit_s"] + 0.1 for run, _ in mine),
            )
        )
    return sorted(rows, key=lambda row: (-row.solved / row.runs, row.mean_s))


def has_best(run: Run, truth: Truth) -> bool:
    """Whether no checked plan of the instance is better than this run's (up to 1e-6 of its value)."""
    if truth.best is None:
        return bool(run["status"] == "infeasible")
    return is_right(run) and float(run["objective"]) >= truth.best - 1e-6 * abs(truth.best) - 1e-9


def primal_integral(run: Run, best: float | None) -> float | None:
    """Return the mean over the limit of the primal gap, 1 while there is no plan (Berthold, 2013).

    Parameters
    ----------
    run
        A run with its trajectory.
    best
        Value of the best checked plan; None where there is none, and then nothing is returned.
    """
    if best is None:
        return None
    limit, gap, since, total = float(run["limit_s"]), 1.0, 0.0, 0.0
    for at_s, incumbent, _ in run.get("trajectory", []) if is_right(run) else []:
        at_s = min(at_s, limit)
        if incumbent is None:
            continue
        total += gap * (at_s - since)
        since, gap = at_s, min(gap, primal_gap(incumbent, best))
    return (total + gap * (limit - since)) / limit


def primal_gap(value: float, best: float) -> float:
    """Return ``|best - value| / max(|best|, |value|)``, at most 1."""
    if abs(best - value) <= 1e-9 * max(1.0, abs(best)):
        return 0.0
    return min(1.0, abs(best - value) / max(abs(best), abs(value))) if best * value >= 0 else 1.0


def profile(runs: Sequence[Run], wrong: set[tuple[str, str]]) -> dict[str, NDArray[np.float64]]:
    """Return for each solver its performance ratios to the fastest, infinite where unsolved (Dolan, More, 2002).

    Only instances that every solver of the set met are compared; times are floored at 10 ms.
    """
    peers = list(dict.fromkeys(run["peer"] for run in runs))
    ratios: dict[str, list[float]] = {peer: [] for peer in peers}
    for group in meetings(runs):
        times = {run["peer"]: max(0.01, counted_s(run, wrong)) if is_solved(run, wrong) else math.inf for run in group}
        if set(times) != set(peers) or math.isinf(min(times.values())):
            continue
        fastest = min(times.values())
        for peer in peers:
            ratios[peer].append(times[peer] / fastest)
    return {peer: np.sort(np.array(values, dtype=np.float64)) for peer, values in ratios.items()}


def gap_over_time(run: Run, at_s: NDArray[np.float64], wrong: set[tuple[str, str]]) -> NDArray[np.float64]:
    """Return the proven gap of a run at instants, 1 where there is no plan or bound yet, or the run is exposed."""
    gaps = np.ones(len(at_s))
    if (run["peer"], run["instance"]) in wrong or not is_right(run):
        return gaps
    for t, incumbent, bound in run["trajectory"]:
        if incumbent is not None and bound is not None:
            gaps[at_s >= t] = min(1.0, max(0.0, bound - incumbent) / max(abs(incumbent), 1e-9))
    return gaps


def exponent(x: Sequence[float], y: Sequence[float]) -> tuple[float, float] | None:
    """Return exponent and factor of ``y = factor x^exponent``, least squares of logarithms; None below 4 points."""
    if len(set(x)) < 4 or min(y) <= 0:
        return None
    slope, intercept = np.polyfit(np.log(x), np.log(y), 1)
    return float(slope), float(math.exp(intercept))
