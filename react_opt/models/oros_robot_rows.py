"""Rows of the OROS model that speak of one robot: motion, sensing, battery, charging."""

from __future__ import annotations

import numpy as np

from react_opt.models.oros_columns import RobotColumns
from react_opt.models.program import Program
from react_opt.route_problem import RouteProblem


def motion(problem: RouteProblem, program: Program, robot: RobotColumns) -> None:
    """Robot r stands where it arrives, and leaves from where it stands; before its start it is nowhere.

    y[i,t] = [start] + h[i,t-1] + sum_{a into i} x[a, t - d_a]   and   y[i,t] = h[i,t] + sum_{a out of i} x[a,t], t < T
    """
    nodes = np.argwhere(robot.y >= 0)
    number = np.full(robot.y.shape, -1, dtype=np.int64)
    number[nodes[:, 0], nodes[:, 1]] = np.arange(len(nodes))
    arcs, starts = np.nonzero(robot.x >= 0)
    cells, instants = np.nonzero(robot.h >= 0)
    ends = starts + problem.arc_steps[arcs]
    begins = (nodes[:, 0] == robot.group.start) & (nodes[:, 1] == robot.group.start_step)
    y, x, h = robot.y[nodes[:, 0], nodes[:, 1]], robot.x[arcs, starts], robot.h[cells, instants]
    program.add_rows(
        f"arrive{robot.index}",
        nodes,
        row=np.concatenate([np.arange(len(nodes)), number[problem.arc_to[arcs], ends], number[cells, instants + 1]]),
        column=np.concatenate([y, x, h]),
        value=np.concatenate([np.ones(len(y)), -np.ones(len(x) + len(h))]),
        lower=begins.astype(float),
        upper=begins.astype(float),
    )
    before = nodes[:, 1] < problem.horizon
    number[nodes[before, 0], nodes[before, 1]] = np.arange(before.sum())
    program.add_rows(
        f"leave{robot.index}",
        nodes[before],
        row=np.concatenate([np.arange(before.sum()), number[problem.arc_from[arcs], starts], number[cells, instants]]),
        column=np.concatenate([y[before], x, h]),
        value=np.concatenate([np.ones(before.sum()), -np.ones(len(x) + len(h))]),
        lower=0.0,
        upper=0.0,
    )


def sensing_where_it_stands(problem: RouteProblem, program: Program, robot: RobotColumns) -> None:
    """s[i,t] <= y[i,t]."""
    nodes = np.argwhere(robot.s >= 0)
    m = np.arange(len(nodes))
    program.add_rows(
        f"sense_stands{robot.index}",
        nodes,
        row=np.concatenate([m, m]),
        column=np.concatenate([robot.s[nodes[:, 0], nodes[:, 1]], robot.y[nodes[:, 0], nodes[:, 1]]]),
        value=np.concatenate([np.ones(len(m)), -np.ones(len(m))]),
        upper=0.0,
    )


def battery(problem: RouteProblem, program: Program, robot: RobotColumns) -> None:
    """Battery balance, with reserve_r and capacity_r as bounds of b.

    b[t] = b[t-1] - sum_a q_a x[a,t-1] - idle sum_i h[i,t-1] + sum_i u[i,t] - sensing sum_i s[i,t],
    b[start] = battery_r - sensing sum_i s[i,start]
    """
    first = robot.group.start_step
    live = np.arange(first, problem.horizon + 1)
    arcs, starts = np.nonzero(robot.x >= 0)
    cells, instants = np.nonzero(robot.h >= 0)
    sensed, sense_at = np.nonzero(robot.s >= 0)
    charged, charge_at = np.nonzero(robot.u >= 0)
    rows = [
        live - first,
        live[1:] - first,
        starts + 1 - first,
        instants + 1 - first,
        sense_at - first,
        charge_at - first,
    ]
    columns = [
        robot.b[live],
        robot.b[live[:-1]],
        robot.x[arcs, starts],
        robot.h[cells, instants],
        robot.s[sensed, sense_at],
        robot.u[charged, charge_at],
    ]
    values = [
        np.ones(len(live)),
        -np.ones(len(live) - 1),
        problem.arc_energy_j[arcs],
        np.full(len(cells), robot.group.wait_j),
        np.full(len(sensed), robot.group.sense_j),
        -np.ones(len(charged)),
    ]
    start = np.where(live == first, robot.group.battery_j, 0.0)
    program.add_rows(
        f"battery{robot.index}",
        live,
        row=np.concatenate(rows),
        column=np.concatenate(columns),
        value=np.concatenate(values),
        lower=start,
        upper=start,
    )


def charging_while_waiting(problem: RouteProblem, program: Program, robot: RobotColumns) -> None:
    """u[i,t] <= charger_i h[i,t-1], and u[i,t] <= charger_i z[i,t] where slots are scarce."""
    for name, gate in (("charge_waits", np.roll(robot.h, 1, axis=1)), ("charge_slot", robot.z)):
        nodes = np.argwhere((robot.u >= 0) & (gate >= 0))
        if not len(nodes):
            continue
        m, (i, t) = np.arange(len(nodes)), nodes.T
        program.add_rows(
            f"{name}{robot.index}",
            nodes,
            row=np.concatenate([m, m]),
            column=np.concatenate([robot.u[i, t], gate[i, t]]),
            value=np.concatenate([np.ones(len(m)), -problem.charger_j[i]]),
            upper=0.0,
        )
