"""Plans with the map known: driven in the simulator they see what they promise, and no bound is above them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.instance import Mission, canonical
from react_opt.jsonio import load, parse
from react_opt.limits.bound import candidates, time_bound
from react_opt.limits.drive import Drive, nominal
from react_opt.limits.fullmap import best_plan, outlook_of
from react_opt.limits.hidden import survey
from react_opt.limits.legs import place_at
from react_opt.limits.polish import MOST_POINTS, done_s, polish
from react_opt.limits.ride import SCAN_TICKS, law_of, ride
from react_opt.limits.routes import MOST_STOPS, anneal, popcount, route_s, seen_by
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
    plan = best_plan(mission, truth, 0.97, restarts=2, steps=20_000)
    assert plan.time_s is not None
    assert plan.coverage >= 0.97
    assert 0 < bound.time_s <= plan.time_s < 40
    explored = coverage_times(Simulation(mission, truth).run())
    needed = explored[int(np.ceil(0.97 * len(explored))) - 1]
    assert needed >= bound.time_s / (1 + 3 * mission.noise.speed)


def test_bits_are_counted() -> None:
    for word in (0, 1, 2**63, 2**64 - 1, 0x123456789ABCDEF0):
        assert popcount(np.uint64(word)) == word.bit_count()


WAY = [
    (2.0, 2.0), (3.0, 2.4), (3.2, 3.5), (4.6, 2.1), (6.5, 2.1), (8.0, 3.0), (7.0, 3.1), (9.0, 3.4),
    (11.0, 3.4), (11.2, 1.5),
]  # fmt: skip


def test_a_compiled_ride_is_a_ride_in_the_simulator() -> None:
    """Straight stretches, bends, a turn on the spot, a door that slows down: at every scan they are at one place."""
    mission, truth = mission_of(1), two_rooms()
    trace = Simulation(nominal(mission), truth, strategy=Drive({"r0": tuple(WAY)})).run()
    driven = trace.tracks[0].array()[:, :2]
    profile = RobotProfile(**mission.profiles["jackal"].model_dump())
    space = World(truth, profile.radius_m, 8.0, np.array([(1.0, 2.0)])).space
    places = np.empty((2000, 2))
    ticks = ride(np.array(WAY), len(WAY), (space.clearance_m, 0.1), law_of(profile, 1.0, 2.0, 0.0), places)
    assert np.hypot(*(places[ticks] - WAY[-1])) < 0.2
    scans = places[: ticks + 1 : SCAN_TICKS]
    assert len(driven) >= len(scans)
    np.testing.assert_allclose(scans, driven[: len(scans)], atol=1e-3)


def test_what_is_seen_on_a_way_is_what_is_seen_along_its_points() -> None:
    mission = mission_of(1)
    view = outlook_of(mission, two_rooms())
    n = len(view.chosen)
    assert np.isfinite(view.time_s).all()
    for i, j in [(0, n - 1), (n - 1, 3), (n // 2, n // 3)]:
        way, high, low = view.way(i, j), max(i, j), min(i, j)
        assert np.array_equal(way[[0, -1]], view.points_m[view.chosen[[i, j]]])
        seen = view.seen[high * (high + 1) // 2 + low]
        for u, v in way:
            place = place_at(view.lattice, u, v)
            assert place < 0 or not (view.lattice[2][place] & ~seen).any()


def test_no_order_of_few_stops_is_faster_than_the_one_found() -> None:
    """A robot that must see all that five stops show, from them alone: every order of them is tried."""
    mission = mission_of(1)
    view = outlook_of(mission, two_rooms())
    kept = np.array([0, len(view.chosen) // 4, len(view.chosen) // 2, len(view.chosen) - 3, len(view.chosen) - 1])
    pairs = [int(kept[j] * (kept[j] + 1) // 2 + kept[i]) for j in range(len(kept)) for i in range(j + 1)]
    square = np.ix_(kept, kept)
    net = (view.time_s[square], view.out_rad[square], view.into_rad[square], view.loss_s, view.seen[pairs])
    starts, seen = np.array([len(kept) - 1]), np.zeros(view.seen.shape[1], dtype=np.uint64)
    every = list(range(len(kept) - 1))
    whole = seen_by(net, np.array([every]), np.array([len(every)]), starts, seen)
    best = np.inf
    for size in range(len(every) + 1):
        for order in itertools.permutations(every, size):
            stops, counts = np.array([[*order, 0]]), np.array([size])
            if seen_by(net, stops, counts, starts, seen) == whole:
                best = min(best, route_s(net, stops[0], size, int(starts[0]), 0.0))
    stops, counts = np.zeros((1, MOST_STOPS), dtype=np.int64), np.zeros(1, dtype=np.int64)
    near = np.argsort(net[0], axis=1)[:, 1:]
    cost = anneal(net, near, stops, counts, starts, np.zeros(1), whole, 10.0, 20_000, 5.0, 0.05, 0)
    assert route_s(net, stops[0], int(counts[0]), int(starts[0]), 0.0) == pytest.approx(best)
    assert best <= cost <= 1.05 * best


def test_the_time_of_a_team_is_when_the_last_pixel_that_is_wanted_comes() -> None:
    first = np.array([[0, 4, 9, 1 << 40], [2, 6, 5, 1 << 40]])
    scans, histogram = np.array([10, 7]), np.zeros(100, dtype=np.int64)
    times = [done_s(first, scans, needed, histogram)[0] for needed in (1, 2, 3, 4)]
    assert times[:3] == pytest.approx([0.0, 1.0, 1.25])  # at the scans 0, 4 and 5, four a second
    assert times[3] > 1000  # the last pixel is never seen


@pytest.mark.parametrize("seed", [0, 1])
def test_polishing_makes_no_plan_worse_and_keeps_to_free_space(seed: int) -> None:
    mission, truth = mission_of(1), two_rooms()
    view = outlook_of(mission, truth)
    ways, counts = np.zeros((1, MOST_POINTS, 2)), np.array([len(WAY)])
    ways[0, : len(WAY)] = WAY
    profile = RobotProfile(**mission.profiles["jackal"].model_dump())
    laws = np.array([law_of(profile, 1.0, 2.0, 0.0)])
    still = (view.space.padded, 1 / view.space.resolution_m, ways, counts, view.ground, laws, view.lattice)
    needed = int(0.95 * view.samples)
    before = polish(*still, needed, 0, 0.1, 0.01, seed)
    after = polish(*still, needed, 3000, 0.1, 0.01, seed)
    assert after < before
    path = truth.pixel_to_world(ways[0, : counts[0]] / 0.1)
    assert view.space.path_free(np.concatenate(([(1.0, 2.0)], path)))


def test_same_seed_same_plan() -> None:
    one, other = (best_plan(mission_of(2), two_rooms(), 0.9, restarts=1, steps=5000, seed=3) for _ in range(2))
    assert one == other
