"""Plan on a ROS map: from map and fleet to a checked plan, a picture of it, and the way points of the first drives.

Run ``python examples/plan_on_map.py [MAP.yaml FLEET.json] [-o plan.svg]``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from react_opt import check, load, save, solve
from react_opt.build import build
from react_opt.energy import RobotProfile
from react_opt.geometry import load_map
from react_opt.geometry.inflation import Footprint, inflate
from react_opt.paths.exact import exact_costs

FACTORY = Path(__file__).parent / "factory"


def first_drives(map_file: Path, fleet_file: Path, folder: Path) -> dict[str, np.ndarray]:
    """Write instance and plan into a folder; return per robot the way points of its first drive, m."""
    source, fleet = load_map(map_file), load(fleet_file, "fleet")
    report = build(source, fleet, cell_m=10, horizon_s=240, step_s=10)
    for line in [*report.notes, *report.dropped]:
        print(line)
    instance = report.instance
    plan = solve(instance, time_limit_s=10)
    assert check(instance, plan).ok
    save(instance, folder / "instance.json")
    save(plan, folder / "plan.json")
    profiles = {name: RobotProfile(**each.model_dump()) for name, each in fleet.profiles.items()}
    space = inflate(source, Footprint(max(profile.radius_m for profile in profiles.values())))
    place = {cell.id: np.array([cell.x_m, cell.y_m]) for cell in instance.cells}
    drives = {}
    for robot in plan.robots:
        arcs = [instance.travel[step.arc] for step in robot.steps if step.arc is not None]
        pose = next(each for each in fleet.robots if each.id == robot.id)
        if arcs:
            costs = exact_costs(space, profiles[pose.profile])
            path = costs.path(np.array([pose.x_m, pose.y_m]), place[arcs[0].to])
            assert path is not None
            assert space.path_free(path.points_m)
            drives[robot.id] = path.points_m
    return drives


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("map", nargs="?", type=Path, default=FACTORY / "factory.yaml")
    parser.add_argument("fleet", nargs="?", type=Path, default=FACTORY / "fleet_2.json")
    parser.add_argument("-o", "--output", type=Path, default=Path("plan.svg"))
    options = parser.parse_args()
    for name, points in first_drives(options.map, options.fleet, options.output.parent).items():
        print(name, " > ".join(f"({x:.1f}, {y:.1f})" for x, y in points))
    from react_opt.report.show import show

    show([options.output.parent / "plan.json"], options.output, map_file=options.map)
