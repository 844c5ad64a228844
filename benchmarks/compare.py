"""Two results files side by side: what must agree on any machine, and times as ratios.

Runs that both files solved are decided: their objectives, bounds and verdicts must be the same. A run that its time
limit cut off depends on the machine: of it only consistency is asked, that nothing checked in one file contradicts a
bound or a proof in the other.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from benchmarks import measures
from benchmarks.report import Results
from benchmarks.trial import agreed
from benchmarks.verdicts import Exposure, exposures


@dataclass(frozen=True)
class Comparison:
    """What two results files say of the runs that both hold.

    Parameters
    ----------
    both
        Runs that both hold.
    solved
        Runs that both solved: their objectives, bounds and verdicts must agree.
    differences
        Those that do not, one line each.
    contradictions
        Claims of one file, finished or not, that a checked plan or a certificate of the other file refutes, one line
        each; what a file refutes by itself is in its own report.
    ratio
        For each solver the geometric mean of the second file's times over the first's, on runs both solved.
    """

    both: int
    solved: int
    differences: list[str]
    contradictions: list[str]
    ratio: dict[str, float]

    def __str__(self) -> str:
        lines = [
            f"{self.both} runs in both: {self.solved} solved in both, {len(self.differences)} differences; "
            f"{self.both - self.solved} not, {len(self.contradictions)} contradictions"
        ]
        lines += [f"DIFFERENT  {text}" for text in self.differences]
        lines += [f"CONTRADICTED  {text}" for text in self.contradictions]
        lines += [f"{peer}: {ratio:.2f} times the other's time" for peer, ratio in sorted(self.ratio.items())]
        return "\n".join(lines)


def compare(other: Results, mine: Results) -> Comparison:
    """Compare two results files, of the same suite on two machines or of two versions on one."""
    theirs, ours = _by_case(other), _by_case(mine)
    alone = [*exposures(other.solves), *exposures(mine.solves)]
    wrong = {(item.peer, item.instance) for item in alone}
    both = [key for key in ours if key in theirs]
    solved = [key for key in both if all(measures.is_solved(side[key], wrong) for side in (ours, theirs))]
    differences = [text for key in both if (text := _difference(theirs[key], ours[key], key in solved))]
    logs: dict[str, list[float]] = {}
    for key in solved:
        ratio = max(0.001, ours[key]["wall_s"]) / max(0.001, theirs[key]["wall_s"])
        logs.setdefault(ours[key]["peer"], []).append(math.log(ratio))
    ratio = {peer: math.exp(sum(v) / len(v)) for peer, v in logs.items()}
    return Comparison(len(both), len(solved), differences, _contradictions(other, mine, alone), ratio)


def _contradictions(other: Results, mine: Results, alone: list[Exposure]) -> list[str]:
    """Return what is wrong only in the light of both files; the same instance is the one with the same digest."""
    known = {(item.peer, item.instance, item.fault) for item in alone}
    digests = {json.dumps(run["case"], sort_keys=True): run.get("sha256") for run in other.solves}
    same = [
        run for run in mine.solves if digests.get(json.dumps(run["case"], sort_keys=True)) == run.get("sha256", "")
    ]  # fmt: skip
    found = exposures([*other.solves, *same])
    return sorted({str(item) for item in found if (item.peer, item.instance, item.fault) not in known})


def _by_case(results: Results) -> dict[str, Mapping[str, Any]]:
    return {
        json.dumps([run["case"], run["peer"], run["gap_asked"]], sort_keys=True): run
        for run in results.solves
        if run["status"] != "not met"
    }


def _difference(one: Mapping[str, Any], other: Mapping[str, Any], solved: bool) -> str:
    who = f"{other['peer']} on {other['instance']}"
    if one.get("sha256", "") != other.get("sha256", "") and one.get("sha256") and other.get("sha256"):
        return f"{who}: another instance under the same name"
    if not solved or other["gap_asked"] > 0:
        return ""
    if one["status"] != other["status"]:
        return f"{who}: {one['status']} and {other['status']}"
    for what in ("objective", "bound"):
        first, second = one.get(what), other.get(what)
        if first is not None and second is not None and abs(first - second) > 2 * agreed(first, other["tolerance"]):
            return f"{who}: {what} {first:.9g} and {second:.9g}"
    return ""
