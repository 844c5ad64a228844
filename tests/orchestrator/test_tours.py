"""Tours of the fleet: the local search against all orders of a few targets, and what the cost stands for."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from react_opt.orchestrator.tours import Tasks, better_tours, insert_all, plan_tours, tour_cost

SHARES = np.array([0.8, 0.97, 1.0])
WEIGHTS = np.array([1.0, 2.0, 1.0])
PRICE_S = 10.0


def line(  # type: ignore[no-untyped-def]
    at: list[float], starts: list[float], value: list[float], left_s: float = 1000.0, price_s: float = PRICE_S
):
    """Return targets on a line, where a metre takes a second."""
    x, s = np.array(at), np.array(starts)
    return tasks_of(np.abs(s[:, None] - x[None]), np.abs(x[:, None] - x[None]), value, left_s=left_s, price_s=price_s)


def tasks_of(start_s, between_s, value, **changes) -> Tasks:  # type: ignore[no-untyped-def]
    """Return targets of which nothing is seen but from their own place."""
    robots, count = start_s.shape
    tasks = Tasks(
        start_s, between_s, np.tile(np.eye(count), (robots, 1, 1)), np.tile(np.eye(count), (count, 1, 1)),
        np.array(value), 0.0, SHARES, WEIGHTS, PRICE_S, 1000.0, np.full(robots, -1, dtype=np.int64), 0.0,
    )  # fmt: skip
    return tasks._replace(**changes)


def planned(tasks: Tasks, work: int = 20_000):  # type: ignore[no-untyped-def]
    robots, count = tasks.start_s.shape
    begin = insert_all(np.full(robots - 1, -1, dtype=np.int64), np.arange(count), tasks)
    return plan_tours(begin, tasks, work)


@pytest.mark.parametrize("seed", range(8))
def test_small_fleets_get_the_best_of_all_tours(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, starts = rng.uniform(0, 30, (4, 2)), rng.uniform(0, 30, (2, 2))
    tasks = tasks_of(
        np.hypot(*(starts[:, None] - points[None]).transpose(2, 0, 1)),
        np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1)),
        rng.uniform(1, 9, 4),
        known=5.0,
    )
    best = min(tour_cost(np.array(order), tasks, np.empty(4)) for order in itertools.permutations([0, 1, 2, 3, -1]))
    order, cost = planned(tasks)
    assert sorted(order.tolist()) == [-1, 0, 1, 2, 3]
    assert cost <= 1.05 * best  # a local search: on instances so small it is nearly always the optimum


def test_a_small_region_on_the_way_is_taken_along() -> None:
    """From 0: a small one at 2 and a large one at 20. Coming back for the small one would take 18 s."""
    order, _ = planned(line([20.0, 2.0], [0.0], [50.0, 1.0]))
    assert order.tolist() == [1, 0]


def test_two_robots_share_the_work() -> None:
    """Robots at 0 and 100, targets beside either: neither crosses the hall."""
    order, _ = planned(line([2.0, 98.0], [0.0, 100.0], [5.0, 5.0]))
    assert order.tolist() == [0, -1, 1]


def test_a_robot_keeps_its_target_unless_another_is_better_by_more_than_turning_costs() -> None:
    tasks = line([10.0, -9.0], [0.0], [5.0, 5.0])
    assert planned(tasks)[0].tolist() == [1, 0]
    assert planned(tasks._replace(first=np.array([0]), keep_s=3.0))[0].tolist() == [0, 1]


def test_a_target_that_will_have_been_seen_is_passed_over() -> None:
    """A room at 10 and a hall at 30 that shows it: driving straight to the hall is better, and ends the tour."""
    tasks = line([10.0, 30.0], [0.0], [2.0, 50.0])._replace(start_s=np.array([[18.0, 30.0]]))
    apart, _ = planned(tasks)
    assert apart.tolist() == [0, 1]
    at_first, on_way = tasks.at_first.copy(), tasks.on_way.copy()
    at_first[0, 1, 0] = on_way[0, 1, 0] = 0.9
    order, cost = planned(tasks._replace(at_first=at_first, on_way=on_way))
    assert order.tolist() == [1, 0]
    alone = tasks_of(np.array([[30.0]]), np.zeros((1, 1)), [52.0])
    assert cost <= planned(alone)[1] + 10.0  # nearly as if there were the hall only


def test_what_cannot_be_reached_in_time_comes_last() -> None:
    """With 12 s left the large region at 30 is out of reach: the small one behind is visited first."""
    order, _ = planned(line([30.0, 10.0], [0.0], [50.0, 5.0], left_s=12.0))
    assert order.tolist() == [1, 0]


@pytest.mark.parametrize(("price_s", "first"), [(1.0, 1), (30.0, 0)])
def test_a_closet_is_looked_into_in_passing_if_it_is_worth_its_time(price_s: float, first: int) -> None:
    """A closet is 4 s off the way to a hall, which makes nearly all of the whole: 8 s for a worth of 1."""
    start = np.array([[4.0, 10.0]])
    between = np.array([[0.0, 14.0], [14.0, 0.0]])
    tasks = tasks_of(start, between, [1.0, 200.0], shares=np.array([0.97]), weights=np.array([0.0]), price_s=price_s)
    assert planned(tasks)[0][0] == first


@pytest.mark.parametrize("left_s", [1000.0, 45.0])
def test_a_crumb_that_will_be_too_late_is_not_fetched_first(left_s: float) -> None:
    """A large region at 20 and a crumb at -10: after the region the crumb takes until 50."""
    order, _ = planned(line([20.0, -10.0], [0.0], [60.0, 0.1], left_s))
    assert order.tolist() == [0, 1]


def test_tours_are_kept_unless_others_are_better_by_more_than_the_margin() -> None:
    """Beginning with the target at the far side costs some seconds more, of which the margin may be more or less."""
    tasks = line([10.0, -12.0], [0.0], [5.0, 5.0])
    kept, unseen = np.array([1, 0]), np.empty(2)
    gain_s = tour_cost(kept, tasks, unseen) - tour_cost(np.array([0, 1]), tasks, unseen)
    assert gain_s > 0.0
    assert better_tours(kept, tasks, 1000, 0.9 * gain_s) == [[0, 1]]
    assert better_tours(kept, tasks, 1000, 1.1 * gain_s) == [[1, 0]]


def test_a_robot_without_work_gets_some_whatever_the_margin() -> None:
    tasks = line([2.0, 98.0], [0.0, 100.0], [5.0, 5.0])
    assert better_tours(np.array([0, 1, -1]), tasks, 1000, 1e6) == [[0], [1]]
