"""What trdlab can see and do in a Gymnasium environment, and what it refuses."""

from typing import Any

import gymnasium as gym
import numpy as np

from trdlab.errors import InputError

_CHANNELS = (1, 3, 4)


def frame_space(space: gym.Space[Any], name: str) -> gym.Space[Any]:
    """Returns the space of single frames as networks read them: images channels first.

    Raises:
        InputError: no network reads such observations.

    >>> frame_space(gym.spaces.Box(0, 255, (96, 64, 3), np.uint8), "CarRacing-v3")
    Box(0, 255, (3, 96, 64), uint8)
    """
    if isinstance(space, gym.spaces.Discrete):
        return space
    if not isinstance(space, gym.spaces.Box):
        raise InputError(
            f"There is no network for the observation space of {name}: {_say(space)}.",
            "Use a Box or Discrete one, for example through gymnasium.wrappers.FlattenObservation.",
        )
    if not (is_image(space) and len(space.shape) == 3 and space.shape[-1] in _CHANNELS):
        return space
    low, high = (np.moveaxis(bound, -1, 0) for bound in (space.low, space.high))
    return gym.spaces.Box(low, high, dtype=np.uint8)


def is_image(space: gym.Space[Any]) -> bool:
    """Returns whether observations are pictures: bytes of the whole range, in rows and columns."""
    if not isinstance(space, gym.spaces.Box) or space.dtype != np.uint8:
        return False
    full = bool((space.low == 0).all() and (space.high == 255).all())
    return full and len(space.shape) in (2, 3)


def discrete_actions(space: gym.Space[Any], name: str) -> gym.spaces.Discrete:
    """Returns the space of actions.

    Raises:
        InputError: they are not discrete.
    """
    if not isinstance(space, gym.spaces.Discrete):
        raise InputError(
            f"The action space of {name} is {_say(space)}.",
            "A decomposition has one row per action: use an environment with a Discrete one.",
        )
    return space


def _say(space: gym.Space[Any]) -> str:
    return " ".join(str(space).split())  # arrays of bounds have lines
