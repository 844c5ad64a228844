"""A program in whole numbers without loss: what CP-SAT needs, or a clear refusal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from itertools import pairwise

import numpy as np

from react_opt.errors import UsageError
from react_opt.models.program import FloatArray, Program

LARGEST = 2**60
"""Largest sum that a row or the objective may reach; 64-bit integers end at 2**63."""
_FAITHFUL_DIGITS = 15
_ULPS = 4
_PASSES = 20

Row = tuple[list[int], list[int], int, int]
"""Columns, whole coefficients, whole lower and upper bound."""


@dataclass(frozen=True)
class Lattice:
    """A program whose every number is whole.

    Column j takes the values ``step[j] * n`` with whole n, ``lower[j] <= n <= upper[j]``.

    Parameters
    ----------
    step
        Step of every column; 1 for integer columns.
    lower, upper
        Bounds of n.
    rows
        The rows, each multiplied by a factor of its own.
    objective
        Whole coefficients of n; the program's objective times ``objective_scale``.
    objective_scale
        See ``objective``.
    """

    step: list[Fraction]
    lower: list[int]
    upper: list[int]
    rows: list[Row]
    objective: list[int]
    objective_scale: Fraction

    def x(self, n: Sequence[int]) -> FloatArray:
        """Return the solution vector of whole numbers."""
        return np.array([float(step * value) for step, value in zip(self.step, n, strict=True)], dtype=np.float64)

    def n(self, x: FloatArray) -> list[int]:
        """Return the whole numbers nearest to a solution vector."""
        return [round(value / float(step)) for step, value in zip(self.step, x.tolist(), strict=True)]


def rational(value: float) -> Fraction:
    """Return the number that a float stands for.

    A float of at most 15 significant digits is that decimal; any other one, the result of arithmetic, is the simplest
    fraction within 4 units in its last place, so that ``1 / 5737`` and ``0.1 * 3`` are what they look like.
    """
    decimal = Decimal(repr(value))
    if len(decimal.as_tuple().digits) <= _FAITHFUL_DIGITS:
        return Fraction(decimal)
    slack = Fraction(_ULPS * math.ulp(value))
    middle = Fraction(value)
    return _simplest(middle - slack, middle + slack)


def _simplest(low: Fraction, high: Fraction) -> Fraction:
    """Return the fraction of least denominator in [low, high], which does not hold 0."""
    if high < 0:
        return -_simplest(-high, -low)
    whole = math.ceil(low)
    if whole <= high:
        return Fraction(whole)
    floor = math.floor(low)
    return floor + 1 / _simplest(1 / (high - floor), 1 / (low - floor))


def common_step(values: Sequence[Fraction]) -> Fraction:
    """Return the largest number of which all values are whole multiples; 1 where all are 0."""
    step = Fraction(0)
    for value in set(values):
        if value:
            step = Fraction(
                math.gcd(step.numerator * value.denominator, value.numerator * step.denominator),
                step.denominator * value.denominator,
            )
    return step or Fraction(1)


def to_lattice(program: Program) -> Lattice:
    """Restate a program in whole numbers, without loss.

    Continuous columns are allowed where an optimal solution provably lies on a lattice: in every row their
    coefficients agree but for the sign, and rows and continuous columns form a forest. Then, for any choice of the
    integers, the rows divided by that coefficient have a totally unimodular matrix over the continuous columns (peel
    off the leaves), so some optimal vertex lies on the lattice of the common step of all their data (Hoffman and
    Kruskal, 1956). Battery balances with or without chargers are of this kind.

    Raises
    ------
    UsageError
        Where that does not hold, a column has no finite bounds, or the whole numbers grow too large.
    """
    exact = _Exact(program)
    factor = [Fraction(0)] * len(exact.rows)
    step = [Fraction(1)] * len(exact.integer)
    for rows, columns in _components(exact):
        data = [bound for j in columns for bound in (exact.lower[j], exact.upper[j]) if bound is not None]
        for i in rows:
            factor[i] = _magnitude(exact, i)
            bounds = [bound for bound in (exact.row_lower[i], exact.row_upper[i]) if bound is not None]
            data += [value / factor[i] for value in bounds + [a for j, a in exact.rows[i] if exact.integer[j]]]
        common = common_step(data)
        for j in columns:
            step[j] = common
        for i in rows:
            factor[i] *= common
    _bound_all(exact)
    lower, upper = [], []
    for j, (low, high) in enumerate(zip(exact.lower, exact.upper, strict=True)):
        if low is None or high is None:
            raise exact.refusal(f"the column {exact.column(j)} has no finite bounds")
        # A derived bound of a continuous column may fall between two lattice points: it is loosened, being implied.
        inward = exact.integer[j]
        lower.append(math.ceil(low / step[j]) if inward else math.floor(low / step[j]))
        upper.append(math.floor(high / step[j]) if inward else math.ceil(high / step[j]))
    lattice_rows = []
    for i, terms in enumerate(exact.rows):
        scale = factor[i] or common_step([a for _, a in terms])
        columns, whole = [j for j, _ in terms], [int(a * step[j] / scale) for j, a in terms]
        least, most = _range(exact, i, columns, whole, lower, upper)
        low, high = exact.row_lower[i], exact.row_upper[i]
        low_n = least if low is None else max(least, math.ceil(low / scale))
        lattice_rows.append((columns, whole, low_n, most if high is None else min(most, math.floor(high / scale))))
    cost = [c * s for c, s in zip(exact.cost, step, strict=True)]
    objective_scale = 1 / common_step(cost)
    objective = [int(c * objective_scale) for c in cost]
    _range(exact, None, list(range(len(step))), objective, lower, upper)
    return Lattice(step, lower, upper, lattice_rows, objective, objective_scale)


class _Exact:
    """The numbers of a program as fractions; None where it has no bound."""

    def __init__(self, program: Program) -> None:
        self.program = program
        known: dict[float, Fraction] = {}

        def exact(values: FloatArray) -> list[Fraction | None]:
            fresh = set(values.tolist()) - known.keys()
            known.update({value: rational(value) for value in fresh if math.isfinite(value)})
            return [known.get(value) for value in values.tolist()]

        matrix = program.matrix()
        self.integer: list[bool] = program.integer.tolist()
        self.lower, self.upper = exact(program.lower), exact(program.upper)
        self.row_lower, self.row_upper = exact(program.row_lower), exact(program.row_upper)
        self.cost = [value or Fraction(0) for value in exact(program.cost)]
        terms = list(zip(matrix.indices.tolist(), (a or Fraction(0) for a in exact(matrix.data)), strict=True))
        ends = matrix.indptr.tolist()
        self.rows = [terms[first:last] for first, last in pairwise(ends)]

    def refusal(self, why: str) -> UsageError:
        return UsageError(
            f"cp-sat computes in whole numbers, and {self.program.name!r} cannot be stated in them without loss: "
            f"{why}; take another solver, or round the numbers of the instance"
        )

    def column(self, j: int) -> str:
        return self.program.column_labels()[j]

    def row(self, i: int) -> str:
        return self.program.row_labels()[i]


def _components(exact: _Exact) -> list[tuple[list[int], list[int]]]:
    """Return the trees (rows, continuous columns) that the continuous columns and their rows form."""
    n = len(exact.integer)
    parent = list(range(n + len(exact.rows)))

    def root(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    touched = [i for i, terms in enumerate(exact.rows) if any(not exact.integer[j] for j, _ in terms)]
    for i in touched:
        for j, _ in exact.rows[i]:
            if not exact.integer[j]:
                a, b = root(j), root(n + i)
                if a == b:
                    raise exact.refusal(f"the continuous columns of the row {exact.row(i)} are linked in a circle")
                parent[a] = b
    trees: dict[int, tuple[list[int], list[int]]] = {}
    for i in touched:
        trees.setdefault(root(n + i), ([], []))[0].append(i)
    for j in range(n):
        if not exact.integer[j]:
            trees.setdefault(root(j), ([], []))[1].append(j)
    return list(trees.values())


def _magnitude(exact: _Exact, i: int) -> Fraction:
    """Return what the coefficients of the continuous columns of a row agree on."""
    sizes = {abs(a) for j, a in exact.rows[i] if not exact.integer[j]}
    if len(sizes) != 1:
        raise exact.refusal(f"the continuous columns of the row {exact.row(i)} have coefficients of several sizes")
    return sizes.pop()


def _bound_all(exact: _Exact) -> None:
    """Fill in missing bounds that the rows imply."""
    lower, upper = exact.lower, exact.upper
    for _ in range(_PASSES):
        loose = {j for j in range(len(lower)) if lower[j] is None or upper[j] is None}
        filled = False
        for i, terms in enumerate(exact.rows) if loose else ():
            if all(j not in loose for j, _ in terms):
                continue
            for sign, side in ((1, exact.row_upper[i]), (-1, exact.row_lower[i])):
                if side is None:
                    continue
                # sum c x <= sign * side; each column's least share of the left side, where it has one
                shares = [(j, sign * a, lower[j] if sign * a > 0 else upper[j]) for j, a in terms]
                unknown = [j for j, _, bound in shares if bound is None]
                least = sum((c * bound for _, c, bound in shares if bound is not None), Fraction(0))
                for j, c, bound in shares:
                    if unknown not in ([], [j]):
                        continue
                    reach = (sign * side - least + (Fraction(0) if bound is None else c * bound)) / c
                    if c > 0 and upper[j] is None:
                        upper[j], filled = reach, True
                    elif c < 0 and lower[j] is None:
                        lower[j], filled = reach, True
        if not filled:
            return


def _range(
    exact: _Exact, i: int | None, columns: list[int], whole: list[int], lower: list[int], upper: list[int]
) -> tuple[int, int]:
    """Return the least and the largest value of row i or the objective; 64 bits must hold it with room to spare."""
    least = sum(a * (lower[j] if a > 0 else upper[j]) for j, a in zip(columns, whole, strict=True))
    most = sum(a * (upper[j] if a > 0 else lower[j]) for j, a in zip(columns, whole, strict=True))
    largest = max(
        (abs(a) * max(abs(lower[j]), abs(upper[j]), 1) for j, a in zip(columns, whole, strict=True)), default=0
    )
    if max(abs(least), abs(most), largest) > LARGEST:
        what = "the objective" if i is None else f"the row {exact.row(i)}"
        raise exact.refusal(f"{what} needs whole numbers above 2**60")
    return least, most
