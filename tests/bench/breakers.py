"""Made-up solvers that break: one returns something else than a plan, one raises."""

from __future__ import annotations

from typing import Any

from benchmarks.peers import Limits, Tell, peer


@peer("no_plan_at_all", ("assignment",), about="returns something else than a plan", package="react_opt")
def no_plan_at_all(instance: Any, limits: Limits, tell: Tell) -> Any:
    return {"assigned": []}


@peer("crashes", ("assignment",), about="raises an error of two lines", package="react_opt")
def crashes(instance: Any, limits: Limits, tell: Tell) -> Any:
    raise RuntimeError("one line\nand another | with a bar")
