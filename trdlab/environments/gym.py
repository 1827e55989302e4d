"""Gymnasium environments, stepped one after the other."""

from collections.abc import Mapping
from copy import copy, deepcopy
from typing import Any, Self

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from trdlab.arrays import IntArray
from trdlab.environments.history import Histories, checked_actions
from trdlab.environments.making import make_environment
from trdlab.environments.protocol import Frames, NotCopyable, Padding, Step
from trdlab.errors import InputError

_CHANNELS = (1, 3, 4)


class GymEnvironments:
    """B Gymnasium environments of one kind, in one process.

    Every episode begins with a seeded reset, so that any moment of it can be restored from that
    seed and the actions since. Images become channels first; grey ones `(H, W)` are single frames,
    seen as `[B, 1, H, W]` (`stack` is 1).

    Args:
        env_id: as for `make_environment`.
        num_envs: B.
        seed: what all seeds are drawn from.
        env_arguments: what to make them with.

    Raises:
        InputError: the environment cannot be made, its actions are not discrete, or no network
            reads its observations.

    >>> import numpy as np
    >>> environments = GymEnvironments("CartPole-v1", 2, seed=0)
    >>> environments.reset().shape, environments.num_actions, environments.time_limit
    ((2, 4), 2, 500)
    >>> environments.step(np.array([0, 1])).rewards.tolist()
    [1.0, 1.0]
    """

    frame_skip = 1
    padding: Padding = "reset"

    def __init__(
        self,
        env_id: str,
        num_envs: int = 1,
        *,
        seed: int,
        env_arguments: Mapping[str, Any] | None = None,
    ) -> None:
        arguments = dict(env_arguments or {})
        settings = {"env_id": env_id, "arguments": arguments}
        self._histories = Histories(settings, num_envs=num_envs, seed=seed)
        self._envs = [make_environment(env_id, arguments) for _ in range(num_envs)]
        env = self._envs[0]
        self.env_id, self.num_envs = env_id, num_envs
        actions = _checked_actions(env, env_id)
        self.num_actions, self.first_action = int(actions.n), int(actions.start)
        self.action_names = _action_names(env, self.num_actions)
        self._space = env.observation_space
        self.observation_space = frame_space(self._space, env_id)
        self._channels_last = self.observation_space.shape != self._space.shape
        grey = _is_image(self._space) and len(self._space.shape or ()) == 2
        self.stack = 1 if grey else None
        self.time_limit = env.spec.max_episode_steps if env.spec else None
        self.frames_per_second: float | None = env.metadata.get("render_fps")

    def reset(self) -> Frames:
        """Begins an episode in every environment, and returns their first frames `[B, ...]`."""
        frames = self._blank_frames()
        for env in range(self.num_envs):
            self._begin(env, frames)
        return frames

    def step(self, actions: IntArray) -> Step:
        """Takes actions `[B]`; where an episode ends, the next one begins in the same call.

        Raises:
            InputError: there are not B actions, or one does not exist.
        """
        step = self._blank_step()
        for env, action in enumerate(checked_actions(actions, self.num_envs, self.num_actions)):
            self._act(env, action, step)
        return step

    def state_dict(self) -> dict[str, Any]:
        """Returns the seeds of the running episodes and the actions taken in them.

        Raises:
            TrdlabError: no episode has begun.
        """
        return self._histories.state_dict()

    def load_state_dict(self, state: Mapping[str, Any]) -> Frames:
        """Plays the saved episodes again; returns the frames the next action is chosen at.

        Raises:
            InputError: the state was saved with other settings, or is torn.
            NotReproducible: an environment does not do again what it did.
        """
        step = self._blank_step()
        for env, (seeding, actions) in enumerate(self._histories.saved(state)):
            self._begin(env, step.following, seeding)
            for action in actions:
                self._act(env, action, step)
        self._histories.verify(state, self.env_id)
        return step.following

    def branch(self, which: IntArray, seed: int) -> Self:
        """Returns copies of the environments `which [B′]`; their `state_dict` cannot be asked for.

        Raises:
            NotCopyable: an environment cannot be copied.
        """
        other, seeds = copy(self), np.random.SeedSequence(seed).spawn(len(which))
        try:
            envs = [deepcopy(self._envs[env]) for env in which]
        except (TypeError, AttributeError, NotImplementedError, RuntimeError) as error:
            raise NotCopyable(
                f"{self.env_id} cannot be copied ({error}).", "Ask for no ceiling and no foils."
            ) from error
        for env, words in zip(envs, seeds, strict=True):
            env.unwrapped.np_random = np.random.default_rng(words)
        other._envs, other.num_envs = envs, len(envs)
        other._histories = Histories({"copied": True}, num_envs=len(envs), seed=seed)
        return other

    def close(self) -> None:
        """Closes the environments."""
        for env in self._envs:
            env.close()

    def _begin(self, env: int, frames: Frames, seeding: int | None = None) -> None:
        """Begins an episode, its first frame into `frames [B, ...]`."""
        observation, _ = self._envs[env].reset(seed=self._histories.begin(env, seeding))
        frame = np.asarray(observation)
        if not np.can_cast(frame.dtype, frames.dtype, "same_kind"):
            raise InputError(
                f"{self.env_id} gives observations of type {frame.dtype}, and its observation "
                f"space is {self._space}.",
                "One of the two is wrong.",
            )
        frames[env] = self._frame(observation)
        self._histories.record_reset(env, frames)

    def _act(self, env: int, action: np.int64, step: Step) -> None:
        """Takes one environment's action, and fills its row of `step`."""
        observation, reward, terminated, truncated, _ = self._envs[env].step(
            action + self.first_action
        )
        step.frames[env] = self._frame(observation)
        step.rewards[env] = reward
        step.terminated[env] = terminated
        step.truncated[env] = truncated and not terminated
        self._histories.record_step(env, int(action), step.frames, step.rewards)
        if terminated or truncated:
            self._begin(env, step.following)
        else:
            step.following[env] = step.frames[env]

    def _frame(self, observation: Any) -> Frames:
        frame = np.asarray(observation)
        if frame.shape != self._space.shape:
            raise InputError(
                f"{self.env_id} gives observations of shape {frame.shape}, and its observation "
                f"space is {self._space}.",
                "One of the two is wrong.",
            )
        return np.moveaxis(frame, -1, 0) if self._channels_last else frame

    def _blank_frames(self) -> Frames:
        shape = self.observation_space.shape or ()
        return np.empty((self.num_envs, *shape), dtype=self.observation_space.dtype)

    def _blank_step(self) -> Step:
        each = self.num_envs
        return Step(
            frames=self._blank_frames(),
            rewards=np.empty(each),
            terminated=np.empty(each, dtype=np.bool_),
            truncated=np.empty(each, dtype=np.bool_),
            life_lost=np.zeros(each, dtype=np.bool_),
            following=self._blank_frames(),
        )


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
            f"There is no network for the observation space of {name}: {space}.",
            "Use a Box or Discrete one, for example through gymnasium.wrappers.FlattenObservation.",
        )
    if not (_is_image(space) and len(space.shape) == 3 and space.shape[-1] in _CHANNELS):
        return space
    low, high = (np.moveaxis(bound, -1, 0) for bound in (space.low, space.high))
    return gym.spaces.Box(low, high, dtype=np.uint8)


