"""What the residual hides, and how many components would suffice to show it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.intervals import LEVEL, RESAMPLES, by_episode
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import common_axis
from trdlab.statistics import Estimate
from trdlab.tabular import ExactTable, exact

SHARE = 0.05
"""The share of the reward that may lie in the residual of an N that suffices."""


@dataclass(frozen=True, eq=False)
class Hidden:
    """The share of rewards that is predicted, but not when.

    Shares are of absolute values, so that gains and costs do not cancel.

    Args:
        time_axis: what the components mean.
        value: the share of the components of the actions taken that is in the residual.
        gap: the same of the difference between the best action and the next best; NaN where
            actions never differ.
        tails: `[N+1]`, the share of the predicted components from each one on; the last of them
            is `value`.
        observed_tails: `[L]`, the share of the discounted rewards that came 0, 1, … steps later or
            after that; empty if no reward came, or some episode was cut off.
    """

    time_axis: TimeAxis
    value: Estimate
    gap: Estimate
    tails: FloatArray
    observed_tails: FloatArray

    def sufficient(self, share: float = SHARE) -> int | None:
        """Returns the least N at which no more than a share of the reward would be residual.

        It is read off the rewards that were observed; None where too few were.
        """
        return sufficient_horizon(self.observed_tails, self.time_axis.width, share)


def hidden(
    episodes: Sequence[Episode],
    *,
    seed: int = 0,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
) -> Hidden:
    """Returns how much of values, and of the differences between actions, is in the residual.

    Args:
        episodes: what was predicted and what happened; all of one time axis.
        seed: of the bootstrap, which is by episode.
        level: the probability that the intervals are made for.
        resamples: how many samples of episodes are drawn.

    Raises:
        InputError: there are no episodes, or they are of different time axes.
    """
    axis, rng = common_axis(episodes), np.random.default_rng(seed)
    sums = np.stack([[np.abs(of).sum(axis=0) for of in (e.predicted, _gaps(e))] for e in episodes])
    shares = by_episode(
        sums.astype(np.float64),  # [E, 2, N+1]
        lambda pooled: pooled[..., -1] / pooled.sum(axis=-1),
        rng=rng,
        level=level,
        resamples=resamples,
    )
    predicted = sums[:, 0].sum(axis=0)
    return Hidden(
        time_axis=axis,
        value=shares[0],
        gap=shares[1],
        tails=_tails(predicted),
        observed_tails=_observed_tails(episodes, axis.gamma),
    )


def exact_tails(table: ExactTable, visits: FloatArray, steps: int) -> FloatArray:
    """Returns `[steps + 1]`: the share of the discounted rewards that comes each step or later.

    Args:
        table: an exact model and its policy.
        visits: `[S, A]`, how often each action is taken in each state (any unit).
        steps: how far to look.
    """
    magnitudes = table.mdp.with_rewards(np.abs(table.mdp.rewards))
    axis = TimeAxis(table.time_axis.gamma, steps)
    components = exact(magnitudes, axis, policy=table.solution.policy).decomposition.components
    return _tails(np.einsum("sa,san->n", visits, components))


def sufficient_horizon(tails: FloatArray, width: int = 1, share: float = SHARE) -> int | None:
    """Returns the least N at which components of w steps leave no more than a share to come.

    Args:
        tails: `[L]`, the share of the reward that comes 0, 1, … steps later or after that.
        width: w.
        share: of the reward that may be in the residual.

    Returns:
        N; None where the tails do not reach that far down.

    >>> sufficient_horizon(np.array([1.0, 0.5, 0.2, 0.04]), width=2)
    2
    """
    enough = np.flatnonzero(tails <= share)
    return -(-int(enough[0]) // width) if enough.size else None


def _gaps(episode: Episode) -> FloatArray:
    """Returns `[T, N+1]`: the components of the best action less those of the next best."""
    components = episode.decomposition.components
    if components.shape[1] < 2:
        return np.zeros_like(episode.predicted)
    order = np.argsort(-episode.decomposition.value, axis=1, kind="stable")[:, :2, None]
    best, second = np.moveaxis(np.take_along_axis(components, order, axis=1), 1, 0)
    return np.asarray(best - second)


def _tails(sums: FloatArray) -> FloatArray:
    """Returns the share of `sums [n]` from each entry on; NaN where they are all zero."""
    tails = np.cumsum(sums[::-1])[::-1]
    return np.asarray(tails / tails[0] if tails[0] else np.full(len(sums), np.nan))


def _observed_tails(episodes: Sequence[Episode], gamma: float) -> FloatArray:
    """Returns `[L]`, of all steps; nothing where some were cut off, for these are the long ones."""
    if any(not episode.ends[-1] for episode in episodes):
        return np.zeros(0)
    longest = max(len(episode) for episode in episodes)
    sums = np.zeros(longest + 1)
    for episode in episodes:
        for part in np.split(episode.rewards, np.flatnonzero(episode.ends) + 1)[:-1]:
            left, tail = np.zeros(len(part) + 1), 0.0
            for step in reversed(range(len(part))):
                tail = abs(part[step]) + gamma * tail
                left[step] = tail  # the discounted reward from here to the end
            sums[: len(left)] += np.cumsum(left[::-1])[::-1]  # of all steps that are m later
    sums *= gamma ** np.arange(longest + 1)
    return np.asarray(sums / sums[0] if sums[0] else np.zeros(0))
