"""Calibration: what was predicted for each step against the reward that then came."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import Samples, pool
from trdlab.statistics import (
    FEWEST_EPISODES,
    Estimate,
    Estimates,
    by_episode,
    different_episodes,
    effective,
    enough,
    unseen,
)

Status = Literal["good", "bad", "open", "not tested"]
SLACK = 0.1
"""How wrong a forecast may be where the reward was always the same, as a share of it."""
NUM_BINS = 10
"""Of the chances in a `Reliability`."""

_ROUNDING = 1e-12  # relative; rewards that differ by less are the same reward


@dataclass(frozen=True)
class Trust:
    """How far a forecast can be trusted: as far as all components up to there are good.

    Args:
        time_axis: what the components mean.
        status: N+1 of them, as a `Calibration` has found each; the residual is judged by itself.
    """

    time_axis: TimeAxis
    status: tuple[Status, ...]

    @property
    def components(self) -> int:
        """How many explicit components in a row, from the first on, are good."""
        explicit = self.status[:-1]
        return next((i for i, own in enumerate(explicit) if own != "good"), len(explicit))

    @property
    def residual(self) -> bool:
        """Whether the residual is good."""
        return self.status[-1] == "good"

    @property
    def last_step(self) -> int | None:
        """The k of `trustworthy to t+k`; None where no step is."""
        return self.components * self.time_axis.width - 1 if self.components else None

    @property
    def is_whole(self) -> bool:
        """Whether all explicit components are good."""
        return self.components == self.time_axis.horizon > 0

    @property
    def doubtful(self) -> BoolArray:
        """`[N+1]`: the components not to be trusted: from the first on that is not good."""
        explicit = np.arange(self.time_axis.horizon) >= self.components
        return np.append(explicit, not self.residual)


@dataclass(frozen=True, eq=False)
class Calibration:
    """How well each component was predicted, over the steps of whole episodes.

    All are in units of discounted reward. Intervals are bootstrapped by episode; they are NaN
    where fewer than `FEWEST_EPISODES` different ones tell of a component.

    Args:
        time_axis: what the components mean.
        status: N+1 of them. `good`: surely better than a constant guess, or right where the reward
            was always the same. `bad`: surely no better, or wrong there; but where hardly any
            episode differs, only if wrong by more than could be put down to what is too rare to be
            seen. `open`: too few episodes tell. `not tested`: no reward came then or later, nor was
            expected, or nothing is known of what came.
        constant: `[N+1]`, whether what was observed was always the same; then there is no skill.
        num_samples: `[N+1]`, the steps of which it is known what followed.
        num_episodes: `[N+1]`, the different episodes that these are from.
        enough: N+1 times, about how many different episodes would tell, where too few do; None
            where nobody can say.
        bias: `[N+1]`, the mean of predicted − observed; where hardly any episode differs its
            interval is as much wider as what is too rare to be seen could make it.
        error: `[N+1]`, the mean of (predicted − observed)².
        mean: `[N+1]`, of what was observed.
        variance: `[N+1]`, of what was observed: the error of the best constant prediction.
        skill: `[N+1]`, 1 − error / error of the best constant prediction; 1 is perfect, 0 no better
            than a constant.
        predicted_range: `[2, N+2]`, the least and the most that was predicted of every component,
            and of all together.
        observed_range: `[2, N+2]`, the same of what was observed.
        reliability: what came where a reward was predicted with some probability; None where
            rewards are not either 0 or one amount, and for w > 1.
    """

    time_axis: TimeAxis
    status: tuple[Status, ...]
    constant: BoolArray
    num_samples: IntArray
    num_episodes: IntArray
    enough: tuple[int | None, ...]
    bias: Estimates
    error: Estimates
    mean: FloatArray
    variance: FloatArray
    skill: Estimates
    predicted_range: FloatArray
    observed_range: FloatArray
    reliability: "Reliability | None"

    def is_(self, status: Status) -> BoolArray:
        """Returns `[N+1]`: the components of a status."""
        return np.array([own == status for own in self.status])

    @property
    def trust(self) -> Trust:
        """How far such forecasts can be trusted."""
        return Trust(self.time_axis, self.status)

    @property
    def off_by(self) -> FloatArray:
        """`[N+1]`: the root mean square of predicted − observed; NaN where it is not known."""
        return np.where(np.isfinite(self.error.low), np.sqrt(self.error.value), np.nan)


def calibrate(episodes: Sequence[Episode] | Samples, *, seed: int = 0) -> Calibration:
    """Returns how well each component was predicted.

    Args:
        episodes: what was predicted and what happened, or the samples of that.
        seed: of the bootstrap.

    Raises:
        InputError: there are no episodes, or they are of different time axes.
    """
    samples = episodes if isinstance(episodes, Samples) else pool(episodes)
    axis, known, observed = samples.time_axis, samples.known, samples.observed
    num_samples = known.sum(axis=0)
    seen = num_samples > 0
    mean = np.where(seen, observed.sum(axis=0) / np.maximum(num_samples, 1), np.nan)
    o = np.where(known, observed - mean, 0.0)  # so that squares do not swallow what is small
    e = np.where(known, samples.predicted - observed, 0.0)
    parts = (known.astype(np.float64), e, e * e, o, o * o)
    sums = np.stack([samples.per_episode(part) for part in parts], axis=1)  # [E, 5, N+1]
    varies = np.abs(o).max(axis=0) > _ROUNDING * np.abs(observed).max(axis=0)
    constant = seen & ~varies

    num_episodes = different_episodes(sums, sums[:, 0] > 0)
    telling = np.minimum(num_episodes, effective(sums[:, 4]) * varies)
    rare = telling < FEWEST_EPISODES
    ranges = [_range(of) for of in (samples.predicted, observed)]
    missed = _could_be_missed(axis, num_episodes, ranges)

    shown = np.stack([seen, seen, varies, seen])
    found = by_episode(sums, _statistics, seed=seed)  # [4, N+1]
    found = found.where(shown, shown & (num_episodes >= FEWEST_EPISODES))
    wider = np.eye(4)[0][:, None] * np.where(rare, missed, 0.0)  # of the bias alone
    ends = zip(found.value, found.low - wider, found.high + wider, strict=True)
    bias, error, skill, variance = (Estimates(*of) for of in ends)

    right = error.value <= _allowed(axis, mean, np.where(varies, variance.value, np.nan))
    wrong = np.abs(bias.value) > missed
    untested = ~seen | (constant & ~_pays(mean) & ~wrong)
    is_good = np.where(constant, right, skill.low > 0.0)
    is_bad = (constant & wrong) | ((skill.high <= 0.0) & (wrong | ~rare))
    status = np.select([untested, is_good, is_bad], ["not tested", "good", "bad"], "open")
    return Calibration(
        time_axis=axis,
        status=tuple(status.tolist()),
        constant=constant,
        num_samples=num_samples,
        num_episodes=num_episodes,
        enough=tuple(
            _enough(count, telling[i], skill[i], missed[i], bias.value[i])
            for i, count in enumerate(num_episodes.tolist())
        ),
        bias=bias,
        error=error,
        mean=mean,
        variance=variance.value,
        skill=skill,
        predicted_range=ranges[0],
        observed_range=ranges[1],
        reliability=reliability_of(samples),
    )


def _statistics(sums: FloatArray) -> FloatArray:
    """Returns `[R, 4, N+1]`: bias, error, skill and variance of pooled sums `[R, 5, N+1]`.

    The sums are of 1, e = predicted − observed, e², o and o², with o counted from the mean of what
    was observed. Where a sample has no variance, its skill is −∞ if there was an error and does not
    exist if there was none.
    """
    n, e, ee, o, oo = np.moveaxis(sums, 1, 0)
    variance = np.maximum(oo / n - (o / n) ** 2, 0.0)
    return np.stack([e / n, ee / n, 1.0 - (ee / n) / variance, variance], axis=1)


def _pays(mean: FloatArray) -> BoolArray:
    """Returns `[N+1]`: whether rewards came then, or later at an explicit component."""
    pays = np.nan_to_num(mean) != 0.0
    return np.append(np.maximum.accumulate(pays[-2::-1])[::-1], pays[-1])


def _allowed(axis: TimeAxis, mean: FloatArray, variance: FloatArray) -> FloatArray:
    """Returns `[N+1]`: the error of a forecast that is right, where the reward is always the same.

    It is a tenth of that reward or, undiscounted, of the error of a constant guess at components
    `variance [N+1]` of which something is to be predicted (NaN where nothing is).
    """
    scale = np.maximum(axis.discounts, np.finfo(np.float64).tiny) ** 2
    guess = (variance / scale)[~np.isnan(variance)]
    usual = SLACK * guess.mean() if guess.size else 0.0
    return np.asarray(np.maximum((SLACK * mean) ** 2, usual * scale))


def _could_be_missed(
    axis: TimeAxis, num_episodes: IntArray, ranges: Sequence[FloatArray]
) -> FloatArray:
    """Returns `[N+1]`: by how much a mean can be off because of what is too rare to be seen.

    That is the chance of what came in none of so many different episodes, times the largest amount
    that was seen, or predicted, at any component.
    """
    discounts = np.maximum(axis.discounts, np.finfo(np.float64).tiny)
    largest = np.abs(np.stack(ranges)[..., :-1] / discounts).max()
    missed = np.array([unseen(count) for count in num_episodes.tolist()])
    return np.asarray(missed * largest * discounts)


def _enough(count: int, telling: float, skill: Estimate, missed: float, bias: float) -> int | None:
    """Returns how many different episodes would tell; what could be missed shrinks as they grow."""
    if telling == 0.0:  # the reward was always the same
        return enough(count, np.sqrt(missed), np.sqrt(abs(bias)))
    if count < FEWEST_EPISODES:
        return FEWEST_EPISODES
    if telling < FEWEST_EPISODES:
        return enough(count, np.sqrt(FEWEST_EPISODES), np.sqrt(telling))
    reach = skill.value - skill.low if skill.value > 0.0 else skill.high - skill.value
    return enough(count, reach, skill.value)


def _range(components: FloatArray) -> FloatArray:
    """Returns `[2, N+2]`: the least and the most of components `[M, N+1]`, and of their sum."""
    rows = np.column_stack([components, components.sum(axis=1)])
    return np.stack([rows.min(axis=0), rows.max(axis=0)])


# ---- where a reward was predicted with some probability, how often it came -----------------------


@dataclass(frozen=True, eq=False)
class Reliability:
    """How often the one amount that is ever paid came, by the probability that was predicted.

    Where each observed reward is either 0 or c, a component divided by γ^k·c is the probability
    that step k pays (errata P10).

    Args:
        amount: c.
        counts: `[N, bins]`, the predictions in each of as many equal parts of [0, 1]; those below
            0 and above 1, which are no probabilities, are in the first and the last.
        predicted: `[N, bins]`, their mean; NaN where there is none.
        observed: `[N, bins]`, the share of them that was followed by the reward.
    """

    amount: float
    counts: IntArray
    predicted: FloatArray
    observed: FloatArray


def reliability_of(samples: Samples) -> Reliability | None:
    """Returns the reliability of every explicit component, None where it is not defined.

    It is defined for w = 1 and γ > 0, where every observed reward is 0 or one and the same amount.
    """
    axis = samples.time_axis
    if axis.width != 1 or axis.horizon == 0 or axis.discounts[-2] == 0.0:
        return None
    rewards = samples.observed[:, :-1] / axis.discounts[:-1]  # [M, N]
    paid = rewards[rewards != 0.0]
    if not paid.size or np.ptp(paid) > 1e-9 * np.abs(paid).max():
        return None
    amount = float(np.median(paid))
    chance = samples.predicted[:, :-1] / (axis.discounts[:-1] * amount)  # [M, N]
    known = samples.known[:, :-1]
    part = np.clip((chance * NUM_BINS).astype(np.int64), 0, NUM_BINS - 1)
    cells = (part + np.arange(axis.horizon) * NUM_BINS)[known]  # one number per component and bin

    def sums(weights: FloatArray) -> FloatArray:
        total = np.bincount(cells, weights[known], minlength=axis.horizon * NUM_BINS)
        return np.asarray(total.reshape(axis.horizon, NUM_BINS))

    counts = sums(np.ones(known.shape))
    shown = np.where(counts > 0, counts, np.nan)
    return Reliability(
        amount=amount,
        counts=counts.astype(np.int64),
        predicted=sums(chance) / shown,
        observed=sums((rewards != 0.0).astype(np.float64)) / shown,
    )
