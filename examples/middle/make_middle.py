"""Two small files of the middle layer, seeded: who takes which target now, and who inspects the postponed ones.

Run ``python examples/middle/make_middle.py [FOLDER]``; the files are the same on every machine.
"""

from __future__ import annotations

import sys
from math import hypot
from pathlib import Path
from random import Random
from typing import Any

SPEED_M_S = 0.8
JOULES_PER_M = 12.0
Data = dict[str, Any]


def targets(rng: Random) -> Data:
    """Return an assignment: four robots, one nearly empty, eleven targets, some pairs without a way."""
    robots = {f"r{k + 1}": _place(rng) for k in range(4)}
    wanted = {f"t{k + 1}": _place(rng) for k in range(11)}
    battery = dict(zip(robots, (3000.0, 900.0, 2500.0, 260.0), strict=True))
    return {
        "kind": "assignment", "schema_version": 1, "name": "local targets of one map update",
        "robots": [{"id": name, "battery_j": battery[name], "reserve_j": 200.0} for name in robots],
        "targets": [{"id": name, "gain": round(rng.uniform(0.5, 3.0), 2)} for name in wanted],
        "costs": [
            {"robot": robot, "target": target, **_drive(robots[robot], wanted[target])}
            for robot in robots for target in wanted if target != "t5" and rng.random() < 0.8
        ],
        "conflicts": [["t1", "t2"]],
        "weights": {"alpha": 1.0, "beta": 1.0, "time_ref_s": 40.0},
    }  # fmt: skip


def postponed(rng: Random) -> Data:
    """Return an inspection: three robots, fourteen postponed targets, too little time for all of them."""
    wanted = {f"t{k + 1}": _place(rng) for k in range(14)}
    places = {**wanted, "dock": (2.0, 2.0), "hall": (30.0, 5.0), "office": (10.0, 35.0)}
    return {
        "kind": "inspection", "schema_version": 1, "name": "postponed targets", "time_left_s": 90.0,
        "robots": [
            {"id": "r1", "at": "hall", "battery_j": 1900.0, "reserve_j": 200.0, "end": "dock"},
            {"id": "r2", "at": "office", "battery_j": 1500.0, "reserve_j": 200.0, "end": "dock"},
            {"id": "r3", "at": "dock", "battery_j": 700.0, "reserve_j": 200.0},
        ],
        "targets": [
            {"id": name, "value": float(rng.randint(1, 4)), "service_s": 3.0, "service_energy_j": 60.0}
            for name in wanted
        ],
        "travel": [
            {"from": one, "to": other, **_drive(places[one], places[other])}
            for one in places for other in places if one != other
        ],
    }  # fmt: skip


def _place(rng: Random) -> tuple[float, float]:
    return rng.uniform(0, 40), rng.uniform(0, 40)


def _drive(one: tuple[float, float], other: tuple[float, float]) -> Data:
    metres = hypot(one[0] - other[0], one[1] - other[1])
    return {"time_s": round(metres / SPEED_M_S, 2), "energy_j": round(metres * JOULES_PER_M, 1)}


def main(folder: Path) -> None:
    """Write ``targets.json`` and ``postponed.json`` into a folder."""
    from react_opt import parse, save

    folder.mkdir(parents=True, exist_ok=True)
    save(parse(targets(Random(3))), folder / "targets.json")
    save(parse(postponed(Random(4))), folder / "postponed.json")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
