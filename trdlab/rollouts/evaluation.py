"""How well an agent plays: whole episodes, and the returns that the environment pays."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.environments import Environments, in_batches
from trdlab.environments.batches import Make
from trdlab.errors import InputError
from trdlab.estimator import Estimator
from trdlab.policies import Policy, acting
from trdlab.rollouts.playing import Playing, Watch, part_of, unwatched
from trdlab.statistics import Estimate, bootstrap, interquartile_mean


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The episodes of an agent, one in each of E environments.

    Args:
        returns: `[E]`, the plain sum of rewards of each episode, as the environment pays them.
        lengths: `[E]`, in agent steps.
        truncated: `[E]`, whether an episode was cut off rather than ended.
        epsilon: the chance of a random action.
        seed: of the environments and of the random actions.
        max_steps: after which an episode was cut off, if the environment had not done so before.
    """

    returns: FloatArray
    lengths: IntArray
    truncated: BoolArray
    epsilon: float
    seed: int
    max_steps: int | None = None

    @property
    def mean(self) -> Estimate:
        """The mean return, with a bootstrap interval (95 %)."""
        return bootstrap(self.returns, rng=np.random.default_rng(self.seed))

    @property
    def interquartile_mean(self) -> Estimate:
        """The mean of the middle half of the returns, with a bootstrap interval (95 %)."""
        return bootstrap(self.returns, interquartile_mean, rng=np.random.default_rng(self.seed))

    def to_dict(self) -> dict[str, Any]:
        """Returns plain data, for JSON."""
        return {
            "schema": "trdlab.evaluation/1",
            "episodes": len(self.returns),
            "epsilon": self.epsilon,
            "seed": self.seed,
            "max_steps": self.max_steps,
            "mean": {**asdict(self.mean), "level": 0.95},
            "interquartile_mean": {**asdict(self.interquartile_mean), "level": 0.95},
            "returns": self.returns.tolist(),
            "lengths": self.lengths.tolist(),
            "truncated": self.truncated.tolist(),
        }


def evaluate(
    who: Policy | Estimator,
    environments: Environments,
    *,
    epsilon: float = 0.0,
    max_steps: int | None = None,
    seed: int = 0,
    watch: Watch = unwatched,
) -> Evaluation:
    """Plays one episode in each environment, and keeps the rewards that the environment pays.

    Args:
        who: plays; an estimator by its greedy policy.
        environments: E of them, made with `seed`; they are reset.
        epsilon: the chance of a random action instead.
        max_steps: after which an episode is cut off, if the environment has not ended it before.
        seed: of the actions, and to be told with the result.
        watch: told how far the episodes are, after every step.

    Raises:
        InputError: `who` is neither policy nor estimator, or there is not a single step.
    """
    count = environments.num_envs
    playing = Playing(
        None,
        environments,
        np.random.default_rng(seed),
        policy=acting(who),
        epsilon=epsilon,
        chance=np.random.default_rng([seed, 1]),
        max_steps=max_steps,
    )
    returns, lengths = np.zeros(count), np.zeros(count, dtype=np.int64)
    truncated = np.zeros(count, dtype=np.bool_)
    while playing.running.any():
        running = playing.running
        step = playing.take(playing.turn().actions)
        returns[running] += step.rewards[running]
        lengths[running] += 1
        truncated |= playing.finished & ~step.terminated
        watch(playing.progress("episodes to score"))
    return Evaluation(returns, lengths, truncated, epsilon, seed, max_steps)


def score(
    who: Policy | Estimator,
    make: Make,
    episodes: int,
    *,
    epsilon: float = 0.0,
    max_steps: int | None = None,
    enough: int = 1_000,
    seed: int = 0,
    watch: Watch = unwatched,
) -> Evaluation:
    """Plays episodes beside each other, or one after another where there can be no more at a time.

    Args:
        who: plays; an estimator by its greedy policy.
        make: makes the environments.
        episodes: how many.
        epsilon: the chance of a random action instead.
        max_steps: after which an episode is cut off; by default the environment's own limit.
        enough: the same, where nothing is said and the environment has none.
        seed: of everything.
        watch: told how far the episodes are, after every step.

    Raises:
        InputError: the environments cannot be made, or there is not a single episode or step.
    """
    if episodes < 1:
        raise InputError(f"There are {episodes} episodes.", "Ask for at least 1.")
    parts: list[Evaluation] = []
    for before, environments in enumerate(in_batches(make, episodes, seed)):  # 0 if all at once
        limit = max_steps or (None if environments.time_limit else enough)
        told, own = part_of(watch, before, episodes), seed + before
        part = evaluate(who, environments, epsilon=epsilon, max_steps=limit, seed=own, watch=told)
        parts.append(part)
    return joined(parts)


def joined(parts: Sequence[Evaluation]) -> Evaluation:
    """Returns evaluations of one agent, made alike but of other episodes, as a single one."""
    return replace(
        parts[0],
        returns=np.concatenate([part.returns for part in parts]),
        lengths=np.concatenate([part.lengths for part in parts]),
        truncated=np.concatenate([part.truncated for part in parts]),
    )
