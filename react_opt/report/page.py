"""A page around a figure: one file, no script, what the file says of itself below the picture."""

from __future__ import annotations

import html
from typing import Any

from react_opt.plan import Claim, PlanDocument
from react_opt.report.tables import percent, shown

_STYLE = """
body{margin:0 auto;max-width:1100px;padding:1.2rem;font:15px/1.45 system-ui,sans-serif;color:#1a1a1a;background:#fff}
h1{font-size:1.25rem;margin:0 0 .8rem}svg{width:100%;height:auto}
dl{display:grid;grid-template-columns:max-content 1fr;gap:.15rem 1rem;border-top:1px solid #ddd;padding-top:.8rem}
dt{color:#555}dd{margin:0;overflow-wrap:anywhere}
"""


def figure_page(document: Any, svg: str) -> str:
    """Return an HTML page with a figure (SVG text) and the document's claim, where it has one."""
    name = document.instance.name if isinstance(document, PlanDocument) else getattr(document, "name", document.kind)
    rows = _claim_rows(document.claim) if isinstance(document, PlanDocument) else []
    facts = "".join(f"<dt>{html.escape(key)}</dt><dd>{html.escape(value)}</dd>" for key, value in rows)
    title = html.escape(f"{name} ({document.kind.replace('_', ' ')})")
    drawing = svg[svg.index("<svg") :]
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{_STYLE}</style></head>\n'
        f"<body><h1>{title}</h1>\n{drawing}\n{f'<dl>{facts}</dl>' if facts else ''}</body></html>\n"
    )


def _claim_rows(claim: Claim) -> list[tuple[str, str]]:
    rows = [
        ("status", claim.status),
        ("objective", shown(claim.objective, 6)),
        ("proven bound", shown(claim.bound, 6)),
        ("gap", percent(claim.gap)),
        ("stopped by", "nothing" if claim.limit == "none" else claim.limit),
        ("method", claim.method),
        ("solver", claim.solver or "-"),
        ("seed, threads", f"{claim.seed}, {claim.threads}"),
        ("wall time", ", ".join(f"{phase} {seconds:.2f} s" for phase, seconds in claim.wall_s.items()) or "-"),
    ]
    if claim.reason:
        rows.append(("reason", claim.reason))
    return rows
