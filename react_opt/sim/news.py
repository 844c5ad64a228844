"""What changes in the belief from one decision to the next, for the trace: local targets and areas."""

from __future__ import annotations

from react_opt.orchestrator.fleet_belief import FleetBelief
from react_opt.sim.record import Recorder


class News:
    """Compares the belief with what it was and records what is new.

    Parameters
    ----------
    belief, record
        The mission's.
    """

    def __init__(self, belief: FleetBelief, record: Recorder) -> None:
        self._belief = belief
        self._record = record
        self._targets: set[str] = set()
        self._areas: set[str] | None = None
        self._unreachable: set[str] = set()

    def note(self, t_s: float) -> None:
        """Record the targets that appeared or are inspected, and the areas that were added or proved unreachable."""
        targets = {target.id: target for target in self._belief.targets}
        for name, target in targets.items():
            if name not in self._targets:
                self._record.event(
                    t_s, "target_new", target=name, x_m=round(target.x_m, 3), y_m=round(target.y_m, 3),
                    size_m2=round(target.size_m2, 3),
                )  # fmt: skip
        for name in sorted(self._targets - targets.keys()):
            self._record.event(t_s, "target_inspected", target=name)
        self._targets = set(targets)
        areas = self._belief.areas
        known = {area.id for area in areas} if self._areas is None else self._areas
        for area in areas:
            if area.id not in known:
                self._record.event(t_s, "area_added", target=area.id, x_m=round(area.x_m, 3), y_m=round(area.y_m, 3))
            if area.unreachable and area.id not in self._unreachable:
                why = f"c = {area.known_share:.3f}, and nothing more of it can be seen from where robots can drive"
                self._record.event(t_s, "area_unreachable", target=area.id, reason=why)
        self._areas = {area.id for area in areas}
        self._unreachable = {area.id for area in areas if area.unreachable}
