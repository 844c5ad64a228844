"""A second formulation of OROS as a cvxpy problem, written from the mathematics alone, for agreement tests.

It shares no idea with the model of the package: there are no arc variables. An arc of several steps is a chain of
nodes, so every robot makes one hop per step, and the only motion variables are positions ``p[n, t]`` on cells and
chain nodes. A hop needs a predecessor (``p[n, t] <= sum of p[m, t - 1]`` over the nodes m before n), and its
energy is a lower bound on the debit: ``c[t] >= q[m, n] (p[m, t - 1] + p[n, t] - 1)``, which is exact because a
larger debit never helps.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from react_opt.instance import OrosInstance, OrosRobot

Hop = tuple[int, int]


@dataclass(frozen=True)
class Network:
    """Cells (the first nodes, in order) and chain nodes, with the hops between them that last one step each.

    ``hops`` holds the joules of each travelling hop; waiting is not among them. ``arc_of`` tells the cells between
    which a chain node lies.
    """

    cells: dict[str, int]
    size: int
    hops: dict[Hop, float]
    arc_of: dict[int, tuple[int, int]]


def network(instance: OrosInstance) -> Network:
    """Return the unit-step network of an instance; arcs that no robot can complete are left out."""
    cells = {cell.id: k for k, cell in enumerate(instance.cells)}
    size, hops, arc_of = len(cells), {}, {}
    for arc in instance.travel:
        i, j = cells[arc.from_], cells[arc.to]
        if arc.steps > instance.horizon_steps:
            continue
        nodes = [i, *range(size, size + arc.steps - 1), j]
        size += arc.steps - 1
        arc_of.update(dict.fromkeys(nodes[1:-1], (i, j)))
        joules = arc.energy_j
        for hop in itertools.pairwise(nodes):
            hops[hop] = min(joules, hops.get(hop, np.inf))
            joules = 0.0  # the first step pays for the whole arc
    return Network(cells, size, hops, arc_of)


@dataclass(frozen=True)
class Motion:
    """The variables of one robot: columns are the instants start_step..T."""

    robot: OrosRobot
    stand: cp.Variable
    sense: cp.Variable
    charge: cp.Variable
    plugged: cp.Variable
    level: cp.Variable
    constraints: list[cp.Constraint]


def robot_motion(instance: OrosInstance, net: Network, robot: OrosRobot) -> Motion:
    """Return one robot's variables and the constraints that concern it alone."""
    n, instants = len(net.cells), instance.horizon_steps - robot.start_step + 1
    p = cp.Variable((net.size, instants), boolean=True)
    s = cp.Variable((n, instants), boolean=True)
    u = cp.Variable((n, instants), nonneg=True)
    plugged = cp.Variable((n, instants), boolean=True)
    b = cp.Variable(instants)
    idle_j, sensing_j = robot.idle_w * instance.step_s, robot.sensing_w * instance.step_s
    rules = [cp.sum(p, axis=0) == 1, p[net.cells[robot.start], 0] == 1, s <= p[:n]]
    rules += [cp.sum(p[:n, -1]) == 1, b >= robot.reserve_j, b <= robot.capacity_j]
    if robot.start_step == 0:
        rules.append(s[:, 0] == 0)
    if robot.return_to is not None:
        rules.append(p[net.cells[robot.return_to], -1] == 1)
    rules += [u[:, 0] == 0, plugged[:, 0] == 0, b[0] == robot.battery_j - sensing_j * cp.sum(s[:, 0])]
    power_j = np.zeros((n, 1))
    for charger in instance.chargers:
        power_j[net.cells[charger.cell], 0] = charger.power_w * instance.step_s
    rules.append(u <= cp.multiply(np.repeat(power_j, instants, axis=1), plugged))
    if instants > 1:
        before, after = p[:, :-1], p[:, 1:]
        joules = {**dict.fromkeys(((k, k) for k in range(n)), idle_j), **net.hops}
        tail, head = (_choose([hop[side] for hop in joules], net.size) for side in (0, 1))
        rules.append(after <= head.T @ tail @ before)
        rules += [plugged[:, 1:] <= before[:n], plugged[:, 1:] <= after[:n]]
        debit = cp.Variable((1, instants - 1), nonneg=True)
        cost = sp.diags_array(np.array(list(joules.values())))
        hopped = tail @ before + head @ after - 1
        rules.append(np.ones((len(joules), 1)) @ debit >= cost @ hopped)
        rules.append(b[1:] == b[:-1] - debit[0] - sensing_j * cp.sum(s[:, 1:], axis=0) + cp.sum(u[:, 1:], axis=0))
    return Motion(robot, p, s, u, plugged, b, rules)


