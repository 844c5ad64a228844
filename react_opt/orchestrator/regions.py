"""Unexplored regions as things to visit: what each is worth, and the nearest place to look into it from.

Hidden space is shared out among the pieces of the frontier: each hidden block belongs to the piece it is nearest to
through hidden space. How much of it a look from there reveals falls with its depth, since nobody knows what stands in
the way: a share ``exp(-depth / mean_free_m)`` counts for the piece. Of what lies deeper than ``DEEP_M`` the rest
counts for the area in which it lies, as something that has to be driven to. Where hidden space cannot be reached at
all (the inside of a machine that has been seen from all sides) there is nothing to visit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.orchestrator.belief import AreaView
from react_opt.orchestrator.strategy import Point
from react_opt.orchestrator.survey import COARSE, Block, Cluster, Survey
from react_opt.orchestrator.views import best_view

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

NONE = np.zeros((0, 2), dtype=np.int64)
DEEP_M = 5.0
"""What lies so deep is not looked into from the frontier: it is a matter of the area."""
SHORTEST_M = 0.3
WIDEST_M = 5.0
"""Frontier pieces are between so long: shorter ones are noise, longer ones are cut."""
LEAST_M2 = 0.06
LEAST_DEEP_M2 = 4.0
"""Regions worth less are not visited; those that have to be driven to first are worth more or wait."""
LOOKS_M = (0.0, 0.8, 1.6, 2.6, 4.0)
LOOK_ANGLES = 12
"""Places to look from are tried around the middle of the frontier at these distances and so many directions."""
LOOKED_BLOCKS = 2  # coarse blocks around where a robot looked from that are no place to look from again


@dataclass(frozen=True)
class HiddenSpace:
    """What hidden space is expected to be like.

    Parameters
    ----------
    free_share
        Share of it that is free; the rest is walls and what stands on the floor.
    mean_free_m
        Mean length of a look into it, m.
    most_per_m
        A metre of frontier reveals at most so many m^2: little is seen through a slit.
    """

    free_share: float = 0.65
    mean_free_m: float = 3.0
    most_per_m: float = 4.0


@dataclass(frozen=True, eq=False)
class Region:
    """An unexplored region.

    Parameters
    ----------
    at_m
        Middle of its frontier; of a deep one, middle of its hidden space.
    view_m, view
        Where to look into it from: point and coarse block.
    value_m2
        Free area that this is expected to reveal.
    size_m2
        Hidden area, whatever it is.
    frontier_m
        Length of its frontier; 0 for a deep region.
    area
        Id of the area in which ``at_m`` lies.
    blocks
        ``(k, 2)`` its hidden coarse blocks that can be seen from the frontier, empty for a deep one.
    ground
        Numbers of all its hidden coarse blocks, row by row, empty for a deep one.
    number
        Which piece of the frontier it is; of a deep one, -1 less the number of its area.
    """

    at_m: Point
    view_m: Point
    view: Block
    value_m2: float
    size_m2: float
    frontier_m: float
    area: str
    blocks: IntArray
    ground: IntArray
    number: int

    def is_part_of(self, before: Region, near_m: float) -> bool:
        """Tell whether this is what is left of an earlier region: frontiers move as robots look behind them."""
        if np.hypot(self.at_m[0] - before.at_m[0], self.at_m[1] - before.at_m[1]) <= near_m:
            return True
        left = len(np.intersect1d(self.ground, before.ground, assume_unique=True))
        return bool(2 * left > len(self.ground))


class Belonging(NamedTuple):
    """To what the hidden coarse blocks of a survey belong."""

    owner: IntArray
    """``(rows, cols)`` number of the piece of the frontier, -1 for none."""
    depth: FloatArray
    """``(rows, cols)`` how far behind the frontier, coarse blocks."""
    area_of: IntArray
    """``(rows, cols)`` number of the area."""
    behind: FloatArray
    """Hidden blocks that each area's deep region stands for."""


