"""When sensors are on: by the mission's rule, and always where a robot would drive blind."""

from __future__ import annotations

from react_opt.geometry.occupancy import UNKNOWN, OccupancyMap
from react_opt.orchestrator.belief import Belief
from react_opt.orchestrator.strategy import Decision, Order
from react_opt.sim.loop import Simulation
from react_opt.trace import Trace
from tests.sim.missions import JACKAL, building, mission

HALL = building([(5.0, 3.0, 5.2, 5.0)], (10.0, 8.0))
"""A hall with a wall across the straight way from left to right."""

SHORT_SIGHTED = JACKAL.model_copy(update={"lidar_range_m": 2.0})
"""The first scan, made before any order, does not reach the wall."""


class Across:
    """Sends the robot to the other side, with its sensors off as far as the strategy is concerned."""

    def __init__(self, sensing: bool) -> None:
        self.sensing = sensing
        self.sent = False

    def decide(self, belief: Belief) -> Decision:
        (robot,) = belief.robots
        orders = [] if self.sent else [Order("r1", ((robot.x_m, robot.y_m), (8.5, 4.0)), "across", self.sensing)]
        self.sent = True
        return Decision(orders, done=robot.state in ("idle", "stuck") and not orders)


def crossed(known: OccupancyMap, sensing: bool) -> Trace:
    """Return the trace of a robot that crosses the hall, of which something is known; its area counts as explored."""
    of = mission([(1.5, 4.0)], delta=0.5, cell_m=20.0, profiles={"jackal": SHORT_SIGHTED})
    simulation = Simulation(of, HALL, strategy=Across(sensing))
    simulation.belief.merge_map(0.0, known)
    simulation.channel.merged[:] = known.cells
    return simulation.run()


def without_wall() -> OccupancyMap:
    """Return the hall's map without the strip in which the wall stands."""
    cells = HALL.cells.copy()
    cells[:, 45:57] = UNKNOWN
    return OccupancyMap(cells, HALL.resolution_m)


def test_a_robot_does_not_drive_blind_into_a_wall_it_has_not_seen() -> None:
    """Neither by the rule, since the area is explored, nor by its order were sensors on; it looks, and goes around."""
    for sensing in (True, False):
        trace = crossed(without_wall(), sensing)
        assert any(frame.robots[0].sensing for frame in trace.frames if frame.t_s >= 1.0)
        last = trace.frames[-1].robots[0]
        assert abs(last.x_m - 8.5) < 0.2
        assert all(event.type not in ("robot_stuck", "target_abandoned") for event in trace.events)


def test_sensors_stay_off_over_ground_that_is_known() -> None:
    """The same hall, all of it known."""
    trace = crossed(HALL, sensing=False)
    assert not any(frame.robots[0].sensing for frame in trace.frames if frame.t_s >= 1.0)


def test_a_robot_that_cannot_move_as_it_wants_looks_around() -> None:
    """Whatever it thinks it knows."""
    simulation = Simulation(mission([(1.5, 4.0)]), HALL)
    simulation.belief.merge_map(0.0, HALL)
    (robot,) = simulation.robots
    robot.order = Order("r1", (), None, sensing=False)
    assert not simulation.lidars.wanted(robot, HALL.cells, simulation.belief)
    robot.wedged = True
    assert simulation.lidars.wanted(robot, HALL.cells, simulation.belief)
