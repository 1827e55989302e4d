"""Importing this registers the built-in maps with Gymnasium: `trdlab/DroneGridworld-v0` and so on.

`gymnasium.make("trdlab.envs:trdlab/DroneGridworld-v0")` imports it on the way.
"""

import gymnasium as gym

from trdlab.gridworld.gridmap import load_map, map_names

_STEPS_PER_CELL = 4  # enough to wander, and to walk the corridor's 525 cells several times
_LEAST_STEPS = 100


def env_id(map_name: str) -> str:
    """Returns the id under which a built-in map is registered.

    >>> env_id("drone")
    'trdlab/DroneGridworld-v0'
    """
    return f"trdlab/{map_name.capitalize()}Gridworld-v0"


def register_maps() -> None:
    """Registers the built-in maps that are not registered yet."""
    for name in map_names():
        if env_id(name) in gym.registry:
            continue
        rows, columns = load_map(name).shape
        gym.register(
            id=env_id(name),
            entry_point="trdlab.gridworld.env:GridworldEnv",
            max_episode_steps=max(_LEAST_STEPS, _STEPS_PER_CELL * rows * columns),
            kwargs={"map": name},
        )


register_maps()
