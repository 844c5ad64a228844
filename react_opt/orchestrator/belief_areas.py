"""Areas and local targets of a belief: shares explored, regions with stable names, and areas that turn out to exist."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.orchestrator.belief import AreaView, FloatArray, LocalTarget
from react_opt.orchestrator.belief_map import BeliefMap
from react_opt.orchestrator.belief_regions import (
    FRONTIER,
    OLD,
    SIZE,
    SUM_COL,
    SUM_ROW,
    IntArray,
    joined_to_open,
    label_window,
    look_at,
    missed_pixels,
    provably_unseen,
    touching,
)

MIN_TARGET_M2 = 0.1
"""Unknown regions below this are no local targets."""

NEW_AREA_M2 = 1.0
"""So much known free space beyond the grid makes a new area."""

Bools = NDArray[np.bool_]


@dataclass
class _Area:
    """An area: its place in the grid, its blocks, and its regions as last labelled (one row of numbers each)."""

    a: int
    b: int
    window: IntArray
    centre_px: tuple[float, float] = (0.0, 0.0)
    """On the canvas: column and row."""
    centre_m: tuple[float, float] = (0.0, 0.0)
    labels: range = range(0)
    stats: IntArray = field(default_factory=lambda: np.zeros((0, 5), dtype=np.int64))
    known: int = 0
    missed: int = 0
    free: bool = False
    view: AreaView | None = None

    @property
    def id(self) -> str:
        return f"{self.a},{self.b}"


class Areas:
    """The high-level grid over a belief's map, and the unknown regions in it.

    Parameters
    ----------
    map_
        The belief's map.
    low_px, high_px
        Corners of the building as far as known, frame pixels (column, row).
    cell_m
        Side of an area, m.
    range_m
        LiDAR range, m.
    """

    def __init__(self, map_: BeliefMap, low_px: FloatArray, high_px: FloatArray, cell_m: float, range_m: float) -> None:
        self._map = map_
        self._origin = low_px
        self._side = cell_m / map_.frame.resolution_m
        self._range_blocks = range_m / map_.frame.resolution_m / map_.k
        self._list: list[_Area] = []
        self._by_place: dict[tuple[int, int], _Area] = {}
        self._names: dict[int, str] = {}
        self._named = 0
        self._next = 0
        self._targets: dict[str, LocalTarget] = {}
        self._laid: tuple[int, int, int, int] | None = None
        self._labels = np.zeros((0, 0), dtype=np.int32)
        counts = np.maximum(1, np.ceil((high_px - low_px) / self._side - 1e-6).astype(int))
        for b in range(counts[1]):
            for a in range(counts[0]):
                self._add(a, b)

    def _add(self, a: int, b: int) -> None:
        area = _Area(a, b, np.zeros(4, dtype=np.int64))
        self._list.append(area)
        self._by_place[a, b] = area

    # --- what is asked ---

    def views(self) -> tuple[AreaView, ...]:
        """Return all areas, in the order they became known."""
        return tuple(area.view for area in self._list if area.view is not None)

    def targets(self) -> tuple[LocalTarget, ...]:
        """Return the local targets, in the order they appeared."""
        return tuple(self._targets.values())

    def is_area(self, name: str) -> bool:
        """Tell whether a name is an area's id."""
        return any(area.id == name for area in self._list)

    def share(self, name: str) -> float:
        """Return c[a,b] of an area by its id, 0 before the first refresh."""
        return next((area.view.known_share for area in self._list if area.id == name and area.view is not None), 0.0)

    def area_of(self, point_m: tuple[float, float]) -> str | None:
        """Return the id of the area that a point lies in."""
        x, y = (self._map.frame.world_to_pixel(point_m) - self._origin) / self._side
        area = self._by_place.get((floor(x), floor(y)))
        return None if area is None else area.id

    # --- how it is worked out ---

    def fit(self) -> None:
        """Add the areas that turn out to exist and fit all of them to the canvas, which may grow for that."""
        if self._laid != self._map.window:
            self._lay()
        if self._discover():
            self._lay()

    def refresh(self, reached: Bools, reachable: Bools) -> None:
        """Bring all up to date, after :meth:`fit`.

        Parameters
        ----------
        reached
            Blocks that robots reach through known-free space.
        reachable
            Blocks that they reach if unknown space is free.
        """
        fresh = [area for area in self._list if self._dirty(area.window)]
        for area in fresh:
            self._label(area)
        self._map.touched[:] = False
        counted = self._counted()
        self._make_targets(counted, reached)
        for area in self._list:
            area.view = self._view(area, counted, reached, reachable)

    def _lay(self) -> None:
        """Fit the areas' windows to a new canvas."""
        self._laid = self._map.window
        self._labels = np.full(self._map.deep.shape, -1, dtype=np.int32)
        for area in self._list:
            edges = []
            for start, first, count in (
                (self._origin[1] + area.b * self._side, self._map.row0, self._labels.shape[0]),
                (self._origin[0] + area.a * self._side, self._map.col0, self._labels.shape[1]),
            ):
                ends = [ceil((edge - first) / self._map.k - 0.5 - 1e-9) for edge in (start, start + self._side)]
                edges += [min(max(end, 0), count) for end in ends]
            area.window = np.array(edges, dtype=np.int64)
            centre = (self._origin + (np.array((area.a, area.b)) + 0.5) * self._side) - (self._map.col0, self._map.row0)
            area.centre_px = (float(centre[0]), float(centre[1]))
            x, y = self._map.to_world(centre)
            area.centre_m = (float(x), float(y))
        self._map.bound([area.window for area in self._list])
        self._map.touched[:] = True

    def _dirty(self, window: IntArray) -> bool:
        return bool(self._map.touched[window[0] : window[1], window[2] : window[3]].any())

    def _discover(self) -> bool:
        """Add areas where known free space lies beyond the grid; tell whether there were any."""
        outside = self._map.touched & ~self._map.inside
        if not outside.any() or not (outside & (self._map.known > 0) & (self._map.solid == 0)).any():
            return False
        rows, cols = np.nonzero((self._map.known > 0) & (self._map.solid == 0))
        a = np.floor((self._map.col0 + (cols + 0.5) * self._map.k - self._origin[0]) / self._side).astype(int)
        b = np.floor((self._map.row0 + (rows + 0.5) * self._map.k - self._origin[1]) / self._side).astype(int)
        places, counts = np.unique(np.stack((b, a), axis=1), axis=0, return_counts=True)
        enough = NEW_AREA_M2 / self._block_m2
        found = [
            (int(place[1]), int(place[0]))
            for place, count in zip(places, counts, strict=True)
            if count >= enough and (int(place[1]), int(place[0])) not in self._by_place
        ]
        for place in found:
            self._add(*place)
            low = self._origin + np.array(place) * self._side
            self._map.cover(floor(low[1]), ceil(low[1] + self._side), floor(low[0]), ceil(low[0] + self._side))
        return bool(found)

    @property
    def _block_m2(self) -> float:
        return (self._map.k * self._map.frame.resolution_m) ** 2

    def _label(self, area: _Area) -> None:
        """Label the regions of an area anew; a region keeps the name of the one it mostly was."""
        map_ = self._map
        first = self._next
        area.stats, count = label_window(map_.deep, map_.known, map_.solid, self._labels, area.window, first)
        self._next = first + count
        heirs: dict[int, int] = {}
        for n in np.argsort(-area.stats[:, SIZE], kind="stable"):
            heirs.setdefault(int(area.stats[n, OLD]), first + int(n))
        names = {heirs[old]: self._names[old] for old in area.labels if old in heirs and old in self._names}
        for old in area.labels:
            self._names.pop(old, None)
        self._names.update(names)
        area.labels = range(first, first + count)
        r0, r1, c0, c1 = area.window
        area.known = int(map_.known[r0:r1, c0:c1].sum())
        area.missed = missed_pixels(map_.deep, map_.known, map_.solid, area.window, map_.k**2)
        area.free = bool(((map_.known[r0:r1, c0:c1] > 0) & (map_.solid[r0:r1, c0:c1] == 0)).any())

    def _counted(self) -> Bools:
        """Tell for each region number whether it connects through unknown to known free space."""
        base = min((area.labels.start for area in self._list if len(area.labels)), default=0)
        rows, cols = (np.unique([area.window[n : n + 2] for area in self._list]) for n in (0, 2))
        pairs = touching(self._labels, rows, cols) - base
        open_ = np.zeros(self._next - base, dtype=np.bool_)
        for area in self._list:
            if len(area.labels):
                open_[area.labels.start - base : area.labels.stop - base] = area.stats[:, FRONTIER] > 0
        counted = np.zeros(self._next + 1, dtype=np.bool_)
        counted[base : self._next] = joined_to_open(pairs, open_)
        return counted

    def _make_targets(self, counted: Bools, reached: Bools) -> None:
        map_ = self._map
        side_m = map_.k * map_.frame.resolution_m
        labels = np.concatenate([np.array(area.labels, dtype=np.int64) for area in self._list])
        stats = np.concatenate([area.stats for area in self._list])
        of = np.repeat(np.arange(len(self._list)), [len(area.labels) for area in self._list])
        kept = counted[labels] & ~(stats[:, SIZE] * self._block_m2 < MIN_TARGET_M2)
        labels, stats, of = labels[kept], stats[kept], of[kept]
        centres = stats[:, (SUM_ROW, SUM_COL)] / stats[:, SIZE, None]
        windows = np.array([area.window for area in self._list])[of]
        open_ = map_.deep | ((map_.known > 0) & (map_.solid == 0))
        stands, openings = look_at(
            self._labels, labels, windows, centres, stats[:, FRONTIER] > 0, open_, reached, counted, self._range_blocks
        )
        columns = (
            map_.to_world((centres[:, ::-1] + 0.5) * map_.k).tolist(),
            stands.tolist(),
            map_.centres_m(stands).tolist(),
            (stats[:, SIZE] * self._block_m2).tolist(),
            (openings * self._block_m2).tolist(),
            (stats[:, FRONTIER] * side_m).tolist(),
        )
        found: dict[str, LocalTarget] = {}
        for label, n, (x, y), stand, (stand_x, stand_y), size_m2, opening_m2, frontier_m in zip(
            labels.tolist(), of.tolist(), *columns, strict=True
        ):
            if label not in self._names:
                self._named += 1
                self._names[label] = f"u{self._named}"
            name = self._names[label]
            place = (stand_x, stand_y) if stand >= 0 else None
            found[name] = LocalTarget(name, self._list[n].id, x, y, place, size_m2, opening_m2, frontier_m)
        order = [name for name in self._targets if name in found]
        order += [name for name in found if name not in self._targets]
        self._targets = {name: found[name] for name in order}

    def _view(self, area: _Area, counted: Bools, reached: Bools, reachable: Bools) -> AreaView:
        map_ = self._map
        labels = np.array(area.labels, dtype=np.int64)
        unknown = int(area.stats[counted[labels], SIZE].sum()) * map_.k**2 if len(labels) else 0
        share = area.known / (area.known + unknown + area.missed) if area.known else 0.0
        stand = _nearest(reached, area.window, area.centre_px[1] / map_.k, area.centre_px[0] / map_.k)
        place = area.centre_m
        if stand >= 0:
            (at,) = map_.centres_m([stand])
            place = (float(at[0]), float(at[1]))
        if unknown:
            closed = provably_unseen(self._labels, counted, area.window, map_.solid, reachable, self._range_blocks)
        else:
            closed = not area.free
        return AreaView(area.id, *area.centre_m, place, share, bool(closed))


@kernel
def _nearest(reached: Bools, window: IntArray, row: float, col: float) -> int:
    """Return the reached block of a window nearest to a place, -1 for none."""
    best, found = np.inf, -1
    for r in range(window[0], window[1]):
        for c in range(window[2], window[3]):
            if reached[r, c]:
                gap = (r + 0.5 - row) ** 2 + (c + 0.5 - col) ** 2
                if gap < best:
                    best, found = gap, r * reached.shape[1] + c
    return found
