"""A roadmap of random milestones: joined to queried points, searched, and bridged where the pixel map knows better.

The planner that links the milestones is passed in; this module knows no planning library.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations

import numpy as np
from scipy import ndimage
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from react_opt.geometry.sight import Padded
from react_opt.paths.sampled import FloatArray, Grids, IntArray, flood, join

Grow = Callable[[FloatArray], tuple[FloatArray, IntArray]]
Weigh = Callable[[FloatArray, IntArray], FloatArray]
_JOINED = 24
"""Roadmap neighbours of a queried point, at most; they are looked for among four times as many nearest nodes."""


class Roadmap:
    """A roadmap, and what the pixel map knows that random samples miss.

    Samples are drawn evenly from the free pixels. Where they leave two parts of one connected region unjoined, as
    narrow passages do, further samples are taken along a pixel path between the parts and handed to the planner,
    closer and closer together until it joins them. So no pair of points is missing that the disc can reach.

    Parameters
    ----------
    grids
        Where the robot may stand and drive.
    grow
        Takes ``(m, 2)`` further milestones in pixel coordinates and returns all nodes and edges of the roadmap.
    weigh
        Takes nodes and ``(e, 2)`` pairs of them and returns what each leg costs; least cost is searched for.
    samples
        Random milestones.
    seed
        Seed of the samples; the same seed and the same queries give the same roadmap.
    """

    def __init__(self, grids: Grids, grow: Grow, weigh: Weigh, samples: int, seed: int) -> None:
        self._grids = grids
        self._grow = grow
        self._weigh = weigh
        self._regions = np.asarray(ndimage.label(grids.stand == 0)[0], dtype=np.int32).ravel()
        rows, cols = np.nonzero(grids.stand[1:-1, 1:-1] == 0)
        rng = np.random.default_rng(seed)
        self.nodes: FloatArray = np.empty((0, 2))
        self.edges: IntArray = np.empty((0, 2), dtype=np.int64)
        if rows.size:
            pick = rng.integers(rows.size, size=samples)
            self.nodes, self.edges = grow(np.stack((cols[pick], rows[pick]), axis=1) + rng.random((samples, 2)))
        self.graph(np.empty((0, 2)))

    def graph(self, points: FloatArray) -> tuple[FloatArray, csr_array]:
        """Return the roadmap with points joined to it, first bridging whatever cuts its parts or the points off.

        Parameters
        ----------
        points
            ``(n, 2)`` pixel coordinates where the robot may stand.

        Returns
        -------
        nodes, graph
            ``(n + v, 2)`` pixel coordinates, the points first, and the symmetric ``(n + v, n + v)`` graph of
            costs.
        """
        for spacing in (8, 3, 1):
            nodes, graph = self._joined(points)
            guide = self._guide(nodes, graph, spacing)
            if not len(guide):
                return nodes, graph
            self.nodes, self.edges = self._grow(guide)
        return self._joined(points)

    def paths(self, points: FloatArray) -> Iterator[tuple[tuple[int, int], FloatArray]]:
        """Yield ``(i, j)``, i < j, and the cheapest path in the graph, for every pair of points that has one.

        Parameters
        ----------
        points
            ``(n, 2)`` pixel coordinates where the robot may stand.
        """
        n = len(points)
        if n < 2:
            return
        nodes, graph = self.graph(points)
        costs, before = dijkstra(graph, indices=np.arange(n), return_predecessors=True)
        for i, j in combinations(range(n), 2):
            if np.isfinite(costs[i, j]):
                trail = [j]
                while trail[-1] != i:
                    trail.append(int(before[i, trail[-1]]))
                yield (i, j), nodes[trail[::-1]]

    def _joined(self, points: FloatArray) -> tuple[FloatArray, csr_array]:
        """Return the nodes and the graph with every point joined to what it sees near by, and to other points."""
        n, stand, drive = len(points), self._grids.stand, self._grids.drive
        nodes = np.concatenate((points, self.nodes))
        edges = [self.edges + n]
        if n:
            point, other, _ = join(stand, drive, points, points, np.tile(np.arange(n), (n, 1)), n)
            edges.append(np.stack((point, other), axis=1)[point < other])
        if n and len(self.nodes):
            near = cKDTree(self.nodes).query(points, k=min(4 * _JOINED, len(self.nodes)))[1]
            near = np.asarray(near, dtype=np.int64).reshape(n, -1)
            point, node, _ = join(stand, drive, points, self.nodes, near, _JOINED)
            edges.append(np.stack((point, node + n), axis=1))
        low, high = np.sort(np.concatenate(edges), axis=1).T
        pairs = np.stack(np.divmod(np.unique(low * len(nodes) + high), len(nodes)), axis=1)
        costs = np.maximum(self._weigh(nodes, pairs), 1e-12)  # 0 would be no edge
        both = np.concatenate((pairs, pairs[:, ::-1]))
        weights = np.concatenate((costs, costs))
        return nodes, csr_array((weights, (both[:, 0], both[:, 1])), shape=(len(nodes), len(nodes)))

    def _guide(self, nodes: FloatArray, graph: csr_array, spacing: int) -> FloatArray:
        """Return points along pixel paths from each region's largest part to its other parts."""
        if not len(nodes):
            return nodes
        stand = self._grids.stand
        at = flat_pixels(stand, nodes)
        _, part = connected_components(graph, directed=False)
        sizes = np.bincount(part)
        leaders = np.unique(part, return_index=True)[1]
        order = np.lexsort((-sizes, self._regions[at[leaders]]))
        main = np.zeros(len(sizes), dtype=np.bool_)
        main[order[np.unique(self._regions[at[leaders]][order], return_index=True)[1]]] = True
        if main.all():
            return np.empty((0, 2))
        before = flood(stand, np.unique(at[main[part]]))
        guide: list[int] = []
        for leader in leaders[~main]:
            pixel, trail = int(at[leader]), []
            while before[pixel] != pixel:
                trail.append(pixel)
                pixel = int(before[pixel])
            guide += [*trail[::spacing], pixel]
        rows, cols = np.divmod(np.array(guide, dtype=np.int64), stand.shape[1])
        return np.stack((cols - 0.5, rows - 0.5), axis=1)


def flat_pixels(stand: Padded, nodes: FloatArray) -> IntArray:
    """Return the free pixel, as flat index of the padded grid, in which or on whose rim each node lies.

    Parameters
    ----------
    stand
        Blocked pixels with their ring.
    nodes
        ``(v, 2)`` pixel coordinates where the robot may stand.
    """
    result = np.full(len(nodes), -1, dtype=np.int64)
    for dx in (0.0, -2e-6, 2e-6):
        for dy in (0.0, -2e-6, 2e-6):
            flat = np.floor(nodes[:, 1] + dy + 1).astype(np.int64) * stand.shape[1]
            flat += np.floor(nodes[:, 0] + dx + 1).astype(np.int64)
            take = (result < 0) & (stand.ravel()[flat] == 0)
            result[take] = flat[take]
    return result
