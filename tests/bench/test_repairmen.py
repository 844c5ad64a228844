"""Several repairmen: published least latencies, a dynamic programme over all sets of customers, and the engine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.readers import documents
from benchmarks.readers.__main__ import main as convert
from benchmarks.readers.depots import parsed
from benchmarks.readers.latency import enough_steps, good_routes, latency, latency_instance, latency_of
from benchmarks.repairmen import PROBLEMS, TABLE, main, routes_of
from react_opt import check, load, solve
from react_opt.errors import InputError, UsageError
from react_opt.jsonio import parse

SMALL = [row for row in TABLE if row.name.startswith("10x")]
BURMA = """NAME: burma14
TYPE: TSP
DIMENSION: 14
EDGE_WEIGHT_TYPE: GEO
NODE_COORD_SECTION
1 16.47 96.10
2 16.47 94.44
3 20.09 92.54
4 22.39 93.37
5 25.23 97.24
6 22.00 96.05
7 20.47 97.02
8 17.20 96.29
9 16.30 97.38
10 14.05 98.12
11 16.53 97.38
12 21.52 95.59
13 19.41 97.13
14 20.09 94.55
EOF
"""


def least_latency(distances: Any, robots: int) -> float:
    """Least sum of arrival times at all customers by routes from 0: best orders of all sets, then best partitions."""
    n = len(distances) - 1
    size = 1 << n
    rest = np.zeros((size, n + 1))  # by the set still to be served, from each cell
    for left in range(1, size):
        to = [j for j in range(n) if left >> j & 1]
        there = [rest[left ^ 1 << j, j + 1] for j in to]
        rest[left] = (distances[:, [j + 1 for j in to]] * len(to) + there).min(axis=1)
    alone = rest[:, 0]
    best = alone
    for _ in range(robots - 1):
        shared = best.copy()
        for some in range(1, size):  # the sets that are apart from this one, by doubling
            apart = np.zeros(1, dtype=np.int64)
            for j in range(n):
                if not some >> j & 1:
                    apart = np.concatenate((apart, apart | 1 << j))
            shared[apart | some] = np.minimum(shared[apart | some], alone[some] + best[apart])
        best = shared
    return float(best[-1])


def shortest(steps: Any) -> Any:
    """Return the least distances: passing through a customer may be shorter, where they are rounded down or random."""
    for k in range(1, len(steps)):  # nobody comes back to 0
        steps = np.minimum(steps, steps[:, [k]] + steps[[k], :])
    return steps


def proven(instance: Any) -> Any:
    plan = solve(instance, method="routes", threads=1, time_limit_s=600, explain=False)
    assert plan.claim.status == "optimal"
    assert check(instance, plan, bound=True).ok
    return plan


@pytest.mark.parametrize("row", SMALL, ids=lambda row: f"{row.name}, {row.robots}")
def test_published_latencies_are_those_of_all_sets_of_customers(row: Any) -> None:
    """Any vehicle may begin at any depot: the nearest one of its first customer. The capacities do not bind."""
    assert least_latency(row.problem().distances(), row.robots) == pytest.approx(row.published, abs=6e-6)


@pytest.mark.parametrize("row", SMALL, ids=lambda row: f"{row.name}, {row.robots}")
def test_the_engine_proves_them_for_distances_rounded_down(row: Any) -> None:
    problem = row.problem()
    instance = parse(problem.instance("rounded", row.robots))
    plan = proven(instance)
    least = latency_of(instance, plan.objective.coverage)
    assert least == least_latency(shortest(np.floor(problem.distances() + 1e-9)), row.robots)
    assert least <= row.published
    routes = routes_of(plan)
    assert sorted(cell for route in routes for cell in route) == list(range(1, 11))
    assert row.published - 6e-6 <= latency(problem.distances(), routes) <= 1.01 * row.published
    assert max(problem.loads(routes)) <= problem.capacity


def test_the_published_plan_of_25_customers_and_10_vehicles_is_found() -> None:
    """At one step per unit the plan that is proven best has the published latency in unrounded distances, too."""
    (row,) = (row for row in TABLE if row.name == "25x4-1")
    problem = row.problem()
    routes = routes_of(proven(parse(problem.instance("rounded", row.robots))))
    assert latency(problem.distances(), routes) == pytest.approx(row.published, abs=6e-6)
    assert max(problem.loads(routes)) <= problem.capacity


def test_three_repairmen_on_burma14_are_proven(tmp_path: Path, capsys: Any) -> None:
    file = tmp_path / "burma14.tsp"
    file.write_text(BURMA)
    assert convert(["tsplib", str(file), "--robots", "3", "-o", str(tmp_path)]) == 0
    instance = load(capsys.readouterr().out.strip())
    assert instance.name == "latency_burma14_3"
    steps = np.zeros((14, 14))
    for leg in instance.travel:
        steps[int(leg.from_[1:]), int(leg.to[1:])] = leg.steps
    plan = proven(instance)
    assert latency_of(instance, plan.objective.coverage) == least_latency(steps, 3) == 6492


@pytest.mark.parametrize("seed", range(12))
def test_the_horizon_cuts_no_optimum_off(seed: int) -> None:
    """Random distances, far from metric for half of them: what the horizon leaves is as good as without one."""
    rng = np.random.default_rng(seed)
    n, robots = int(rng.integers(3, 7)), 1 + seed % 3
    if seed % 2:
        steps = rng.integers(1, 30, (n, n))
    else:
        places = rng.uniform(0, 30, (n, 2))
        steps = np.maximum(1, np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)).astype(int))
    instance = parse(latency_instance("random", steps, np.zeros((n, 2)), robots))
    assert instance.horizon_steps == enough_steps(steps, robots)
    plan = solve(instance, threads=1, explain=False)
    assert plan.claim.status == "optimal"
    assert latency_of(instance, plan.objective.coverage) == least_latency(shortest(steps), robots)


@pytest.mark.parametrize("robots", [1, 2, 4])
def test_good_routes_serve_everybody_once(robots: int) -> None:
    steps = np.random.default_rng(robots).integers(1, 50, (9, 9))
    routes = good_routes(steps, robots)
    assert len(routes) == robots
    assert sorted(cell for route in routes for cell in route) == list(range(1, 9))
    assert latency(steps, routes) >= least_latency(steps, robots)


FILE = "2 1 5\n\n3 4\n-6 8\n0 0\n\n2\n4\n0\n"


def test_a_file_of_depots(tmp_path: Path) -> None:
    file = tmp_path / "two.txt"
    file.write_text(FILE)
    (instance,) = documents("depots", str(file), robots=2, steps_per_unit=3)
    assert {(leg.from_, leg.to): leg.steps for leg in instance.travel} == {
        ("c0", "c1"): 15, ("c0", "c2"): 30, ("c1", "c2"): 29, ("c2", "c1"): 29,
    }  # fmt: skip
    assert instance.step_s == pytest.approx(1 / 3)
    assert len(instance.robots) == 2
    assert parsed(str(file)).loads([[1, 2], []]) == [6, 0]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("2 1 5\n3 4\n", "expected x, found nothing more"),
        ("0 1 5\n", "the number of customers, a whole number >= 1"),
        ("4000 1 5\n", "expected at most 3000"),
        (FILE + "7\n", "expected the end of the file"),
    ],
)
def test_faults_of_a_file_of_depots(tmp_path: Path, text: str, fault: str) -> None:
    file = tmp_path / "bad.txt"
    file.write_text(text)
    with pytest.raises(InputError) as raised:
        documents("depots", str(file))
    assert fault in str(raised.value)


def test_options_that_a_format_does_not_have(tmp_path: Path, capsys: Any) -> None:
    with pytest.raises(UsageError, match="robots: the format gap has no such option"):
        documents("gap", "x", robots=2)
    with pytest.raises(UsageError, match="robots: expected a whole number >= 1"):
        documents("tsplib", "x", robots=0)
    assert convert(["tsplib", "x.tsp", "--steps-per-unit", "2", "-o", str(tmp_path)]) == 2
    assert "steps_per_unit: the format tsplib has no such option" in capsys.readouterr().err


def test_the_published_problems_are_written_as_files(tmp_path: Path, capsys: Any) -> None:
    assert main(["--problems", "10x4-1", "10x4-2", "-o", str(tmp_path)]) == 0
    names = [load(line).name for line in capsys.readouterr().out.split()]
    assert names == ["latency_10x4-1_5", "latency_10x4-2_5", "latency_10x4-2_2"]
    assert set(PROBLEMS) == {row.name for row in TABLE}


def test_a_row_of_the_table_is_printed(capsys: Any) -> None:
    assert main(["--problems", "10x4-1"]) == 0
    words = capsys.readouterr().out.splitlines()[1].split()
    assert words[:2] == ["10x4-1", "5"]
    assert words[4:6] == ["545.69071", "545.69071"]
    assert (words[7], words[10:]) == ("optimal", ["fit", "ok"])


@pytest.mark.parametrize(("option", "value"), [("--limit-s", "-1"), ("--limit-s", "nan"), ("--threads", "0")])
def test_a_limit_that_is_none_is_refused_before_anything_is_solved(
    option: str, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2 and one line that names the option, as for every wrong argument."""
    with pytest.raises(SystemExit) as left:
        main([option, value])
    assert left.value.code == 2
    assert f"error: {option}: expected" in capsys.readouterr().err