def _is_image(space: gym.Space[Any]) -> bool:
    """Whether observations are pictures: bytes that use the whole range, in rows and columns."""
    if not isinstance(space, gym.spaces.Box) or space.dtype != np.uint8:
        return False
    full = bool((space.low == 0).all() and (space.high == 255).all())
    return full and len(space.shape) in (2, 3)


def _checked_actions(env: gym.Env[Any, Any], name: str) -> gym.spaces.Discrete:
    if str(env.spec.entry_point if env.spec else "").startswith("ale_py"):
        raise InputError(
            f"{name} is an Atari game.", f"Use: trdlab train atari {name.rpartition(':')[2]}"
        )
    if not isinstance(env.action_space, gym.spaces.Discrete):
        raise InputError(
            f"The action space of {name} is {env.action_space}.",
            "A decomposition has one row per action: use an environment with a Discrete one.",
        )
    return env.action_space


def _action_names(env: gym.Env[Any, Any], num_actions: int) -> tuple[str, ...]:
    """Returns what the environment calls its actions, nothing where it does not tell."""
    base: Any = env.unwrapped
    names: npt.ArrayLike = getattr(base, "action_names", ())
    if hasattr(base, "get_action_meanings"):
        names = base.get_action_meanings()
    told = tuple(str(name) for name in np.asarray(names).ravel())
    return told if len(told) == num_actions else ()
