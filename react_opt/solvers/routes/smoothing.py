"""The Lagrangian dual with the best route replaced by a sum over all routes: a smooth function of the prices.

    F(pi) = sum_i pi_i + sum_k n_k tau log sum_{r in k} exp((v_r - pi a_r) / tau)

lies above the Lagrangian bound at pi and tends to it as the temperature tau falls (Nesterov 2005 on smoothing; for
multipliers of a dynamic programme the sum costs as much as the maximum). Its gradient is an average over all routes
rather than one of many best ones, so a quasi-Newton method with bounds (L-BFGS-B) goes in tens of steps where
subgradients need thousands. The sums run over routes with a small memory of their own; what is claimed is the bound
of the exact pricing at the prices found.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue

import numpy as np
from numpy.typing import NDArray

from react_opt.route_problem import FloatArray, Route, RouteProblem
from react_opt.solvers.routes.softkernel import NEVER, SoftGraph, SoftRobot, SoftTables, draw_route, soft_pass

MOST_BITS = 7  # cells remembered in one place
MOST_WEIGHTS = 8_000_000  # numbers per table of (instant, cell, memory)


class SmoothedDual:
    """The smoothed dual of a route problem; the battery and the limits between robots are left out.

    Parameters
    ----------
    problem
        The route problem.
    near
        For each cell the cells remembered there, itself included.
    threads
        Robot classes that are summed at once; each thread has tables of its own.
    stop
        ``(1,)`` flag; while it is not 0, sums are given up at once and mean nothing.
    """

    def __init__(
        self,
        problem: RouteProblem,
        near: Sequence[Iterable[int]],
        threads: int = 1,
        stop: NDArray[np.uint8] | None = None,
    ) -> None:
        self.problem = problem
        self._stop = np.zeros(1, np.uint8) if stop is None else stop
        self._threads = max(1, min(threads, len(problem.classes)))
        self.near = [[*sorted({*cells} - {j}), j] for j, cells in enumerate(near)]  # the cell itself last
        self._cell, self._temperature = np.zeros(problem.n_cells), 1.0
        self._lay_out()

    def value(self, cell: FloatArray, temperature: float) -> tuple[float, FloatArray]:
        """Return the smoothed bound at some prices and its gradient.

        Parameters
        ----------
        cell
            ``(n_cells,)`` prices, not negative.
        temperature
            In units of the objective; the bound is above the Lagrangian bound by less than this times the
            logarithm of the number of routes, for every robot.
        """
        self._cell, self._temperature = np.array(cell), temperature
        classes = self.problem.classes
        parts: Iterable[tuple[float, FloatArray]]
        if self._threads == 1:
            parts = [self._pass(k, self._tables[0]) for k in range(len(classes))]
        else:
            free: SimpleQueue[SoftTables] = SimpleQueue()
            for tables in self._tables:
                free.put(tables)

            def one(k: int) -> tuple[float, FloatArray]:
                tables = free.get()
                try:
                    return self._pass(k, tables)
                finally:
                    free.put(tables)

            with ThreadPoolExecutor(self._threads) as pool:
                parts = list(pool.map(one, range(len(classes))))
        total, gradient = float(cell.sum()), np.ones(self.problem.n_cells)
        for group, (most, visits) in zip(classes, parts, strict=True):
            total += len(group.robots) * (most + self.problem.sigma * group.battery_j)
            gradient -= len(group.robots) * visits
        return total, gradient

    def draw(self, robot_class: int, count: int, rng: np.random.Generator) -> list[Route]:
        """Return routes drawn with the probabilities of the last call of `value`.

        Parameters
        ----------
        robot_class
            Class of the routes.
        count
            How many.
        rng
            Random generator.
        """
        tables, begin = self._tables[0], self.problem.classes[robot_class].start_step
        self._pass(robot_class, tables)
        robot = self._robot(robot_class)
        routes = []
        for _ in range(count):
            random = rng.random((self.problem.horizon + 1, 2))
            cells, arcs, senses = draw_route(self._graph, robot, tables, self._temperature, random)
            routes.append(Route(robot_class, cells[begin:], arcs[begin:], senses[begin:], np.zeros(len(cells) - begin)))
        return routes

    def grow(self, cycles: Iterable[tuple[int, Iterable[int]]]) -> list[tuple[int, int]]:
        """Remember cells along cycles, the first ones first, as far as there is room; return the new pairs.

        Parameters
        ----------
        cycles
            ``(cell, places)``: a cell collected twice and the places between, all of which have to remember it.
        """
        rows = self.problem.horizon + 1
        states = sum(1 << len(cells) for cells in self.near)
        added: list[tuple[int, int]] = []
        for cell, places in cycles:
            missing = [place for place in {*places} if cell not in self.near[place]]
            more = sum(1 << len(self.near[place]) for place in missing)
            full = any(len(self.near[place]) >= MOST_BITS for place in missing)
            if not missing or full or (states + more) * rows > MOST_WEIGHTS:
                continue
            states += more
            for place in missing:
                self.near[place] = [*sorted([*self.near[place][:-1], cell]), place]
                added.append((place, cell))
        if added:
            self._lay_out()
        return added

    def _robot(self, robot_class: int) -> SoftRobot:
        """Return a class at the prices of the last call."""
        problem, group = self.problem, self.problem.classes[robot_class]
        reward, sensing = np.ascontiguousarray(problem.reward.T), problem.sigma * group.sense_j
        gain = reward - (sensing + self._cell)[None, :]
        gain[(reward <= 0.0) | (reward <= sensing)] = NEVER
        gain[: max(1, group.start_step)] = NEVER
        return SoftRobot(group.start, group.start_step, group.return_to, problem.sigma * group.wait_j, gain)

    def _pass(self, robot_class: int, tables: SoftTables) -> tuple[float, FloatArray]:
        return soft_pass(self._graph, self._robot(robot_class), tables, self._temperature, self._stop)

    def _lay_out(self) -> None:
        """Number the memories and tabulate how arcs carry them."""
        problem, near = self.problem, self.near
        sizes = np.array([1 << len(cells) for cells in near], dtype=np.int64)
        first = np.concatenate((np.zeros(1, np.int64), np.cumsum(sizes)))
        bit = [{cell: 1 << k for k, cell in enumerate(cells)} for cells in near]
        known: dict[tuple[int, int], int] = {}
        tables: list[np.ndarray[tuple[int], np.dtype[np.int32]]] = []
        length = 0
        carry = np.empty(problem.n_arcs, dtype=np.int64)
        for a, (i, j) in enumerate(zip(problem.arc_from.tolist(), problem.arc_to.tolist(), strict=True)):
            if (i, j) not in known:
                memories = np.arange(sizes[i], dtype=np.int32)
                table = np.zeros(sizes[i], dtype=np.int32)
                for cell, mask in bit[i].items():
                    if cell in bit[j]:
                        table += np.where(memories & mask, bit[j][cell], 0).astype(np.int32)
                known[i, j] = length
                length += len(table)
                tables.append(table)
            carry[a] = known[i, j]
        carried = np.concatenate(tables) if tables else np.zeros(0, np.int32)
        self._graph = SoftGraph(
            problem.out_start, problem.arc_to, problem.arc_steps, problem.sigma * problem.arc_energy_j,
            first, carried, carry,
        )  # fmt: skip
        shape = (problem.horizon + 1, int(first[-1]))
        self._tables = [SoftTables(np.empty(shape), np.empty(shape)) for _ in range(self._threads)]
