"""Statistics of a few scores, with intervals: numbers in, numbers out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError

RESAMPLES = 10_000


@dataclass(frozen=True)
class Estimate:
    """A number from a sample, and an interval for what it estimates.

    Args:
        value: of the sample.
        low: the interval's lower end.
        high: its upper end.
    """

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.4g} [{self.low:.4g}, {self.high:.4g}]"


def mean(samples: FloatArray) -> FloatArray:
    """Returns the mean over the last axis."""
    return np.asarray(samples.mean(axis=-1))


def interquartile_mean(samples: FloatArray) -> FloatArray:
    """Returns the mean of the middle half over the last axis: robust, and finer than a median.

    Where a quarter of the samples is no whole number, the two at the edges count in part.

    Source: Agarwal et al. (2021), "Deep reinforcement learning at the edge of the statistical
    precipice".

    >>> float(interquartile_mean(np.array([0.0, 1.0, 2.0, 100.0])))
    1.5
    >>> float(interquartile_mean(np.array([0.0, 0.0, 4.0, 8.0, 90.0])))  # (0.75·0 + 4 + 0.75·8)/2.5
    4.0
    """
    ordered, count = np.sort(samples, axis=-1), samples.shape[-1]
    ranks = np.arange(count)
    # how much of each sample, a piece of length 1 of the line from 0 to n, lies in the middle half
    inside = np.minimum(ranks + 1, 0.75 * count) - np.maximum(ranks, 0.25 * count)
    weights = np.maximum(inside, 0.0) / (0.5 * count)
    return np.asarray((ordered * weights).sum(axis=-1))


def bootstrap(
    samples: Sequence[float] | FloatArray,
    statistic: Callable[[FloatArray], FloatArray] = mean,
    *,
    rng: "np.random.Generator",  # a string, for numpy.random takes long to import
    level: float = 0.95,
    resamples: int = RESAMPLES,
) -> Estimate:
    """Returns a statistic with its percentile bootstrap interval.

    Args:
        samples: `[n]`, independent of each other, such as the returns of episodes.
        statistic: from `[..., n]` to `[...]`.
        rng: where the chance comes from.
        level: the probability that the interval is made for.
        resamples: how many samples of n are drawn with replacement.

    Raises:
        InputError: there are no samples, or one is not finite.

    Source: Efron (1979).

    >>> bootstrap([3.0, 3.0], rng=np.random.default_rng(0))
    Estimate(value=3.0, low=3.0, high=3.0)
    """
    values = np.asarray(samples, dtype=np.float64)
    if values.ndim != 1 or not values.size or not np.isfinite(values).all():
        raise InputError(
            f"There is no interval for samples of shape {values.shape}.",
            "Give at least one number, all of them finite.",
        )
    drawn = values[rng.integers(values.size, size=(resamples, values.size))]  # [resamples, n]
    low, high = np.quantile(statistic(drawn), [(1 - level) / 2, (1 + level) / 2])
    return Estimate(float(statistic(values)), float(low), float(high))
