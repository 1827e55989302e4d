"""What trdlab can see and do in a Gymnasium environment, and what it refuses."""

from typing import Any, TypeGuard

import gymnasium as gym
import numpy as np

from trdlab.environments.flat import FlatSpace
from trdlab.errors import InputError

_CHANNELS = (1, 3, 4)


def frame_space(space: gym.Space[Any], name: str) -> gym.Space[Any]:
    """Returns the space of single frames as networks read them: images channels first.

    What has several parts becomes a vector of all of them.

    Raises:
        InputError: no network reads such observations.

    >>> frame_space(gym.spaces.Box(0, 255, (96, 64, 3), np.uint8), "CarRacing-v3")
    Box(0, 255, (3, 96, 64), uint8)
    >>> frame_space(gym.spaces.MultiBinary(3), "Lamps-v0")
    Box(0.0, 1.0, (3,), float32)
    """
    if isinstance(space, gym.spaces.Discrete | gym.spaces.Box):
        return _channels_first(space)
    if not _is_of_numbers(space) or gym.spaces.flatdim(space) == 0:
        raise InputError(
            f"There is no network for the observation space of {name}: {_say(space)}.",
            "Use one of numbers: Box, Discrete, MultiDiscrete, MultiBinary, or a Dict or Tuple of "
            "such.",
        )
    return FlatSpace(_channels_first(space))


def _is_of_numbers(space: Any) -> bool:
    if isinstance(space, gym.spaces.Dict | gym.spaces.Tuple):
        parts = space.values() if isinstance(space, gym.spaces.Dict) else space
        return all(map(_is_of_numbers, parts))
    kinds = (gym.spaces.Box, gym.spaces.Discrete, gym.spaces.MultiDiscrete, gym.spaces.MultiBinary)
    return isinstance(space, kinds)


def _channels_first(space: gym.Space[Any]) -> gym.Space[Any]:
    """Returns a space with the channels of its images first, wherever it has some."""
    if isinstance(space, gym.spaces.Dict):
        return gym.spaces.Dict([(key, _channels_first(of)) for key, of in space.spaces.items()])
    if isinstance(space, gym.spaces.Tuple):
        return gym.spaces.Tuple(map(_channels_first, space.spaces))
    if not is_image(space) or len(space.shape or ()) != 3 or space.shape[-1] not in _CHANNELS:
        return space
    low, high = (np.moveaxis(bound, -1, 0) for bound in (space.low, space.high))
    return gym.spaces.Box(low, high, dtype=np.uint8)


def is_image(space: gym.Space[Any]) -> TypeGuard[gym.spaces.Box]:
    """Returns whether observations are pictures: bytes of the whole range, in rows and columns."""
    if not isinstance(space, gym.spaces.Box) or space.dtype != np.uint8:
        return False
    full = bool((space.low == 0).all() and (space.high == 255).all())
    return full and len(space.shape) in (2, 3)


def _say(space: gym.Space[Any]) -> str:
    return " ".join(str(space).split())  # arrays of bounds have lines
