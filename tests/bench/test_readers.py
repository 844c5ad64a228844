"""Public formats of neighbouring problems: small files of our own, whose optima brute force knows."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.readers import FORMATS, documents
from benchmarks.readers.__main__ import main as convert
from benchmarks.readers.tsplib import DISTANCES
from react_opt import check, load, solve
from react_opt.errors import InputError, UsageError
from react_opt.jsonio import parse

POINTS = [(0, 0), (10, 0), (10, 7), (3, 8), (-5, 2), (-2, -9)]


def written(folder: Path, name: str, text: str) -> str:
    path = folder / name
    path.write_text(text)
    return str(path)


def solved(instance: Any) -> Any:
    plan = solve(instance, threads=1, explain=False)
    assert plan.claim.status == "optimal"
    assert check(instance, plan).ok
    return plan


def whole(one: tuple[float, float], other: tuple[float, float]) -> int:
    return max(1, int(math.dist(one, other) + 0.5))


def tsp(kind: str, extra: str, section: str) -> str:
    return f"NAME: six\nTYPE: TSP\nDIMENSION: 6\nEDGE_WEIGHT_TYPE: {kind}\n{extra}{section}EOF\n"


COORDINATES = "NODE_COORD_SECTION\n" + "".join(f"{k + 1} {x} {y}\n" for k, (x, y) in enumerate(POINTS))


def test_a_tsplib_file_is_a_minimum_latency_problem(tmp_path: Path) -> None:
    """The most coverage is (n - 1)(T + 1) less the least sum of arrival times, which all orders of five cities give."""
    (instance,) = documents("tsplib", written(tmp_path, "six.tsp", tsp("EUC_2D", "", COORDINATES)))
    least = math.inf
    for order in itertools.permutations(range(1, 6)):
        t = total = 0
        for i, j in itertools.pairwise((0, *order)):
            t += whole(POINTS[i], POINTS[j])
            total += t
        least = min(least, total)
    plan = solved(instance)
    assert plan.objective.coverage == 5 * (instance.horizon_steps + 1) - least


CITIES = [(16.47, 96.10), (16.47, 94.44), (20.09, 92.54), (22.39, 93.37), (25.23, 97.24), (22.00, 96.05),
          (20.47, 97.02), (17.20, 96.29), (16.30, 97.38), (14.05, 98.12), (16.53, 97.38), (21.52, 95.59),
          (19.41, 97.13), (20.09, 94.55)]  # fmt: skip


def burma(folder: Path, n: int) -> tuple[Any, Any]:
    """The latency problem of the first n cities of TSPLIB's burma14, and its distances."""
    cities = CITIES[:n]
    section = "NODE_COORD_SECTION\n" + "".join(f"{k} {x} {y}\n" for k, (x, y) in enumerate(cities, start=1))
    text = f"NAME: burma\nTYPE: TSP\nDIMENSION: {n}\nEDGE_WEIGHT_TYPE: GEO\n{section}EOF\n"
    (instance,) = documents("tsplib", written(folder, "burma.tsp", text))
    return instance, np.array([[DISTANCES["GEO"](*a, *b) for b in cities] for a in cities])


def test_two_repairmen_share_the_cities_of_burma(tmp_path: Path) -> None:
    """Seven customers: every way to share them out, each share in its best order."""
    instance, steps = burma(tmp_path, 8)
    data = instance.model_dump(mode="json", by_alias=True)
    instance = parse({**data, "robots": [{**data["robots"][0], "id": name} for name in ("r0", "r1")]})
    shares = [[j for j in range(1, 8) if share >> j & 1] for share in range(0, 1 << 8, 2)]
    best_of = {
        tuple(share): min(
            int(np.cumsum(steps[[0, *order[:-1]], order]).sum()) if order else 0
            for order in map(list, itertools.permutations(share))
        )
        for share in shares
    }
    best = min(best_of[tuple(s)] + best_of[tuple(j for j in range(1, 8) if j not in s)] for s in shares)
    plan = solve(instance, method="routes", threads=1, time_limit_s=600)
    assert plan.claim.status == "optimal"
    assert 7 * (instance.horizon_steps + 1) - plan.objective.coverage == best
    assert check(instance, plan, bound=True).ok


