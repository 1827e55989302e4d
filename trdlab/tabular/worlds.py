"""Where sampled steps come from: a model, or Gymnasium environments; many episodes at a time."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.errors import InputError
from trdlab.tabular.mdp import MDP
from trdlab.tabular.reach import reachable

if TYPE_CHECKING:
    from gymnasium import Env, Space
    from gymnasium.vector import VectorEnv


@dataclass(frozen=True, eq=False)
class Step:
    """One step of B environments.

    Args:
        rewards: `[B]`.
        terminated: `[B]`, whether the episode ended for good.
        truncated: `[B]`, whether it was cut off.
        next_observations: `[B, ...]`, to which the step led; at the end of an episode the true
            last observation.
        active: `[B]`, false where the environment was only reset, whatever the action.
    """

    rewards: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    next_observations: npt.NDArray[Any]
    active: BoolArray


class ModelWorlds:
    """B episodes drawn from a model, each begun in a random state and cut after a few steps.

    A state is drawn evenly from all those in which an action may have to be chosen, so that every
    state is visited often however hard it is to come by (*exploring starts*).

    Args:
        mdp: the model.
        num_envs: B.
        time_limit: the steps after which an episode is truncated.
        rng: where chance comes from.
    """

    def __init__(
        self, mdp: MDP, num_envs: int, time_limit: int, rng: "np.random.Generator"
    ) -> None:
        self.num_states, self.num_actions = mdp.num_states, mdp.num_actions
        self.num_envs, self.time_limit = num_envs, time_limit
        self._rng, self._reachable = rng, np.flatnonzero(reachable(mdp))
        possible = mdp.probabilities > 0.0
        rows = np.repeat(np.arange(len(mdp.offsets) - 1), np.diff(mdp.offsets))[possible]
        probabilities = mdp.probabilities[possible]
        # Row k fills the levels from k to k + 1, so that one sorted search draws for all.
        ends = np.flatnonzero(np.diff(rows, append=-1))  # [S·A], the last transition of each row
        sums = np.cumsum(probabilities)
        before = np.concatenate([[0.0], sums[ends[:-1]]])  # [S·A]
        self._levels = rows + np.minimum(sums - before[rows], 1.0)
        self._levels[ends] = np.arange(1, len(ends) + 1)
        self._next, self._rewards = mdp.next_states[possible], mdp.rewards[possible]
        self._terminated = mdp.terminated[possible]
        self.elapsed = np.zeros(num_envs, dtype=np.int64)
        self.observations = self._starts(num_envs)

    def step(self, actions: IntArray) -> Step:
        """Takes one action in each environment; ended episodes begin anew at once."""
        rows = self.observations * self.num_actions + actions
        levels = rows + self._rng.random(self.num_envs)
        levels = np.minimum(levels, np.nextafter(rows + 1.0, 0.0))  # not rounded into the next row
        drawn = np.searchsorted(self._levels, levels, side="right")
        following, terminated = self._next[drawn], self._terminated[drawn]
        self.elapsed += 1
        truncated = (self.elapsed == self.time_limit) & ~terminated
        ended = terminated | truncated
        self.elapsed[ended] = 0
        self.observations = following.copy()
        self.observations[ended] = self._starts(int(ended.sum()))
        active = np.ones(self.num_envs, dtype=np.bool_)
        return Step(self._rewards[drawn], terminated, truncated, following, active)

    def _starts(self, count: int) -> IntArray:
        return self._reachable[self._rng.integers(len(self._reachable), size=count)]


class GymWorlds:
    """Gymnasium environments, whichever way they reset themselves.

    Args:
        envs: a vector environment with discrete observations and actions, counted from 0; or a
            single environment, which becomes a vector of one.
        seed: of the first reset.

    Raises:
        InputError: the spaces are not discrete, or do not count from 0.
    """

    def __init__(self, envs: "VectorEnv[Any, Any, Any] | Env[Any, Any]", seed: int) -> None:
        from gymnasium import Env
        from gymnasium.vector import SyncVectorEnv

        self.envs: Any = SyncVectorEnv([lambda: envs]) if isinstance(envs, Env) else envs
        self.num_states = _size("observations", self.envs.single_observation_space)
        self.num_actions = _size("actions", self.envs.single_action_space)
        self.num_envs = int(self.envs.num_envs)
        self.time_limit = _time_limit(self.envs)
        # gymnasium 1.0 knows no modes: it always resets on the step after the end
        self._mode = getattr(self.envs.metadata.get("autoreset_mode"), "name", "NEXT_STEP")
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        self.observations, _ = self.envs.reset(seed=seed)

    def step(self, actions: IntArray) -> Step:
        """Takes one action in each environment; ended episodes begin anew by the next step."""
        active = ~self._ended if self._mode == "NEXT_STEP" else np.ones_like(self._ended)
        following, rewards, terminated, truncated, infos = self.envs.step(actions)
        following = np.array(following)  # a copy: environments may write into their own
        self.observations = following
        self._ended = ended = np.logical_or(terminated, truncated)
        if self._mode == "SAME_STEP" and ended.any():
            following = following.copy()
            for env in np.flatnonzero(ended):  # what came back begins the next episode
                following[env] = infos["final_obs"][env]
        elif self._mode == "DISABLED" and ended.any():
            fresh, _ = self.envs.reset(options={"reset_mask": ended})
            self.observations = np.array(fresh)
            self._ended = np.zeros_like(ended)
        return Step(
            rewards=np.array(rewards, dtype=np.float64),
            terminated=np.array(terminated, dtype=np.bool_),
            truncated=np.array(truncated, dtype=np.bool_),
            next_observations=following,
            active=active,
        )


def _size(name: str, space: "Space[Any]") -> int:
    from gymnasium.spaces import Discrete

    if not isinstance(space, Discrete) or space.start != 0:
        raise InputError(
            f"The space of {name} is {space}.",
            "A table has a row for each: use an environment with a Discrete one, counted from 0.",
        )
    return int(space.n)


def _time_limit(envs: Any) -> int | None:
    """Returns the shortest time limit that the environments' specifications tell."""
    specs = [env.spec for env in getattr(envs, "envs", [envs])]
    limits = [spec.max_episode_steps for spec in specs if spec is not None]
    known = [limit for limit in limits if limit is not None]
    return min(known) if known else None
