"""What the missions must reach, row by row: the figure asked for, the figure here, and the verdict."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

from benchmarks.missions.runs import RULES, Setting
from benchmarks.missions.tables import mean, number, ratio

if TYPE_CHECKING:
    from benchmarks.missions.paper import Campaign

Row = list[str]
FRONTIERS = ("nearest", "cost_utility", "hungarian", "market")


def verdict(value: float | None, most: float | None = None, least: float | None = None) -> str:
    """Return whether a value lies where it must."""
    if value is None:
        return "unknown"
    good = (most is None or value <= most) and (least is None or value >= least)
    return "met" if good else "NOT met"


def _less(gain: float | None) -> str:
    return "-" if gain is None else f"{abs(gain):.0%} {'less' if gain >= 0 else 'more'}"


def goals(campaign: Campaign) -> list[Row]:
    """Return the rows of the table of goals."""
    rows: list[Row] = []
    for part in (_oros, _against_full_map, _relaxed, _against_frontiers, _naive, _savings, _bounds, _wall):
        rows += part(campaign)
    return rows


def _rated(campaign: Campaign) -> list[str]:
    return [name for name in ("react", "react_plus") if name in campaign.strategies]


def _oros(campaign: Campaign) -> Iterator[Row]:
    done = []
    for robots in campaign.teams:
        runs = campaign.of(Setting("oros", robots))
        if runs and robots <= 3:
            share = mean([run["coverage"] for run in runs])
            done.append(mean([run["last_s"] for run in runs]))
            here = "-" if share is None else f"{share:.1%}"
            yield ["OROS, final coverage", str(robots), "86 to 91 %", here, verdict(share, 0.91, 0.86)]
    if len(done) > 1 and None not in done:
        falls = all(a > b for a, b in pairwise(done) if a is not None and b is not None)
        here = " > ".join(number(value) for value in done)
        yield ["OROS, time falls with robots", "1 to 3", "strictly", here, "met" if falls else "NOT met"]


def _against_full_map(campaign: Campaign) -> Iterator[Row]:
    for name in _rated(campaign):
        for share, factors in ((0.97, (1.25, 1.25, 1.25, 1.35)), (0.99, (1.35, 1.35, 1.35, None))):
            for robots, most in zip((1, 2, 3, 4), factors, strict=True):
                if robots in campaign.teams and most is not None:
                    value = ratio(campaign.time(name, robots, share), campaign.full_map(robots, share))
                    here, said = number(value, 2), verdict(value, most)
                    if value is None and campaign.of(Setting(name, robots)) and campaign.full_map(robots, share):
                        here, said = "not reached", "NOT met"
                    yield [f"{name}, {share:.0%} / full map", str(robots), f"<= {most:g}", here, said]


def _relaxed(campaign: Campaign) -> Iterator[Row]:
    for name in _rated(campaign):
        runs = campaign.of(Setting(name, 1, horizon_s=360.0))
        if runs:
            share = mean([run["curve"][33] for run in runs])  # at 330 s
            here = "-" if share is None else f"{share:.2%}"
            yield [f"{name}, T = 360, known at 330 s", "1", ">= 99.5 %", here, verdict(share, least=0.995)]


def _against_frontiers(campaign: Campaign) -> Iterator[Row]:
    for name in _rated(campaign):
        for suffix, words in (("", "best frontier"), ("_areas", "best frontier with area distances")):
            for what, share, kind, least in (
                ("90 %", 0.90, 0, 0.20),
                ("97 %", 0.97, 0, 0.15),
                ("J at 97 %", 0.97, 1, 0.08),
            ):
                for robots in campaign.teams:
                    others = [campaign.time(other + suffix, robots, share, kind) for other in FRONTIERS]
                    best = min((other for other in others if other is not None), default=None)
                    ours = campaign.time(name, robots, share, kind)
                    value = ratio(ours, best)
                    wanted = least if robots <= 3 else 0.0
                    gain = None if value is None else 1 - value
                    here, said = _less(gain), verdict(gain, least=wanted)
                    if campaign.of(Setting(name, robots)) and ours is None and best is not None:
                        here, said = "not reached", "NOT met"
                    if best is None and ours is not None and campaign.of(Setting(FRONTIERS[0] + suffix, robots)):
                        here, said = "only ours always gets there", "met"
                    if here == "-" and not campaign.of(Setting(FRONTIERS[0] + suffix, robots)):
                        continue
                    goal = f">= {wanted:.0%} less" if wanted else "not worse"
                    yield [f"{name}, {what} against the {words}", str(robots), goal, here, said]


def _naive(campaign: Campaign) -> Iterator[Row]:
    for name in _rated(campaign):
        for share in (0.80, 0.90, 0.95):
            for robots in campaign.teams:
                if not campaign.of(Setting("naive", robots)) or not campaign.of(Setting(name, robots)):
                    continue
                ours, naive = campaign.time(name, robots, share), campaign.time("naive", robots, share)
                value = ratio(naive, ours)
                here, said = number(value, 2), verdict(value, least=1.10)
                if naive is None:
                    here, said = "not reached", "met" if ours is not None else "unknown"
                yield [f"naive / {name}, {share:.0%}", str(robots), ">= 1.1 or not reached", here, said]


def _savings(campaign: Campaign) -> Iterator[Row]:
    from benchmarks.missions.paper import saved

    for rule in RULES:
        runs = campaign.of(Setting("oros", 1, rule))
        if runs:
            share = mean(saved(runs, 0))
            here = "-" if share is None else f"{share:.1%}"
            yield [f"OROS, saving by switching ({rule})", "1", "12 to 20 %", here, verdict(share, 0.20, 0.12)]


def _bounds(campaign: Campaign) -> Iterator[Row]:
    for robots in campaign.teams:
        value = ratio(campaign.bound(robots, 0.97), campaign.full_map(robots, 0.97))
        if robots == 3:
            yield ["proven bound / full map, 97 %", "3", ">= 0.8", number(value, 2), verdict(value, least=0.8)]
        elif robots == 1:
            yield ["proven bound / full map, 97 %", "1", "> 0.36", number(value, 2), verdict(value, least=0.36)]


def _wall(campaign: Campaign) -> Iterator[Row]:
    for name in _rated(campaign):
        runs = campaign.of(Setting(name, 3))
        if runs:
            value = mean([run["wall_s"] for run in runs])
            yield [f"{name}, computing a mission, s", "3", "< 5", number(value), verdict(value, 5.0)]