def test_burma14_is_proven_and_its_proof_recomputed(tmp_path: Path) -> None:
    """Least latency, the way back not counted: 16160, by a dynamic programme over all sets of cities.

    The same programme gives the published 3323 for the shortest round trip, so the data are those of TSPLIB.
    """
    instance, steps = burma(tmp_path, 14)
    assert least_latency(steps) == 16160
    assert shortest_round_trip(steps) == 3323
    plan = solve(instance, method="routes", threads=1, time_limit_s=600)
    assert plan.claim.status == "optimal"
    assert 13 * (instance.horizon_steps + 1) - plan.objective.coverage == 16160
    found = check(instance, plan, bound=True)
    assert found.ok
    assert found.bound == pytest.approx(plan.claim.bound)


def least_latency(steps: Any) -> int:
    """Least sum of arrival times from the first city: each leg counts for all that are still to be visited."""
    return least(steps, list(range(len(steps))), np.zeros(len(steps)))


def shortest_round_trip(steps: Any) -> int:
    return least(steps, [1] * len(steps), steps[:, 0])


def least(steps: Any, times: list[int], end: Any) -> int:
    """Least sum of legs from the first city through all others and ``end``; with k left a leg counts ``times[k]``."""
    n = len(steps) - 1
    best = np.tile(end, (1 << n, 1))  # by the cities that are left, from each city
    for left in range(1, 1 << n):
        to = [j for j in range(n) if left >> j & 1]
        there = [best[left ^ 1 << j, j + 1] for j in to]
        best[left] = (steps[:, [j + 1 for j in to]] * times[len(to)] + there).min(axis=1)
    return int(best[-1, 0])


@pytest.mark.parametrize("form", ["FULL_MATRIX", "UPPER_ROW", "LOWER_DIAG_ROW", "UPPER_DIAG_ROW", "LOWER_ROW"])
def test_explicit_matrices_agree_with_coordinates(tmp_path: Path, form: str) -> None:
    def used(i: int, j: int) -> bool:
        diagonal = "DIAG" in form and i == j
        return diagonal or form == "FULL_MATRIX" or (j > i if form.startswith("UPPER") else j < i)

    numbers = [0 if i == j else whole(POINTS[i], POINTS[j]) for i in range(6) for j in range(6) if used(i, j)]
    section = "EDGE_WEIGHT_SECTION\n" + " ".join(map(str, numbers)) + "\n"
    extra = f"EDGE_WEIGHT_FORMAT: {form}\n"
    (instance,) = documents("tsplib", written(tmp_path, "e.tsp", tsp("EXPLICIT", extra, section)))
    (other,) = documents("tsplib", written(tmp_path, "c.tsp", tsp("EUC_2D", "", COORDINATES)))
    assert instance.travel == other.travel
    assert instance.horizon_steps == other.horizon_steps


def test_distances_are_tsplibs() -> None:
    assert DISTANCES["ATT"](0, 0, 30, 40) == 16  # sqrt(2500 / 10) = 15.81, rounded up
    assert DISTANCES["CEIL_2D"](0, 0, 1, 1) == 2
    assert DISTANCES["MAN_2D"](0, 0, 3, 4) == 7
    assert DISTANCES["GEO"](0.0, 10.0, 0.0, 11.0) == 112  # a degree of the equator: 111.3 km, and TSPLIB adds one


def test_a_repairman_problem_with_profits(tmp_path: Path) -> None:
    """Two repairmen share four customers: every way to split and order them, each earning profit less arrival."""
    nodes = [(0, 0, 0), (4, 0, 20), (8, 1, 18), (-5, 3, 25), (0, 9, 12)]
    text = f"{len(nodes)} 2\n" + "".join(f"{x} {y} {p}\n" for x, y, p in nodes)
    (instance,) = documents("mrpp", written(tmp_path, "m.txt", text))
    best = 0.0
    for order in itertools.permutations(range(1, 5)):
        for cut in range(5):
            earned = 0.0
            for route in (order[:cut], order[cut:]):
                t, at = 0, 0
                for k in route:
                    t, at = t + whole(nodes[at][:2], nodes[k][:2]), k
                    earned += max(0, nodes[k][2] - t)
            best = max(best, earned)
    assert solved(instance).objective.coverage == best