def problem(instance: OrosInstance) -> cp.Problem:
    """Return the whole problem, to be maximised."""
    net, horizon = network(instance), instance.horizon_steps
    n = len(net.cells)
    fleet = [robot_motion(instance, net, robot) for robot in instance.robots]
    rules = [rule for motion in fleet for rule in motion.constraints]

    def at(motion: Motion, table: cp.Variable, t: int) -> cp.Expression | None:
        """Return the column of instant t, None before the robot's start."""
        k = t - motion.robot.start_step
        return table[:, k] if k >= 0 else None

    e = cp.Variable((n, horizon + 1), boolean=True)
    rules.append(e[:, 0] == np.array([float(cell.explored) for cell in instance.cells]))
    for t in range(1, horizon + 1):
        sensing = [column for motion in fleet if (column := at(motion, motion.sense, t)) is not None]
        rules.append(e[:, t] <= e[:, t - 1] + sum(sensing, np.zeros(n)))
        standing = [column[:n] for motion in fleet if (column := at(motion, motion.stand, t)) is not None]
        if instance.limits.robots_per_cell is not None and standing:
            rules.append(sum(standing) <= instance.limits.robots_per_cell)
        if instance.limits.sensing_robots_per_step is not None and sensing:
            rules.append(cp.sum(sum(sensing)) <= instance.limits.sensing_robots_per_step)
        for charger in instance.chargers:
            users = [column for motion in fleet if (column := at(motion, motion.plugged, t)) is not None]
            if users:
                rules.append(sum(users)[net.cells[charger.cell]] <= charger.slots)
    if instance.limits.forbid_swaps:
        rules += _no_swaps(net, fleet, horizon)
    weights = np.zeros((n, horizon + 1))
    for k, cell in enumerate(instance.cells):
        last = horizon if cell.deadline_step is None else min(cell.deadline_step, horizon)
        weights[k, 1 : last + 1] = cell.weight
    left = sum((motion.level[-1] for motion in fleet), cp.Constant(0.0))
    return cp.Problem(cp.Maximize(cp.sum(cp.multiply(weights, e)) + instance.sigma * left), rules)


def _no_swaps(net: Network, fleet: list[Motion], horizon: int) -> list[cp.Constraint]:
    """During no step two robots are on i -> j and on j -> i: ``on[e, t]``, robot on edge e from t - 1 to t."""
    n = len(net.cells)
    edges = sorted({(i, j) for i, j in net.hops if i < n and j < n} | set(net.arc_of.values()))
    both = [k for k, (i, j) in enumerate(edges) if (j, i) in edges]
    moving = [motion for motion in fleet if motion.robot.start_step < horizon]
    if not both or len(moving) < 2:
        return []
    tail, head = (_choose([edge[side] for edge in edges], net.size) for side in (0, 1))
    chain = sp.csr_array(
        (np.ones(len(net.arc_of)), ([edges.index(ends) for ends in net.arc_of.values()], list(net.arc_of))),
        shape=(len(edges), net.size),
    )
    rules, under_way = [], []
    for motion in moving:
        before, after = motion.stand[:, :-1], motion.stand[:, 1:]
        on = cp.Variable((len(edges), before.shape[1]), nonneg=True)
        rules += [on >= tail @ before + head @ after - 1, on >= chain @ before, on >= chain @ after]
        under_way.append(on)
    back = [edges.index(edges[k][::-1]) for k in both]
    for one, other in itertools.combinations(under_way, 2):
        steps = min(one.shape[1], other.shape[1])  # both end at T
        rules.append(one[both, -steps:] + other[back, -steps:] <= 1)
    return rules


def _choose(nodes: list[int], size: int) -> sp.csr_array:
    """Return the matrix whose row k picks ``nodes[k]``."""
    return sp.csr_array((np.ones(len(nodes)), (range(len(nodes)), nodes)), shape=(len(nodes), size))


def optimum(instance: OrosInstance) -> float | None:
    """Return the optimal objective, None where the instance is infeasible.

    Solved by HiGHS with its tolerances tightened: the default gap of 1e-4 is wider than a battery's worth.
    """
    whole = problem(instance)
    tight = {"mip_rel_gap": 0.0, "mip_abs_gap": 1e-9, "mip_feasibility_tolerance": 1e-9}
    value = whole.solve(solver=cp.HIGHS, **tight)
    if whole.status == cp.INFEASIBLE:
        return None
    assert whole.status == cp.OPTIMAL, whole.status
    return float(value)
