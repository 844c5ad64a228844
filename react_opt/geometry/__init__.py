"""Occupancy maps and what fits into them."""

from react_opt.geometry.mapfile import load_map, save_map
from react_opt.geometry.occupancy import OccupancyMap

__all__ = ["OccupancyMap", "load_map", "save_map"]
