"""What actions are called, in one place."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt


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


def action_names(env: Any, num_actions: int, first: int = 0) -> tuple[str, ...]:
    """Returns A names: what an environment calls its actions, or else their numbers.

    It tells them in `action_names` or, as Atari games do, by `get_action_meanings()`. Names that
    are too few, too many, or not all different count as none.

    Args:
        env: a Gymnasium environment; what is asked is `env.unwrapped`.
        num_actions: A.
        first: what the environment itself calls action 0.
    """
    base = getattr(env, "unwrapped", env)
    names: npt.ArrayLike = getattr(base, "action_names", ())
    if hasattr(base, "get_action_meanings"):
        names = base.get_action_meanings()
    told = tuple(str(name) for name in np.asarray(names).ravel())
    return told if len(set(told)) == len(told) == num_actions else numbered(num_actions, first)
