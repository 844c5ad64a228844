import json

import numpy as np
import pytest

from react_opt import certify_bound_enumerate
from react_opt.certify_bound import recompute_bound
from react_opt.certify_bound_choice import repriced
from react_opt.certify_bound_enumerate import Found
from react_opt.errors import UsageError
from react_opt.instance import OrosInstance
from react_opt.plan import Claim
from react_opt.solvers.routes import engine, finish
from react_opt.solvers.routes.engine import solve_routes
from react_opt.solvers.routes.finish import Finish
from react_opt.solvers.routes.tightening import Tightening
from react_opt.timegraph import route_problem


def _instance(seed: int, battery_j: float) -> OrosInstance:
    rng = np.random.default_rng(seed)
    n = 6
    travel = [
        {"from": f"c{i}", "to": f"c{j}", "steps": int(rng.integers(1, 3)), "energy_j": float(rng.integers(20, 80))}
        for i in range(n)
        for j in range(n)
        if i != j and rng.random() < 0.5
    ]
    return OrosInstance.model_validate(
        {
            "kind": "oros",
            "name": "small",
            "horizon_steps": 9,
            "step_s": 10.0,
            "cells": [{"id": f"c{i}", "x_m": 0.0, "y_m": 0.0, "weight": float(rng.integers(1, 4))} for i in range(n)],
            "travel": travel,
            "robots": [
                {
                    "id": f"r{k}",
                    "start": "c0",
                    "battery_j": battery_j,
                    "capacity_j": battery_j,
                    "idle_w": 2.0,
                    "sensing_w": 9.0,
                }
                for k in range(2)
            ],
        }
    )


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("battery_j", [5000.0, 420.0])
def test_recomputed_bound_is_the_claimed_one_and_above_the_optimum(seed: int, battery_j: float) -> None:
    """The plain dynamic programme confirms the prices of the solver, with and without a binding battery."""
    instance = _instance(seed, battery_j)
    result = solve_routes(route_problem(instance), work_limit=2000)
    bound = recompute_bound(instance, result.certificate)
    assert result.status == "optimal"
    assert bound <= result.certificate["bound"] * (1 + 1e-8)
    assert bound >= result.objective - 1e-9


def test_a_certificate_that_claims_too_much_is_found_out() -> None:
    """Lowering the claimed value of a class does not lower the recomputed bound."""
    instance = _instance(1, 5000.0)
    result = solve_routes(route_problem(instance), work_limit=2000)
    forged = {**result.certificate, "classes": [{**g, "best": g["best"] - 3.0} for g in result.certificate["classes"]]}
    assert recompute_bound(instance, forged) >= result.objective - 1e-9


def test_any_prices_give_a_bound() -> None:
    """Bounds are valid whatever the prices are: too high, too low or zero."""
    instance = _instance(2, 5000.0)
    result = solve_routes(route_problem(instance), work_limit=2000)
    for factor in (0.0, 0.5, 2.0):
        changed = {**result.certificate, "cell_price": [factor * p for p in result.certificate["cell_price"]]}
        changed["classes"] = [{**group, "best": 0.0} for group in changed["classes"]]
        assert recompute_bound(instance, changed) >= result.objective - 1e-9


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("battery_j", [5000.0, 420.0])
def test_without_prices_and_with_all_cells_remembered_one_robot_is_bounded_by_its_optimum(
    seed: int, battery_j: float
) -> None:
    """Then the programme is exact; progress is told in rising shares up to the whole."""
    data = _instance(seed, battery_j)
    instance = data.model_copy(update={"robots": data.robots[:1]})
    result = solve_routes(route_problem(instance), work_limit=2000)
    nothing = {"cell_price": [0.0] * 6, "classes": [{"robots": [0], "best": 0.0}], "cuts": [], "rows": []}
    shares: list[float] = []
    bound = recompute_bound(instance, {"kind": "lagrangian", "bound": 0.0, "memory": "all", **nothing}, shares.append)
    assert result.status == "optimal"
    assert bound == pytest.approx(result.objective, rel=1e-8)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def _walled(seed: int) -> OrosInstance:
    """A grid of weighted cells for two or three robots; on odd seeds the batteries bind."""
    rng = np.random.default_rng(seed)
    cols, n, horizon = 4, 12, 11
    edges = [(i, i + 1) for i in range(n) if (i + 1) % cols] + [(i, i + cols) for i in range(n - cols)]
    battery_j = horizon * 239.0 * (0.5 if seed % 2 else 1.0)
    robot = {"battery_j": battery_j, "capacity_j": battery_j, "idle_w": 2.0, "sensing_w": 16.9}
    return OrosInstance.model_validate(
        {
            "kind": "oros",
            "name": "walled",
            "horizon_steps": horizon,
            "step_s": 10.0,
            "cells": [{"id": f"c{i}", "x_m": 0.0, "y_m": 0.0, "weight": float(rng.integers(1, 4))} for i in range(n)],
            "travel": [
                {"from": f"c{i}", "to": f"c{j}", "steps": 1, "energy_j": 70.0}
                for edge in edges
                if rng.random() < 0.9
                for i, j in (edge, edge[::-1])
            ],
            "robots": [
                {"id": f"r{k}", "start": start, **robot} for k, start in enumerate(["c0", "c0", "c11"][seed % 3 :])
            ],
        }
    )


