"""OR-Library's generalised assignment files: the number of problems, then each with m, n, costs, resources, capacities.

Problems with ``max`` in the format's name (gap1 to gap12) are maximised, the others (gapa to gapd) minimised. Every
job gains three times the largest cost, so that leaving one out does not pay; a proven plan that takes all jobs is
then optimal for the original problem, and its cost is ``n gain - objective``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.readers.text import Words, fault

GAIN = 3.0


def read_min(file: str) -> list[dict[str, Any]]:
    """Return the ``assignment`` instances of a file whose costs are minimised."""
    return _read(file, maximise=False)


def read_max(file: str) -> list[dict[str, Any]]:
    """Return the ``assignment`` instances of a file whose profits are maximised."""
    return _read(file, maximise=True)


def _read(file: str, maximise: bool) -> list[dict[str, Any]]:
    words = Words.of(file)
    problems = [
        _problem(words, f"gap_{Path(file).stem}_{k}", maximise) for k in range(words.count("the number of problems"))
    ]
    if words.at < len(words.words):
        line, word = words.words[words.at]
        fault(file, f"line {line}", f"expected the end of the file, found {word[:40]!r}")
    return problems


def _problem(words: Words, name: str, maximise: bool) -> dict[str, Any]:
    agents, jobs = words.count("the number of agents"), words.count("the number of jobs")
    cost = [[words.next("a cost") for _ in range(jobs)] for _ in range(agents)]
    spend = [[words.next("a resource") for _ in range(jobs)] for _ in range(agents)]
    budget = [words.next("a capacity") for _ in range(agents)]
    if min(map(min, (*cost, *spend, budget))) < 0:
        fault(words.file, name, "expected no negative number")
    most = max(map(max, cost))
    if maximise:  # what a pair falls short of the largest profit is its cost
        cost = [[most - profit for profit in row] for row in cost]
    return {
        "kind": "assignment",
        "schema_version": 1,
        "name": name,
        "robots": [{"id": f"a{r}", "battery_j": budget[r], "capacity": jobs} for r in range(agents)],
        "targets": [{"id": f"j{k}", "gain": GAIN * max(1.0, most)} for k in range(jobs)],
        "costs": [
            {"robot": f"a{r}", "target": f"j{k}", "time_s": cost[r][k], "energy_j": spend[r][k]}
            for r in range(agents)
            for k in range(jobs)
        ],
        "weights": {"alpha": 1.0, "beta": 0.0, "time_ref_s": 1.0},
    }
