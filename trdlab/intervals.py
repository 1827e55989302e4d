"""Intervals of many numbers at once, from the sums of whole episodes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.statistics import Estimate

LEVEL = 0.95
RESAMPLES = 1_000
FEWEST_EPISODES = 10
"""Different episodes below which no interval is given."""

Flags = BoolArray | np.bool_


@dataclass(frozen=True, eq=False)
class Estimates:
    """Numbers with the intervals in which they would be found again; NaN where there is none.

    Args:
        value: `[...]`, of the sample.
        low: `[...]`, the lower ends.
        high: `[...]`, the upper ends.
    """

    value: FloatArray
    low: FloatArray
    high: FloatArray

    def __getitem__(self, index: int | tuple[()]) -> Estimate:
        """Returns one of them."""
        return Estimate(float(self.value[index]), float(self.low[index]), float(self.high[index]))

    def where(self, shown: Flags, supported: Flags) -> "Estimates":
        """Returns them with NaN in place of values not `shown` and intervals not `supported`."""
        ends = (np.where(supported, end, np.nan) for end in (self.low, self.high))
        return Estimates(np.where(shown, self.value, np.nan), *ends)


def by_episode(
    sums: FloatArray,
    statistic: Callable[[FloatArray], FloatArray],
    *,
    rng: np.random.Generator,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
) -> Estimates:
    """Returns a statistic of pooled episodes with its percentile bootstrap interval.

    Whole episodes are drawn with replacement, for the steps of one are not independent of each
    other. Only their sums are drawn and added, never their steps. There is no interval where fewer
    than `FEWEST_EPISODES` episodes differ.

    Args:
        sums: `[E, ...]`, the sums of each episode.
        statistic: from pooled sums `[R, ...]` to `[R, ...]`; NaN where a sample does not say.
        rng: where the chance comes from.
        level: the probability that the intervals are made for.
        resamples: how many samples of E episodes are drawn.

    Source: Efron (1979); clusters as in Field and Welsh (2007).
    """
    drawn = draws(len(sums), resamples, rng)
    with np.errstate(divide="ignore", invalid="ignore"):  # 0/0 is a statistic that does not exist
        values = statistic(pooled(drawn, sums))  # [1 + R, ...]
    return percentiles(values, level, has_enough(sums))


def draws(count: int, resamples: int, rng: np.random.Generator) -> FloatArray:
    """Returns `[1 + R, E]`: how often each of E episodes counts, in the first row once each."""
    drawn = rng.multinomial(count, np.full(count, 1.0 / count), size=resamples)
    return np.concatenate([np.ones((1, count)), drawn])


def pooled(drawn: FloatArray, sums: FloatArray) -> FloatArray:
    """Returns `[1 + R, ...]`: the sums of each sample of episodes, from `sums [E, ...]`."""
    return np.asarray((drawn @ sums.reshape(len(sums), -1)).reshape(-1, *sums.shape[1:]))


def percentiles(values: FloatArray, level: float, has_interval: bool) -> Estimates:
    """Returns the first of `values [1 + R, ...]` with the percentiles of the others.

    The ends are samples themselves, the next outer ones, for infinity cannot be averaged; samples
    that are NaN do not count.
    """
    ordered = np.sort(values[1:], axis=0)  # NaN last
    valid = (~np.isnan(ordered)).sum(axis=0)
    ranks = (
        np.floor((valid - 1) * (1.0 - level) / 2.0),
        np.ceil((valid - 1) * (1.0 + level) / 2.0),
    )
    low, high = (
        np.take_along_axis(ordered, np.maximum(rank, 0).astype(np.int64)[None], axis=0)[0]
        for rank in ranks
    )
    return Estimates(values[0], low, high).where(np.True_, np.bool_(has_interval))


def different_episodes(sums: FloatArray, among: BoolArray) -> IntArray:
    """Returns `[...]`: how many different episodes tell of each entry.

    In a world without chance all episodes can be the same one; those count once.

    Args:
        sums: `[E, ...]`; episodes whose sums are all equal are the same.
        among: `[E, ...]`, which episodes tell of an entry.
    """
    _, same = np.unique(sums.reshape(len(sums), -1), axis=0, return_inverse=True)
    of = np.eye(same.max() + 1, dtype=np.bool_)[same.ravel()]  # [E, different]
    return np.asarray((of.T.astype(np.int64) @ among.reshape(len(sums), -1) > 0).sum(axis=0))


def has_enough(sums: FloatArray) -> bool:
    """Returns whether the different episodes among `sums [E, ...]` are enough for an interval."""
    among = np.ones((len(sums), 1), dtype=np.bool_)
    return bool(different_episodes(sums.reshape(len(sums), -1), among)[0] >= FEWEST_EPISODES)
