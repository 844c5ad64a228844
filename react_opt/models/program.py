"""A sparse mixed-integer linear program whose columns and rows come in named blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
_T = TypeVar("_T", bound=np.generic)


@dataclass(frozen=True)
class Block:
    """A family of columns or of rows.

    Parameters
    ----------
    name
        Symbol of the family, as in the docstring of the model that adds it.
    first, size
        Its columns (rows) are ``first .. first + size - 1``.
    keys
        ``(size, k)`` index of each member, the subscripts of the symbol.
    """

    name: str
    first: int
    size: int
    keys: IntArray

    @property
    def indices(self) -> IntArray:
        """Column (row) numbers of the block."""
        return np.arange(self.first, self.first + self.size, dtype=np.int64)

    def labels(self) -> list[str]:
        """Names of the members, valid in MPS and LP files: ``x_0_3_5``."""
        return ["_".join((self.name, *map(str, key))) for key in self.keys.tolist()]


@dataclass
class Program:
    """``max (or min) c x  s.t.  row_lower <= A x <= row_upper, lower <= x <= upper``, some x integer.

    Built block by block with :meth:`add_columns` and :meth:`add_rows`; a caller may add blocks of its own to a
    model that it was handed.
    """

    name: str
    maximise: bool = True
    columns: dict[str, Block] = field(default_factory=dict)
    rows: dict[str, Block] = field(default_factory=dict)
    _cost: list[FloatArray] = field(default_factory=list)
    _lower: list[FloatArray] = field(default_factory=list)
    _upper: list[FloatArray] = field(default_factory=list)
    _integer: list[NDArray[np.bool_]] = field(default_factory=list)
    _row_lower: list[FloatArray] = field(default_factory=list)
    _row_upper: list[FloatArray] = field(default_factory=list)
    _entries: list[tuple[IntArray, IntArray, FloatArray]] = field(default_factory=list)
    _n_columns: int = 0
    _n_rows: int = 0

    def add_columns(
        self,
        name: str,
        keys: ArrayLike,
        *,
        cost: ArrayLike = 0.0,
        lower: ArrayLike = 0.0,
        upper: ArrayLike = np.inf,
        integer: bool = False,
    ) -> IntArray:
        """Add a block of columns and return their numbers.

        Parameters
        ----------
        name
            Symbol of the block, not used before.
        keys
            ``(n, k)`` subscripts, one row per column (``(n,)`` for one subscript).
        cost, lower, upper
            Objective coefficients and bounds, scalars or ``(n,)``.
        integer
            Whether the columns take whole values only.

        Raises
        ------
        ValueError
            Where the name is taken or the shapes do not fit.
        """
        if name in self.columns:
            raise ValueError(f"the program already has columns {name!r}")
        block = _block(name, self._n_columns, keys)
        n = block.size
        self.columns[name] = block
        self._cost.append(_filled(cost, n))
        self._lower.append(_filled(lower, n))
        self._upper.append(_filled(upper, n))
        self._integer.append(np.full(n, integer))
        self._n_columns += n
        return block.indices

    def add_rows(
        self,
        name: str,
        keys: ArrayLike,
        *,
        row: ArrayLike,
        column: ArrayLike,
        value: ArrayLike,
        lower: ArrayLike = -np.inf,
        upper: ArrayLike = np.inf,
    ) -> IntArray:
        """Add a block of rows and return their numbers.

        Parameters
        ----------
        name
            Symbol of the block, not used before.
        keys
            ``(m, k)`` subscripts, one row per constraint.
        row, column, value
            Entries: ``row`` counts from 0 within the block, ``column`` is a column number; repeated entries
            add up.
        lower, upper
            Bounds of the rows, scalars or ``(m,)``.

        Raises
        ------
        ValueError
            Where the name is taken, an entry lies outside, or the shapes do not fit.
        """
        if name in self.rows:
            raise ValueError(f"the program already has rows {name!r}")
        block = _block(name, self._n_rows, keys)
        rows, columns = np.asarray(row, dtype=np.int64).ravel(), np.asarray(column, dtype=np.int64).ravel()
        values = _filled(value, len(rows))
        if len(rows) != len(columns):
            raise ValueError(f"{len(rows)} row numbers, but {len(columns)} column numbers")
        if len(rows) and not (rows.min() >= 0 and rows.max() < block.size):
            raise ValueError(f"a row number of {name!r} lies outside 0..{block.size - 1}")
        if len(columns) and not (columns.min() >= 0 and columns.max() < self._n_columns):
            raise ValueError(f"a column number of {name!r} lies outside 0..{self._n_columns - 1}")
        self.rows[name] = block
        self._row_lower.append(_filled(lower, block.size))
        self._row_upper.append(_filled(upper, block.size))
        self._entries.append((rows + block.first, columns, values))
        self._n_rows += block.size
        return block.indices

    @property
    def n_columns(self) -> int:
        """Number of columns."""
        return self._n_columns

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return self._n_rows

    @property
    def cost(self) -> FloatArray:
        """``(n_columns,)`` objective coefficients."""
        return _joined(self._cost, np.float64)

    @property
    def lower(self) -> FloatArray:
        """``(n_columns,)`` lower bounds."""
        return _joined(self._lower, np.float64)

    @property
    def upper(self) -> FloatArray:
        """``(n_columns,)`` upper bounds."""
        return _joined(self._upper, np.float64)

    @property
    def integer(self) -> NDArray[np.bool_]:
        """``(n_columns,)`` True where a column takes whole values only."""
        return _joined(self._integer, np.bool_)

    @property
    def row_lower(self) -> FloatArray:
        """``(n_rows,)`` lower bounds of the rows."""
        return _joined(self._row_lower, np.float64)

    @property
    def row_upper(self) -> FloatArray:
        """``(n_rows,)`` upper bounds of the rows."""
        return _joined(self._row_upper, np.float64)

    def matrix(self) -> sp.csr_array:
        """Return A, ``(n_rows, n_columns)``, without stored zeros."""
        rows = _joined([entry[0] for entry in self._entries], np.int64)
        columns = _joined([entry[1] for entry in self._entries], np.int64)
        values = _joined([entry[2] for entry in self._entries], np.float64)
        matrix = sp.coo_array((values, (rows, columns)), shape=(self._n_rows, self._n_columns)).tocsr()
        matrix.sum_duplicates()
        matrix.eliminate_zeros()
        return matrix

    def column_labels(self) -> list[str]:
        """Names of all columns, in order."""
        return [label for block in self.columns.values() for label in block.labels()]

    def row_labels(self) -> list[str]:
        """Names of all rows, in order."""
        return [label for block in self.rows.values() for label in block.labels()]

    def values(self, x: FloatArray, name: str) -> FloatArray:
        """Return the part of a solution vector that belongs to a block of columns."""
        block = self.columns[name]
        return x[block.first : block.first + block.size]

    def objective(self, x: FloatArray) -> float:
        """Return c x."""
        return float(self.cost @ x)

    def violation(self, x: FloatArray) -> float:
        """Return the largest violation of any row, bound or integrality by ``x``."""
        activity = self.matrix() @ x
        parts = [
            self.lower - x,
            x - self.upper,
            self.row_lower - activity,
            activity - self.row_upper,
            np.abs(x - np.round(x))[self.integer],
        ]
        return max((float(part.max()) for part in parts if len(part)), default=0.0)

    def fixed(self, values: Mapping[int, float]) -> Program:
        """Return a copy in which some columns are fixed; blocks and rows are shared."""
        lower, upper = self.lower, self.upper
        for column, value in values.items():
            lower[column] = upper[column] = value
        return Program(
            self.name, self.maximise, self.columns, self.rows, self._cost, [lower], [upper], self._integer,
            self._row_lower, self._row_upper, self._entries, self._n_columns, self._n_rows,
        )  # fmt: skip


def _block(name: str, first: int, keys: ArrayLike) -> Block:
    array = np.asarray(keys, dtype=np.int64)
    if array.ndim == 1:
        array = array[:, None]
    return Block(name, first, len(array), array)


def _filled(value: ArrayLike, n: int) -> FloatArray:
    return np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (n,)))


def _joined(parts: Sequence[NDArray[_T]], kind: type[_T]) -> NDArray[_T]:
    return np.concatenate(parts) if parts else np.empty(0, dtype=kind)
