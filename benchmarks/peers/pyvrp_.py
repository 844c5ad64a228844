"""PyVRP on the inspection: prize-collecting vehicle routing, prizes far above durations, distance for energy."""

from __future__ import annotations

import time
from typing import Any

from benchmarks.peers.monoliths import EXTRA
from benchmarks.peers.plans import inspection_plan, whole, without_plan
from benchmarks.peers.registry import Limits, Tell, needs, peer
from react_opt.models.inspection import ABSENT, InspectionArrays, Routes, build

SCALE = 100  # whole hundredths of s and J: of 10, 100, 1000 and 10000 the one with which PyVRP found most


@peer(
    "pyvrp", ("inspection",), about="PyVRP's hybrid genetic search, prize-collecting", package="pyvrp",
    missing=needs("pyvrp", EXTRA), takes=lambda instance: instance.minimise == "time", endless=True,
)  # fmt: skip
def pyvrp(instance: Any, limits: Limits, tell: Tell) -> Any:
    """Search until the time is up; PyVRP proves no bound."""
    begun = time.perf_counter()
    model = build(instance)
    arrays = model.arrays
    routes = search(arrays, limits.time_s, limits.seed, tell)
    if routes is None:
        return without_plan(instance, "pyvrp", limit="time", reason="no feasible routes were found")
    tell(time.perf_counter() - begun, arrays.worth(routes)[0], None)
    return inspection_plan(instance, model, routes, None, "time", "pyvrp")


def search(arrays: InspectionArrays, seconds: float, seed: int, tell: Tell | None = None) -> Routes | None:
    """Search for routes for so many seconds, modelling included; None where no feasible ones were found."""
    import pyvrp
    from pyvrp.stop import MaxRuntime

    begun = time.perf_counter()
    prize = _prize(arrays)
    problem = _model(pyvrp, arrays, prize)
    stop: Any = MaxRuntime(max(0.01, seconds - (time.perf_counter() - begun)))
    if tell is not None:
        stop = _Watched(stop, arrays, begun, tell, prize)
    best = problem.solve(stop, seed=seed, display=False, collect_stats=False).best
    if not best.is_feasible():
        return None
    routes: Routes = [[] for _ in arrays.time_s]
    for route in best.routes():
        routes[route.vehicle_type()] = [stop.idx for stop in route if stop.is_client()]
    # PyVRP leaves vehicles unused, whose robots may be unable to get to their ends without a target on the way.
    return routes if arrays.is_feasible(routes) else None


def _prize(arrays: InspectionArrays) -> int:
    """Return the prize of a unit of value: just more than any sum of durations."""
    return int(len(arrays.time_s) * arrays.time_limit_s * SCALE) + 1


class _Watched:
    """A stopping criterion that also tells how the best cost falls: the value is what its prizes say."""

    def __init__(self, inner: Any, arrays: InspectionArrays, begun: float, tell: Tell, prize: int) -> None:
        self._inner, self._begun, self._tell, self._prize = inner, begun, tell, prize
        self._all = float(arrays.value.sum())
        self._best = float("inf")

    def __call__(self, best_cost: float) -> bool:
        if best_cost < self._best and best_cost < 2**60:
            self._best = best_cost
            # cost = prizes left out + durations, and the durations are less than one unit of prize
            value = self._all - int(best_cost // self._prize)
            self._tell(time.perf_counter() - self._begun, value, None)
        return bool(self._inner(best_cost))


def _model(pyvrp: Any, arrays: InspectionArrays, prize: int) -> Any:
    n = len(arrays.value)
    model = pyvrp.Model()
    places = [model.add_location(0, 0) for _ in range(n + 2 * len(arrays.time_s))]
    for i, value in enumerate(arrays.value.tolist()):
        model.add_client(places[i], prize=round(value * prize), required=False)
    for r, limit_j in enumerate(arrays.energy_limit_j.tolist()):
        profile = model.add_profile()
        start, end = places[n + 2 * r], places[n + 2 * r + 1]
        model.add_vehicle_type(
            1, start_depot=model.add_depot(start), end_depot=model.add_depot(end),
            shift_duration=int(arrays.time_limit_s * SCALE), max_distance=int(limit_j * SCALE),
            unit_distance_cost=0, unit_duration_cost=1, profile=profile,
        )  # fmt: skip
        nodes = [*places[:n], start, end]
        for i in range(n + 1):
            for j in [*range(n), n + 1]:
                energy_j, time_s = float(arrays.energy_j[r, i, j]), float(arrays.time_s[r, i, j])
                if i != j and time_s < ABSENT and energy_j < ABSENT:
                    model.add_edge(nodes[i], nodes[j], whole(energy_j, SCALE), whole(time_s, SCALE), profile)
    return model
