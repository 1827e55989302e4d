"""The score: how an agent does, and how its episodes end."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trdlab.rollouts.episodes import Episode, distinct
from trdlab.statistics import FEWEST_EPISODES, Estimate, bootstrap


@dataclass(frozen=True)
class Score:
    """How an agent did in some episodes.

    Args:
        episodes: E.
        different: how many of them are not the same as another one.
        steps: of all together.
        epsilon: the chance of a random action.
        returns: the mean of the undiscounted rewards of an episode, as they are counted; its ends
            are NaN where fewer than `FEWEST_EPISODES` differ, unless all pay the same.
        least: the least reward of any step.
        most: the largest.
        terminated: how many ended for good.
        truncated: how many were cut off.
        life_losses: how often a life was lost and the episode went on.
        life_loss_ends: whether that counts as an end.
        time_limit: the steps after which they were cut off, if that is known.
    """

    episodes: int
    different: int
    steps: int
    epsilon: float
    returns: Estimate
    least: float
    most: float
    terminated: int
    truncated: int
    life_losses: int
    life_loss_ends: bool
    time_limit: int | None = None


def score_of(episodes: Sequence[Episode], *, seed: int = 0) -> Score:
    """Returns how an agent did in some episodes, one or more.

    Args:
        episodes: what happened.
        seed: of the bootstrap.
    """
    returns = np.array([episode.rewards.sum() for episode in episodes])
    mean = bootstrap(returns, rng=np.random.default_rng(seed))
    different = len(distinct(episodes))
    if different < FEWEST_EPISODES and np.ptp(returns) > 0.0:
        mean = Estimate(mean.value, np.nan, np.nan)
    limits = {episode.time_limit for episode in episodes}
    return Score(
        episodes=len(episodes),
        different=different,
        steps=sum(len(episode) for episode in episodes),
        epsilon=max(episode.epsilon for episode in episodes),
        returns=mean,
        least=float(min(episode.rewards.min() for episode in episodes)),
        most=float(max(episode.rewards.max() for episode in episodes)),
        terminated=sum(episode.terminated for episode in episodes),
        truncated=sum(not episode.terminated for episode in episodes),
        life_losses=sum(int(episode.life_lost.sum()) for episode in episodes),
        life_loss_ends=any(bool((e.life_lost & e.ends).any()) for e in episodes),
        time_limit=limits.pop() if len(limits) == 1 else None,
    )
