"""Gridworlds drawn as text: the paper's drone, more maps, and your own."""

from trdlab.gridworld.gridmap import GridMap, load_map, map_names, parse_map
from trdlab.gridworld.world import Gridworld, Source, State

__all__ = ["GridMap", "Gridworld", "Source", "State", "load_map", "map_names", "parse_map"]
