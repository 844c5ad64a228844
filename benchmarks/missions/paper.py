"""The paper's tables, its numbers beside ours, and what was asked for with met or not met."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.missions.runs import CURVE_S, FULL_MAP, LIMIT_SHARES, RULES, SHARES, Setting
from benchmarks.missions.tables import Table, mean, number, ratio, spread

RATED = ("react", "react_plus")

# REACT, arXiv 2503.05904: when the final coverage is reached, s; joules per robot switched and always on.
PAPER_S = {"oros": {1: 175.0, 2: 150.0, 3: 110.0}, "react": {1: 210.0, 2: 190.0, 3: 160.0}}
PAPER_SHARE = {"oros": 0.88, "react": 0.97}
PAPER_J = {
    ("oros", 1): [(4238.01, 4914.60)],
    ("oros", 2): [(3516.80, 3516.80), (3229.89, 3900.06)],
    ("oros", 3): [(3028.65, 3028.65), (2799.20, 2799.20), (2766.96, 2766.96)],
    ("react", 1): [(4398.37, 5147.92)],
    ("react", 2): [(3499.54, 3499.54), (3386.22, 4301.65)],
    ("react", 3): [(2986.10, 2986.10), (3093.18, 3093.18), (2772.64, 2772.64)],
}

Result = dict[str, Any]


class Campaign:
    """The results of a campaign, by setting and key.

    Parameters
    ----------
    settings
        What was run with every seed.
    seeds
        How many.
    results
        Per job key what it returned; jobs that failed are missing.
    """

    def __init__(self, settings: Sequence[Setting], seeds: int, results: Mapping[str, Any]) -> None:
        self.settings = list(settings)
        self.seeds = seeds
        self._results = results
        self.strategies = list(dict.fromkeys(s.strategy for s in settings))
        self.teams = sorted({s.robots for s in settings})
        self._bounds = {(b["robots"], b["share"]): b for b in results.get("bounds", [])}

    def of(self, setting: Setting) -> list[Result]:
        """Return the results of a setting, one per seed that has one."""
        keys = [setting.key(seed) for seed in range(1, self.seeds + 1)]
        return [self._results[key] for key in keys if key in self._results]

    def reached(self, setting: Setting, share: float, what: int = 0) -> list[float | None]:
        """Return per run when a share was known (or, with ``what`` 1, the joules by then); None: not reached."""
        return [result["reached"][f"{share:g}"][what] for result in self.of(setting)]

    def time(self, strategy: str, robots: int, share: float, what: int = 0) -> float | None:
        """Return the mean over all seeds, None where some run did not reach the share."""
        return mean(self.reached(Setting(strategy, robots), share, what))

    def bound(self, robots: int, share: float, name: str = "time_s") -> float | None:
        """Return the proven lower bound, s."""
        found = self._bounds.get((robots, share))
        return None if found is None else float(found[name])

    def full_map(self, robots: int, share: float, blocking: bool = True) -> float | None:
        """Return the time of the best full-map plan found, as driven, s.

        A plan that sees more is a plan for this too. One for fewer robots is not: where robots block each other, those
        that it leaves at their starts may stand in its way.
        """
        team = f"{FULL_MAP} x{robots}{'' if blocking or robots < 3 else ' no blocking'}"
        keys = [f"{team} {other:.0%}" for other in LIMIT_SHARES if other >= share]
        times = [self._results[key]["time_s"] for key in keys if key in self._results]
        return min((time for time in times if time is not None), default=None)


def all_tables(campaign: Campaign) -> list[Table]:
    """Return every table of a campaign that has data for it."""
    tables = [times(campaign), coverage(campaign), limits(campaign), beside_paper(campaign), energy(campaign)]
    return [table for table in [*tables, savings(campaign), fourth(campaign), reached_what(campaign)] if table.rows]


def times(campaign: Campaign) -> Table:
    """When shares of the area were known."""
    table = Table(
        "Time to see a share of the coverable area, s",
        ["strategy", "robots", *(f"{share:.0%}" for share in SHARES), "final %", "J at 97 %", "missions"],
        note="Mean, standard deviation (sd) and half the 95 % confidence interval (±) over the seeds; sensors switched "
        "off. Where not all runs reached a share, how many did, and no mean. J: whole fleet.",
    )
    for strategy in campaign.strategies:
        for robots in campaign.teams:
            setting = Setting(strategy, robots)
            runs = campaign.of(setting)
            if runs:
                cells = [spread(campaign.reached(setting, share)) for share in SHARES]
                final = spread([run["coverage"] for run in runs], unit=100)
                joules = spread(campaign.reached(setting, 0.97, 1), 0)
                table.rows.append([strategy, str(robots), *cells, final, joules, str(len(runs))])
    for robots in campaign.teams:
        for name, value in (("best full-map plan", campaign.full_map), ("proven lower bound", campaign.bound)):
            figures = [number(value(robots, share)) if share in LIMIT_SHARES else "-" for share in SHARES]
            if any(figure != "-" for figure in figures):
                table.rows.append([name, str(robots), *figures, "-", "-", "-"])
    return table


def coverage(campaign: Campaign) -> Table:
    """Mean coverage over time."""
    length = max((len(run["curve"]) for s in campaign.settings for run in campaign.of(s)), default=0)
    instants = list(range(0, length, 2))
    table = Table(
        "Coverage over time, %",
        ["strategy", "robots", *(f"{n * CURVE_S:g} s" for n in instants)],
        note="Mean over seeds.",
    )
    for strategy in campaign.strategies:
        for robots in campaign.teams:
            runs = campaign.of(Setting(strategy, robots))
            if runs:
                curve = [np.mean([run["curve"][min(n, len(run["curve"]) - 1)] for run in runs]) * 100 for n in instants]
                table.rows.append([strategy, str(robots), *(f"{share:.1f}" for share in curve)])
    return table


def limits(campaign: Campaign) -> Table:
    """How far from the best possible every strategy is."""
    table = Table(
        "How far from the best possible",
        ["robots", "share", "bound s", "reachability s", "full map s", "bound / full map",
         *(f"{name} / full map" for name in campaign.strategies)],
        note="Bound: proven, no plan of this team is faster without speed noise. Full map: the best plan found with "
        "the map known, as driven in the simulator; a better one may exist. docs/limits.md says exactly what each is.",
    )  # fmt: skip
    for robots in campaign.teams:
        for share in LIMIT_SHARES:
            bound, best = campaign.bound(robots, share), campaign.full_map(robots, share)
            if bound is None and best is None:
                continue
            ours = [ratio(campaign.time(name, robots, share), best) for name in campaign.strategies]
            table.rows.append(
                [str(robots), f"{share:.0%}", number(bound), number(campaign.bound(robots, share, "reachability_s")),
                 number(best), number(ratio(bound, best), 2), *(number(value, 2) for value in ours)]
            )  # fmt: skip
    return table


def _done_s(campaign: Campaign, strategy: str, robots: int) -> float | None:
    """Return the mean time at which OROS had seen its last pixel, or REACT 97 %."""
    if strategy == "oros":
        return mean([run["last_s"] for run in campaign.of(Setting(strategy, robots))])
    return campaign.time(strategy, robots, 0.97)


def beside_paper(campaign: Campaign) -> Table:
    """The paper's completion times beside ours, and both as ratios to one robot."""
    table = Table(
        "Completion beside the paper's",
        ["strategy", "robots", "paper s", "here s", "paper / its 1 robot", "here / its 1 robot", "paper %", "here %"],
        note="OROS: when its final coverage is reached; REACT: 97 %. The paper's map and speeds are not given, so the "
        "ratios to one robot compare, not the seconds.",
    )
    for strategy, theirs in PAPER_S.items():
        one = _done_s(campaign, strategy, 1)
        for robots, seconds in theirs.items():
            runs = campaign.of(Setting(strategy, robots))
            if runs:
                here = _done_s(campaign, strategy, robots)
                final = spread([run["coverage"] for run in runs], unit=100)
                table.rows.append(
                    [strategy, str(robots), number(seconds, 0), number(here), number(seconds / theirs[1], 2),
                     number(ratio(here, one), 2), f"{PAPER_SHARE[strategy]:.0%}", final]
                )  # fmt: skip
    return table


