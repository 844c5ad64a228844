"""OR-tools' routing library on the inspection: optional visits, two dimensions, guided local search."""

from __future__ import annotations

import time
from typing import Any

from benchmarks.peers.plans import inspection_plan, whole, without_plan
from benchmarks.peers.registry import Limits, Tell, needs, peer
from react_opt.models.inspection import ABSENT, Routes, build

SCALE = 1000  # whole milliseconds and millijoules
PRIZE = 10_000_000  # per unit of value
FAR = 2**40


@peer(
    "or-routing", ("inspection",), about="OR-tools' routing library, guided local search", package="ortools",
    missing=needs("ortools", "pip install ortools"), takes=lambda instance: instance.minimise == "time", endless=True,
)  # fmt: skip
def or_routing(instance: Any, limits: Limits, tell: Tell) -> Any:
    """Search until the time is up; the library proves no bound."""
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    begun = time.perf_counter()
    model = build(instance)
    arrays, n, robots = model.arrays, len(model.targets), len(model.robots)
    # Nodes: targets, then a start and an end of every robot.
    starts, ends = [n + 2 * r for r in range(robots)], [n + 2 * r + 1 for r in range(robots)]
    manager = pywrapcp.RoutingIndexManager(n + 2 * robots, robots, starts, ends)
    routing = pywrapcp.RoutingModel(manager)

    def transits(matrix: Any) -> list[int]:
        callbacks = []
        for r in range(robots):
            own = matrix[r].tolist()
            place = {**{k: k for k in range(n)}, starts[r]: n, ends[r]: n + 1}

            def transit(one: int, other: int, own: Any = own, place: Any = place) -> int:
                i, j = place.get(manager.IndexToNode(one)), place.get(manager.IndexToNode(other))
                if i is None or j is None or own[i][j] >= ABSENT:
                    return FAR
                return whole(own[i][j], SCALE)

            callbacks.append(routing.RegisterTransitCallback(transit))
        return callbacks

    time_of, energy_of = transits(arrays.time_s), transits(arrays.energy_j)
    for r in range(robots):
        routing.SetArcCostEvaluatorOfVehicle(time_of[r], r)
    latest, budgets = int(arrays.time_limit_s * SCALE), [int(e * SCALE) for e in arrays.energy_limit_j]
    routing.AddDimensionWithVehicleTransitAndCapacity(time_of, 0, [latest] * robots, True, "time")
    routing.AddDimensionWithVehicleTransitAndCapacity(energy_of, 0, budgets, True, "energy")
    for k in range(n):
        routing.AddDisjunction([manager.NodeToIndex(k)], round(arrays.value[k] * PRIZE))

    total = float(arrays.value.sum())
    best = [float("inf")]

    def improved() -> None:
        cost = routing.CostVar().Max()
        if cost < best[0]:
            best[0] = cost
            tell(time.perf_counter() - begun, total - cost // PRIZE, None)

    routing.AddAtSolutionCallback(improved)
    parameters = pywrapcp.DefaultRoutingSearchParameters()
    parameters.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
    parameters.local_search_metaheuristic = routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    left_ms = max(10, int(1000 * (limits.time_s - (time.perf_counter() - begun))))
    parameters.time_limit.seconds, parameters.time_limit.nanos = left_ms // 1000, left_ms % 1000 * 1_000_000
    found = routing.SolveWithParameters(parameters)
    if not found:
        return without_plan(instance, "or-routing", limit="time", reason="no feasible routes were found")
    routes: Routes = []
    for r in range(robots):
        route, index = [], found.Value(routing.NextVar(routing.Start(r)))
        while not routing.IsEnd(index):
            route.append(manager.IndexToNode(index))
            index = found.Value(routing.NextVar(index))
        routes.append(route)
    return inspection_plan(instance, model, routes, None, "time", "or-routing")
