"""Gymnasium wrappers that put the decomposition of every action into `info`."""

from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import VectorEnv, VectorWrapper
from gymnasium.vector.utils import concatenate, create_empty_array
from gymnasium.wrappers import Autoreset

from trdlab.arrays import BoolArray, FloatArray
from trdlab.environments.answers import layers
from trdlab.errors import InputError, TrdlabError
from trdlab.estimator import Estimator

if TYPE_CHECKING:
    _VectorWrapper = VectorWrapper[Any, Any, Any, Any, Any]
else:  # which is generic from Gymnasium 1.4 on
    _VectorWrapper = VectorWrapper

ALL_ACTIONS = "reward_decomposition"
CHOSEN = "chosen_decomposition"


class TemporalRewardDecomposition(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Looks up, at each observation, what each action is expected to earn and when.

    `info["reward_decomposition"]`, `[A, N+1]`, speaks of every action at the observation just
    returned. After a step `info["chosen_decomposition"]`, `[N+1]`, speaks of the action just
    taken, at the observation it was taken in; over Gymnasium's `Autoreset` there is none after a
    step that only begins the next episode. Nothing else changes. At the observation of a terminated
    step no action follows, whatever the estimator says of it.

    Args:
        env: an environment with discrete actions.
        estimator: shared, not copied; what it says speaks of `estimator.future`.

    Raises:
        InputError: the actions are not discrete, `estimator` is none, or (when first asked) it
            decomposes another number of actions.

    >>> from trdlab.decomposition import TimeAxis
    >>> from trdlab.gridworld.env import GridworldEnv
    >>> from trdlab.tabular import exact
    >>> env = GridworldEnv("drone")
    >>> table = exact(env.mdp, TimeAxis(0.95, horizon=2, width=2))
    >>> _, info = TemporalRewardDecomposition(env, table).reset()
    >>> info["reward_decomposition"][1].round(2).tolist()  # down
    [0.95, 1.76, 0.81]
    """

    def __init__(self, env: gym.Env[Any, Any], estimator: Estimator) -> None:
        RecordConstructorArgs.__init__(self, _disable_deepcopy=True, estimator=estimator)
        gym.Wrapper.__init__(self, env)
        self._actions = _discrete(env.action_space)
        self.estimator = _checked_estimator(estimator)
        self._components: FloatArray | None = None  # [A, N+1] at the last observation
        self._resetting = [layer for layer in layers(env) if isinstance(layer, Autoreset)]

    @property
    def components(self) -> FloatArray:
        """`[A, N+1]`: what is expected at the last observation.

        Raises:
            TrdlabError: there is none yet.
        """
        if self._components is None:
            raise TrdlabError("There is no observation yet.", "Call reset() before step().")
        return self._components

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Resets the environment, and decomposes every action at the first observation."""
        observation, info = self.env.reset(seed=seed, options=options)
        return observation, {**info, ALL_ACTIONS: self._look_up(observation)}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Steps, and decomposes the action taken and every action at the new observation."""
        before = self.components
        only_resets = any(layer.autoreset for layer in self._resetting)
        observation, reward, terminated, truncated, info = self.env.step(action)
        added = {ALL_ACTIONS: self._look_up(observation)}
        if not only_resets:
            added[CHOSEN] = before[int(action) - int(self._actions.start)].copy()
        return observation, reward, terminated, truncated, {**info, **added}

    def _look_up(self, observation: Any) -> FloatArray:
        """Returns `[A, N+1]`, the caller's own copy."""
        space = self.env.observation_space
        empty: Any = create_empty_array(space, 1)
        batch = concatenate(space, [observation], empty)  # [1, ...], or a dict or tuple of those
        self._components = _decompose(self.estimator, batch, 1, self._actions)[0]
        return self._components.copy()


class VectorTemporalRewardDecomposition(_VectorWrapper):
    """Looks up, at each batch of observations, what each action is expected to earn and when.

    `info["reward_decomposition"]` is `[num_envs, A, N+1]` and `info["chosen_decomposition"]`, after
    a step, `[num_envs, N+1]`; `info["_reward_decomposition"]` and `info["_chosen_decomposition"]`
    say for which environments (the others hold zeros). No action was taken where the step only
    began a new episode, as the next-step autoreset does; a reset of some environments decomposes
    only those. With the same-step autoreset the chosen action is the last of the old episode, and
    the observation the first of the new one.

    Args:
        env: a vector environment with discrete actions.
        estimator: shared, not copied; it is asked once for the whole batch.

    Raises:
        InputError: the actions are not discrete, `estimator` is none, or (when first asked) it
            decomposes another number of actions.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], estimator: Estimator) -> None:
        super().__init__(env)
        self._actions = _discrete(env.single_action_space)
        self.estimator = _checked_estimator(estimator)
        # gymnasium 1.0 knows no modes: it always resets on the step after the end
        self._mode: str = getattr(env.metadata.get("autoreset_mode"), "name", "NEXT_STEP")
        self._components: FloatArray | None = None  # [num_envs, A, N+1] at the last observations
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)

    @property
    def components(self) -> FloatArray:
        """`[num_envs, A, N+1]`: what is expected at the last observations.

        Raises:
            TrdlabError: there is none yet.
        """
        if self._components is None:
            raise TrdlabError("There is no observation yet.", "Call reset() before step().")
        return self._components

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Resets the environments (or those of `reset_mask`), and decomposes every action."""
        everyone = np.ones(self.num_envs, dtype=np.bool_)
        mask = (options or {}).get("reset_mask", everyone)  # read first: the reset takes it out
        observations, infos = self.env.reset(seed=seed, options=options)
        self._ended = self._ended & ~mask
        return observations, {**infos, **self._look_up(observations, mask.copy())}

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Steps, and decomposes the actions taken and every action at the new observations."""
        before = self.components
        acted = ~self._ended if self._mode == "NEXT_STEP" else np.ones_like(self._ended)
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        chosen = np.zeros_like(before[:, 0])  # [num_envs, N+1]
        chosen[acted] = before[acted, np.asarray(actions)[acted] - self._actions.start]
        self._ended = np.logical_or(terminated, truncated)
        added = self._look_up(observations, np.ones(self.num_envs, dtype=np.bool_))
        added |= {CHOSEN: chosen, f"_{CHOSEN}": acted}
        return observations, rewards, terminated, truncated, {**infos, **added}

    def _look_up(self, observations: Any, mask: BoolArray) -> dict[str, Any]:
        """Returns the entries for `info` `[num_envs, A, N+1]`, zero outside the mask."""
        new = _decompose(self.estimator, observations, self.num_envs, self._actions)
        keep = mask[:, None, None]
        self._components = (
            new if self._components is None else np.where(keep, new, self._components)
        )
        return {ALL_ACTIONS: np.where(keep, new, 0.0).astype(new.dtype), f"_{ALL_ACTIONS}": mask}


def _discrete(space: gym.Space[Any]) -> gym.spaces.Discrete:
    if not isinstance(space, gym.spaces.Discrete):
        raise InputError(
            f"The action space is {space}.",
            "A decomposition has one row per action: wrap an environment with a Discrete one.",
        )
    return space


def _checked_estimator(estimator: Estimator) -> Estimator:
    if not isinstance(estimator, Estimator):
        raise InputError(
            f"A {type(estimator).__name__} is no Estimator.",
            "Give an object with time_axis, future and decompose(observations), "
            "for example the result of trdlab.tabular.exact.",
        )
    return estimator


def _decompose(
    estimator: Estimator, observations: Any, batch: int, actions: gym.spaces.Discrete
) -> FloatArray:
    """Returns `[B, A, N+1]`, checked against the environment."""
    components = estimator.decompose(observations).components
    expected = (batch, int(actions.n), estimator.time_axis.num_components)
    if components.shape != expected:
        raise InputError(
            f"The estimator decomposed {batch} observations into shape {components.shape}; the "
            f"environment has {actions.n} actions, so it should be {expected}.",
            "Use an estimator made for this environment.",
        )
    return components