def _robot_means(runs: Sequence[Result], name: str) -> list[list[float]]:
    return [[run["robots"][n][name] for run in runs] for n in range(len(runs[0]["robots"]))] if runs else []


def energy(campaign: Campaign) -> Table:
    """Energy per robot, switched and always on."""
    table = Table(
        "Energy per robot up to its last useful motion, J",
        ["strategy", "robots", "robot", "switched", "same motion, always on", "always-on missions", "paper switched",
         "paper always on"],
        note="Switching by explored areas, the paper's rule. 'Same motion': the same missions had the sensors never "
        "been off. 'Always-on missions' were run with sensors always on, and may go other ways.",
    )  # fmt: skip
    for strategy in ("oros", *RATED):
        for robots in campaign.teams:
            runs, always = (
                campaign.of(Setting(strategy, robots)),
                campaign.of(Setting(strategy, robots, always_on=True)),
            )
            on = _robot_means(always, "energy_j")
            for n, joules in enumerate(_robot_means(runs, "energy_j")):
                same = [j + off for j, off in zip(joules, _robot_means(runs, "off_j")[n], strict=True)]
                paper = PAPER_J.get((strategy, robots))
                theirs = [f"{value:.0f}" for value in paper[n]] if paper else ["-", "-"]
                table.rows.append(
                    [strategy, str(robots), str(n + 1), spread(joules, 0), spread(same, 0),
                     spread(on[n], 0) if on else "-", *theirs]
                )  # fmt: skip
    return table


