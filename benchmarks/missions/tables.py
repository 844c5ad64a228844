"""Tables as text, Markdown and CSV, and the statistics in them."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import stats


@dataclass
class Table:
    """A titled table of ready text; ``note`` says what its figures are."""

    title: str
    columns: list[str]
    rows: list[list[str]] = field(default_factory=list)
    note: str = ""

    def text(self) -> str:
        """Return the table with aligned columns."""
        widths = [max(len(row[n]) for row in [self.columns, *self.rows]) for n in range(len(self.columns))]
        lines = [self.title, "-" * len(self.title)]
        for row in [self.columns, *self.rows]:
            cells = [
                cell.ljust(w) if n == 0 else cell.rjust(w) for n, (cell, w) in enumerate(zip(row, widths, strict=True))
            ]
            lines.append("  ".join(cells).rstrip())
        return "\n".join([*lines, *([self.note] if self.note else [])])

    def markdown(self) -> str:
        """Return the table in Markdown."""
        lines = [f"## {self.title}", ""]
        lines += ["| " + " | ".join(self.columns) + " |", "|---" + "|--:" * (len(self.columns) - 1) + "|"]
        lines += ["| " + " | ".join(row) + " |" for row in self.rows]
        return "\n".join([*lines, *(["", self.note] if self.note else [])])

    def csv(self) -> str:
        """Return the table as comma-separated values, its title in the first column."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["table", *self.columns])
        writer.writerows([self.title, *row] for row in self.rows)
        return out.getvalue()


def mean(values: Sequence[float | None]) -> float | None:
    """Return the mean; None where any value is missing: an average over the runs that got there would flatter."""
    if not values or any(value is None for value in values):
        return None
    return float(np.mean([value for value in values if value is not None]))


def spread(values: Sequence[float | None], digits: int = 1, unit: float = 1.0) -> str:
    """Return mean, standard deviation and 95 % confidence interval; how many got there where not all did."""
    known = [value * unit for value in values if value is not None]
    if not values:
        return "-"
    if len(known) < len(values):
        return f"{len(known)} of {len(values)} reached" + (f", latest {max(known):.{digits}f}" if known else "")
    text = f"{np.mean(known):.{digits}f}"
    if len(known) > 1:
        deviation = float(np.std(known, ddof=1))
        half = float(stats.t.ppf(0.975, len(known) - 1)) * deviation / len(known) ** 0.5
        text += f" sd {deviation:.{digits}f} ±{half:.{digits}f}"
    return text


def number(value: float | None, digits: int = 1) -> str:
    """Return a number, or a dash."""
    return "-" if value is None else f"{value:.{digits}f}"


def ratio(one: float | None, other: float | None) -> float | None:
    """Return a quotient, None where it is not known."""
    return None if one is None or not other else one / other
