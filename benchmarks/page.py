"""A report as a list of blocks, written as Markdown with figures beside it or as one self-contained HTML file."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from react_opt.jsonio import write_bytes, write_text

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; color: #1a1a1a; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 2.2em; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; margin: 1em 0; font-variant-numeric: tabular-nums; }
th, td { padding: .25em .7em; border-bottom: 1px solid #e2e2e2; text-align: left; vertical-align: top; }
th { border-bottom: 2px solid #888; } td.number, th.number { text-align: right; white-space: nowrap; }
figure { margin: 1.5em 0; } img { max-width: 100%; height: auto; } figcaption { color: #444; }
.wrap { overflow-x: auto; }
"""


@dataclass(frozen=True)
class Heading:
    """A heading; level 1 is the title."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class Table:
    """A table: headings, rows of texts, and a line that says what is in it."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""


@dataclass(frozen=True)
class Figure:
    """A picture: a name for its file, its PNG, and what is seen in it."""

    name: str
    png: bytes
    caption: str


Block = Heading | Text | Table | Figure


def markdown(blocks: Sequence[Block], file: str) -> None:
    """Write blocks as Markdown; figures go to a folder beside the file, named after it."""
    folder = Path(file).with_suffix("").name + "_figures"
    parts = []
    for block in blocks:
        if isinstance(block, Heading):
            parts.append(f"{'#' * block.level} {block.text}")
        elif isinstance(block, Text):
            parts.append(block.text)
        elif isinstance(block, Table):
            parts.append(_markdown_table(block))
        else:
            target = Path(file).parent / folder
            target.mkdir(exist_ok=True)
            write_bytes(block.png, target / f"{block.name}.png")
            parts.append(f"![{block.caption}]({folder}/{block.name}.png)\n\n{block.caption}")
    write_text("\n\n".join(parts) + "\n", file)


def _markdown_table(block: Table) -> str:
    rows = [[cell.replace("|", "\\|") for cell in row] for row in (block.headings, *block.rows)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(block.headings))]
    right = _numeric(block)
    lines = []
    for number, row in enumerate(rows):
        cells = [cell.rjust(width) if flag else cell.ljust(width) for cell, width, flag in zip(row, widths, right)]  # noqa: B905
        lines.append("| " + " | ".join(cells) + " |")
        if number == 0:
            rules = ["-" * (width - 1) + ":" if flag else "-" * width for width, flag in zip(widths, right)]  # noqa: B905
            lines.append("| " + " | ".join(rules) + " |")
    return (block.caption + "\n\n" if block.caption else "") + "\n".join(lines)


def _numeric(block: Table) -> list[bool]:
    """Return which columns hold numbers, which are set to the right."""
    return [
        bool(block.rows) and all(not row[k] or row[k][0] in "-<>~+0123456789" for row in block.rows)
        for k in range(len(block.headings))
    ]


def page(blocks: Sequence[Block], file: str) -> None:
    """Write blocks as one HTML file that holds its figures."""
    title = next((block.text for block in blocks if isinstance(block, Heading)), "results")
    parts = [
        "<!doctype html>", '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{html.escape(title)}</title><style>{STYLE}</style></head><body>",
    ]  # fmt: skip
    for block in blocks:
        if isinstance(block, Heading):
            parts.append(f"<h{block.level}>{html.escape(block.text)}</h{block.level}>")
        elif isinstance(block, Text):
            marked = re.sub("`([^`]*)`", "<code>\\g<1></code>", html.escape(block.text))
            parts.append(f"<p>{marked}</p>")
        elif isinstance(block, Table):
            parts.append(_html_table(block))
        else:
            data = base64.b64encode(block.png).decode()
            text = html.escape(block.caption)
            image = f'<img alt="{text}" src="data:image/png;base64,{data}">'
            parts.append(f"<figure>{image}<figcaption>{text}</figcaption></figure>")
    write_text("\n".join([*parts, "</body></html>"]) + "\n", file)


def _html_table(block: Table) -> str:
    right = _numeric(block)

    def row(cells: Sequence[str], tag: str) -> str:
        marked = [
            f"<{tag}{' class=number' if flag else ''}>{html.escape(cell)}</{tag}>"
            for cell, flag in zip(cells, right, strict=True)
        ]
        return f"<tr>{''.join(marked)}</tr>"

    body = "\n".join(row(cells, "td") for cells in block.rows)
    caption = f"<p>{html.escape(block.caption)}</p>" if block.caption else ""
    head = row(block.headings, "th")
    return f'{caption}<div class="wrap"><table><thead>{head}</thead><tbody>{body}</tbody></table></div>'
