"""What robots see in passing: of each region, from the places to look from and on the ways between them.

From a place, rays run over the coarse blocks of a survey until they meet something solid or reach the LiDAR's range.
What a ray shows of hidden space counts less the further it has come through hidden space, as in
:mod:`react_opt.orchestrator.regions`. The share of a region that is seen from a place is measured against what is seen
of it from where it is looked into; on a way it is that of the best place on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, exp, pi, sin

import numpy as np
from numpy.typing import NDArray

from react_opt.kernels import kernel
from react_opt.orchestrator.regions import DEEP_M, Region, Regions
from react_opt.orchestrator.survey import COARSE, Survey
from react_opt.orchestrator.survey_drives import step_back
from react_opt.orchestrator.survey_kernels import HIDDEN, SOLID, sight_codes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Grid = NDArray[np.uint8]

RAYS = 48
"""Rays per look: at 8 m their ends are a metre apart."""
PLACE_BLOCKS = 4
"""Places on ways are so many coarse blocks wide: what is seen is worked out once for each."""


def in_passing(
    survey: Survey, regions: Regions, found: Sequence[Region], fields: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return which share of each region is seen on the ways to all of them, as of :func:`seen_on_ways`.

    Parameters
    ----------
    survey, regions, found
        What is known, and some of the regions that were found in it.
    fields
        For each result, ``(F, rows, cols)`` s from some starts.
    """
    assert regions.belonging is not None
    owner, depth, area_of, behind = regions.belonging
    piece = np.full(owner.max() + 2, -1, dtype=np.int64)  # the last one stands for no piece
    deep = np.full(len(behind), -1, dtype=np.int64)
    whole = np.zeros(len(found))
    for k, region in enumerate(found):
        if region.number >= 0:
            piece[region.number] = k
        else:
            area = -1 - region.number
            deep[area], whole[k] = k, behind[area] / COARSE**2
    of = np.where((owner >= 0) & (depth * survey.coarse_m <= DEEP_M), piece[owner], deep[area_of])
    views = np.array([region.view for region in found], dtype=np.int64)
    reach = regions.range_m / survey.coarse_m
    fade = exp(-survey.coarse_m / regions.hidden_space.mean_free_m)
    ground = sight_codes(survey.blocks, COARSE)
    return [seen_on_ways(ground, of, part, views, whole, reach, fade) for part in fields]


@kernel
def look(ground: Grid, owner: IntArray, row: int, col: int, reach: float, fade: float, out: FloatArray) -> None:
    """Add up the hidden space that is seen from a coarse block, by the region that it belongs to.

    Parameters
    ----------
    ground
        ``(rows, cols)`` coarse blocks: OPEN, SOLID or HIDDEN.
    owner
        Region of each coarse block, -1 for none.
    row, col
        Where to look from.
    reach, fade
        Range, coarse blocks; share of what a ray shows that is left after each hidden block.
    out
        ``(K,)`` receives hidden coarse blocks.
    """
    rows, cols = ground.shape
    out[:] = 0.0
    turn = 2.0 * pi / RAYS
    for n in range(RAYS):
        dx, dy = cos((n + 0.5) * turn), sin((n + 0.5) * turn)
        left = 1.0
        d = 0.5
        while d < reach:
            r, c = int(row + 0.5 + d * dy), int(col + 0.5 + d * dx)
            if r < 0 or c < 0 or r >= rows or c >= cols or ground[r, c] == SOLID:
                break
            if ground[r, c] == HIDDEN:
                k = owner[r, c]
                if k >= 0:
                    out[k] += left * d * turn
                left *= fade
            d += 1.0


@kernel
def seen_on_ways(
    ground: Grid, owner: IntArray, fields: FloatArray, views: IntArray, whole: FloatArray, reach: float, fade: float
) -> FloatArray:
    """Return ``(F, K, K)`` which share of each region is seen on the way from a field's start to each region.

    Parameters
    ----------
    ground, owner, reach, fade
        As of :func:`look`.
    fields
        ``(F, rows, cols)`` s from each start.
    views
        ``(K, 2)`` the coarse blocks from which the regions are looked into, where the ways end.
    whole
        ``(K,)`` hidden coarse blocks that there are of each region; 0: those seen from where it is looked into.
    """
    rows, cols = ground.shape
    count = views.shape[0]
    wide = (cols + PLACE_BLOCKS - 1) // PLACE_BLOCKS
    places = np.full((rows + PLACE_BLOCKS - 1) // PLACE_BLOCKS * wide, -1)  # row in `seen` of each place looked at
    seen, made = np.empty((places.size, count)), 0
    at_view, norm = np.empty((count, count)), np.empty(count)
    for k in range(count):
        look(ground, owner, views[k, 0], views[k, 1], reach, fade, at_view[k])
        norm[k] = max(1.0, whole[k] if whole[k] > 0 else at_view[k, k])
    shares = np.empty((fields.shape[0], count, count))
    for f in range(fields.shape[0]):
        for k in range(count):
            best = shares[f, k]
            best[:] = at_view[k]
            r, c, last = views[k, 0], views[k, 1], -1
            while np.isfinite(fields[f, r, c]) and fields[f, r, c] > 0.0:
                y, x = step_back(fields[f], r, c)
                if y == r and x == c:
                    break
                r, c = y, x
                place = r // PLACE_BLOCKS * wide + c // PLACE_BLOCKS
                if place == last:
                    continue
                last = place
                if places[place] < 0:
                    look(ground, owner, r, c, reach, fade, seen[made])
                    places[place] = made
                    made += 1
                best[:] = np.maximum(best, seen[places[place]])
            best[:] = np.minimum(1.0, best / norm)
            best[k] = 1.0
    return shares
