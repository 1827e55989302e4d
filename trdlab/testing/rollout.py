"""A few steps in an environment, kept whole."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.errors import InputError


@dataclass(frozen=True, eq=False)
class Rollout:
    """T steps, over as many episodes as they take.

    Args:
        observations: T of them, in which the actions were taken.
        actions: `[T]`, counted from 0.
        rewards: `[T]`, as the environment pays them.
        terminated: `[T]`, whether the episode ended for good.
        truncated: `[T]`, whether it was cut off.
        following: T observations, to which the steps led; at the end of an episode its true last.
    """

    observations: list[Any]
    actions: IntArray
    rewards: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    following: list[Any]

    def __len__(self) -> int:
        return len(self.observations)


def play(env: gym.Env[Any, Any], act: Callable[[Any], int], steps: int, seed: int) -> Rollout:
    """Takes steps in an environment.

    Args:
        env: with discrete actions; it is reset with `seed`, and again after each end.
        act: from an observation to an action counted from 0.
        steps: T.
        seed: of the environment.
    """
    first = int(discrete_actions(env).start)
    seen, log = deepcopy(env.reset(seed=seed)[0]), []
    for _ in range(steps):
        action = act(seen)
        observation, reward, terminated, truncated, _ = env.step(np.int64(first + action))
        following = deepcopy(observation)  # environments may write into their own
        log.append((seen, action, reward, terminated, truncated, following))
        seen = deepcopy(env.reset()[0]) if terminated or truncated else following
    observations, actions, rewards, ended, cut, followers = zip(*log, strict=True)
    return Rollout(
        observations=list(observations),
        actions=np.array(actions, dtype=np.int64),
        rewards=np.array(rewards, dtype=np.float64),
        terminated=np.array(ended, dtype=np.bool_),
        truncated=np.array(cut, dtype=np.bool_),
        following=list(followers),
    )


def discrete_actions(env: gym.Env[Any, Any]) -> gym.spaces.Discrete:
    """Returns the action space of an environment.

    Raises:
        InputError: it is no single Gymnasium environment, or its actions are not discrete.
    """
    if not isinstance(env, gym.Env):
        raise InputError(
            f"A {type(env).__name__} is no gymnasium.Env.",
            "Give a single environment, for example gymnasium.make('FrozenLake-v1').",
        )
    if not isinstance(env.action_space, gym.spaces.Discrete):
        raise InputError(
            f"The action space is {env.action_space}.",
            "A decomposition has one row per action: give an environment with a Discrete one.",
        )
    return env.action_space
