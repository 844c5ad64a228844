"""Path costs without sampling: which method, chosen in the open."""

from __future__ import annotations

from typing import Literal, get_args

from react_opt.energy import RobotProfile
from react_opt.errors import UsageError
from react_opt.geometry.inflation import FreeSpace
from react_opt.paths.grid import PixelCosts
from react_opt.paths.protocol import PathCosts
from react_opt.paths.tautgraph import count_corners
from react_opt.paths.visibility import VisibilityCosts

Method = Literal["auto", "visibility", "dijkstra8", "dijkstra16", "fastest8", "fastest16"]

MANY_CORNERS = 5000
"""Above this many corners ``auto`` takes pixels: a visibility graph is prepared in quadratic time."""


def exact_costs(space: FreeSpace, profile: RobotProfile, *, method: Method = "auto") -> PathCosts:
    """Return path costs for one robot on one map.

    Parameters
    ----------
    space
        Where the footprint may be.
    profile
        The robot.
    method
        ``visibility``: shortest any-angle paths, exact. ``dijkstra8``, ``dijkstra16``: shortest over pixels.
        ``fastest8``, ``fastest16``: fastest over pixels by the speed law, which keep away from walls. ``auto``:
        ``visibility`` up to :data:`MANY_CORNERS` corners, then ``dijkstra16``; every cost table names its method.

    Raises
    ------
    UsageError
        Where there is no such method.
    """
    if method not in get_args(Method):
        raise UsageError(f"path costs are found by {', '.join(get_args(Method))}, not {method!r}")
    if method == "auto":
        method = "visibility" if count_corners(space) <= MANY_CORNERS else "dijkstra16"
    if method == "visibility":
        return VisibilityCosts(space, profile)
    minimise: Literal["time", "length"] = "time" if method.startswith("fastest") else "length"
    return PixelCosts(space, profile, minimise=minimise, connectivity=16 if method.endswith("16") else 8)
