"""Small programs whose optimum is known, in words; no solver is imported here."""

from __future__ import annotations

import numpy as np

from react_opt.models.program import Program


def knapsack(*, maximise: bool = True) -> Program:
    """Items of value 10, 13, 7 and weight 3, 4, 2 in a sack of 6: the last two (20) beat the first and third (17)."""
    program = Program("sack", maximise)
    sign = 1.0 if maximise else -1.0
    take = program.add_columns("take", [0, 1, 2], cost=sign * np.array([10.0, 13.0, 7.0]), upper=1.0, integer=True)
    program.add_rows("weight", [0], row=[0, 0, 0], column=take, value=[3.0, 4.0, 2.0], upper=6.0)
    return program


def battery() -> Program:
    """Two moves earn 1 each and cost 2.5 J of 4 J: only one is made, and 1.5 J at 0.01 each are left: 1.015."""
    program = Program("battery")
    move = program.add_columns("move", [0, 1], cost=1.0, upper=1.0, integer=True)
    left = program.add_columns("b", [0, 1, 2], cost=[0.0, 0.0, 0.01], upper=4.0)
    program.add_rows(
        "balance",
        [0, 1, 2],
        row=[0, 1, 1, 1, 2, 2, 2],
        column=[left[0], left[1], left[0], move[0], left[2], left[1], move[1]],
        value=[1.0, 1.0, -1.0, 2.5, 1.0, -1.0, 2.5],
        lower=[4.0, 0.0, 0.0],
        upper=[4.0, 0.0, 0.0],
    )
    return program


def charging(power_j: float = 2.5, capacity_j: float = 9.3) -> Program:
    """A robot that charges once or not (2 steps), at most ``power_j`` a step, and drives (3.1 J, worth 1) or not.

    From 4 J, with 1.2 J to be kept: charging 0.3 J is enough to drive. What is left counts 0.1 per J, so it charges
    fully: 4 + 2 * 2.5 - 3.1 = 5.9 J are left, and 1 + 0.59 is the optimum.
    """
    program = Program("charging")
    go = program.add_columns("go", [0], cost=1.0, upper=1.0, integer=True)
    plug = program.add_columns("plug", [0, 1], upper=1.0, integer=True)
    battery = program.add_columns("b", [0, 1, 2, 3], cost=[0, 0, 0, 0.1], lower=1.2, upper=capacity_j)
    charge = program.add_columns("u", [0, 1])
    program.add_rows(
        "balance",
        [0, 1, 2, 3],
        row=[0, 1, 1, 1, 2, 2, 2, 3, 3, 3],
        column=[battery[0], battery[1], battery[0], charge[0], battery[2], battery[1], charge[1], battery[3],
                battery[2], go[0]],
        value=[1, 1, -1, -1, 1, -1, -1, 1, -1, 3.1],
        lower=[4, 0, 0, 0],
        upper=[4, 0, 0, 0],
    )  # fmt: skip
    program.add_rows(
        "plugged", [0, 1], row=[0, 1, 0, 1], column=[*charge, *plug], value=[1, 1, -power_j, -power_j], upper=0.0
    )
    return program


def motley(*, maximise: bool) -> Program:
    """Free, one-sided and whole columns; rows of every kind; coefficients with many digits."""
    program = Program("motley", maximise)
    sign = -1.0 if maximise else 1.0
    x = program.add_columns("x", [0, 1], cost=sign * np.array([1 / 3, -0.1234567890123]), lower=[-np.inf, -5.0])
    y = program.add_columns(
        "y", [0, 1], cost=[sign * 1e-7, sign * -2.0], lower=[-3, 0], upper=[7, np.inf], integer=True
    )
    rows = program.add_rows
    rows("range", [0], row=[0, 0, 0], column=[x[0], x[1], y[1]], value=[1.0, 0.1 * 3, 1e3], lower=-4.5, upper=12.25)
    rows("equal", [[0, 1]], row=[0, 0], column=[x[0], y[0]], value=[2.0, 1 / 7], lower=1.0, upper=1.0)
    rows("least", [0], row=[0, 0], column=[x[1], y[0]], value=1.0, lower=-3.0)
    rows("between", [0], row=[0], column=[y[1]], value=1.0, lower=-9.0, upper=11.5)
    return program


def hard(n: int = 150, m: int = 15) -> Program:
    """A multi-dimensional knapsack that no solver here closes in the time that the tests give it."""
    rng = np.random.default_rng(0)
    program = Program("hard")
    take = program.add_columns("take", np.arange(n), cost=rng.integers(10, 100, n), upper=1.0, integer=True)
    weight = rng.integers(5, 60, (m, n))
    program.add_rows(
        "weight",
        np.arange(m),
        row=np.repeat(np.arange(m), n),
        column=np.tile(take, m),
        value=weight.ravel(),
        upper=weight.sum(axis=1) // 3,
    )
    return program
