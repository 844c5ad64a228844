"""Draw the pictures of the documentation into a folder: ``python docs/figures.py docs/_made``.

Everything is computed here and now from the files in ``examples``; what is there already is kept.
"""

from __future__ import annotations

import sys
from pathlib import Path

from react_opt import load, save, solve
from react_opt.report.show import show
from react_opt.sim.run import simulate, with_options

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
FACTORY = EXAMPLES / "factory"


def main(folder: Path) -> None:
    """Write the plans, the trace and the pictures that are missing."""
    folder.mkdir(parents=True, exist_ok=True)
    _plan(folder, FACTORY / "factory_3_10m.json", "plan_3.json", work_limit=2000)
    _plan(folder, FACTORY / "factory_3_5m.json", "plan_3_5m.json", work_limit=2000)
    _plan(folder, EXAMPLES / "middle" / "targets.json", "targets_plan.json")
    _plan(folder, EXAMPLES / "middle" / "postponed.json", "postponed_plan.json", work_limit=2000)
    if not (folder / "mission_3.json").exists():
        mission = with_options(load(FACTORY / "mission_3.json"), strategy="react")
        save(simulate(mission, FACTORY), folder / "mission_3.json")
    ground = FACTORY / "factory.yaml"
    instance = FACTORY / "factory_3_10m.json"
    _show(FACTORY / "mission_3.json", folder / "mission.svg")
    _show(instance, folder / "areas.svg", map_file=ground)
    _show(folder / "plan_3.json", folder / "plan.svg", instance=instance, map_file=ground)
    _show(folder / "plan_3_5m.json", folder / "plan_5m.svg", instance=FACTORY / "factory_3_5m.json")
    _show(folder / "targets_plan.json", folder / "targets.svg", instance=EXAMPLES / "middle" / "targets.json")
    _show(folder / "postponed_plan.json", folder / "postponed.svg", instance=EXAMPLES / "middle" / "postponed.json")
    _show(folder / "mission_3.json", folder / "trace.svg")
    _show(folder / "mission_3.json", folder / "replay.html")


def _plan(folder: Path, instance: Path, name: str, work_limit: int | None = None) -> None:
    if not (folder / name).exists():
        plan = solve(load(instance), time_limit_s=60, work_limit=work_limit, threads=1)
        save(plan, folder / name)


def _show(file: Path, output: Path, **options: Path) -> None:
    if not output.exists():
        show([file], output, **options)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
