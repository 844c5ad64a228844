"""Bounds hold against the best of all plans on small maps, and count what must be visited."""

from __future__ import annotations

import heapq
import itertools

import numpy as np
import pytest

from react_opt.energy import RobotProfile
from react_opt.geometry.occupancy import OccupancyMap
from react_opt.geometry.raycast import ray_table, scan_px
from react_opt.limits.bound import candidates, detours, reachability_s, time_bound
from react_opt.limits.hidden import from_rest_s, survey
from react_opt.sim.loop import TICK_S
from react_opt.sim.world import World

# Letters of one metre, three pixels each; robots drive 1 m/s, turn and gather speed at once.
ROBOT = RobotProfile(0.2, 0.2, 1.0, 1.0, 0.2, 1e6, 1e6, 1.0, 1.0, 1.0, 1.0, 1e6, 1e6, 0.0, 6.0, 360)

COMB = """
#################
#.#.....#.....#.#
#.#.###.#.###.#.#
#.#.###.#.###.#.#
#...###...###...#
#################
"""
CROSS = """
###########
####.#..###
####.##.###
#........##
#.##.##..##
#.##.#.#.##
###########
"""


def world_of(drawing: str, starts: list[tuple[float, float]]) -> World:
    rows = np.array([[0 if letter == "." else 1 for letter in line] for line in drawing.split()][::-1], dtype=np.uint8)
    return World(OccupancyMap(np.kron(rows, np.ones((3, 3), np.uint8)), 1 / 3), ROBOT.radius_m, 6.0, np.array(starts))


