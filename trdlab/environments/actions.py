"""What can be done in an environment: every action has a number, whatever its space is."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from itertools import product
from math import prod
from typing import Any

import gymnasium as gym
import numpy as np

from trdlab.arrays import BoolArray
from trdlab.environments.answers import layers
from trdlab.errors import InputError

MOST = 256
"""So many combinations of a MultiDiscrete space have a row each; more are too many to compare."""


@dataclass(frozen=True)
class Actions:
    """The actions of an environment, by their numbers from 0 to A − 1.

    Args:
        called: what the environment itself calls each of the A: a number, or a vector of them.
        sizes: how many choices each part of an action has; A is their product, the last part runs
            fastest.
        first: what the environment calls action 0, where that is a number.
    """

    called: tuple[Any, ...]
    sizes: tuple[int, ...]
    first: int = 0

    @classmethod
    def of(cls, space: gym.Space[Any], name: str) -> "Actions":
        """Returns the actions of a space.

        Args:
            space: of actions.
            name: what the environment is called.

        Raises:
            InputError: they cannot be counted, or are too many.

        >>> Actions.of(gym.spaces.MultiDiscrete([2, 2]), "Race-v0").called[2]
        array([1, 0])
        """
        if isinstance(space, gym.spaces.Discrete):
            first = int(space.start)
            called = tuple(space.start + i for i in range(int(space.n)))  # np.int64, as drawn
            return cls(called, (int(space.n),), first)
        said = f"The action space of {name} is {' '.join(str(space).split())}."
        if isinstance(space, gym.spaces.Box):
            raise InputError(
                said,
                "A decomposition has one row per action. Name a few actions to choose from: "
                "gymnasium.wrappers.TransformAction(env, lambda i: candidates[i], "
                "gymnasium.spaces.Discrete(len(candidates))).",
            )
        if not isinstance(space, gym.spaces.MultiDiscrete):
            raise InputError(
                said,
                "A decomposition has one row per action: use an environment with a Discrete or "
                "MultiDiscrete one.",
            )
        sizes = tuple(int(n) for n in space.nvec.ravel())
        if prod(sizes) > MOST:
            raise InputError(
                f"{said} These are {prod(sizes):,} combinations.",
                f"A decomposition has one row for each: name {MOST} of them or fewer with "
                "gymnasium.wrappers.TransformAction.",
            )
        places = (np.array(place, dtype=space.dtype) for place in product(*map(range, sizes)))
        return cls(tuple(at.reshape(space.shape) + space.start for at in places), sizes)

    def __len__(self) -> int:
        return len(self.called)

    def allowed(self, told: Any, name: str) -> BoolArray:
        """Returns which actions can be taken now `[A]`.

        Args:
            told: by the environment (see `told_of`), an entry for each choice of each part.
            name: what it is called.

        Raises:
            InputError: what it tells is no mask.
        """
        mask = np.asarray(told)
        if mask.shape != (sum(self.sizes),) or not np.isin(mask, (0, 1)).all():
            raise InputError(
                f"The action mask of {name} has shape {mask.shape} and type {mask.dtype}.",
                f"Give {sum(self.sizes)} values of true or false.",
            )
        parts = np.split(mask.astype(np.bool_), np.cumsum(self.sizes)[:-1])
        return np.asarray(reduce(np.logical_and.outer, parts)).ravel()


def masks_of(env: Any) -> Any:
    """Returns the method by which an environment tells what can be done; None where it has none."""
    found = (getattr(layer, "action_masks", None) for layer in layers(env))
    return next(filter(callable, found), None)


def told_of(masks: Any, info: Any) -> Any:
    """Returns what an environment tells of what can be done now; None where it tells nothing.

    Args:
        masks: its method that tells it (see `masks_of`), as sb3-contrib asks; None where it has
            none, and then `info["action_mask"]` may tell it.
        info: what its last reset or step told.
    """
    if masks is not None:
        return masks()
    # a dict is by far the most frequent, and what else is a Mapping takes long to find out
    return info.get("action_mask") if type(info) is dict or isinstance(info, Mapping) else None


def possible(env: Any, action: Any) -> Any:
    """Returns an action, as the environment calls it, or another where it forbids this one."""
    if (masks := masks_of(env)) is None:
        return action
    if (told := told_of(masks, None)) is None:
        return action
    actions = Actions.of(env.action_space, "it")
    allowed = actions.allowed(told, "it")
    number = next(i for i, own in enumerate(actions.called) if np.array_equal(own, action))
    if allowed[number]:
        return action
    return actions.called[int(allowed.argmax())]
