"""Deferred-priority inspections: team orienteering with a budget of time and one of energy."""

from __future__ import annotations

from typing import Any

import numpy as np

from .registry import family

SPEED_M_S, MOVING_W, SERVICE_S, SERVICE_J = 0.89, 26.0, 5.0, 130.0


@family(
    "inspection", "time for about two thirds of the targets, an exit to end at",
    tiny={"robots": 2, "targets": 8},
    small={"robots": 3, "targets": 15},
    medium={"robots": 4, "targets": 30},
    large={"robots": 4, "targets": 100},
    huge={"robots": 8, "targets": 200},
)  # fmt: skip
def inspection_floor(robots: int, targets: int, seed: int) -> dict[str, Any]:
    """Targets on a floor of 20 m x 50 m, robots anywhere with unlike batteries; energy follows the time driven."""
    rng = np.random.default_rng([seed, robots, targets])
    return _floor(f"inspection_floor_{robots}x{targets}_s{seed}", robots, targets, rng, 0.0, (0.8, 1.6))


@family(
    "inspection", "two budgets that pull apart: joules per second differ from drive to drive, batteries are short",
    tiny={"robots": 2, "targets": 8},
    small={"robots": 3, "targets": 15},
    medium={"robots": 4, "targets": 30},
    large={"robots": 4, "targets": 100},
)  # fmt: skip
def inspection_tight(robots: int, targets: int, seed: int) -> dict[str, Any]:
    """As ``inspection_floor``, with drives of 0.5 to 1.5 times the usual power and batteries that bind first."""
    rng = np.random.default_rng([seed, robots, targets, 1])
    return _floor(f"inspection_tight_{robots}x{targets}_s{seed}", robots, targets, rng, 0.5, (0.5, 1.0))


def _floor(
    name: str, robots: int, targets: int, rng: Any, spread: float, battery: tuple[float, float]
) -> dict[str, Any]:
    names = [*(f"k{i}" for i in range(targets)), *(f"s{r}" for r in range(robots)), "exit"]
    xy = rng.uniform(0, [20.0, 50.0], (len(names), 2))
    time_s = np.round(np.linalg.norm(xy[:, None] - xy[None], axis=2) / SPEED_M_S, 3)
    power_w = MOVING_W * rng.uniform(1.0 - spread, 1.0 + spread, time_s.shape)
    energy_j = np.round(np.triu(power_w, 1) + np.triu(power_w, 1).T, 3) * time_s
    per_robot_s = 0.7124 * np.sqrt(targets * 1000.0) / robots / SPEED_M_S + targets * SERVICE_S / robots
    left_s = float(round(0.65 * per_robot_s + 20.0, 1))
    return {
        "kind": "inspection",
        "schema_version": 1,
        "name": name,
        "time_left_s": left_s,
        "robots": [
            {"id": f"r{r}", "at": f"s{r}", "end": "exit", "battery_j": float(round(share * left_s * MOVING_W, 1))}
            for r, share in enumerate(rng.uniform(*battery, robots))
        ],
        "targets": [
            {"id": f"k{i}", "value": float(value), "service_s": SERVICE_S, "service_energy_j": SERVICE_J}
            for i, value in enumerate(rng.integers(1, 11, targets))
        ],
        "travel": [
            {"from": a, "to": b, "time_s": float(time_s[i, j]), "energy_j": float(round(energy_j[i, j], 3))}
            for i, a in enumerate(names)
            for j, b in enumerate(names)
            if i != j
        ],
    }
