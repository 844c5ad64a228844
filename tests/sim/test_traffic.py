"""The rules of the road: head-on in a corridor, queues in a tunnel, dead ends, dead robots; and passing through."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

from react_opt.certify_trace import check_trace
from react_opt.geometry.inflation import clearance_px
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import Mission
from react_opt.orchestrator.belief import Belief
from react_opt.orchestrator.strategy import Decision, Order
from react_opt.sim.loop import TICK_S, Simulation
from react_opt.trace import Trace
from tests.sim.missions import building, mission

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmarks" / "tunnel_starts.py"
# Two halls, 4 m wide, joined by a corridor 8 m long and 0.9 m wide: nobody passes anybody in it.
CORRIDOR = building([(4.0, 0.0, 12.0, 3.5), (4.0, 4.4, 12.0, 8.0)], (16.0, 8.0))


class Go:
    """Sends each robot to one place."""

    def __init__(self, places: dict[str, tuple[float, float]]) -> None:
        self.places = places
        self.sent: set[str] = set()

    def decide(self, belief: Belief) -> Decision:
        orders = [
            Order(robot.id, belief.path(robot, self.places[robot.id]), f"to {robot.id}")
            for robot in belief.robots
            if robot.id in self.places and robot.id not in self.sent
        ]
        self.sent |= {order.robot for order in orders}
        done = all(robot.state in ("idle", "dead", "stuck") for robot in belief.robots) and not orders
        return Decision(orders, done=done)


def drive(of: Mission, truth: OccupancyMap, places: dict[str, tuple[float, float]]) -> Trace:
    simulation = Simulation(of, truth, strategy=Go(places))
    simulation.belief.merge_map(0.0, truth)
    return simulation.run()


def end_of(trace: Trace, name: str) -> tuple[float, float]:
    return next((robot.x_m, robot.y_m) for robot in trace.frames[-1].robots if robot.id == name)


def test_head_on_in_a_corridor_where_nobody_passes() -> None:
    of = mission([(5.0, 3.95), (11.0, 3.95)], horizon_s=120.0)
    trace = drive(of, CORRIDOR, {"r1": (14.0, 6.0), "r2": (2.0, 2.0)})
    assert end_of(trace, "r1") == pytest.approx((14.0, 6.0), abs=0.3)
    assert end_of(trace, "r2") == pytest.approx((2.0, 2.0), abs=0.3)
    assert any(event.type == "yield" and event.robot == "r2" for event in trace.events), "r1 comes first: it is earlier"
    assert check_trace(of, trace).violations == ()


def test_a_reserved_passage_is_entered_by_one_at_a_time() -> None:
    of = mission([(2.0, 3.95), (14.0, 3.95)], horizon_s=120.0)
    trace = drive(of, CORRIDOR, {"r1": (14.0, 6.0), "r2": (2.0, 2.0)})
    inside = [[4.5 < robot.x_m < 11.5 for robot in frame.robots] for frame in trace.frames]
    assert any(row[0] for row in inside)
    assert any(row[1] for row in inside)
    assert not any(all(row) for row in inside)


def test_robots_that_pass_through_each_other_lose_no_time() -> None:
    starts = [(5.0, 3.95), (11.0, 3.95)]
    places = {"r1": (14.0, 6.0), "r2": (2.0, 2.0)}
    free = drive(mission(starts, horizon_s=120.0, blocking=False), CORRIDOR, places)
    blocked = drive(mission(starts, horizon_s=120.0), CORRIDOR, places)
    assert free.frames[-1].t_s < blocked.frames[-1].t_s
    assert not any(event.type == "yield" for event in free.events)


def test_a_standing_robot_makes_way() -> None:
    of = mission([(2.0, 3.95), (8.0, 3.95)], horizon_s=120.0)
    trace = drive(of, CORRIDOR, {"r1": (14.0, 6.0)})
    assert end_of(trace, "r1") == pytest.approx((14.0, 6.0), abs=0.3)


def test_a_dead_robot_is_driven_around_and_where_that_fails_the_target_is_abandoned() -> None:
    dies = [{"robot": "r2", "t_s": 0.5}]
    hall = mission([(2.0, 4.0), (6.0, 4.0)], failures=dies, horizon_s=60.0)
    trace = drive(hall, building([], (12.0, 8.0)), {"r1": (10.0, 4.0), "r2": (6.0, 4.5)})
    assert end_of(trace, "r1") == pytest.approx((10.0, 4.0), abs=0.3)
    corridor = mission([(2.0, 3.95), (8.0, 3.95)], failures=dies, horizon_s=60.0)
    trace = drive(corridor, CORRIDOR, {"r1": (14.0, 6.0), "r2": (9.0, 3.95)})
    assert any(event.type == "target_abandoned" and event.robot == "r1" for event in trace.events)


@pytest.fixture(scope="module")
def tunnel() -> ModuleType:
    spec = importlib.util.spec_from_file_location("tunnel_starts", BENCHMARK)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["tunnel_starts"] = module  # its dataclass looks itself up
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("seed", [13, 61, 162, 236, 340])
def test_no_deadlock_from_a_tunnel(tunnel: ModuleType, seed: int) -> None:
    """Starts at which earlier rules failed: touching robots, a dead end, a queue from both sides, no room to turn."""
    _, done, _, _ = tunnel.run(seed)
    assert done


def test_a_robot_that_cannot_turn_works_itself_free() -> None:
    """Among three posts it can turn neither way to its goal, and clearance lies beside its heading."""
    posts = building([(2.2, 1.7, 2.4, 1.9), (1.4, 1.4, 1.6, 1.6), (2.4, 2.5, 2.6, 2.7)], (4.0, 4.0))
    simulation = Simulation(mission([(0.6, 0.6)]), posts)
    (robot,) = simulation.robots
    robot.u_m, robot.v_m, robot.heading_rad, robot.state = 2.17, 2.37, 0.27, "driving"
    robot.follow([(3.4, 3.4)])
    clearance = simulation.world.space.clearance_m
    unit = posts.resolution_m
    seen = [clearance_px(clearance, robot.u_m / unit, robot.v_m / unit)]
    for _ in range(round(15.0 / TICK_S)):
        simulation.traffic.move(TICK_S)
        seen.append(clearance_px(clearance, robot.u_m / unit, robot.v_m / unit))
    assert seen[0] < robot.profile.radius_m
    assert max(seen) >= robot.profile.radius_m


NARROW = building([(2.0, 0.0, 6.0, 1.6), (2.0, 2.3, 6.0, 4.0)], (8.0, 4.0))
"""A corridor of 0.7 m: a robot of 0.67 m across has 1.7 cm to spare where it turns."""


def test_a_robot_that_waits_in_a_narrow_place_is_not_wedged() -> None:
    """It stands along the corridor and waits before it drives on; working itself free would lead it back or turn it."""
    simulation = Simulation(mission([(1.0, 1.95)]), NARROW)
    (robot,) = simulation.robots
    robot.u_m, robot.v_m, robot.heading_rad, robot.state, robot.wait_s = 2.05, 1.93, 0.0, "driving", 2.0
    robot.follow([(7.0, 1.95)])
    for _ in range(8):
        simulation.traffic.move(TICK_S)
        assert (robot.u_m, robot.v_m, robot.heading_rad, robot.wedged) == (2.05, 1.93, 0.0, False)


@pytest.mark.parametrize("heading", [-0.9, -0.5, -0.25, 0.25, 0.5, 0.9, 2.2, 2.6, -2.2, -2.6])
def test_a_robot_at_a_slant_in_a_narrow_place_gets_out(heading: float) -> None:
    """Nearer to one wall than turning takes: it must not swing to and fro between two headings for ever."""
    simulation = Simulation(mission([(1.0, 1.95)]), NARROW)
    (robot,) = simulation.robots
    traffic = simulation.traffic
    for v in (1.93, 1.95, 1.97):
        if not traffic._free(robot, 4.0, v, heading):
            continue
        robot.u_m, robot.v_m, robot.heading_rad, robot.state, robot.wedged = 4.0, v, heading, "driving", False
        robot.follow([(7.0, 1.95)])
        for _ in range(round(60.0 / TICK_S)):
            traffic.move(TICK_S)
        assert robot.u_m > 6.5
