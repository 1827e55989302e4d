"""What actions are called, in one place."""

from collections.abc import Sequence
from itertools import product
from math import prod
from typing import Any

import numpy as np

_KNOWN = {
    "CartPole": ("push left", "push right"),
    "MountainCar": ("push left", "no push", "push right"),
    "Acrobot": ("torque -1", "torque 0", "torque +1"),
    "LunarLander": ("no engine", "left engine", "main engine", "right engine"),
}
"""What Gymnasium's documentation says of tasks that do not name their own actions."""


def numbered(num_actions: int, first: int = 0) -> tuple[str, ...]:
    """Returns A names for actions that have none, with the numbers the environment gives them.

    >>> numbered(2, first=1)
    ('action 1', 'action 2')
    """
    return tuple(f"action {first + i}" for i in range(num_actions))


def is_numbered(names: Sequence[str]) -> bool:
    """Returns whether these are the names of actions that have none.

    >>> is_numbered(("action 1", "action 2")), is_numbered(("left", "right"))
    (True, False)
    """
    first = names[0].removeprefix("action ") if names else ""
    return first.isdecimal() and tuple(names) == numbered(len(names), int(first))


def are_own(names: Sequence[str]) -> bool:
    """Returns whether these are names that an environment or a user has given.

    >>> are_own(("action 1", "action 2")), are_own(("push left", "push right")), are_own(("a", "b"))
    (False, False, True)
    """
    return not is_numbered(names) and tuple(names) not in _KNOWN.values()


def action_names(env: Any, sizes: Sequence[int], first: int = 0) -> tuple[str, ...]:
    """Returns A names: what an environment calls its actions, or else their numbers.

    It tells them in `action_names` or, as Atari games do, by `get_action_meanings()`; of a few
    tasks of Gymnasium that do not, they are known. Names that
    are too few, too many, or not all different count as none. Where actions have several parts it
    may also tell the names of each part's choices, a list for each: an action is called by all of
    them, such as "left+jump"; without names by their numbers.

    Args:
        env: a Gymnasium environment; what is asked is `env.unwrapped`.
        sizes: how many choices each part of an action has; A is their product.
        first: what the environment itself calls action 0.
    """
    base = getattr(env, "unwrapped", env)
    task = str(getattr(getattr(base, "spec", None), "id", "")).rpartition("-v")[0]
    names: Any = getattr(base, "action_names", _KNOWN.get(task, ()))
    if hasattr(base, "get_action_meanings"):
        names = base.get_action_meanings()
    if len(sizes) > 1 and [np.size(part) for part in names] == list(sizes):
        names = list(map(_joined, product(*names)))
    told = tuple(str(name) for name in np.asarray(names, dtype=object).ravel())
    if len(set(told)) == len(told) == prod(sizes):
        return told
    if len(sizes) == 1:
        return numbered(sizes[0], first)
    return tuple(f"action {_joined(place)}" for place in product(*map(range, sizes)))


def _joined(parts: Sequence[Any]) -> str:
    return "+".join(map(str, parts))
