"""A pass of the labelling that is under way ends at the deadline: on large instances one takes many seconds."""

import time

import numpy as np

from benchmarks.families import walled_grid
from react_opt import parse
from react_opt.solvers.routes.budget import stopping
from react_opt.solvers.routes.columns import Duals
from react_opt.solvers.routes.memory import Memory, fewest_steps
from react_opt.solvers.routes.pricing import RoutePricer
from react_opt.timegraph import route_problem


def test_a_pass_that_is_told_to_stop_proves_nothing():
    problem = route_problem(parse(walled_grid(3, 3, 1, 8, seed=1)))
    pricer = RoutePricer(problem, Memory(fewest_steps(problem), 4))
    duals = Duals(np.zeros(problem.n_cells), np.zeros(1), np.zeros(0), np.zeros(0))
    assert pricer.price(duals).best is not None
    pricer.stop[0] = 1
    told = pricer.price(duals)
    assert told.best is None
    assert list(told.columns) == []


def test_the_flag_is_raised_at_the_deadline_and_not_without_one():
    flag = np.zeros(1, np.uint8)
    with stopping(None, flag):
        pass
    assert flag[0] == 0
    latest = time.perf_counter() + 60.0
    with stopping(time.perf_counter(), flag):
        while flag[0] == 0:
            assert time.perf_counter() < latest, "the flag was never raised"