class Regions:
    """Finds the regions of a survey.

    Parameters
    ----------
    range_m
        How far robots see, m.
    hidden_space
        What they expect of hidden space.
    """

    def __init__(self, range_m: float, hidden_space: HiddenSpace | None = None) -> None:
        self.range_m = range_m
        self.hidden_space = hidden_space or HiddenSpace()
        self._area_of: IntArray | None = None
        self._area_key: tuple[object, ...] = ()
        self.belonging: Belonging | None = None
        """Of the regions that were found last."""

    def areas_of_blocks(self, survey: Survey, areas: Sequence[AreaView]) -> IntArray:
        """Return for each coarse block the index of its area: the one whose centre is nearest along the worse axis."""
        key = (survey.hidden.shape, survey.map.origin_x_m, survey.map.origin_y_m, tuple(area.id for area in areas))
        if key != self._area_key or self._area_of is None:
            centres = survey.to_blocks(np.array([(area.x_m, area.y_m) for area in areas])) / COARSE
            rows, cols = survey.hidden.shape
            dx = np.abs(np.arange(cols)[None, :] + 0.5 - centres[:, 0, None])
            dy = np.abs(np.arange(rows)[None, :] + 0.5 - centres[:, 1, None])
            worse = np.maximum(dy[:, :, None], dx[:, None, :])
            self._area_of, self._area_key = np.argmin(worse, axis=0).astype(np.int64), key
        return self._area_of

    def find(
        self,
        survey: Survey,
        areas: Sequence[AreaView],
        time_s: FloatArray,
        looked_m: Sequence[Point] = (),
        *,
        deep: bool = True,
    ) -> list[Region]:
        """Return the regions that can be reached, those with a frontier first.

        Parameters
        ----------
        survey, areas
            What is known.
        time_s
            ``(rows, cols)`` s to each coarse block for the robot that is nearest, unknown space taken as free.
        looked_m
            Where robots have stood and looked: all that is seen from there is known, so they are no places to look
            from.
        deep
            Whether areas with hidden space far behind the frontier are regions too.
        """
        clusters = survey.clusters(SHORTEST_M, WIDEST_M)
        labels = np.full(survey.hidden.shape, -1, dtype=np.int64)
        for n, cluster in enumerate(clusters):
            labels[cluster.blocks[:, 0], cluster.blocks[:, 1]] = n
        area_of = self.areas_of_blocks(survey, areas)
        block_m2 = survey.block_m**2 * self.hidden_space.free_share
        reached = np.isfinite(time_s)
        near, size, behind, owner, depth = share_out(
            survey.hidden, labels, len(clusters), area_of, len(areas), reached,
            self.hidden_space.mean_free_m / survey.coarse_m,
            DEEP_M / survey.coarse_m,
        )  # fmt: skip
        may_stand = reached.copy()
        for point in looked_m:
            row, col = survey.block_of(*point)
            low_row, low_col = max(0, row - LOOKED_BLOCKS), max(0, col - LOOKED_BLOCKS)
            may_stand[low_row : row + LOOKED_BLOCKS + 1, low_col : col + LOOKED_BLOCKS + 1] = False
        grounds = _grounds(owner, len(clusters))
        members = [ground[depth[ground[:, 0], ground[:, 1]] <= 3.0 / survey.coarse_m] for ground in grounds]
        self.belonging = Belonging(owner, depth, area_of, behind[:, 0])
        found = []
        for n, cluster in enumerate(clusters):
            value = min(float(near[n]) * block_m2, self.hidden_space.most_per_m * cluster.length_m)
            if value < LEAST_M2:
                continue
            view, share = self._view(survey, cluster, members[n], time_s, may_stand)
            if view is None or value * share < LEAST_M2:
                continue
            row, col = survey.block_of(cluster.x_m, cluster.y_m)
            found.append(
                Region(
                    (cluster.x_m, cluster.y_m),
                    survey.point_of(view),
                    view,
                    value * share,
                    float(size[n]) * survey.block_m**2,
                    cluster.length_m,
                    areas[int(area_of[row, col])].id,
                    members[n],
                    grounds[n][:, 0] * owner.shape[1] + grounds[n][:, 1],
                    n,
                )
            )
        for n, area in enumerate(areas) if deep else ():
            value = float(behind[n, 0]) * block_m2
            if area.unreachable or value < LEAST_DEEP_M2:
                continue
            middle = (int(behind[n, 1] / behind[n, 0]), int(behind[n, 2] / behind[n, 0]))
            block = survey.nearest_block(middle, reached & (survey.hidden > 0), 30)
            if block is not None:
                at = survey.point_of(block)
                size_m2 = float(behind[n, 0]) * survey.block_m**2
                found.append(Region(at, at, block, value, size_m2, 0.0, area.id, NONE, NONE[:, 0], -1 - n))
        return found

    def _view(
        self, survey: Survey, cluster: Cluster, hidden: IntArray, time_s: FloatArray, may_stand: NDArray[np.bool_]
    ) -> tuple[Block | None, float]:
        """Return the nearest place that sees enough of a region (None where none does), and what share it sees."""
        x, y = (survey.to_blocks((cluster.x_m, cluster.y_m)) / COARSE).tolist()
        targets = hidden if len(hidden) else cluster.blocks
        reach = self.range_m / survey.block_m
        offsets = _offsets(survey.coarse_m)
        row, col, seen = best_view(
            survey.blocks, survey.solids, time_s, may_stand, y, x, offsets, targets, COARSE, reach
        )
        return ((row, col), seen / len(targets)) if seen else (None, 0.0)


