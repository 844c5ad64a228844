"""Optional parts: where one is not installed its tests are skipped, but where CI installs all of them they fail.

``REACT_OPT_EXTRAS=required pytest -m extras`` runs the tests of every optional part, and none of them may be skipped.
"""

from __future__ import annotations

import os
from importlib import util

import pytest


def need(module: str, extra: str) -> None:
    """Skip a test whose optional part is not installed; fail it where all of them must be."""
    if util.find_spec(module) is not None:
        return
    text = f"{module} is not installed: pip install 'react_opt[{extra}]'"
    if os.environ.get("REACT_OPT_EXTRAS") == "required":
        pytest.fail(text)
    pytest.skip(text)
