"""One method of path costs on the factory: how long a matrix takes, and how far its paths are from the shortest."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks.families.factory import factory_map
from react_opt.energy import RobotProfile
from react_opt.geometry import load_map
from react_opt.geometry.inflation import Footprint, FreeSpace, inflate
from react_opt.geometry.occupancy import FREE, OCCUPIED, OccupancyMap
from react_opt.jsonio import load
from react_opt.paths.exact import exact_costs
from react_opt.paths.ompl_costs import OmplPathCosts
from react_opt.paths.protocol import PathCosts

LENGTH_SLACK = 1e-6  # relative: a path shorter than the shortest by more than this is no path


def run(resolution_m: float, points: int, method: str, parameters: dict[str, Any], seed: int) -> dict[str, Any]:
    """Measure a method.

    Parameters
    ----------
    resolution_m
        0.05, or a multiple of it: pixels that hold anything blocked are blocked.
    points
        Size of the cost matrix: points drawn evenly over the largest region.
    method
        ``visibility`` and the pixel methods of :func:`react_opt.paths.exact.exact_costs`, or a planner of OMPL.
    parameters
        Its budget: ``samples`` of a roadmap, ``iterations`` of a single-query planner.
    seed
        Seed of the points and of the planner.
    """
    profile = _profile()
    source = coarser(load_map(factory_map()), resolution_m)
    footprint = Footprint(profile.radius_m)
    inflate(source, footprint)  # compile
    begun = time.perf_counter()
    space = inflate(source, footprint)
    inflate_s = time.perf_counter() - begun
    _prepared(space, profile, method, parameters, seed).cost_table(spread(space, 3, seed + 1))  # compile
    at = spread(space, points, seed)
    begun = time.perf_counter()
    costs = _prepared(space, profile, method, parameters, seed)
    prepare_s = time.perf_counter() - begun
    begun = time.perf_counter()
    table = costs.cost_table(at)
    matrix_s = time.perf_counter() - begun
    exact = exact_costs(space, profile, method="visibility").cost_table(at)
    pairs = np.triu(exact.reachable, 1) & (exact.length_m > 0)
    both = pairs & table.reachable
    ratio = table.length_m[both] / exact.length_m[both]
    shorter = int((ratio < 1.0 - LENGTH_SLACK).sum()) + int((table.reachable & ~exact.reachable).sum())
    return {
        "what": "paths", "peer": method, "instance": f"factory_{resolution_m:g}m_{points}", "parameters": parameters,
        "seed": seed, "points": points, "resolution_m": resolution_m, "pixels": source.rows * source.cols,
        "inflate_s": round(inflate_s, 5), "prepare_s": round(prepare_s, 5), "matrix_s": round(matrix_s, 5),
        "pairs": int(pairs.sum()), "missing": int(pairs.sum() - both.sum()), "impossible": shorter,
        "length_mean": float(ratio.mean()) if ratio.size else None,
        "length_worst": float(ratio.max()) if ratio.size else None,
        "time_mean": float((table.time_s[both] / exact.time_s[both]).mean()) if ratio.size else None,
    }  # fmt: skip


def _profile() -> RobotProfile:
    fleet = load(factory_map().with_name("fleet_1.json"), "fleet")
    return RobotProfile(**next(iter(fleet.profiles.values())).model_dump())


def _prepared(space: FreeSpace, profile: RobotProfile, method: str, parameters: dict[str, Any], seed: int) -> PathCosts:
    if method in ("visibility", "dijkstra8", "dijkstra16", "fastest8", "fastest16"):
        return exact_costs(space, profile, method=method)  # type: ignore[arg-type]
    return OmplPathCosts(space, profile, planner=method, seed=seed, **parameters)  # type: ignore[arg-type]


def coarser(map_: OccupancyMap, resolution_m: float) -> OccupancyMap:
    """Return a map with larger pixels: each is free only where all of it was."""
    k = round(resolution_m / map_.resolution_m)
    if k == 1:
        return map_
    rows, cols = -(-map_.rows // k) * k, -(-map_.cols // k) * k
    cells = np.full((rows, cols), OCCUPIED, dtype=np.uint8)
    cells[: map_.rows, : map_.cols] = map_.cells
    blocks = cells.reshape(rows // k, k, cols // k, k).swapaxes(1, 2).reshape(rows // k, cols // k, k * k)
    worst = np.where((blocks == OCCUPIED).any(axis=2), OCCUPIED, blocks.max(axis=2))
    assert FREE == 0
    return OccupancyMap(
        worst.astype(np.uint8), k * map_.resolution_m, map_.origin_x_m, map_.origin_y_m, map_.origin_yaw_rad
    )


def spread(space: FreeSpace, count: int, seed: int) -> np.ndarray:
    """Return points drawn evenly over the largest connected region of a map, m."""
    largest = int(np.argmax(np.bincount(space.regions.ravel())[1:])) + 1
    rows, cols = np.nonzero(space.regions == largest)
    rng = np.random.default_rng(seed)
    picked = rng.choice(rows.size, count)
    return space.to_world(np.stack((cols[picked], rows[picked]), axis=1) + rng.random((count, 2)))
