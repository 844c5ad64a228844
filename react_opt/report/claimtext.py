"""A claim in one line for figures and pages."""

from __future__ import annotations

from react_opt.plan import Claim
from react_opt.report.tables import percent


def claim_text(claim: Claim) -> str:
    """Return status, objective, bound and gap."""
    if claim.objective is None:
        return claim.status
    text = f"{claim.status}, objective {claim.objective:.6g}"
    if claim.bound is not None:
        text += f", proven bound {claim.bound:.6g} (gap {percent(claim.gap)})"
    return text
