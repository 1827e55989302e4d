"""Observations of several parts, a Dict or a Tuple, as the one vector that networks read.

The parts stand one behind the other in the space's order, as `gymnasium.spaces.flatten` lays them:
boxes row by row, one of n numbers as n of which one is 1. Images are channels first; their bytes
become floats from 0 to 255, which takes four times the memory.
"""

from typing import Any

import gymnasium as gym
import numpy as np

from trdlab.arrays import FloatArray


class FlatSpace(gym.spaces.Box):
    """The vectors `[F]` that stand for observations of another space, as float32.

    Args:
        whole: the other space, its images channels first.

    >>> whole = gym.spaces.Dict(at=gym.spaces.Box(-1, 1, (2,)), key=gym.spaces.Discrete(3))
    >>> space = FlatSpace(whole)
    >>> space.flat({"at": [0.5, -1.0], "key": 2})
    array([ 0.5, -1. ,  0. ,  0. ,  1. ], dtype=float32)
    >>> space.unflat(np.array([[0.5, -1.0, 0.0, 0.0, 1.0]]))
    {'at': array([[ 0.5, -1. ]], dtype=float32), 'key': array([2])}
    """

    def __init__(self, whole: gym.Space[Any]) -> None:
        flat: Any = gym.spaces.flatten_space(whole)
        with np.errstate(over="ignore"):  # bounds of a number format
            low, high = (bound.astype(np.float32) for bound in (flat.low, flat.high))
        super().__init__(low, high, dtype=np.float32)
        self.whole = whole

    @property
    def parts(self) -> dict[str, tuple[int, ...]]:
        """The shapes of the parts of a Dict, in order; of one of n numbers `(n,)`."""
        whole: Any = self.whole
        parts = whole.spaces if isinstance(whole, gym.spaces.Dict) else {}
        return {key: _shape(part) for key, part in parts.items()}

    def flat(self, observation: Any) -> FloatArray:
        """Returns an observation as a vector `[F]`.

        Raises:
            Exception: it is none of the space; whatever comes of that.
        """
        return np.asarray(_flat(self.whole, observation), dtype=np.float32)

    def unflat(self, vectors: Any) -> Any:
        """Returns a batch of observations of vectors `[B, F]`: a dict or tuple of `[B, ...]`."""
        return _unflat(self.whole, np.asarray(vectors))


def _shape(space: gym.Space[Any]) -> tuple[int, ...]:
    if isinstance(space, gym.spaces.Box | gym.spaces.MultiBinary):
        return tuple(space.shape)
    return (int(gym.spaces.flatdim(space)),)


def _flat(space: gym.Space[Any], observation: Any) -> Any:
    if isinstance(space, gym.spaces.Dict):
        return np.concatenate([_flat(of, observation[key]) for key, of in space.spaces.items()])
    if isinstance(space, gym.spaces.Tuple):
        pairs = zip(space.spaces, observation, strict=True)
        return np.concatenate([_flat(of, part) for of, part in pairs])
    if not isinstance(space, gym.spaces.Box):
        return gym.spaces.flatten(space, observation)
    seen = np.asarray(observation)
    if seen.shape != space.shape and seen.ndim == 3:
        seen = np.moveaxis(seen, -1, 0)
    if seen.shape != space.shape:
        raise ValueError(f"a part has shape {np.shape(observation)}")
    return seen.ravel()


def _unflat(space: gym.Space[Any], vectors: Any) -> Any:
    if isinstance(space, gym.spaces.Dict):
        parts = _split(vectors, list(space.spaces.values()))
        return {key: _unflat(*part) for key, part in zip(space.spaces, parts, strict=True)}
    if isinstance(space, gym.spaces.Tuple):
        return tuple(_unflat(*part) for part in _split(vectors, space.spaces))
    if isinstance(space, gym.spaces.Discrete):
        return space.start + vectors.argmax(axis=1)
    if isinstance(space, gym.spaces.MultiDiscrete):
        sizes = [gym.spaces.Discrete(int(n)) for n in space.nvec.ravel()]
        places = np.stack([_unflat(*part) for part in _split(vectors, sizes)], axis=1)
        return places.reshape(len(vectors), *space.shape) + space.start
    return vectors.reshape(len(vectors), *(space.shape or ())).astype(space.dtype)


def _split(vectors: Any, spaces: Any) -> list[tuple[gym.Space[Any], Any]]:
    """Returns the columns of `vectors [B, F]` that belong to each of some spaces."""
    ends = np.cumsum([gym.spaces.flatdim(space) for space in spaces])
    return list(zip(spaces, np.split(vectors, ends[:-1], axis=1), strict=True))
