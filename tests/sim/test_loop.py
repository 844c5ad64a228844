"""A mission as a whole: it gets somewhere, and the same mission gives the same trace."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from react_opt.certify_trace import check_trace
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import Noise
from react_opt.orchestrator.belief import Belief
from react_opt.orchestrator.strategy import Decision
from react_opt.sim.loop import Simulation
from react_opt.trace import NEVER, Trace
from tests.sim.missions import TWO_ROOMS, mission


def told(trace: Trace) -> dict[str, Any]:
    """Return all of a trace but what the machine's speed decides."""
    return trace.model_dump(mode="json", exclude={"wall_s", "decisions_wall_s"})


NOISY = Noise(speed=0.05, waiting_s=0.3, power=0.02)


def test_two_robots_see_two_rooms() -> None:
    trace = Simulation(mission([(1.5, 1.5), (1.5, 4.0)]), TWO_ROOMS).run()
    assert trace.frames[-1].coverage > 0.97
    assert trace.status == "finished"


def test_the_same_seed_gives_the_same_trace_and_another_seed_another() -> None:
    runs = [
        Simulation(mission([(1.5, 1.5), (1.5, 4.0)], noise=NOISY, seed=seed), TWO_ROOMS).run() for seed in (3, 3, 4)
    ]
    assert told(runs[0]) == told(runs[1])
    assert told(runs[0])["frames"] != told(runs[2])["frames"]


def test_batteries_never_rise_and_seen_pixels_are_never_unseen() -> None:
    trace = Simulation(mission([(1.5, 1.5), (1.5, 4.0)], noise=NOISY), TWO_ROOMS).run()
    for n in range(2):
        left = [frame.robots[n].battery_j for frame in trace.frames]
        assert all(b <= a for a, b in itertools.pairwise(left))
    shares = [frame.coverage for frame in trace.frames]
    assert all(b >= a for a, b in itertools.pairwise(shares))
    known = trace.known.array("<u2")
    assert np.count_nonzero(known != NEVER) > 0


def test_a_robot_dies_and_the_other_goes_on() -> None:
    trace = Simulation(
        mission([(1.5, 1.5), (1.5, 4.0)], failures=[{"robot": "r1", "t_s": 3.0}], horizon_s=90.0), TWO_ROOMS
    ).run()
    dead = [(event.t_s, event.robot) for event in trace.events if event.type == "robot_dead"]
    assert dead == [(3.0, "r1")]
    assert trace.frames[-1].coverage > 0.97
    places = {(frame.robots[0].x_m, frame.robots[0].y_m) for frame in trace.frames if frame.t_s >= 3}
    assert len(places) == 1


def test_a_building_larger_than_was_said_gets_more_areas() -> None:
    trace = Simulation(
        mission([(1.5, 1.5), (1.5, 4.0)], extent_m=(0.0, 0.0, 6.0, 8.0), horizon_s=90.0), TWO_ROOMS
    ).run()
    assert {event.target for event in trace.events if event.type == "area_added"} == {"1,0", "1,1"}
    assert trace.frames[-1].coverage > 0.97


def test_a_wrong_sketch_costs_time_but_not_the_mission() -> None:
    """The sketch closes the door between the two rooms and opens a wall; what is seen counts."""
    sketch = TWO_ROOMS.cells.copy()
    sketch[34:46, 59:61] = 1
    sketch[10:20, 59:61] = 0
    prior = OccupancyMap(sketch, 0.1)
    trace = Simulation(mission([(1.5, 1.5)], horizon_s=90.0, prior_map="sketch.yaml"), TWO_ROOMS, prior).run()
    assert trace.frames[-1].coverage > 0.97


def test_a_map_that_is_turned_is_driven_all_the_same() -> None:
    turned = OccupancyMap(TWO_ROOMS.cells, 0.1, 3.0, -2.0, 0.5)
    starts = [tuple(map(float, turned.pixel_to_world((x * 10, y * 10)))) for x, y in ((1.5, 1.5), (1.5, 4.0))]
    of = mission(starts)
    trace = Simulation(of, turned).run()
    assert trace.frames[-1].coverage > 0.97
    assert check_trace(of, trace, turned.cells).violations == ()


class Waits:
    """Orders nothing, and says that it is not done."""

    def __init__(self) -> None:
        self.asked_s: list[float] = []

    def decide(self, belief: Belief) -> Decision:
        self.asked_s.append(belief.t_s)
        return Decision()


def test_a_strategy_that_leaves_a_robot_standing_is_asked_again() -> None:
    """Nothing new is seen by a robot that stands; what was given up for a while would never be tried again."""
    strategy = Waits()
    Simulation(mission([(1.5, 1.5)], horizon_s=30.0), TWO_ROOMS, strategy=strategy).run()
    assert len(strategy.asked_s) >= 5
    assert all(b - a <= 5.0 for a, b in itertools.pairwise(strategy.asked_s))