def saved(runs: Sequence[Result], n: int) -> list[float | None]:
    """Return what switching saved of a robot's energy in each run, a share."""
    return [
        run["robots"][n]["off_j"] / max(1e-9, run["robots"][n]["energy_j"] + run["robots"][n]["off_j"]) for run in runs
    ]


def savings(campaign: Campaign) -> Table:
    """Savings under the three switching rules."""
    table = Table(
        "Saving by switching sensors off, % per robot",
        ["strategy", "robots", "robot", *RULES, "paper"],
        note="Of what the same motion costs with sensors always on, up to the robot's last useful motion.",
    )
    for strategy in ("oros", *RATED):
        for robots in campaign.teams:
            by_rule = [campaign.of(Setting(strategy, robots, rule)) for rule in RULES]
            if not by_rule[0]:
                continue
            for n in range(robots):
                cells = [spread(saved(runs, n), unit=100) if runs else "-" for runs in by_rule]
                paper = PAPER_J.get((strategy, robots))
                theirs = f"{(1 - paper[n][0] / paper[n][1]):.1%}"[:-1] if paper else "-"
                table.rows.append([strategy, str(robots), str(n + 1), *cells, theirs])
    return table


def fourth(campaign: Campaign) -> Table:
    """What the fourth robot gains, with and without robots blocking each other, and with the whole map known."""
    table = Table(
        "Gain of the fourth robot, time to a share, s",
        ["strategy", "share", "3 robots", "4 robots", "gain", "3, no blocking", "4, no blocking", "gain, no blocking"],
        note="The paper's fourth robot gains nothing. 'Full map' is the best plan found with the whole map known.",
    )
    if not {3, 4} <= set(campaign.teams):
        return table
    for strategy in (*RATED, FULL_MAP):
        for share in (0.90, 0.97):
            values = []
            for blocking in (True, False):
                for robots in (3, 4):
                    if strategy == FULL_MAP:
                        values.append(campaign.full_map(robots, share, blocking))
                    else:
                        values.append(mean(campaign.reached(Setting(strategy, robots, blocking=blocking), share)))
            if all(value is None for value in values):
                continue
            cells = []
            for three, four in (values[:2], values[2:]):
                gain = None if three is None or four is None else 1 - four / three
                cells += [number(three), number(four), "-" if gain is None else f"{gain:.0%}"]
            table.rows.append([strategy, f"{share:.0%}", *cells])
    return table


def reached_what(campaign: Campaign) -> Table:
    """What was asked for, with met or not met."""
    from benchmarks.missions.goals import goals

    table = Table(
        "What it must reach", ["what", "robots", "wanted", "here", "verdict"],
        note="Not reached: some mission of these never saw the share. Unknown: not run, or no limit to compare with.",
    )  # fmt: skip
    table.rows = goals(campaign)
    return table
