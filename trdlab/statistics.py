"""Statistics with intervals: numbers in, numbers out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.errors import InputError

LEVEL = 0.95
"""The probability that intervals are made for."""
RESAMPLES = 1_000
FEWEST_EPISODES = 10
"""Different episodes below which no interval is given."""
_AT_ONCE = 100  # resamples of a bootstrap, which then stay in the cache

Flags = BoolArray | np.bool_
# np.random takes long to import, so it is named in strings only
Statistic = Callable[[FloatArray], FloatArray]


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

    def __neg__(self) -> "Estimate":
        return Estimate(-self.value, -self.high, -self.low)


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


# ---- a few scores --------------------------------------------------------------------------------


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
    statistic: Statistic = mean,
    *,
    rng: "np.random.Generator",
    level: float = LEVEL,
    resamples: int = 10_000,
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
    counts = [min(_AT_ONCE, resamples - begun) for begun in range(0, resamples, _AT_ONCE)]
    sizes = ((count, values.size) for count in counts)
    found = [statistic(values[rng.integers(values.size, size=size)]) for size in sizes]
    low, high = np.quantile(np.concatenate(found), [(1 - level) / 2, (1 + level) / 2])
    return Estimate(float(statistic(values)), float(low), float(high))


# ---- whole episodes ------------------------------------------------------------------------------


def by_episode(sums: FloatArray, statistic: Statistic, *, seed: int = 0) -> Estimates:
    """Returns a statistic of pooled episodes with its percentile bootstrap interval.

    Whole episodes are drawn with replacement, for the steps of one are not independent of each
    other. Only their sums are drawn and added, never their steps. There is no interval where fewer
    than `FEWEST_EPISODES` episodes differ.

    Args:
        sums: `[E, ...]`, the sums of each episode.
        statistic: from pooled sums `[R, ...]` to `[R, ...]`; NaN where a sample does not say.
        seed: of the chance.

    Source: Efron (1979); clusters as in Field and Welsh (2007).
    """
    drawn = draws(len(sums), seed)
    with np.errstate(divide="ignore", invalid="ignore"):  # 0/0 is a statistic that does not exist
        values = statistic(pooled(drawn, sums))  # [1 + R, ...]
    return percentiles(values, has_enough(sums))


@lru_cache(maxsize=1)  # all that is asked of the same episodes is asked in a row
def draws(count: int, seed: int) -> FloatArray:
    """Returns `[1 + R, E]`: how often each of E episodes counts, in the first row once each."""
    rng = np.random.default_rng(seed)
    drawn = rng.multinomial(count, np.full(count, 1.0 / count), size=RESAMPLES)
    found = np.concatenate([np.ones((1, count)), drawn])
    found.setflags(write=False)
    return found


def pooled(drawn: FloatArray, sums: FloatArray) -> FloatArray:
    """Returns `[1 + R, ...]`: the sums of each sample of episodes, from `sums [E, ...]`."""
    return np.asarray((drawn @ sums.reshape(len(sums), -1)).reshape(-1, *sums.shape[1:]))


def percentiles(values: FloatArray, has_interval: bool) -> Estimates:
    """Returns the first of `values [1 + R, ...]` with the percentiles of the others.

    The ends are samples themselves, the next outer ones, for infinity cannot be averaged; samples
    that are NaN do not count.
    """
    ordered = np.sort(values[1:], axis=0)  # NaN last
    last = (~np.isnan(ordered)).sum(axis=0) - 1
    ranks = (np.floor(last * (1.0 - LEVEL) / 2.0), np.ceil(last * (1.0 + LEVEL) / 2.0))
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


def effective(shares: FloatArray) -> FloatArray:
    """Returns `[...]`: from how many episodes a sum comes, where a few can hold most of it.

    Args:
        shares: `[E, ...]`, not below 0, what each episode adds.

    Source: Kish (1965), "Survey sampling", on the effective size of a weighted sample.

    >>> effective(np.array([1.0, 1.0, 1.0, 0.0])).item(), effective(np.array([9.0, 1.0])).item()
    (3.0, 1.2195121951219512)
    """
    total, squares = shares.sum(axis=0), (shares**2).sum(axis=0)
    return np.asarray(total**2 / np.maximum(squares, np.finfo(np.float64).tiny))


def has_enough(sums: FloatArray) -> bool:
    """Returns whether the different episodes among `sums [E, ...]` are enough for an interval."""
    among = np.ones((len(sums), 1), dtype=np.bool_)
    return bool(different_episodes(sums.reshape(len(sums), -1), among)[0] >= FEWEST_EPISODES)


# ---- what is too rare to be seen -----------------------------------------------------------------


def mean_difference(
    one: FloatArray,
    other: FloatArray,
    least: FloatArray,
    most: FloatArray,
    *,
    rng: "np.random.Generator",
) -> Estimates:
    """Returns mean(one) − mean(other), with intervals that mind what is too rare to be seen.

    What came in none of n samples can still have a chance of about 3/n. So each end of an interval
    is that of samples with one more among them, the best or the worst that there can be, under
    random weights. Of samples that are 0 or 1 these are the ends of Clopper and Pearson (1934).

    Args:
        one: `[n, ...]`, independent of each other.
        other: `[m, ...]`, the same of something else.
        least: `[...]`, below which no sample can be.
        most: `[...]`, above which none can be.
        rng: where the chance comes from.

    Source: Rubin (1981), "The Bayesian bootstrap"; Learned-Miller and Thomas (2019), "A new
    confidence interval for the mean of a bounded random variable".
    """
    weights = [rng.dirichlet(np.ones(len(of) + 1), RESAMPLES) for of in (one, other)]

    def drawn(of: FloatArray, weight: FloatArray, extreme: FloatArray) -> FloatArray:
        centre = of.mean(axis=0)  # counted from there, so that what is constant stays exact
        rest = np.concatenate([of, extreme[None]]) - centre
        return np.asarray(np.tensordot(weight, rest, 1))

    value = one.mean(axis=0) - other.mean(axis=0)
    low = drawn(one, weights[0], least) - drawn(other, weights[1], most)
    high = drawn(one, weights[0], most) - drawn(other, weights[1], least)
    low, high = (
        value + np.quantile(of, (1.0 + sign * LEVEL) / 2.0, axis=0)
        for of, sign in ((low, -1.0), (high, 1.0))
    )
    return Estimates(value, low, high)


def unseen(count: int) -> float:
    """Returns how likely something can be that came in none of so many independent samples.

    >>> round(unseen(50), 3)
    0.071
    """
    return float(1.0 - ((1.0 - LEVEL) / 2.0) ** (1.0 / count)) if count else 1.0


def enough(count: int, reach: float, distance: float) -> int | None:
    """Returns how many samples would tell, roughly: an interval shrinks by √n as they get more.

    Args:
        count: how many there are.
        reach: how far their interval reaches towards what it cannot be told from.
        distance: how far away that is.

    Returns:
        At least as many, with one significant digit; None where no number would do.

    >>> enough(50, 0.4, 0.15)
    400
    """
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        needed = float(count * np.square(np.float64(reach) / np.abs(distance)))
    if not needed < _MOST:
        return None
    unit: int = 10 ** int(np.log10(max(needed, 1.0)))
    return int(np.ceil(needed / unit)) * unit


_MOST = 1e6
"""Samples that nobody takes."""
