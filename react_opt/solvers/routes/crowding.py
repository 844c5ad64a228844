"""Proof that robots which start close together cannot keep `robots_per_cell`: a maximum flow."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_flow

from react_opt.route_problem import RouteProblem

_WINDOW = 8  # steps looked at; a crowd either disperses soon or not at all


def most_placed(problem: RouteProblem) -> tuple[int, int] | None:
    """Return how many robots start in the first steps, and the most of them that find room, if these differ.

    A relaxation: the robots are interchangeable, have energy enough and may swap cells, and only the first few
    steps after the earliest start are looked at. Fewer placed than there are proves that no plan exists. None where
    nothing is proven.

    Parameters
    ----------
    problem
        The problem.
    """
    most = problem.robots_per_cell
    if most is None or problem.n_robots <= most:
        return None
    begin = min(group.start_step for group in problem.classes)
    end = min(problem.horizon, begin + _WINDOW)
    supply: dict[tuple[int, int], int] = {}
    for group in problem.classes:
        if group.start_step <= end:
            place = (group.start_step, group.start)
            supply[place] = supply.get(place, 0) + len(group.robots)
    index = {place: 2 + 2 * number for number, place in enumerate(sorted(supply))}  # in-node; out-node is one more
    edges = [(0, index[place], count) for place, count in supply.items()]
    layers: list[set[int]] = [set() for _ in range(end + 1)]
    for t, cell in supply:
        layers[t].add(cell)
    total = sum(supply.values())
    for t in range(begin, end + 1):
        for cell in sorted(layers[t]):
            node = index[t, cell]
            edges.append((node, node + 1, most if t >= 1 else total))
            if t == end:
                edges.append((node + 1, 1, total))
                continue
            ways = [(t + 1, cell)]
            for arc in range(problem.out_start[cell], problem.out_start[cell + 1]):
                ways.append((t + int(problem.arc_steps[arc]), int(problem.arc_to[arc])))
            for arrival, there in sorted(set(ways)):
                if arrival > end:
                    if arrival <= problem.horizon:
                        edges.append((node + 1, 1, total))  # under way at the end of the window
                    continue
                if (arrival, there) not in index:
                    index[arrival, there] = 2 + 2 * len(index)
                layers[arrival].add(there)
                edges.append((node + 1, index[arrival, there], total))
    size = 2 + 2 * len(index)
    rows, columns, capacities = np.array(edges, dtype=np.int32).T
    network = csr_array((capacities, (rows, columns)), shape=(size, size), dtype=np.int32)
    placed = int(maximum_flow(network, 0, 1).flow_value)
    return (total, placed) if placed < total else None
