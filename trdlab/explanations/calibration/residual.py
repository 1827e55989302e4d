"""What the residual hides, and how many components would suffice to show it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import common_axis
from trdlab.statistics import Estimate, by_episode

SHARE = 0.05
"""The share of the reward that may lie in the residual of an N that suffices."""


@dataclass(frozen=True, eq=False)
class Residual:
    """The share of rewards that is predicted, but not when.

    Shares are of absolute values, so that gains and costs do not cancel.

    Args:
        time_axis: what the components mean.
        value: the share of the components of the actions taken that is in the residual.
        gap: the same of the difference between the best action and the next best; NaN where
            actions never differ.
        observed_tails: `[L]`, the share of the discounted rewards that came 0, 1, … steps later or
            after that; empty if no reward came, or some episode was cut off.
    """

    time_axis: TimeAxis
    value: Estimate
    gap: Estimate
    observed_tails: FloatArray

    @property
    def sufficient(self) -> int | None:
        """The least N at which no more than `SHARE` of the rewards that came would be residual."""
        enough = np.flatnonzero(self.observed_tails <= SHARE)
        return -(-int(enough[0]) // self.time_axis.width) if enough.size else None


def residual_of(episodes: Sequence[Episode], *, seed: int = 0) -> Residual:
    """Returns how much of values, and of the differences between actions, is in the residual.

    Raises:
        InputError: there are no episodes, or they are of different time axes.
    """
    axis = common_axis(episodes)
    sums = np.stack([[np.abs(of).sum(axis=0) for of in (e.predicted, _gaps(e))] for e in episodes])
    shares = by_episode(
        sums.astype(np.float64),  # [E, 2, N+1]
        lambda pooled: pooled[..., -1] / pooled.sum(axis=-1),
        seed=seed,
    )
    return Residual(axis, shares[0], shares[1], _observed_tails(episodes, axis.gamma))


def _gaps(episode: Episode) -> FloatArray:
    """Returns `[T, N+1]`: the components of the best action less those of the next best."""
    components = episode.decomposition.components
    if components.shape[1] < 2:
        return np.zeros_like(episode.predicted)
    order = np.argsort(-episode.decomposition.value, axis=1, kind="stable")[:, :2, None]
    best, second = np.moveaxis(np.take_along_axis(components, order, axis=1), 1, 0)
    return np.asarray(best - second)


def _observed_tails(episodes: Sequence[Episode], gamma: float) -> FloatArray:
    """Returns `[L]`, of all steps; nothing where some were cut off, for these are the long ones."""
    if any(not episode.ends[-1] for episode in episodes):
        return np.zeros(0)
    sums = np.zeros(max(map(len, episodes)) + 1)
    for episode in episodes:
        for part in np.split(episode.rewards, np.flatnonzero(episode.ends) + 1)[:-1]:
            left = np.zeros(len(part) + 1)  # the discounted reward from each step to the end
            for step in reversed(range(len(part))):
                left[step] = abs(part[step]) + gamma * left[step + 1]
            sums[: len(left)] += np.cumsum(left[::-1])[::-1]  # of all steps that are m later
    sums *= gamma ** np.arange(len(sums))
    return np.asarray(sums / sums[0] if sums[0] else np.zeros(0))
