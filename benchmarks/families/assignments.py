"""Assignments: plain, with conflicts as in the loop, and generalised ones of the classical types A to D."""

from __future__ import annotations

from typing import Any

import numpy as np

from .registry import family

SPEED_M_S, MOVING_W, BATTERY_J = 0.89, 26.0, 8245.96


@family(
    "assignment", "a linear assignment problem: one target per robot, no side constraint",
    tiny={"robots": 5, "targets": 8},
    small={"robots": 50, "targets": 60},
    medium={"robots": 200, "targets": 200},
    large={"robots": 400, "targets": 400},
)  # fmt: skip
def plain(robots: int, targets: int, seed: int) -> dict[str, Any]:
    """Robots and targets on a floor of 20 m x 50 m; every robot takes at most one."""
    return _floor(f"plain_{robots}x{targets}_s{seed}", robots, targets, 0, 1, np.random.default_rng(seed))


@family(
    "assignment", "one target per robot, and pairs of targets behind the same passage",
    tiny={"robots": 4, "targets": 20, "pairs": 15},
    small={"robots": 10, "targets": 50, "pairs": 60, "capacity": 2},
    medium={"robots": 20, "targets": 100, "pairs": 60, "capacity": 3},
    large={"robots": 40, "targets": 200, "pairs": 400, "capacity": 3},
)  # fmt: skip
def conflicts(robots: int, targets: int, pairs: int, seed: int, capacity: int = 1) -> dict[str, Any]:
    """As ``plain``, with about ``pairs`` conflicts and 1 to ``capacity`` targets per robot."""
    name = f"conflicts_{robots}x{targets}_p{pairs}_c{capacity}_s{seed}"
    return _floor(name, robots, targets, pairs, capacity, np.random.default_rng(seed))


@family(
    "assignment", "generalised assignment of type C or D: every agent's budget is filled by many targets",
    tiny={"robots": 3, "targets": 12, "type": "C"},
    small={"robots": 5, "targets": 25, "type": "C"},
    medium={"robots": 5, "targets": 50, "type": "D"},
    large={"robots": 10, "targets": 100, "type": "D"},
    huge={"robots": 20, "targets": 200, "type": "D"},
)  # fmt: skip
def generalised(robots: int, targets: int, type: str, seed: int) -> dict[str, Any]:
    """Generalised assignment of the classical types (Martello and Toth; Chu and Beasley, 1997).

    Agent r spends ``a`` of its budget on target k at a cost of ``c``. A: a in 5..25, c in 10..50, budgets 0.6 n/m 15
    + 0.4 max load; B: budgets 0.7 of A's; C: budgets 0.8 of the mean load; D: a in 1..100, c = 111 - a + (-10..10),
    budgets 0.8 of the mean load. The gain of a target is larger than any cost, so that as many as possible are taken.
    """
    rng = np.random.default_rng(seed)
    shape = (robots, targets)
    if type == "D":
        spend = rng.integers(1, 101, shape)
        cost = 111 - spend + rng.integers(-10, 11, shape)
    else:
        spend, cost = rng.integers(5, 26, shape), rng.integers(10, 51, shape)
    if type in ("A", "B"):
        cheapest = cost.argmin(axis=0)
        load = max(int(spend[r, cheapest == r].sum()) for r in range(robots))
        budget = np.full(robots, 0.6 * (targets / robots) * 15 + 0.4 * load) * (0.7 if type == "B" else 1.0)
    elif type in ("C", "D"):
        budget = 0.8 * spend.sum(axis=1) / robots
    else:
        raise ValueError(f"a generalised assignment is of type A, B, C or D, not {type!r}")
    return _agents(f"generalised_{type}_{robots}x{targets}_s{seed}", cost, spend, np.floor(budget))


def _agents(name: str, cost: Any, spend: Any, budget: Any) -> dict[str, Any]:
    """Costs as seconds at one value each, what is spent as joules, no weight on energy."""
    robots, targets = cost.shape
    gain = float(cost.max()) + 1.0
    return {
        "kind": "assignment",
        "schema_version": 1,
        "name": name,
        "robots": [{"id": f"r{r}", "battery_j": float(budget[r]), "capacity": targets} for r in range(robots)],
        "targets": [{"id": f"t{k}", "gain": gain} for k in range(targets)],
        "costs": [
            {"robot": f"r{r}", "target": f"t{k}", "time_s": float(cost[r, k]), "energy_j": float(spend[r, k])}
            for r in range(robots)
            for k in range(targets)
        ],
        "weights": {"alpha": 1.0, "beta": 0.0, "time_ref_s": 1.0},
    }


def _floor(name: str, robots: int, targets: int, pairs: int, capacity: int, rng: Any) -> dict[str, Any]:
    at, to = rng.uniform(0, [20.0, 50.0], (robots, 2)), rng.uniform(0, [20.0, 50.0], (targets, 2))
    length_m = np.linalg.norm(at[:, None] - to[None], axis=2) * rng.uniform(1, 1.5, (robots, targets))
    time_s = np.round(length_m / SPEED_M_S, 1)
    battery = np.round(rng.uniform(0.2, 1.0, robots) * BATTERY_J)
    gain = np.round(rng.uniform(1, 10, targets), 2)
    drawn = np.sort(rng.choice(targets, (pairs, 2)), axis=1)
    drawn = np.unique(drawn[drawn[:, 0] != drawn[:, 1]], axis=0)
    limit = rng.integers(1, capacity + 1, robots)
    return {
        "kind": "assignment",
        "schema_version": 1,
        "name": name,
        "robots": [
            {
                "id": f"r{r}", "battery_j": float(battery[r]), "reserve_j": float(np.round(0.1 * battery[r])),
                "capacity": int(limit[r]),
            }
            for r in range(robots)
        ],
        "targets": [{"id": f"t{k}", "gain": float(gain[k])} for k in range(targets)],
        "costs": [
            {
                "robot": f"r{r}", "target": f"t{k}", "time_s": float(time_s[r, k]),
                "energy_j": float(np.round(MOVING_W * time_s[r, k], 1)),
            }
            for r in range(robots)
            for k in range(targets)
        ],
        "conflicts": [[f"t{a}", f"t{b}"] for a, b in drawn.tolist()],
        "weights": {"alpha": 1.0, "beta": 2.0, "time_ref_s": 20.0},
    }  # fmt: skip