@pytest.mark.parametrize("seed", [2, 3, 4, 8, 10, 12, 13])
def test_the_bound_of_a_tree_is_recomputed_from_its_leaves(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the tree was left half done; a leaf that claims too much is found out, one left out is refused."""
    instance = _walled(seed)
    problem = route_problem(instance)
    best = solve_routes(problem, work_limit=6000).objective
    assert best is not None
    monkeypatch.setattr(engine, "FIRST_MEMORY", 1)
    monkeypatch.setattr(Tightening, "cut", lambda self: False)
    monkeypatch.setattr(Tightening, "grow_memory", lambda self: False)
    monkeypatch.setattr(Finish, "bound", lambda self, *_, **__: None)
    for work in (150, 6000):
        result = solve_routes(problem, work_limit=work)
        bound = recompute_bound(instance, result.certificate)
        assert bound >= best - 1e-9 * best
        assert bound <= result.bound + 1e-8 * best
    assert result.certificate["kind"] == ("tree" if seed != 2 else "lagrangian")
    if seed != 2:
        forged = json.loads(json.dumps(result.certificate))
        _lower(forged["tree"])
        assert recompute_bound(instance, forged) >= best - 1e-9 * best
        del forged["tree"][0]["no"]
        with pytest.raises(UsageError, match="KeyError: 'no'"):
            recompute_bound(instance, forged)


def test_a_bound_that_rests_on_enumeration_is_recomputed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without cuts and memory the routes of a better plan are enumerated; claims that are too low are found out."""
    enumerated = 0
    for seed in range(14):
        instance = _walled(seed)
        problem = route_problem(instance)
        best = solve_routes(problem, work_limit=6000).objective
        assert best is not None
        with monkeypatch.context() as weak:
            weak.setattr(engine, "FIRST_MEMORY", 1)
            weak.setattr(Tightening, "cut", lambda self: False)
            weak.setattr(Tightening, "grow_memory", lambda self: False)
            result = solve_routes(problem, work_limit=6000)
        proof = result.certificate
        assert result.objective == pytest.approx(best, rel=1e-8)
        assert best - 1e-9 * best <= recompute_bound(instance, proof) <= result.bound + 1e-8 * best
        if proof.get("enumerated", False):
            enumerated += 1
            assert recompute_bound(instance, {**proof, "bound": proof["bound"] - 2.5}) >= best - 1e-9 * best
            forged = {**proof, "classes": [{**group, "best": group["best"] - 3.0} for group in proof["classes"]]}
            assert recompute_bound(instance, forged) >= best - 1e-9 * best
    assert enumerated >= 3


def test_an_enumeration_that_is_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line that says so, rather than a machine without memory."""
    monkeypatch.setattr(Tightening, "tighten", lambda self: False)
    monkeypatch.setattr(certify_bound_enumerate, "MOST_BEGINNINGS", 20)
    for seed in range(20):
        instance = _instance(seed, 5000.0)
        proof = solve_routes(route_problem(instance), work_limit=2000).certificate
        if proof.get("enumerated", False):
            with pytest.raises(UsageError, match="more than 20 beginnings"):
                recompute_bound(instance, proof)
            return
    pytest.fail("no bound rests on an enumeration")


def test_prices_over_enumerated_routes_are_recomputed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The programme over the routes proves the bound by its own prices and cuts; whatever these say, bounds hold."""
    rested = 0
    for seed in range(14):
        instance = _walled(seed)
        problem = route_problem(instance)
        best = solve_routes(problem, work_limit=6000).objective
        assert best is not None
        with monkeypatch.context() as weak:
            weak.setattr(engine, "FIRST_MEMORY", 1)
            weak.setattr(finish, "FIRST_WORK", -1)
            weak.setattr(Tightening, "cut", lambda self: False)
            weak.setattr(Tightening, "grow_memory", lambda self: False)
            for most_work in (-1, 10**9):
                weak.setattr(finish, "MOST_WORK", most_work)
                result = solve_routes(problem, work_limit=6000)
                proof = result.certificate
                assert best - 1e-9 * best <= recompute_bound(instance, proof) <= result.bound + 1e-8 * best
                leaves = [leaf for leaf in proof.get("tree", [proof]) if "pool" in leaf]
                rested += len(leaves)
                for leaf in leaves:
                    for stage in leaf["pool"]:
                        stage["cell_price"] = [1.5 * price + 1.0 for price in stage["cell_price"]]
                        for cut in stage["cuts"]:
                            cut["price"] *= 2.0
                    leaf["bound"] -= 2.5
                assert recompute_bound(instance, proof) >= best - 1e-9 * best
    assert rested >= 3


def test_cuts_over_routes_that_do_not_fit_are_refused() -> None:
    """A cut needs one whole multiplier that is not negative for each of its cells."""
    found = [Found(np.array([[1]], dtype=np.uint64), np.zeros(1), np.ones(1))]
    lowest = np.zeros(2)
    for cut in ({"times": [1]}, {"times": [1, -1]}, {"cells": [0, 0]}, {"over": 0}):
        pool = {"cell_price": [0.0, 0.0], "cuts": [{"cells": [0, 1], "times": [1, 1], "over": 2, "price": 1.0, **cut}]}
        with pytest.raises(UsageError, match="do not fit"):
            repriced(found, [1], pool, lowest, 0.0)


def _lower(tree: list[dict]) -> None:
    """Make every leaf of a certificate claim three less for each class."""
    for group in (group for node in tree if "cell" not in node for group in node["classes"]):
        group["best"] -= 3.0


def test_trees_are_deeper_than_documents_may_be_nested() -> None:
    """A chain of a hundred questions: those who answer yes to the last are bounded by its leaf, as all others are. An
    answer that stands before its question, or that two questions share, is refused."""
    instance = _instance(1, 5000.0)
    problem = route_problem(instance)
    result = solve_routes(problem, work_limit=2000)
    leaf = {key: value for key, value in result.certificate.items() if key not in ("kind", "memory")}
    chain = [{"cell": 1, "by": 9, "yes": 2 * k + 1, "no": 2 * k + 2} for k in range(100)]
    tree = [leaf if place % 2 else chain[place // 2] for place in range(200)] + [leaf]
    proof = {"kind": "tree", "bound": leaf["bound"], "memory": result.certificate["memory"], "tree": tree}
    Claim(status="feasible", certificate=proof)
    assert recompute_bound(instance, proof) >= result.objective - 1e-9
    for answers in ({"yes": 0}, {"yes": 2}, {"no": 201}, {"no": 3}):
        with pytest.raises(UsageError, match="tree is none"):
            recompute_bound(instance, {**proof, "tree": [{**tree[0], **answers}, *tree[1:]]})


def test_certificate_of_another_instance_is_refused() -> None:
    """The number of prices has to be that of the cells, and every robot has to be named once."""
    instance = _instance(1, 5000.0)
    result = solve_routes(route_problem(instance), work_limit=2000)
    with pytest.raises(UsageError, match="prices 5 cells"):
        recompute_bound(instance, {**result.certificate, "cell_price": [0.0] * 5})
    with pytest.raises(UsageError, match="every robot once"):
        recompute_bound(instance, {**result.certificate, "classes": [{"robots": [0], "best": 1.0}]})
