"""scipy's linear assignment, for assignments without side constraints."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks.peers.plans import assignment_plan
from benchmarks.peers.registry import Limits, Tell, peer
from react_opt.models.assignment import build, objective_of


def _plain(instance: Any) -> bool:
    return not instance.conflicts and all(robot.capacity == 1 for robot in instance.robots)


@peer("scipy", ("assignment",), about="scipy.optimize.linear_sum_assignment", package="scipy", takes=_plain)
def scipy_assignment(instance: Any, limits: Limits, tell: Tell) -> Any:
    """Solve the linear assignment problem of the pairs that gain something; it has no time limit to be given."""
    model = build(instance)
    gain = np.maximum(model.arrays.value, 0.0)
    robots, targets = linear_sum_assignment(gain, maximize=True)
    useful = gain[robots, targets] > 0
    robot_of = np.full(len(model.targets), -1, dtype=np.int64)
    robot_of[targets[useful]] = robots[useful]
    objective = objective_of(model.arrays, robot_of)
    return assignment_plan(instance, model, robot_of, objective, "none", "scipy")
