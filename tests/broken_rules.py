"""Ways to break the good plan, registered with exactly the rules that the checker must name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from good_plan import Break, certify


class Breaks:
    """The ways of one family of rules; calling it with rules decorates a way to break them."""

    def __init__(self) -> None:
        self.ways: list[tuple[set[str], Break]] = []

    def __call__(self, *rules: str) -> Callable[[Break], Break]:
        """Register a way to break the good plan and exactly the rules that must be named."""

        def register(change: Break) -> Break:
            self.ways.append((set(rules), change))
            return change

        return register

    def parameters(self) -> list[Any]:
        """Return the ways as parameters of a test."""
        return [pytest.param(rules, change, id=change.__name__) for rules, change in self.ways]

    @property
    def rules(self) -> set[str]:
        """The rules that are broken at least once."""
        return {rule for rules, _ in self.ways for rule in rules}


def expect(rules: set[str], change: Break) -> None:
    """Assert that the checker names exactly the rules that a change breaks."""
    certificate = certify(change)
    assert not certificate.ok
    assert {violation.rule for violation in certificate.violations} == rules, certificate.violations
    for violation in certificate.violations:
        assert violation.message
        assert violation.rule in str(violation)