def best_time(world: World, starts: list[tuple[float, float]], share: float) -> float:
    """The least time in which robots that drive from letter to letter see a share: all ways of all robots are tried."""
    cells, cover = world.map.cells, world.coverable.ravel()
    free = [(x, y) for y in range(cells.shape[0] // 3) for x in range(cells.shape[1] // 3) if not cells[3 * y, 3 * x]]
    sees = {}
    for x, y in free:
        known, fresh = np.full(cells.shape, 2, dtype=np.uint8), np.empty(cells.size, dtype=np.int64)
        scan_px(cells, known, 3 * x + 1.5, 3 * y + 1.5, 1.0, 0.0, ray_table(720), 18.0, fresh)
        sees[x, y] = frozenset(np.flatnonzero((known != 2).ravel() & cover).tolist())
    needed = int(np.ceil(share * cover.sum() - 1e-9))
    near = {(x, y): [k for k in ((x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)) if k in sees] for x, y in free}
    homes = tuple((int(x), int(y)) for x, y in starts)
    queue = [(0, 0, homes, frozenset().union(*(sees[k] for k in homes)))]
    done, order = set(), itertools.count(1)
    while queue:  # all robots move one letter, or wait, per second
        time, _, places, seen = heapq.heappop(queue)
        if len(seen) >= needed:
            return float(time)
        if (places, seen) in done:
            continue
        done.add((places, seen))
        for step in itertools.product(*([*near[k], k] for k in places)):
            heapq.heappush(queue, (time + 1, next(order), step, seen.union(*(sees[k] for k in step))))
    return np.inf


@pytest.mark.parametrize("share", [0.8, 0.95])
@pytest.mark.parametrize(
    ("drawing", "starts"),
    [(COMB, [(9.5, 1.5)]), (CROSS, [(4.5, 3.5)]), (CROSS, [(4.5, 3.5), (3.5, 3.5)])],
    ids=["comb", "cross", "cross of two"],
)
def test_no_plan_is_faster(drawing: str, starts: list[tuple[float, float]], share: float) -> None:
    world = world_of(drawing, starts)
    hidden = survey(world, [ROBOT] * len(starts), np.array(starts))
    bound = time_bound(hidden, candidates(hidden), share, len(starts))
    assert bound.reachability_s <= bound.time_s <= best_time(world, starts, share)


@pytest.mark.parametrize("share", [0.8, 0.95])
@pytest.mark.parametrize(
    ("drawing", "starts"),
    [(COMB, [(9.5, 1.5)]), (CROSS, [(4.5, 3.5)]), (CROSS, [(4.5, 3.5), (3.5, 3.5)])],
    ids=["comb", "cross", "cross of two"],
)
def test_with_detours_no_plan_is_faster_whatever_regions_are_counted(
    drawing: str, starts: list[tuple[float, float]], share: float
) -> None:
    world = world_of(drawing, starts)
    hidden = survey(world, [ROBOT] * len(starts), np.array(starts))
    regions = candidates(hidden)
    joined = detours(hidden, regions)
    best, needed = best_time(world, starts, share), int(np.ceil(share * hidden.total - 1e-9))
    rng = np.random.default_rng(0)
    for size in (0, 1, 2, 3, 3, 4):
        family = rng.permutation(len(regions.weight))[:size].tolist()
        assert joined.bounds_s(family, len(starts), [needed])[0] <= best
    assert joined.strongest(share, len(starts), [])[0] <= best


@pytest.mark.parametrize("drawing", [COMB, CROSS], ids=["comb", "cross"])
def test_one_robot_alone_has_the_bound_of_a_team_of_one(drawing: str) -> None:
    """The fast method takes only the sets that leave little unseen, and no splits one by one: it finds the same."""
    starts = [(9.5, 1.5) if drawing == COMB else (4.5, 3.5)]
    hidden = survey(world_of(drawing, starts), [ROBOT], np.array(starts))
    joined = detours(hidden, candidates(hidden))
    needed = [int(np.ceil(share * hidden.total)) for share in (0.7, 0.9, 1.0)]
    rng = np.random.default_rng(1)
    for size in (0, 1, 2, 3, 4, 5):
        family = rng.permutation(len(joined.inside))[:size].tolist()
        np.testing.assert_allclose(joined.alone_s(family, needed), joined.team_s(family, 1, needed), atol=2e-3)


@pytest.mark.parametrize("accel", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("distance", [0.01, 0.2, 1.0, 7.0])
def test_from_rest_is_no_later_than_a_robot_that_gathers_speed_tick_by_tick(accel: float, distance: float) -> None:
    """On ground that allows 0.8 m/s near the start; where it allows more, the way counts less and takes no less."""
    time, done, speed = 0.0, 0.0, 0.0
    while done < distance:
        speed = min(0.8, speed + accel * TICK_S)
        time, done = time + min(TICK_S, (distance - done) / speed), done + speed * TICK_S
    bound = from_rest_s(distance / 0.8, 0.8 / (2 * accel))
    assert distance / 0.8 <= bound <= time + 1e-9
    assert bound >= time - TICK_S - 1e-9


def test_one_region_that_must_be_entered_tells_of_all_that_lies_elsewhere() -> None:
    """A robot that must enter a dead end on one side of its start sees the other side before it or after it."""
    starts = [(9.5, 1.5)]
    world = world_of(COMB, starts)
    hidden = survey(world, [ROBOT], np.array(starts))
    joined, needed = detours(hidden, candidates(hidden)), [int(np.ceil(0.97 * hidden.total))]
    simple = reachability_s(hidden, 0.97, 1)
    assert joined.bounds_s([], 1, needed)[0] <= simple + 1e-9  # places are taken together: it can only be less
    assert max(joined.bounds_s([n], 1, needed)[0] for n in range(len(joined.inside))) > 1.5 * simple


def test_the_dead_ends_of_a_comb_must_be_visited() -> None:
    """One robot must enter dead ends on both sides of its start; reachability counts the way to one of them alone."""
    starts = [(9.5, 1.5)]
    world = world_of(COMB, starts)
    hidden = survey(world, [ROBOT], np.array(starts))
    bound = time_bound(hidden, candidates(hidden), 0.97, 1)
    assert bound.time_s > 2 * bound.reachability_s


def test_a_second_robot_halves_the_work_and_the_bound_knows() -> None:
    starts = [(9.5, 1.5), (8.5, 1.5)]
    world = world_of(COMB, starts)
    hidden = survey(world, [ROBOT] * 2, np.array(starts))
    regions = candidates(hidden)
    one, two = (time_bound(hidden, regions, 0.97, robots).time_s for robots in (1, 2))
    assert two < one


def test_nothing_needed_takes_no_time() -> None:
    world = world_of(CROSS, [(4.5, 3.5)])
    hidden = survey(world, [ROBOT], np.array([(4.5, 3.5)]))
    assert time_bound(hidden, candidates(hidden), 1e-9, 1).time_s <= 0.01
