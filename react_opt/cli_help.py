"""What the command line says of itself: examples below every help, and values that the shell completes."""

from __future__ import annotations

EXAMPLES: dict[str, tuple[str, ...]] = {
    "build": (
        "react-opt build factory.yaml --fleet fleet.json --cell-m 10 --horizon-s 240 --step-s 10 -o factory.json",
        "react-opt build maze.map --fleet fleet.json --cell-m 5 --paths ompl -o maze.json",
    ),
    "solve": (
        "react-opt solve factory.json --time-limit 10 -o plan.json",
        "react-opt solve factory.json --solver cp-sat --gap 0.01",
        "react-opt solve factory.json --start plan.json --at-step 6 -o replanned.json",
        "react-opt solve targets.json --json",
    ),
    "check": (
        "react-opt check factory.json plan.json",
        "react-opt check factory.json plan.json --bound",
    ),
    "simulate": (
        "react-opt simulate examples/factory/mission_3.json -o trace.json",
        "react-opt simulate mission.json --strategy nearest --robots 2 --seed 7 --json",
        "react-opt simulate mission.json --resume trace.json -o trace.json",
    ),
    "show": (
        "react-opt show plan.json -o plan.png",
        "react-opt show plan.json --instance factory.json --map factory.yaml -o plan.svg",
        "react-opt show trace.json -o replay.html",
        "react-opt show react.json naive.json -o replay.html",
    ),
    "schema": ("react-opt schema oros > oros.schema.json",),
    "solvers": ("react-opt solvers",),
}
"""Per command the lines that its help ends with."""


def examples(command: str) -> str:
    """Return the examples of a command as help shows them: one a line, not wrapped (which the backspace asks for)."""
    return "\n".join(("\b", "Examples:", *(f"  {line}" for line in EXAMPLES[command])))


def kinds_begun(begun: str) -> list[str]:
    """Return the kinds of files whose names begin like this."""
    from react_opt.jsonio import KINDS

    return [name for name in KINDS if name.startswith(begun)]


def solvers_begun(begun: str) -> list[str]:
    """Return the solvers whose names begin like this."""
    from react_opt.solvers.registry import names

    return [name for name in names() if name.startswith(begun)]


def strategies_begun(begun: str) -> list[str]:
    """Return the strategies whose names begin like this."""
    from react_opt.orchestrator.registry import strategy_names

    return [name for name in strategy_names() if name.startswith(begun)]
