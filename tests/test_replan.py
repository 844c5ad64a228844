"""Replanning from a step on: what is frozen stays, the rest is never worse."""

import pytest
from strategies import random_oros

from react_opt import check, solve
from react_opt.errors import InputError, UsageError
from react_opt.models.readback import routes_of
from react_opt.models.replay import value
from react_opt.replan import freeze
from react_opt.timegraph import route_problem


def frozen_part(plan, robot, at_step):
    """Rows up to ``at_step``: position, sensing, charge; and what was started before it."""
    rows = next(r for r in plan.robots if r.id == robot).steps
    return [
        (row.t, row.cell, row.arc if row.t < at_step else None, row.sensing, row.charging_j)
        for row in rows
        if row.t <= at_step
    ]


@pytest.mark.parametrize("seed", range(0, 60, 3))
def test_the_first_steps_stay_and_the_plan_is_never_worse(seed):
    instance = random_oros(seed)
    # A plan that leaves room: stop at the greedy one.
    plan = solve(instance, time_limit_s=0.0, threads=1)
    if not plan.robots:
        return
    for at_step in range(instance.horizon_steps + 1):
        again = solve(instance, start=plan, at_step=at_step, threads=1)
        assert check(instance, again).ok
        assert again.objective.total >= plan.objective.total - 1e-9
        assert again.claim.bound >= again.objective.total - 1e-9
        for robot in instance.robots:
            assert frozen_part(again, robot.id, at_step) == frozen_part(plan, robot.id, at_step)


@pytest.mark.parametrize("seed", range(40))
def test_freezing_splits_a_plan_and_joins_it_again(seed):
    instance = random_oros(seed)
    plan = solve(instance, method="monolith", threads=1)
    if not plan.robots:
        return
    problem = route_problem(instance)
    routes = routes_of(instance, problem, plan)
    for at_step in range(instance.horizon_steps + 1):
        frozen = freeze(problem, routes, at_step)
        rest = frozen.rest(routes)
        assert frozen.earned + value(frozen.problem, rest) == pytest.approx(value(problem, routes), abs=1e-9)
        for whole, route in zip(frozen.whole(rest), routes, strict=True):
            assert whole.cell.tolist() == route.cell.tolist()
            assert whole.arc.tolist() == route.arc.tolist()
            assert whole.sense.tolist() == route.sense.tolist()
            assert whole.charge_j == pytest.approx(route.charge_j)


def test_replanning_from_the_start_reaches_the_optimum():
    for seed in range(0, 40, 4):
        instance = random_oros(seed)
        best = solve(instance, threads=1)
        if best.claim.status != "optimal":
            continue
        greedy = solve(instance, time_limit_s=0.0, threads=1)
        again = solve(instance, start=greedy, threads=1)
        assert again.objective.total == pytest.approx(best.objective.total, abs=1e-6)


def test_a_plan_of_another_instance_is_refused():
    plan = solve(random_oros(0), threads=1)
    with pytest.raises(InputError, match="another instance"):
        solve(random_oros(1), start=plan)


def test_at_step_needs_a_plan_and_lies_within_the_horizon():
    instance = random_oros(0)
    plan = solve(instance, threads=1)
    with pytest.raises(UsageError, match="plan to start from"):
        solve(instance, at_step=1)
    with pytest.raises(UsageError, match="expected 0 to"):
        solve(instance, start=plan, at_step=instance.horizon_steps + 1)
