"""The naive variant of REACT: everything of an area before the next one, nothing postponed."""

from __future__ import annotations

from react_opt.orchestrator.react import React


class Naive(React):
    """REACT without priorities: a robot leaves its area only when no accessible target is left in it."""

    postpones = False
    ends_at_delta = False
