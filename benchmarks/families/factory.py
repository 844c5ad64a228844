"""The project's own factory, built from its map at several cell sizes."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from .registry import family

PACKAGE = Path(__file__).resolve().parent.parent
FOLDERS = (PACKAGE.parent / "examples" / "factory", PACKAGE / "data" / "factory")  # a clone, an installed package
STEP_S = {10.0: 10.0, 5.0: 6.0, 2.5: 3.0, 1.25: 2.0}
HORIZON_S = 240.0


def factory_map() -> Path:
    """Return the YAML file of the factory's map."""
    found = [folder / "factory.yaml" for folder in FOLDERS if (folder / "factory.yaml").is_file()]
    if not found:
        raise FileNotFoundError("the factory's map belongs to the package, and is missing: install react_opt again")
    return found[0]


@family(
    "oros", "a real map: speed modes, drives of several steps, an upper half behind one door",
    tiny={"robots": 2, "cell_m": 10.0},
    small={"robots": 3, "cell_m": 5.0},
    medium={"robots": 2, "cell_m": 2.5},
    large={"robots": 4, "cell_m": 2.5},
    huge={"robots": 4, "cell_m": 1.25},
)  # fmt: skip
def factory(robots: int, cell_m: float, seed: int) -> dict[str, Any]:
    """The factory of 20 m x 50 m, 240 s; seed 0 has equal weights, others draw each area's weight from 1 to 3.

    Parameters
    ----------
    robots
        1 to 4 Jackals that wait in the entry tunnel.
    cell_m
        Side of an area, m: 10, 5, 2.5 or 1.25; steps last 10, 6, 3 or 2 s.
    seed
        Seed of the weights.
    """
    instance = dict(_built(robots, cell_m))
    if seed:
        rng = np.random.default_rng(seed)
        instance["cells"] = [{**cell, "weight": float(rng.integers(1, 4))} for cell in instance["cells"]]
    return {**instance, "name": f"factory_{cell_m:g}m_r{robots}_s{seed}"}


@lru_cache(maxsize=4)
def _built(robots: int, cell_m: float) -> dict[str, Any]:
    from react_opt.build import build
    from react_opt.geometry import load_map
    from react_opt.instance import canonical
    from react_opt.jsonio import load

    file = factory_map()
    fleet = load(file.with_name(f"fleet_{robots}.json"), "fleet")
    report = build(load_map(file), fleet, cell_m=cell_m, horizon_s=HORIZON_S, step_s=STEP_S[cell_m])
    return canonical(report.instance)
