"""The scripts in ``examples`` run and do what they say."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from react_opt import load, solve
from react_opt.geometry import OccupancyMap, load_map
from react_opt.models.oros import oros_model

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
FACTORY = EXAMPLES / "factory"


@pytest.fixture(autouse=True)
def importable(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    monkeypatch.syspath_prepend(str(EXAMPLES / "middle"))


def test_a_robot_that_senses_is_never_alone():
    from extend_oros import neighbours, solve_with_buddies

    instance = load(FACTORY / "factory_2_10m.json")
    outcome, routes = solve_with_buddies(instance, 20)
    near = neighbours(oros_model(instance))
    sensed = 0
    for one, other in (routes, routes[::-1]):
        for t in np.flatnonzero(one.sense):
            assert other.cell[t] in near[one.cell[t]]
            sensed += 1
    assert sensed > 0
    free = solve(instance, time_limit_s=5)  # without the equation nothing is lost, whatever has been proven by then
    assert outcome.objective <= free.claim.bound + 1e-6


def test_no_plan_is_better_than_what_another_solver_proves():
    from compare_solvers import compare, table

    plans = compare(FACTORY / "factory_1_10m.json", 8, only=["routes", "highs"])
    assert list(plans) == ["routes", "highs"]
    least = min(plan.claim.bound for plan in plans.values() if plan.claim.bound is not None)
    assert all(plan.claim.objective <= least * (1 + 1e-9) for plan in plans.values())
    assert table(plans).row_count == len(plans)


def test_a_map_becomes_way_points_that_start_where_the_robots_are(tmp_path):
    from plan_on_map import first_drives

    fleet = load(FACTORY / "fleet_2.json")
    drives = first_drives(FACTORY / "factory.yaml", FACTORY / "fleet_2.json", tmp_path)
    assert drives
    for robot in fleet.robots:
        if robot.id in drives:
            assert drives[robot.id][0].tolist() == [robot.x_m, robot.y_m]
    assert load(tmp_path / "plan.json").kind == "oros_plan"


def test_robots_from_outside_explore_with_a_belief_fed_by_hand(capsys):
    from own_robots import FleetBelief, explore, my_fleet

    hidden = load_map(FACTORY / "factory.yaml")

    def run():
        robots = my_fleet(FACTORY / "fleet_2.json", hidden)
        blank = OccupancyMap(np.full_like(hidden.cells, 2), hidden.resolution_m, hidden.origin_x_m, hidden.origin_y_m)
        belief = FleetBelief(blank, (0.0, 0.0, 20.0, 50.0), 10.0, [robot.profile for robot in robots])
        return explore(robots, belief, "react", 25), [(robot.x_m, robot.y_m) for robot in robots]

    share, places = run()
    assert share > 0.06  # two of ten areas are being explored
    assert "target_taken" in capsys.readouterr().out
    assert (share, places) == run()


def test_the_files_of_the_middle_layer_are_what_their_script_makes(tmp_path):
    from make_middle import main

    main(tmp_path)
    for name in ("targets.json", "postponed.json"):
        assert json.loads((tmp_path / name).read_text()) == json.loads((EXAMPLES / "middle" / name).read_text())
