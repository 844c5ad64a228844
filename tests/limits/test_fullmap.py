"""Plans with the map known: driven in the simulator they see what they promise, and no bound is above them."""

from __future__ import annotations

import numpy as np
import pytest

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import Mission, canonical
from react_opt.jsonio import load, parse
from react_opt.limits.bound import candidates, time_bound
from react_opt.limits.fullmap import best_plan
from react_opt.limits.hidden import survey
from react_opt.limits.routes import popcount
from react_opt.sim.loop import Simulation
from react_opt.sim.summary import coverage_times
from react_opt.sim.world import World


def two_rooms() -> OccupancyMap:
    """Two rooms of 5 m x 4 m with a door of 1.2 m, and a closet off the second one."""
    cells = np.zeros((42, 122), dtype=np.uint8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 1
    cells[:15, 55:57] = cells[27:, 55:57] = 1
    cells[:28, 100:102] = 1
    return OccupancyMap(cells, 0.1)


def mission_of(robots: int) -> Mission:
    data = canonical(load("examples/factory/mission_1.json", "mission"))
    row = data["robots"][0]
    data["robots"] = [{**row, "id": f"r{n}", "x_m": 1.0 + n, "y_m": 2.0, "yaw_rad": 0.0} for n in range(robots)]
    data["horizon_s"] = 60.0
    mission: Mission = parse(data, kind="mission")
    return mission


@pytest.mark.parametrize("robots", [1, 2])
def test_the_plan_is_driven_and_the_bound_lies_below_it_and_below_an_explorer(robots: int) -> None:
    mission, truth = mission_of(robots), two_rooms()
    profiles = [RobotProfile(**mission.profiles[robot.profile].model_dump()) for robot in mission.robots]
    starts = np.array([(robot.x_m, robot.y_m) for robot in mission.robots])
    hidden = survey(World(truth, profiles[0].radius_m, 8.0, starts), profiles, starts)
    bound = time_bound(hidden, candidates(hidden), 0.97, robots)
    plan = best_plan(mission, truth, 0.97, restarts=2, steps=2000)
    assert plan.time_s is not None
    assert plan.coverage >= 0.97
    assert 0 < bound.time_s <= plan.time_s < 40
    explored = coverage_times(Simulation(mission, truth).run())
    needed = explored[int(np.ceil(0.97 * len(explored))) - 1]
    assert needed >= bound.time_s / (1 + 3 * mission.noise.speed)


def test_bits_are_counted() -> None:
    for word in (0, 1, 2**63, 2**64 - 1, 0x123456789ABCDEF0):
        assert popcount(np.uint64(word)) == word.bit_count()
