"""How good the plans of the primal search are, alone: ``python -m benchmarks.primal [--seconds S] [--seeds N]``.

Prints for each instance the greedy plan, the plan after some seconds, when it was found, and how the seeds differ.
"""

from __future__ import annotations

import argparse
import time

from benchmarks.families import metric_complete, walled_grid
from react_opt.instance import OrosInstance
from react_opt.models.replay import feasible, value
from react_opt.route_problem import Route
from react_opt.solvers.routes.greedy import greedy
from react_opt.solvers.routes.search import improve
from react_opt.timegraph import route_problem

INSTANCES = [
    (walled_grid(2, 5, 4, 24, 1), 1.0),
    (walled_grid(4, 10, 1, 40, 1), 2.0),
    (walled_grid(4, 10, 3, 24, 1), 2.0),
    (walled_grid(5, 8, 2, 30, 1), 2.0),
    (walled_grid(6, 10, 3, 32, 1), 5.0),
    (walled_grid(8, 8, 4, 28, 1), 5.0),
    (walled_grid(8, 8, 4, 28, 1, 0.5), 5.0),
    (walled_grid(10, 10, 4, 40, 1), 10.0),
    (walled_grid(10, 10, 4, 40, 1, 0.5), 10.0),
    (metric_complete(20, 3, 1), 3.0),
    (metric_complete(50, 4, 1), 10.0),
    (walled_grid(20, 20, 4, 120, 1), 60.0),
    (walled_grid(40, 40, 10, 240, 1), 300.0),
]


class _Clock:
    """When the last improvement came."""

    def __init__(self, begin: float) -> None:
        self.begin = begin
        self.last_s = 0.0

    def __call__(self, routes: list[Route], worth: float) -> None:
        self.last_s = time.perf_counter() - self.begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, help="time for every instance (default: its own)")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--cells", type=int, default=10**9, help="largest instance")
    arguments = parser.parse_args()
    _warm_up()
    print(f"{'instance':42} {'greedy':>11} {'s':>6}  " + "plan after s (found at s), by seed")
    for data, own in INSTANCES:
        if len(data["cells"]) > arguments.cells:
            continue
        problem = route_problem(OrosInstance.model_validate(data))
        begin = time.perf_counter()
        start = greedy(problem).routes
        greedy_s = time.perf_counter() - begin
        assert start is not None
        plans = []
        for seed in range(arguments.seeds):
            begin = time.perf_counter()
            clock = _Clock(begin)
            deadline = begin + (arguments.seconds or own)
            plan = improve(problem, start, deadline=deadline, seed=seed, on_improve=clock)
            assert not feasible(problem, plan)
            plans.append(f"{value(problem, plan):.3f} ({clock.last_s:.2f})")
        name = data["name"]
        print(f"{name:42} {value(problem, start):11.3f} {greedy_s:6.3f}  {'  '.join(plans)}", flush=True)


def _warm_up() -> None:
    """Compile the kernels before anything is timed."""
    problem = route_problem(OrosInstance.model_validate(walled_grid(2, 3, 2, 6, 0)))
    start = greedy(problem).routes
    assert start is not None
    improve(problem, start, work_limit=12)


if __name__ == "__main__":
    main()
