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


def test_routes_that_differ_in_what_they_charge_are_columns_of_their_own() -> None:
    """The plan in hand moves and senses as a better route does, but charges less: a master that takes the two for one
    ends with a bound of 35.8, a step's waiting above the optimum."""
    end, faults = compared(drawn("sigma", 447), by_brute_force=False)
    assert (end, faults) == ("optimal", [])
