"""Tune the frontier methods on generated buildings, never on the maps that results are reported for.

    python -m benchmarks.tune_baselines [--buildings 3] [--robots 2]

Per value of a method's parameter: the mean time to 97 % over the buildings, s (400 where it is not reached).
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np

from benchmarks.buildings import building
from react_opt.instance import Mission
from react_opt.jsonio import load
from react_opt.orchestrator.registry import make_strategy
from react_opt.sim.loop import Simulation, options_of

EXAMPLES = Path(__file__).resolve().parent.parent / "examples" / "factory"
HORIZON_S = 400.0
SWEEP = {
    "cost_utility": ("gain_s_per_m", (0.0, 1.0, 4.0)),
    "hungarian": ("gain_s_per_m", (0.0, 1.0, 4.0)),
    "market": ("seconds_worth", (0.01, 0.03, 0.1)),
}


def time_to(share: float, name: str, extra: dict[str, float], seed: int, robots: int) -> float:
    """Return when a share of a building was known, s; the horizon where it never was."""
    truth, starts = building(seed)
    fleet = load(EXAMPLES / "fleet_4.json")
    placed = [
        {**robot.model_dump(), "x_m": x, "y_m": y} for robot, (x, y) in zip(fleet.robots, starts[:robots], strict=False)
    ]
    mission = Mission.model_validate(
        {
            "name": f"building {seed}", "map": "generated", "cell_m": 10.0, "horizon_s": HORIZON_S, "step_s": 10.0,
            "profiles": {key: profile.model_dump() for key, profile in fleet.profiles.items()}, "robots": placed,
            "delta": 0.95, "strategy": name, "postpone_below": 0.3, "seed": seed,
        }
    )  # fmt: skip
    options = dataclasses.replace(options_of(mission), extra=extra)
    simulation = Simulation(mission, truth, strategy=make_strategy(name, options))
    trace = simulation.run(should_stop=lambda: simulation.record.coverage >= share)
    return trace.frames[-1].t_s if simulation.record.coverage >= share else HORIZON_S


def main() -> None:
    """Print one line per method and value."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--buildings", type=int, default=3)
    parser.add_argument("--robots", type=int, default=2)
    options = parser.parse_args()
    for name, (parameter, values) in SWEEP.items():
        for value in values:
            each = [time_to(0.97, name, {parameter: value}, seed, options.robots) for seed in range(options.buildings)]
            print(f"{name:14s} {parameter:14s} {value:6.3f}   {np.mean(each):6.1f} s   {np.round(each, 1)}", flush=True)


if __name__ == "__main__":
    main()