@lru_cache(maxsize=8)
def _offsets(coarse_m: float) -> FloatArray:
    """Return ``(n, 2)`` rows and columns of the places to look from, against the middle of a frontier."""
    offsets = []
    for radius_m in LOOKS_M:
        reach = radius_m / coarse_m
        for n in range(LOOK_ANGLES if radius_m > 0 else 1):
            angle = 2 * np.pi * n / LOOK_ANGLES
            offsets.append((reach * np.sin(angle), reach * np.cos(angle)))
    return np.array(offsets)


def _grounds(owner: IntArray, count: int) -> list[IntArray]:
    """Return for each frontier piece its hidden coarse blocks."""
    at = np.argwhere(owner >= 0)
    of = owner[at[:, 0], at[:, 1]]
    order = np.argsort(of, kind="stable")
    edges = np.searchsorted(of[order], np.arange(count + 1))
    return [at[order[edges[n] : edges[n + 1]]] for n in range(count)]


@kernel
def share_out(
    hidden: IntArray,
    labels: IntArray,
    count: int,
    area_of: IntArray,
    areas: int,
    reachable: NDArray[np.bool_],
    mean_free: float,
    deep: float,
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray, FloatArray]:
    """Share hidden blocks out among frontier pieces and areas (see this module).

    Parameters
    ----------
    hidden
        ``(rows, cols)`` hidden blocks in each coarse block.
    labels, count
        Frontier piece of each coarse block, -1 for none, and how many there are.
    area_of, areas
        Area of each coarse block, and how many there are.
    reachable
        Whether some robot gets there if hidden space is free.
    mean_free, deep
        Mean length of a look, and the depth from which the rest counts for the area, coarse blocks.

    Returns
    -------
    near, size, behind, owner, depth
        Per piece its hidden blocks, weighted by depth and not; per area the rest of what can be reached, with the
        weighted sums of rows and columns; per coarse block its piece (-1: none) and depth (coarse blocks).
    """
    rows, cols = hidden.shape
    near, size, behind = np.zeros(count), np.zeros(count), np.zeros((areas, 3))
    owner = np.full((rows, cols), -1, dtype=np.int64)
    depth = np.full((rows, cols), np.inf)
    queue = np.empty(rows * cols, dtype=np.int64)
    head, tail = 0, 0
    for r in range(rows):
        for c in range(cols):
            if labels[r, c] >= 0:
                owner[r, c], depth[r, c] = labels[r, c], 0.0
                queue[tail] = r * cols + c
                tail += 1
    while head < tail:
        r, c = queue[head] // cols, queue[head] % cols
        head += 1
        for n in range(4):
            y = r + (1 if n == 0 else -1 if n == 1 else 0)
            x = c + (1 if n == 2 else -1 if n == 3 else 0)
            if 0 <= y < rows and 0 <= x < cols and owner[y, x] < 0 and hidden[y, x] > 0:
                owner[y, x], depth[y, x] = owner[r, c], depth[r, c] + 1.0
                queue[tail] = y * cols + x
                tail += 1
    for r in range(rows):
        for c in range(cols):
            if hidden[r, c] == 0:
                owner[r, c] = -1
                continue
            share = 0.0
            if owner[r, c] >= 0:
                share = np.exp(-depth[r, c] / mean_free)
                near[owner[r, c]] += share * hidden[r, c]
                size[owner[r, c]] += hidden[r, c]
            if reachable[r, c] and depth[r, c] > deep:
                rest = (1.0 - share) * hidden[r, c]
                behind[area_of[r, c], 0] += rest
                behind[area_of[r, c], 1] += rest * r
                behind[area_of[r, c], 2] += rest * c
    return near, size, behind, owner, depth
