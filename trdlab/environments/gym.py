"""Gymnasium environments, stepped one after the other."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, Self

import numpy as np

from trdlab.arrays import BoolArray, IntArray
from trdlab.environments.actions import Actions, masks_of, told_of
from trdlab.environments.answers import beginning_of, outcome_of
from trdlab.environments.aside import aside
from trdlab.environments.chance import generators, kept_luck, own_chance, renew
from trdlab.environments.copies import (
    COMPARED,
    LEAST,
    Env,
    NoDeepCopy,
    Past,
    Proof,
    copied,
    prove,
)
from trdlab.environments.flat import FlatSpace
from trdlab.environments.history import Histories, checked_actions
from trdlab.environments.naming import action_names
from trdlab.environments.protocol import Frames, NotCopyable, Padding, Step
from trdlab.environments.sources import EnvSource, Source
from trdlab.environments.spaces import frame_space, is_image
from trdlab.errors import InputError


class GymEnvironments:
    """B Gymnasium environments of one kind, in one process.

    Every episode begins with a seeded reset, so that any moment of it can be restored from that
    seed and the actions since. Images become channels first; grey ones `(H, W)` are single frames,
    seen as `[B, 1, H, W]` (`stack` is 1). A Dict or Tuple becomes a vector (see `FlatSpace`). What
    they print goes to stderr.

    Args:
        env: a Gymnasium id, such as `CartPole-v1`, or `module:id` to import a module first; a
            function that makes an environment; or an environment, which is reset, copied, and left
            open (see `Source`).
        num_envs: B.
        seed: what all seeds are drawn from.
        env_arguments: what to make those of an id with.

    Raises:
        InputError: the environment cannot be made, its actions cannot be counted, or no network
            reads its observations.
        NotParallel: one can be made, and not B beside each other.

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
        env: EnvSource,
        num_envs: int = 1,
        *,
        seed: int,
        env_arguments: Mapping[str, Any] | None = None,
    ) -> None:
        self._source, self.num_envs = Source(env, env_arguments), num_envs
        self.given: tuple[EnvSource, int, dict[str, Any]] = env, seed, dict(env_arguments or {})
        self._envs = self._source.make(num_envs)
        self.name = self._source.name
        settings = {"env_id": self.name, "arguments": dict(env_arguments or {})}
        try:
            self._histories = Histories(settings, num_envs=num_envs, seed=seed)
            self._look_at(self._envs[0])
        except InputError:
            self.close()
            raise
        self.allowed: BoolArray | None = None
        self.shared_chance, self._is_copy = False, False
        self._infos: dict[int, Any] = {}
        self._masks: list[Any] = [None] * num_envs
        self._proof: Proof | None = None

    @aside()
    def reset(self) -> Frames:
        """Begins an episode in every environment, and returns their first frames `[B, ...]`."""
        frames = self._blank_frames()
        for env in range(self.num_envs):
            self._begin(env, frames)
        return frames

    @aside()
    def step(self, actions: IntArray, active: BoolArray | None = None) -> Step:
        """Takes actions `[B]`; where an episode ends, the next one begins in the same call.

        Args:
            actions: `[B]`.
            active: `[B]`, which environments act; by default all. The others are left as they are.

        Raises:
            InputError: there are not B actions, one does not exist, or an environment answers as
                none should.
        """
        taken = checked_actions(actions, self.num_envs, self.num_actions).tolist()
        if active is None or active.all():
            return self._act(range(self.num_envs), taken)
        acting = np.flatnonzero(active).tolist()
        return self._act(acting, [taken[env] for env in acting])

    def state_dict(self) -> dict[str, Any]:
        """Returns the seeds of the running episodes and the actions taken in them.

        Raises:
            TrdlabError: no episode has begun.
        """
        return self._histories.state_dict()

    @aside()
    def load_state_dict(self, state: Mapping[str, Any]) -> Frames:
        """Plays the saved episodes again; returns the frames the next action is chosen at.

        Raises:
            InputError: the state was saved with other settings, or is torn.
            NotReproducible: an environment does not do again what it did.
        """
        frames = self._blank_frames()
        for env, (seeding, actions) in enumerate(self._histories.saved(state)):
            self._begin(env, frames, seeding)
            for action in actions.tolist():
                frames[env] = self._act([env], [action]).following[env]
        self._histories.verify(state, self.name)
        return frames

    @aside()
    def branch(self, which: IntArray, seed: int) -> Self:
        """Returns copies of the environments `which [B′]`, each with a chance of its own.

        They are deep copies where these have proved to be copies: another environment of this kind
        is stepped as its copy was, and does the same. Elsewhere seed and actions are played again
        in new environments, which must show the same. Then every generator of chance that a copy
        holds is seeded anew: `np_random`, and those of NumPy and Python in attributes and in what
        these hold. Where others decide, out of reach, `shared_chance` says so as far as that was
        seen. The `state_dict` of copies cannot be asked for. Close them when they are done with.

        Raises:
            NotCopyable: neither gives a copy.
            TrdlabError: no episode has begun.
        """
        chosen, found = which.tolist(), []
        with kept_luck():  # copying must not disturb the chance of what is copied
            self._proof = self._proof or self._proved(chosen[0])
            held = {env: generators(self._envs[env]) for env in set(chosen)}
            if not self._proof.fault:
                try:
                    found = [copied(self._envs[env], held[env]) for env in chosen]
                except NoDeepCopy as error:
                    self._proof = replace(self._proof, fault=str(error))
            if self._proof.fault:
                again = zip(chosen, self._played_again(chosen, self._proof.fault), strict=True)
                found = [(twin, own_chance(twin, held[env])) for env, twin in again]
            chances = np.random.SeedSequence(seed).spawn(len(chosen))
            for (_, chance), own in zip(found, chances, strict=True):
                renew(chance, own)
        copies = self._with([twin for twin, _ in found], seed)
        copies.shared_chance = self._proof.shared_chance
        copies.allowed = None if self.allowed is None else self.allowed[which]
        return copies

    @aside()
    def close(self) -> None:
        """Closes the environments."""
        for env in self._envs:
            self._source.close(env)

    def _look_at(self, env: Any) -> None:
        """Notes what can be seen and done in an environment."""
        self._actions = Actions.of(env.action_space, self.name)
        self.num_actions, self.first_action = len(self._actions), self._actions.first
        self.action_names = action_names(env, self._actions.sizes, self.first_action)
        self._space = env.observation_space
        self.observation_space = frame_space(self._space, self.name)
        whole = getattr(self.observation_space, "whole", None)
        self._channels_last = whole is None and self.observation_space.shape != self._space.shape
        is_plain = whole is None and not self._channels_last
        self._plain_shape = self._space.shape if is_plain else None
        self.stack = 1 if is_image(self._space) and len(self._space.shape or ()) == 2 else None
        spec, metadata = getattr(env, "spec", None), getattr(env, "metadata", None)
        self.time_limit: int | None = spec.max_episode_steps if spec else None
        self.frames_per_second: float | None = (metadata or {}).get("render_fps")
        self.render_modes: tuple[str, ...] = tuple((metadata or {}).get("render_modes") or ())

    def _proved(self, env: int) -> Proof:
        """Returns what others of this kind show about copies of an environment."""
        seed, past = self._histories.past(env)
        more = np.random.default_rng(0).integers(self.num_actions, size=LEAST + COMPARED)
        actions = [self._actions.called[action] for action in (*past, *more)]
        try:
            return prove(
                lambda: self._source.make(1, beside=self._envs)[0],
                Past(seed, actions[: len(past)]),
                actions[len(past) :],
            )
        except InputError as error:
            raise self._not_copyable(error.cause) from error
        except Exception as error:  # noqa: BLE001  anything can be raised in another's code
            return Proof(f"Its copies cannot be tried ({type(error).__name__}: {error}).")

    def _played_again(self, which: list[int], fault: str) -> list[Env]:
        """Returns new environments in which episodes of these have been played again.

        Raises:
            NotCopyable: they cannot be made, or show something else.
        """
        if self._is_copy:
            raise self._not_copyable(f"{fault} Nor can a copy be played again.")
        try:
            envs = self._source.make(len(which), beside=self._envs)
        except InputError as error:
            raise self._not_copyable(f"{fault} {error.cause}") from error
        copies = self._with(envs, seed=0)
        frames = copies._blank_frames()
        for twin, env in enumerate(which):
            seed, actions = self._histories.past(env)
            copies._histories.begin(twin)
            copies._reset(twin, frames, seed)
            for action in actions.tolist():
                copies._act([twin], [action])
            if not copies._histories.same(twin, self._histories, env):
                copies.close()
                raise self._not_copyable(f"{fault} Played again, it did something else.")
        return envs

    def _not_copyable(self, why: str) -> NotCopyable:
        why = f"{self.name} cannot be copied: {why}"
        return NotCopyable(why, "Judge it without copies of its states.")

    def _with(self, envs: list[Env], seed: int) -> Self:
        """Returns the same with copies for environments, whose past is not known."""
        other = copy(self)
        other._envs, other.num_envs, other._is_copy = envs, len(envs), True
        other._infos, other._masks = {}, [masks_of(env) for env in envs]
        other._histories = Histories({"copied": True}, num_envs=len(envs), seed=seed)
        other.allowed = None
        return other

    def _begin(self, env: int, frames: Frames, seeding: int | None = None) -> None:
        """Begins an episode, its first frame into `frames [B, ...]`."""
        self._reset(env, frames, self._histories.begin(env, seeding))

    def _reset(self, env: int, frames: Frames, seed: int) -> None:
        observation, info = beginning_of(self._envs[env], seed, self.name)
        frame = self._frame(observation)
        if not np.can_cast(frame.dtype, frames.dtype, "same_kind"):
            raise InputError(
                f"{self.name} gives observations of type {frame.dtype}, and its observation "
                f"space is {self._space}.",
                "One of the two is wrong.",
            )
        frames[env] = frame
        self._masks[env] = masks_of(self._envs[env])
        self._allow(env, info)
        self._histories.record_reset(env, frames)

    def _act(self, acting: Sequence[int], actions: Sequence[int]) -> Step:
        """Takes an action in each of some environments; where an episode ends, another begins."""
        envs, called, infos, masks = self._envs, self._actions.called, self._infos, self._masks
        name, plain, step = self.name, self._plain_shape, self._blank_step()
        frames, rewards, ended = step.frames, step.rewards, []
        # where a step takes microseconds, each name that is looked up in this loop counts
        for env, action in zip(acting, actions, strict=True):
            observation, rewards[env], terminated, truncated, info = outcome_of(
                envs[env], called[action], name
            )
            is_plain = type(observation) is np.ndarray and observation.shape == plain
            frames[env] = observation if is_plain else self._frame(observation)
            infos[env] = info
            if masks[env] is not None or self.allowed is not None or info != {}:
                self._allow(env, info, terminated)
            if terminated or truncated:
                ended.append(env)
                step.terminated[env], step.truncated[env] = terminated, not terminated
        self._histories.record_step(acting, actions, frames, rewards)
        if step.allowed is not None and self.allowed is not None:
            step.allowed[acting] = self.allowed[acting]
        step.following[...] = frames
        for env in ended:
            self._begin(env, step.following)
        return step

    def _allow(self, env: int, info: Any, is_over: bool = False) -> None:
        """Notes which actions can be taken next; once it is over, that does not matter."""
        told = told_of(self._masks[env], info)
        if told is None and self.allowed is None:
            return
        if self.allowed is None:
            self.allowed = np.ones((self.num_envs, self.num_actions), dtype=np.bool_)
        mask = None if told is None else self._actions.allowed(told, self.name)
        self.allowed[env] = True if mask is None or is_over else mask
        if not self.allowed[env].any():
            raise InputError(f"{self.name} forbids every action.", "Leave at least one.")

    def _frame(self, observation: Any) -> Frames:
        if isinstance(self.observation_space, FlatSpace):
            return self._flat(self.observation_space, observation)
        frame = np.asarray(observation)
        if frame.shape != self._space.shape:
            raise InputError(
                f"{self.name} gives observations of shape {frame.shape}, and its observation "
                f"space is {self._space}.",
                "One of the two is wrong.",
            )
        return np.moveaxis(frame, -1, 0) if self._channels_last else frame

    def _flat(self, space: FlatSpace, observation: Any) -> Frames:
        try:
            return space.flat(observation)
        except Exception as error:
            raise InputError(
                f"{self.name} gives an observation that is none of its observation space "
                f"{self._space} ({type(error).__name__}: {error}).",
                "One of the two is wrong.",
            ) from error

    def _blank_frames(self) -> Frames:
        shape = self.observation_space.shape or ()
        return np.zeros((self.num_envs, *shape), dtype=self.observation_space.dtype)

    def _blank_step(self) -> Step:
        each = self.num_envs
        return Step(
            frames=self._blank_frames(),
            rewards=np.zeros(each),
            terminated=np.zeros(each, dtype=np.bool_),
            truncated=np.zeros(each, dtype=np.bool_),
            life_lost=np.zeros(each, dtype=np.bool_),
            following=self._blank_frames(),
            allowed=None if self.allowed is None else np.ones_like(self.allowed),
            info=lambda env: self._infos.get(env) or {},
        )