@pytest.mark.parametrize(
    ("repairmen", "best"), [(1, 6 * 20 - (1 + 2 + 3 + 7 + 8 + 9)), (2, 6 * 20 - 2 * (1 + 2 + 3)), (6, 108)]
)
def test_repairmen_on_a_line_are_proven(tmp_path: Path, capsys: Any, repairmen: int, best: int) -> None:
    """Customers 1, 2 and 3 to either side of the depot. Two repairmen take a side each and arrive as early as anybody
    can, so more do not help; one goes to one end first: to turn earlier delays more customers than it serves sooner."""
    nodes = "".join(f"{x} 0 {20 if x else 0}\n" for x in (0, 1, -1, 2, -2, 3, -3))
    file = written(tmp_path, "line.txt", f"7 {repairmen}\n{nodes}")
    assert convert(["mrpp", file, "-o", str(tmp_path / "made")]) == 0
    instance = load(capsys.readouterr().out.strip())
    plan = solve(instance, method="routes", threads=1)
    assert (plan.claim.status, plan.claim.objective) == ("optimal", best)
    assert check(instance, plan, bound=True).ok or plan.claim.certificate is None


def test_a_team_orienteering_file(tmp_path: Path) -> None:
    """Two routes from the first point to the last within T: all ordered pairs of disjoint subsets of four points."""
    points = [(0, 0, 0), (1, 2, 5), (3, 1, 8), (-2, 1, 6), (2, -3, 9), (4, 0, 0)]
    text = "n 6\nm 2\ntmax 8.5\n" + "".join(f"{x}\t{y}\t{s}\n" for x, y, s in points)
    (instance,) = documents("chao", written(tmp_path, "p0.txt", text))

    def fits(route: tuple[int, ...]) -> bool:
        return sum(math.dist(points[i][:2], points[j][:2]) for i, j in itertools.pairwise((0, *route, 5))) <= 8.5

    routes = [r for k in range(5) for r in itertools.permutations(range(1, 5), k) if fits(r)]
    best = max(sum(points[k][2] for k in {*a, *b}) for a in routes for b in routes if not {*a} & {*b})
    assert solved(instance).claim.objective == best


@pytest.mark.parametrize(("format", "pick"), [("gap", min), ("gap-max", max)])
def test_generalised_assignment_files(tmp_path: Path, format: str, pick: Any) -> None:
    """Two problems in one file; all 3^5 ways to give five jobs to three agents."""
    cost = [[17, 21, 22, 18, 24], [23, 16, 21, 20, 19], [16, 25, 19, 24, 22]]
    spend = [[8, 15, 14, 23, 8], [15, 7, 23, 22, 11], [21, 20, 6, 22, 24]]
    budget = [36, 34, 38]
    problem = "3 5\n" + "\n".join(" ".join(map(str, row)) for row in (*cost, *spend, budget)) + "\n"
    first, second = documents(format, written(tmp_path, "g.txt", "2\n" + problem + problem))
    assert first.name != second.name
    totals = []
    for agents in itertools.product(range(3), repeat=5):
        if all(sum(spend[r][k] for k in range(5) if agents[k] == r) <= budget[r] for r in range(3)):
            totals.append(sum(cost[agents[k]][k] for k in range(5)))
    plan = solved(second)
    assert len(plan.assigned) == 5
    given = {(int(a.robot[1:]), int(a.target[1:])) for a in plan.assigned}
    assert sum(cost[r][k] for r, k in given) == pick(totals)


def test_files_are_written_as_instances_that_solve_to_the_same(tmp_path: Path, capsys: Any) -> None:
    """Two agents, three jobs; agent 0 has room for one of them. The best profits are 9 + 7 + 8 = 24."""
    text = "1\n2 3\n9 6 7\n5 7 8\n4 4 4\n3 3 3\n5 6\n"
    good = written(tmp_path, "small.txt", text)
    folder = tmp_path / "made"
    assert convert(["gap-max", good, "-o", str(folder)]) == 0
    (path,) = capsys.readouterr().out.split()
    plan = solved(load(path))
    gain = load(path).targets[0].gain
    assert len(plan.assigned) == 3
    # A pair costs what it falls short of the largest profit, 9.
    assert 3 * 9 - (3 * gain - plan.claim.objective) == 24


