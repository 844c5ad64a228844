"""Local targets for REACT: an area's unknown regions, each by the piece of frontier that opens it, with stable names.

The belief's own targets are whole connected regions; in a hall that has been half seen all that is left is one of
them, with one place to look from. Here each piece of the frontier has its share of the unknown
(:mod:`react_opt.orchestrator.regions`), which is what a robot can look into from one place.
"""

from __future__ import annotations

from math import hypot

from react_opt.orchestrator.belief import Belief, LocalTarget, RobotView
from react_opt.orchestrator.regions import Region, Regions
from react_opt.orchestrator.strategy import Point
from react_opt.orchestrator.survey import Survey

SAME_M = 2.0
"""A region whose frontier moved less within its area keeps its name."""


class LocalTargets:
    """Finds local targets from map to map.

    Parameters
    ----------
    range_m
        How far robots see, m.
    """

    def __init__(self, range_m: float) -> None:
        self.regions = Regions(range_m)
        self._named: dict[str, Region] = {}
        self._serial = 0

    def find(
        self, belief: Belief, survey: Survey, robots: list[RobotView], looked_m: list[Point]
    ) -> tuple[LocalTarget, ...]:
        """Return the local targets that robots can reach over known-free space, in the order they appeared."""
        if not robots:
            return ()
        time_s = survey.times_from_nearest([(robot.x_m, robot.y_m) for robot in robots], optimistic=False)
        found = self.regions.find(survey, belief.areas, time_s, looked_m, deep=False)
        named: dict[str, Region] = {}
        for name, before in self._named.items():
            near = [
                (gap, n)
                for n, region in enumerate(found)
                if region.area == before.area
                and (gap := hypot(region.at_m[0] - before.at_m[0], region.at_m[1] - before.at_m[1])) <= SAME_M
            ]
            if near:
                named[name] = found.pop(min(near)[1])
        for region in found:
            self._serial += 1
            named[f"k{self._serial}"] = region
        self._named = named
        return tuple(_target(name, region, self.regions.hidden_space.free_share) for name, region in named.items())


def _target(name: str, region: Region, free_share: float) -> LocalTarget:
    """Return a region as a target: what a look reveals is its size, what lies behind it may open."""
    size_m2 = region.value_m2 / free_share
    return LocalTarget(
        id=name,
        area=region.area,
        x_m=region.at_m[0],
        y_m=region.at_m[1],
        stand_m=region.view_m,
        size_m2=size_m2,
        opening_m2=max(0.0, region.size_m2 - size_m2),
        frontier_m=region.frontier_m,
    )
