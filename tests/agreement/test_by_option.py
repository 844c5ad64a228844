"""A small slice of the comparison by option; ``by_option.py`` as a script draws hundreds of each."""

from __future__ import annotations

import pytest
from by_option import OPTIONS, compared, drawn

from react_opt.solvers import oros


@pytest.mark.parametrize("seed", [100, 101, 102])
@pytest.mark.parametrize("option", list(OPTIONS))
def test_decomposition_monolith_and_brute_force_agree(option: str, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """No plan beats the optimum, no bound cuts it off, and what is called optimal is; the even seeds are tiny enough
    to try everything."""
    monkeypatch.setattr(oros, "IMPROVE_S", 0.01)  # of primal search before the monolith, which needs no help here
    _, faults = compared(drawn(option, seed), by_brute_force=seed % 2 == 0, work_limit=200)
    assert faults == []
