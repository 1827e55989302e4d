"""How well an agent plays: whole episodes, and the returns that the environment pays."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.environments import Environments
from trdlab.environments.stack import FrameStack
from trdlab.estimator import Estimator
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
    """

    returns: FloatArray
    lengths: IntArray
    truncated: BoolArray
    epsilon: float
    seed: int

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
        means = {"mean": self.mean, "interquartile_mean": self.interquartile_mean}
        return {
            "schema": "trdlab.rollouts.evaluation/1",
            "episodes": len(self.returns),
            "epsilon": self.epsilon,
            "seed": self.seed,
            **{
                name: {"value": of.value, "low": of.low, "high": of.high, "level": 0.95}
                for name, of in means.items()
            },
            "returns": self.returns.tolist(),
            "lengths": self.lengths.tolist(),
            "truncated": self.truncated.tolist(),
        }


def evaluate(
    estimator: Estimator,
    environments: Environments,
    *,
    epsilon: float = 0.0,
    seed: int = 0,
    on_episode: Callable[[int], None] = lambda finished: None,
) -> Evaluation:
    """Plays one episode in each environment, taking the action of largest Σ components.

    Args:
        estimator: whose greedy policy it is.
        environments: E of them, made with `seed`; they are reset.
        epsilon: the chance of a random action instead.
        seed: of the random actions, and to be told with the result.
        on_episode: called with the number of finished episodes whenever some finish.
    """
    rng, count = np.random.default_rng(seed), environments.num_envs
    stack = FrameStack(environments.reset(), environments.stack, environments.padding)
    returns, lengths = np.zeros(count), np.zeros(count, dtype=np.int64)
    running, truncated = np.ones(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    while running.any():
        explore = rng.random(count) < epsilon  # [E]
        actions = rng.integers(environments.num_actions, size=count)  # [E]
        chosen = running & ~explore
        if chosen.any():  # those that have finished need no forward pass
            values = estimator.decompose(stack.observations[chosen]).value  # [≤ E, A]
            actions[chosen] = values.argmax(axis=1)
        step = environments.step(actions)
        stack.push(step.following, step.ended)
        returns[running] += step.rewards[running]
        lengths[running] += 1
        truncated |= running & step.truncated
        finishes = running & step.ended
        running &= ~step.ended
        if finishes.any():
            on_episode(int(count - running.sum()))
    return Evaluation(returns, lengths, truncated, epsilon, seed)
