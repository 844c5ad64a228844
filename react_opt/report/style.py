"""How figures look: sizes, colours that colour-blind readers tell apart, and files that are the same on every run."""

from __future__ import annotations

import io
import re
import warnings
from typing import Any, NamedTuple

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from react_opt.report.colours import GREY, INK, PALE, ROBOT_COLOURS

WIDTH_IN = 7.2
"""Width of a figure: two columns of a journal page."""

RC: Any = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same letters on every machine
    "text.parse_math": False,  # names from files are shown as they are
    "font.size": 7.5,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 7.5,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": PALE,
    "grid.linewidth": 0.5,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "hatch.linewidth": 0.6,
    "savefig.dpi": 200,
    "figure.dpi": 100,
    "svg.hashsalt": "react_opt",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
}

_NO_DATE: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


class Look(NamedTuple):
    """How one robot is drawn everywhere: colour, line style and marker, each enough to tell it from the others."""

    colour: str
    line: Any
    marker: str


_LINES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (6, 1.5, 1, 1.5)), (0, (1.5, 1.2)), (0, (3, 1, 1, 1, 1, 1)))
_MARKERS = "os^DvPX*"


def look(k: int) -> Look:
    """Return the look of the k-th robot."""
    return Look(ROBOT_COLOURS[k % len(ROBOT_COLOURS)], _LINES[k % len(_LINES)], _MARKERS[k % len(_MARKERS)])


def robot_key(k: int, name: str) -> Line2D:
    """Return the legend's entry of the k-th robot."""
    style = look(k)
    return Line2D(
        [], [], color=style.colour, linestyle=style.line, marker=style.marker, markersize=4, linewidth=1.4, label=name
    )


def tint(colour: str, share: float) -> tuple[float, float, float]:
    """Return a colour mixed into white: ``share`` 1 is the colour itself."""
    parts = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    red, green, blue = (1 - share + share * part for part in parts)
    return red, green, blue


def shortened(text: str, most: int) -> str:
    """Return a text on one line of at most ``most`` characters."""
    text = " ".join(text.split())
    return text if len(text) <= most else text[: most - 1] + "…"


def render(figure: Figure, suffix: str) -> bytes:
    """Return a figure as ``png``, ``svg`` or ``pdf``: the same bytes on every run with the same matplotlib."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # a name in letters that the font lacks
        _settle(figure)
        figure.savefig(buffer, format=suffix, metadata=_NO_DATE[suffix])
    return _numbered(buffer.getvalue()) if suffix == "svg" else buffer.getvalue()


def _settle(figure: Figure) -> None:
    """Lay the figure out and round the result: the layout's solver is not exact in the last digits."""
    engine = figure.get_layout_engine()
    if engine is None:
        return
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes in figure.axes:
        left, bottom, width, height = (round(float(value), 6) for value in axes.get_position(original=True).bounds)
        axes.set_position((left, bottom, width, height), which="original")


def _numbered(svg: bytes) -> bytes:
    """Return an SVG whose ids count up: matplotlib makes some of them from addresses in memory."""
    ids = dict.fromkeys(re.findall(rb'<[^<>]* id="([A-Za-z][0-9a-f]{10})"', svg))
    number = {name: b"%c%d" % (name[0], k) for k, name in enumerate(ids)}
    return re.sub(rb"\b[A-Za-z][0-9a-f]{10}\b", lambda match: number.get(match[0], match[0]), svg)