def test_a_file_of_another_format_is_not_written(tmp_path: Path, capsys: Any) -> None:
    bad = written(tmp_path, "bad.txt", "1\n2 3\n9 6\n")
    folder = tmp_path / "made"
    assert convert(["gap-max", bad, "-o", str(folder)]) == 2
    assert str(bad) in capsys.readouterr().err
    assert not folder.exists()


def test_a_movingai_scenario_drives_along_shortest_paths(tmp_path: Path) -> None:
    """A wall of two pixels stands between the start and one goal; the other goal is in sight."""
    rows = ["." * 8 for _ in range(8)]
    for y in (2, 3, 4, 5):
        rows[y] = "...@@..."
    written(tmp_path, "m.map", "type octile\nheight 8\nwidth 8\nmap\n" + "\n".join(rows) + "\n")
    text = "version 1\n0\tm.map\t8\t8\t1\t3\t6\t3\t9.0\n0\tm.map\t8\t8\t1\t3\t1\t7\t4.0\n"
    (instance,) = documents("movingai", written(tmp_path, "m.map.scen", text))
    assert [target.id for target in instance.targets] == ["g0", "g1"]
    drive = {(row.from_, row.to): row.time_s for row in instance.travel}
    assert drive["s0", "g1"] == pytest.approx(4.0)  # straight down
    # Round the wall's upper corners, 0.2 pixels off them: up over it, along it, and down.
    side = math.hypot(3 - 1.5, 3.5 - 2.0)
    assert 2 * side + 2 < drive["s0", "g0"] < 2 * (side + 0.35) + 2.4
    # Half of the tour s0, g1, g0 is less than the way to g0, so that only one of the two can be visited.
    assert instance.time_left_s == pytest.approx((4.0 + drive["g1", "g0"]) / 2, abs=1e-3)
    assert solved(instance).claim.objective == 1


@pytest.mark.parametrize(
    ("format", "text", "fault"),
    [
        ("tsplib", "NAME: x\nDIMENSION: two\n", "DIMENSION: expected a whole number from 2 to 3000, found 'two'"),
        ("tsplib", tsp("EUC_2D", "", "NODE_COORD_SECTION\n1 0 0\n"), "NODE_COORD_SECTION: expected 6 lines, found 1"),
        ("tsplib", tsp("XRAY1", "", ""), "EDGE_WEIGHT_TYPE: expected one of EXPLICIT"),
        ("tsplib", "what is this\n", "line 1: expected KEY : VALUE or a section"),
        ("tsplib", tsp("EXPLICIT", "EDGE_WEIGHT_FORMAT: UPPER_ROW\n", "EDGE_WEIGHT_SECTION\n1 2\n"), "expected 15"),
        ("mrpp", "3 1\n0 0 0\n1 1 x\n2 2 3\n", "line 3: expected a number, found 'x'"),
        ("mrpp", "3 0\n", "at least 1 repairman"),
        ("chao", "n 3\nm 1\nT 5\n", "line 3: expected 'tmax NUMBER', found 'T 5'"),
        ("chao", "n 3\nm 1\ntmax 5\n0 0 0\n", "expected 3 points, found 1"),
        ("gap", "1\n2 2\n1 2 3\n", "end of file: expected a cost, found nothing more"),
        ("gap", "1\n1 1\n1 1 1 9\n", "expected the end of the file, found '9'"),
        ("gap", "x", "line 1: expected a number, found 'x'"),
        ("movingai", "version 1\n", "expected at least one scenario"),
        ("movingai", "0 m.map 8 8 9 0 1 1 2\n", "line 1: expected start and goal on the map"),
    ],
)
def test_faults_are_one_line_with_a_place(tmp_path: Path, format: str, text: str, fault: str) -> None:
    file = written(tmp_path, "bad.txt", text)
    with pytest.raises(InputError) as raised:
        documents(format, file)
    assert len(raised.value.faults) == 1
    assert file in str(raised.value)
    assert fault in str(raised.value)


def test_a_format_that_does_not_exist_and_a_file_that_does_not() -> None:
    with pytest.raises(UsageError, match="expected one of json, tsplib"):
        documents("cvrp", "x")
    for format in FORMATS:
        with pytest.raises(InputError, match="cannot be read"):
            documents(format, "/nowhere/x.txt")
