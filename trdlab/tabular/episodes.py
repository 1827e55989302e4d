"""Episodes drawn from an exact model."""

from collections.abc import Mapping
from copy import copy
from typing import Any, Self

import gymnasium as gym
import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.environments.history import checked_actions
from trdlab.environments.naming import numbered
from trdlab.environments.protocol import Padding, Step
from trdlab.errors import InputError
from trdlab.tabular.mdp import MDP


class ModelEnvironments:
    """B episodes drawn from an exact model; the observations are state indices.

    Args:
        mdp: the model.
        num_envs: B.
        seed: where all chance comes from.
        starts: `[S]`, how likely episodes begin in each state; without it in `mdp.start`.
        time_limit: the steps after which an episode is truncated.
        action_names: A names; by default their numbers.
        parts: `[K]` each, what the transitions are paid for by name; steps tell it as `parts`.

    Raises:
        InputError: there is no environment, or the starts are no distribution over the states.

    >>> coin = MDP.from_transitions([[[(1.0, 0, 1.0, True)], [(1.0, 0, 0.0, False)]]])
    >>> environments = ModelEnvironments(coin, 2, seed=0)
    >>> environments.reset().tolist(), environments.step(np.array([0, 1])).terminated.tolist()
    ([0, 0], [True, False])
    """

    first_action = 0
    shared_chance = False
    stack: int | None = None
    padding: Padding = "reset"
    frame_skip = 1
    frames_per_second: float | None = None

    def __init__(
        self,
        mdp: MDP,
        num_envs: int,
        *,
        seed: int,
        starts: FloatArray | None = None,
        time_limit: int | None = None,
        action_names: tuple[str, ...] = (),
        parts: Mapping[str, FloatArray] | None = None,
    ) -> None:
        if num_envs < 1:
            raise InputError(f"There are {num_envs} environments.", "Make at least 1.")
        begin = np.zeros(mdp.num_states) if starts is None else np.asarray(starts)
        if starts is None:
            begin[mdp.start] = 1.0
        if begin.shape != (mdp.num_states,) or begin.min() < 0.0 or abs(begin.sum() - 1) > 1e-9:
            raise InputError(
                "The starts are no distribution over the states.",
                f"Give {mdp.num_states} probabilities that sum to 1.",
            )
        self.mdp, self.num_envs, self.num_actions = mdp, num_envs, mdp.num_actions
        self.observation_space: gym.Space[Any] = gym.spaces.Discrete(mdp.num_states)
        self.action_names, self.time_limit = action_names or numbered(mdp.num_actions), time_limit
        self._rng, self._begin = np.random.default_rng(seed), np.cumsum(begin)
        self._cumulative = np.cumsum(mdp.probabilities)  # [K], over all rows
        self._before = np.concatenate([[0.0], self._cumulative])[mdp.offsets]  # [S·A + 1]
        self._parts = dict(parts or {})
        self._states = np.zeros(num_envs, dtype=np.int64)
        self._elapsed = np.zeros(num_envs, dtype=np.int64)

    def reset(self) -> IntArray:
        """Begins every episode, and returns their first states `[B]`."""
        self._states, self._elapsed = self._first(self.num_envs), np.zeros_like(self._elapsed)
        return self._states.copy()

    def step(self, actions: IntArray, active: BoolArray | None = None) -> Step:
        """Takes actions `[B]`; where an episode ends, the next one begins in the same call.

        Args:
            actions: `[B]`.
            active: `[B]`, which environments act; by default all.

        Raises:
            InputError: there are not B actions, or one does not exist.
        """
        actions = checked_actions(actions, self.num_envs, self.num_actions)
        acts = np.ones(self.num_envs, dtype=np.bool_) if active is None else active
        frames, rewards = self._states.copy(), np.zeros(self.num_envs)
        terminated, late = np.zeros_like(acts), np.zeros_like(acts)
        drawn = self._drawn((self._states * self.num_actions + actions)[acts])  # [≤ B], transitions
        frames[acts], rewards[acts] = self.mdp.next_states[drawn], self.mdp.rewards[drawn]
        terminated[acts] = self.mdp.terminated[drawn]
        self._elapsed[acts] += 1
        late[acts] = self._elapsed[acts] == (self.time_limit or -1)
        ended = terminated | late
        self._states = frames.copy()
        self._states[ended] = self._first(int(ended.sum()))
        self._elapsed[ended] = 0
        taken = np.zeros(self.num_envs, dtype=np.int64)
        taken[acts] = drawn
        return Step(
            frames=frames,
            rewards=rewards,
            terminated=terminated,
            truncated=late & ~terminated,
            life_lost=np.zeros(self.num_envs, dtype=np.bool_),
            following=self._states.copy(),
            info=lambda env: self._told(int(taken[env])),
        )

    def branch(self, which: IntArray, seed: int) -> Self:
        """Returns copies of the environments `which [B′]`, each with a chance of its own."""
        other = copy(self)
        other.num_envs, other._rng = len(which), np.random.default_rng(seed)
        other._states, other._elapsed = self._states[which], self._elapsed[which]
        return other

    def state_dict(self) -> dict[str, Any]:
        """Returns the states of the episodes and of chance."""
        chance = self._rng.bit_generator.state
        return {"states": self._states.copy(), "elapsed": self._elapsed.copy(), "chance": chance}

    def load_state_dict(self, state: Mapping[str, Any]) -> IntArray:
        """Restores to the bit; returns `[B]`, the states the next actions are chosen in."""
        self._states, self._elapsed = state["states"].copy(), state["elapsed"].copy()
        self._rng.bit_generator.state = state["chance"]
        return self._states.copy()

    def close(self) -> None:
        """There is nothing to let go of."""

    def _told(self, transition: int) -> dict[str, Any]:
        """Returns what a step tells beside its reward."""
        return {"parts": {name: float(paid[transition]) for name, paid in self._parts.items()}}

    def _first(self, count: int) -> IntArray:
        level = self._rng.random(count) * self._begin[-1]
        return np.asarray(np.searchsorted(self._begin, level, side="right"))

    def _drawn(self, rows: IntArray) -> IntArray:
        """Returns `[B]`: a transition of each row of the model, by their probabilities."""
        low, high = self._before[rows], self._before[rows + 1]
        level = low + self._rng.random(len(rows)) * (high - low)
        drawn = np.searchsorted(self._cumulative, level, side="right")
        first, last = self.mdp.offsets[rows], self.mdp.offsets[rows + 1] - 1
        return np.asarray(np.clip(drawn, first, last))  # rounding must not lead into another row
