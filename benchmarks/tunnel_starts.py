"""Robots that start in a tunnel and must get past each other: does a deadlock ever occur?

Each seed draws a building (a tunnel of 0.8 to 2.4 m that leads to a hall with a door to a second one), 2 to 4 robots
that wait in the tunnel one behind the other, and three errands for each of them, anywhere in the building, so that
robots that stand in front must often go back in past those behind them. Robots know the building; only the rules of
the road are at work. A robot that gives up an errand (stuck) is sent to it again.

A *deadlock* is a start after which some robot has not done all its errands within ten minutes. What is printed: for
each number of robots the starts, the deadlocks, how often a robot abandoned an errand, and the time to the last errand.

Run ``python benchmarks/tunnel_starts.py [STARTS] [FIRST_SEED]`` (1000 starts take about ten minutes).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field

import numpy as np

from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import FleetRobot, Mission, Profile
from react_opt.orchestrator.belief import Belief, RobotView
from react_opt.orchestrator.strategy import Decision, Order
from react_opt.sim.loop import Simulation

ERRANDS = 3
HORIZON_S = 600.0
Point = tuple[float, float]

JACKAL = Profile(
    length_m=0.508, width_m=0.43, speed_max_m_s=0.89, speed_min_m_s=0.3, full_speed_clearance_m=0.6, accel_m_s2=1.0,
    turn_rad_s=1.5, idle_w=2.0, motion_w=7.0, turn_w=9.0, sensing_w=16.9, battery_j=1e6, capacity_j=1e6,
    lidar_range_m=8.0, lidar_rays=90,
)  # fmt: skip


@dataclass
class Errands:
    """Sends every robot to one place after the other; done when all are done."""

    places: dict[str, list[Point]]
    abandoned: int = 0
    finished_s: dict[str, float] = field(default_factory=dict)

    def decide(self, belief: Belief) -> Decision:
        """Return the next errand of every robot that stands, and the same again where it got stuck."""
        orders = []
        for robot in belief.robots:
            left = self.places[robot.id]
            if robot.state == "stuck":
                self.abandoned += 1
            elif left and robot.state == "idle" and robot.target is not None and near(robot, left[0]):
                left.pop(0)
                if not left:
                    self.finished_s[robot.id] = belief.t_s
            if robot.state in ("idle", "stuck"):
                if left:
                    orders.append(Order(robot.id, belief.path(robot, left[0]), f"errand {len(left)}"))
                elif robot.target is not None:
                    orders.append(Order(robot.id))
        return Decision(orders, done=not any(self.places.values()))


def near(robot: RobotView, place: Point) -> bool:
    return bool(np.hypot(robot.x_m - place[0], robot.y_m - place[1]) < 0.6)


def building(rng: np.random.Generator) -> tuple[OccupancyMap, float]:
    """Return a building, and the y of the middle of its tunnel."""
    cells = np.ones((80, 160), dtype=np.uint8)
    width = float(rng.choice([0.8, 1.0, 1.2, 1.4, 1.6, 2.0, 2.4]))
    middle = float(rng.uniform(2.0, 6.0))
    low = round((middle - width / 2) * 10)
    cells[low : low + round(width * 10), 2:72] = 0  # the tunnel, 7 m
    cells[4:76, 70:115] = 0
    cells[4:76, 117:156] = 0
    door = int(rng.integers(8, 60))
    cells[door : door + int(rng.choice([8, 14])), 115:117] = 0
    return OccupancyMap(cells, 0.1), (low + round(width * 10) / 2) / 10


def run(seed: int) -> tuple[int, bool, int, float]:
    """Return how many robots there were, whether they all did their errands, errands given up, and the time, s."""
    rng = np.random.default_rng(seed)
    truth, middle = building(rng)
    count = int(rng.integers(2, 5))
    robots = tuple(
        FleetRobot(id=f"r{n}", profile="jackal", x_m=1.2 * (n + 1), y_m=middle, yaw_rad=float(rng.uniform(-3, 3)))
        for n in rng.permutation(count).tolist()
    )
    mission = Mission(
        name="tunnel", map="drawn", cell_m=8.0, horizon_s=HORIZON_S, step_s=10.0, profiles={"jackal": JACKAL},
        robots=robots, delta=0.95, strategy="nearest", postpone_below=0.0, seed=seed,
    )  # fmt: skip
    errands = Errands({robot.id: [] for robot in robots})
    simulation = Simulation(mission, truth, strategy=errands)
    simulation.belief.merge_map(0.0, truth)
    rows, cols = np.nonzero(simulation.world.drivable)
    for name in errands.places:
        for at in rng.integers(len(rows), size=ERRANDS):
            errands.places[name].append((float(cols[at] + 0.5) / 10, float(rows[at] + 0.5) / 10))
    trace = simulation.run()
    return count, not any(errands.places.values()), errands.abandoned, trace.frames[-1].t_s


def main(starts: int, first: int) -> int:
    """Print a table; return the number of deadlocks."""
    results: dict[int, list[tuple[bool, int, float]]] = {}
    for seed in range(first, first + starts):
        count, good, abandoned, end_s = run(seed)
        results.setdefault(count, []).append((good, abandoned, end_s))
        if not good:
            print(f"deadlock: seed {seed}", flush=True)
    print("robots  starts  deadlocks  abandoned  median s  longest s")
    for count, rows in sorted(results.items()):
        bad, abandoned = sum(not good for good, _, _ in rows), sum(row[1] for row in rows)
        times = [end_s for good, _, end_s in rows if good]
        print(f"{count:6d}  {len(rows):6d}  {bad:9d}  {abandoned:9d}  {np.median(times):8.1f}  {max(times):9.1f}")
    return sum(not good for rows in results.values() for good, _, _ in rows)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000, int(sys.argv[2]) if len(sys.argv) > 2 else 0) > 0)
