"""What environments answer, checked: old ways of answering are named with their cure."""

import inspect
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np

from trdlab.errors import InputError

_NUMBERS = (int, float)
_PASS_ON = ("gymnasium.wrappers.", "gymnasium.core", "trdlab.environments.")


def layers(env: Any) -> Iterator[Any]:
    """Yields an environment's wrappers, the outermost first, and then itself."""
    while isinstance(env, gym.Wrapper):
        yield env
        env = env.env
    yield env


def check_reset(env: Any, name: str) -> None:
    """Refuses an environment whose episodes cannot be seeded.

    Raises:
        InputError: its `reset`, or that of a wrapper, takes no seed.
    """
    for layer in layers(env):
        taken = inspect.signature(layer.reset).parameters
        if "seed" not in taken and all(of.kind is not of.VAR_KEYWORD for of in taken.values()):
            raise InputError(
                f"{type(layer).__name__}.reset() of {name} takes no seed.",
                "Write reset(self, *, seed=None, options=None), call super().reset(seed=seed) "
                "there, and return observation, info.",
            )


def beginning_of(env: Any, seed: int, name: str) -> tuple[Any, Any]:
    """Begins an episode, and returns its first observation and `info`.

    Raises:
        InputError: `reset` does not return an observation and `info`.
    """
    answer = env.reset(seed=seed)
    if not isinstance(answer, tuple) or len(answer) != 2:
        found = "nothing" if answer is None else f"one {type(answer).__name__}"
        raise InputError(
            f"{name}.reset() returns {found}.",
            "Return observation, info, as Gymnasium asks since 0.26.",
        )
    return answer


def outcome_of(env: Any, action: Any, name: str) -> tuple[Any, float, bool, bool, Any]:
    """Takes an action, and returns observation, reward, terminated, truncated, info.

    Raises:
        InputError: `step` does not return five values, or the reward is no number.
    """
    try:
        observation, reward, terminated, truncated, info = env.step(action)
    except (TypeError, ValueError) as error:
        if "unpack" not in str(error) or not _is_passed_on(error):
            raise
        raise InputError(
            f"{name}.step() does not return five values ({error}).",
            "Return observation, reward, terminated, truncated, info, as Gymnasium asks since "
            "0.26: 'done' became two.",
        ) from error
    paid = float(reward) if isinstance(reward, _NUMBERS) else _number(reward, name)
    return observation, paid, bool(terminated), bool(truncated), info


def _is_passed_on(error: Exception) -> bool:
    """Returns whether an error came of an answer, and not in the environment's own code."""
    frame = error.__traceback__
    while frame is not None and frame.tb_next is not None:
        frame = frame.tb_next
    home = frame.tb_frame.f_globals.get("__name__", "") if frame is not None else ""
    return str(home).startswith(_PASS_ON)


def _number(reward: Any, name: str) -> float:
    try:
        if np.ndim(reward) == 0:
            return float(reward)
    except (TypeError, ValueError):
        pass
    raise InputError(
        f"The reward of {name} is no number: {' '.join(repr(reward).split())}.",
        "Return one number for each step, such as float(reward.sum()).",
    )
