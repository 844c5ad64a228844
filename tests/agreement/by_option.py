"""Decomposition, monolith and brute force on random instances of one option at a time.

``python tests/agreement/by_option.py --options chargers deadlines --count 300`` draws instances in which the option
is present for certain and every other one by chance, solves each by the route decomposition and by HiGHS on the
monolith (the tiniest by brute force, too), and prints one line per option and one per difference. Plans go through
the checker, certificates through the recomputation of ``check --bound``.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

if __name__ == "__main__":
    sys.path[:0] = [str(Path(__file__).resolve().parents[2])]

from brute import brute_force

from react_opt import check, solve
from react_opt.certify_bound import recompute_bound
from react_opt.instance import OrosInstance
from react_opt.jsonio import parse
from react_opt.plan import OrosPlan
from react_opt.solvers import oros

Rng = np.random.Generator
Data = dict[str, Any]
BY_CHANCE = 0.15  # that an option is present which is not asked for
STEP_S = 10.0


def _weights(rng: Rng, data: Data) -> None:
    for cell in data["cells"]:
        cell["weight"] = float(rng.choice([0.0, 0.5, 1.0, 2.0, 3.7]))


def _deadlines(rng: Rng, data: Data) -> None:
    for cell in data["cells"]:
        if rng.random() < 0.7:
            cell["deadline_step"] = int(rng.integers(0, data["horizon_steps"] + 3))


def _speed_modes(rng: Rng, data: Data) -> None:
    slower = [arc for arc in data["travel"] if rng.random() < 0.6]
    data["travel"] += [{**arc, "steps": arc["steps"] + 1, "energy_j": 0.4 * arc["energy_j"]} for arc in slower]


def _long_arcs(rng: Rng, data: Data) -> None:
    for arc in data["travel"]:
        arc["steps"] = int(rng.integers(1, 4))


def _late_starts(rng: Rng, data: Data) -> None:
    for robot in data["robots"]:
        robot["start_step"] = int(rng.integers(0, data["horizon_steps"]))


def _return_to(rng: Rng, data: Data) -> None:
    for robot in data["robots"]:
        robot["return_to"] = robot["start"] if rng.random() < 0.5 else _cell(rng, data)


def _batteries(rng: Rng, data: Data) -> None:
    for robot in data["robots"]:
        battery_j = float(rng.choice([0.15, 0.25, 0.4, 0.6])) * data["horizon_steps"] * 239.0
        robot["battery_j"], robot["capacity_j"] = battery_j, battery_j + float(rng.choice([0.0, 50.0, 400.0]))


def _reserves(rng: Rng, data: Data) -> None:
    _batteries(rng, data)
    for robot in data["robots"]:
        robot["reserve_j"] = float(rng.choice([0.1, 0.3, 0.5])) * robot["battery_j"]


def _robots_per_cell(rng: Rng, data: Data) -> None:
    data["limits"]["robots_per_cell"] = int(rng.choice([1, 1, 2]))


def _shared_sensing(rng: Rng, data: Data) -> None:
    data["limits"]["sensing_robots_per_step"] = int(rng.choice([0, 1, 1, 1]))


def _swaps(rng: Rng, data: Data) -> None:
    data["limits"]["forbid_swaps"] = True


def _chargers(rng: Rng, data: Data) -> None:
    _batteries(rng, data)
    places = rng.choice(len(data["cells"]), size=int(rng.integers(1, 3)), replace=False).tolist()
    powers_w = [float(rng.choice([0.5, 8.0, 30.0, 200.0])) for _ in places]
    data["chargers"] = [
        {"cell": data["cells"][i]["id"], "power_w": power_w, "slots": len(data["robots"])}
        for i, power_w in zip(places, powers_w, strict=True)
    ]


def _scarce_slots(rng: Rng, data: Data) -> None:
    _chargers(rng, data)
    for charger in data["chargers"]:
        charger["slots"] = int(rng.choice([0, 1, 1, 1]))
    start = data["chargers"][0]["cell"]
    data["robots"] = [{**data["robots"][0], "id": f"r{k}", "start": start} for k in range(2)]


def _explored(rng: Rng, data: Data) -> None:
    for cell in data["cells"]:
        cell["explored"] = bool(rng.random() < 0.4)


def _classes(rng: Rng, data: Data) -> None:
    while len(data["robots"]) < 2:
        data["robots"].append(_robot(rng, data, len(data["robots"])))
    for robot in data["robots"]:
        robot["start"] = _cell(rng, data)
        robot["idle_w"], robot["sensing_w"] = float(rng.choice([0.0, 2.0, 3.3])), float(rng.choice([0.0, 9.0, 16.9]))


def _sigma(rng: Rng, data: Data) -> None:
    data["objective"] = {"sigma": float(rng.choice([0.0, 1e-6, 0.003, 0.02, 0.7]))}


OPTIONS: dict[str, Callable[[Rng, Data], None]] = {
    "weights": _weights,
    "deadlines": _deadlines,
    "speed_modes": _speed_modes,
    "long_arcs": _long_arcs,
    "late_starts": _late_starts,
    "classes": _classes,
    "return_to": _return_to,
    "batteries": _batteries,
    "reserves": _reserves,
    "robots_per_cell": _robots_per_cell,
    "shared_sensing": _shared_sensing,
    "swaps": _swaps,
    "chargers": _chargers,
    "scarce_slots": _scarce_slots,
    "explored": _explored,
    "sigma": _sigma,
}


def drawn(option: str, seed: int) -> OrosInstance:
    """Return a random instance with an option, the others by chance; the even seeds are tiny.

    Parameters
    ----------
    option
        One of `OPTIONS`.
    seed
        Seed of everything.
    """
    rng = np.random.default_rng([seed, sorted(OPTIONS).index(option)])
    tiny = seed % 2 == 0
    n = int(rng.integers(2, 5)) if tiny else int(rng.integers(4, 8))
    data: Data = {
        "kind": "oros",
        "schema_version": 1,
        "name": f"{option} {seed}",
        "horizon_steps": int(rng.integers(2, 6)) if tiny else int(rng.integers(5, 10)),
        "step_s": STEP_S,
        "cells": [{"id": f"c{i}", "x_m": float(i), "y_m": 0.0} for i in range(n)],
        "limits": {},
    }
    edges = {(int(rng.integers(0, i)), i) for i in range(1, n)}
    edges |= {(i, j) for i in range(n) for j in range(i + 1, n) if rng.random() < 0.25}
    data["travel"] = [
        {"from": f"c{i}", "to": f"c{j}", "steps": 1, "energy_j": float(rng.choice([10.0, 37.5, 70.0]))}
        for edge in sorted(edges)
        for i, j in (edge, edge[::-1])
        if rng.random() < 0.95
    ]
    data["robots"] = []
    for k in range(int(rng.integers(1, 3 if tiny else 4))):
        again = bool(data["robots"]) and rng.random() < 0.6  # of the same class
        data["robots"].append({**data["robots"][-1], "id": f"r{k}"} if again else _robot(rng, data, k))
    for name, add in OPTIONS.items():
        if name == option or rng.random() < BY_CHANCE:
            add(rng, data)
    for robot in data["robots"]:  # a battery drawn later may be below a reserve drawn before
        robot["reserve_j"] = min(robot.get("reserve_j", 0.0), robot["battery_j"])
    instance = parse(data, kind="oros")
    assert isinstance(instance, OrosInstance)
    return instance


def _cell(rng: Rng, data: Data) -> str:
    return str(data["cells"][int(rng.integers(0, len(data["cells"])))]["id"])


def _robot(rng: Rng, data: Data, k: int) -> Data:
    battery_j = 239.0 * data["horizon_steps"] + 1.0
    powers = {"idle_w": 2.0, "sensing_w": 16.9}
    return {"id": f"r{k}", "start": _cell(rng, data), "battery_j": battery_j, "capacity_j": battery_j, **powers}


def compared(instance: OrosInstance, *, by_brute_force: bool, work_limit: int = 1000) -> tuple[str, list[str]]:
    """Return how the decomposition ended and what differs, in words.

    Parameters
    ----------
    instance
        The instance.
    by_brute_force
        Whether to try everything as well, which only a tiny instance allows.
    work_limit
        Work of the decomposition.
    """
    ours = solve(instance, method="routes", threads=1, work_limit=work_limit)
    whole = solve(instance, method="monolith", threads=1, time_limit_s=60.0)
    assert isinstance(ours, OrosPlan)
    assert isinstance(whole, OrosPlan)
    faults = [f"decomposition: {text}" for text in check(instance, ours).violations]
    faults += [f"monolith: {text}" for text in check(instance, whole).violations]
    status = ours.claim.status
    truths = {"monolith": None if whole.claim.status == "infeasible" else whole.claim.objective}
    if whole.claim.status not in ("optimal", "infeasible"):
        return f"{status}, monolith {whole.claim.status}", faults
    if by_brute_force:
        truths["brute force"] = brute_force(instance)
    for name, truth in truths.items():
        if truth is None:
            if status not in ("infeasible", "no_plan"):
                faults.append(f"{name}: infeasible, decomposition {status} {ours.claim.objective}")
            continue
        slack = 2e-6 * abs(truth) + 1e-9
        found, bound = ours.claim.objective, ours.claim.bound
        if status == "infeasible":
            faults.append(f"{name}: {truth}, decomposition infeasible")
        if found is not None and (found > truth + slack or (status == "optimal" and found < truth - slack)):
            faults.append(f"{name}: {truth}, decomposition {found}")
        if bound is not None and bound < truth - slack:
            faults.append(f"{name}: {truth}, bound {bound}")
        if ours.claim.certificate:
            again = recompute_bound(instance, ours.claim.certificate)
            if again < truth - slack:
                faults.append(f"{name}: {truth}, bound recomputed {again}")
            if bound is not None and again > bound + slack:
                faults.append(f"bound {bound}, recomputed {again}")
    return status, faults


def main() -> int:
    """Compare and print; return 1 if anything differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--options", nargs="*", default=list(OPTIONS), choices=list(OPTIONS))
    parser.add_argument("--count", type=int, default=20, help="instances per option")
    parser.add_argument("--first", type=int, default=0, help="seed of the first one")
    parser.add_argument("--limit-s", type=float, default=200.0, help="stop after this many seconds")
    asked = parser.parse_args()
    oros.IMPROVE_S = 0.01  # of primal search before the monolith, which needs no help here
    begun, wrong = time.monotonic(), 0
    for option in asked.options:
        ends: Counter[str] = Counter()
        for seed in range(asked.first, asked.first + asked.count):
            if time.monotonic() - begun > asked.limit_s:
                print(f"stopped after {asked.limit_s:g} s at seed {seed} of {option}: {_counts(ends)}", flush=True)
                return int(wrong > 0)
            instance = drawn(option, seed)
            end, faults = compared(instance, by_brute_force=seed % 2 == 0)
            ends[end] += 1
            if end == "feasible" and not _coupled(instance):
                faults.append("no proof, though there are no limits between robots")
            wrong += len(faults)
            for fault in faults:
                print(f"  {option} {seed}: {fault}", flush=True)
        print(f"{option:16} {asked.count:5d} instances: {_counts(ends)}", flush=True)
    return int(wrong > 0)


def _counts(ends: Counter[str]) -> str:
    return ", ".join(f"{count} {end}" for end, count in sorted(ends.items()))


def _coupled(instance: OrosInstance) -> bool:
    limits = instance.limits
    scarce = any(charger.slots < len(instance.robots) for charger in instance.chargers)
    return scarce or limits.forbid_swaps or bool(limits.model_dump(exclude={"forbid_swaps"}, exclude_none=True))


if __name__ == "__main__":
    raise SystemExit(main())
