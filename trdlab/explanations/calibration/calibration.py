"""Calibration: what was predicted for each step against the reward that then came."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.explanations.calibration.reliability import Reliability, reliability_of
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import Samples, pool
from trdlab.statistics import (
    FEWEST_EPISODES,
    Estimate,
    Estimates,
    by_episode,
    different_episodes,
    enough,
    unseen,
)

Status = Literal["good", "bad", "open", "not tested"]
SLACK = 0.1
"""How wrong a forecast may be where the reward was always the same, as a share of it."""

_ROUNDING = 1e-12  # relative; rewards that differ by less are the same reward


@dataclass(frozen=True, eq=False)
class Calibration:
    """How well each component was predicted, over the steps of whole episodes.

    All are in units of discounted reward. Intervals are bootstrapped by episode; they are NaN
    where fewer than `FEWEST_EPISODES` different ones tell of a component.

    Args:
        time_axis: what the components mean.
        status: N+1 of them. `good`: surely better than a constant guess, or right where the reward
            was always the same. `bad`: surely no better, or wrong there by more than could be put
            down to what is too rare to be seen. `open`: too few episodes tell. `not tested`: no
            reward came then or later, nor was expected, or nothing is known of what came.
        constant: `[N+1]`, whether what was observed was always the same; then there is no skill.
        num_samples: `[N+1]`, the steps of which it is known what followed.
        num_episodes: `[N+1]`, the different episodes that these are from.
        enough: N+1 times, about how many different episodes would tell, where too few do; None
            where nobody can say.
        bias: `[N+1]`, the mean of predicted − observed.
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
    reliability: Reliability | None

    def is_(self, status: Status) -> BoolArray:
        """Returns `[N+1]`: the components of a status."""
        return np.array([own == status for own in self.status])


def calibrate(episodes: Sequence[Episode] | Samples, *, seed: int = 0) -> Calibration:
    """Returns how well each component was predicted.

    Args:
        episodes: what was predicted and what happened, or the samples of that.
        seed: of the bootstrap.

    Raises:
        InputError: there are no episodes, or they are of different time axes.
    """
    samples = episodes if isinstance(episodes, Samples) else pool(episodes)
    sums, constant = _sums(samples)
    estimates = by_episode(sums, _statistics, seed=seed)
    num_episodes = different_episodes(sums, sums[:, 0] > 0)
    num_samples = samples.known.sum(axis=0)
    seen, many = num_samples > 0, num_episodes >= FEWEST_EPISODES
    bias, error, skill = (
        Estimates(estimates.value[i], estimates.low[i], estimates.high[i]).where(
            shown, shown & many
        )
        for i, shown in enumerate((seen, seen, seen & ~constant))
    )
    mean = np.where(seen, samples.observed.sum(axis=0) / np.maximum(num_samples, 1), np.nan)
    ranges = [_range(samples, of) for of in (samples.predicted, samples.observed)]
    missed = _could_be_missed(samples.time_axis, num_episodes, ranges)
    variance = _variance(*sums[:, [0, 3, 4]].sum(axis=0))
    right = error.value <= _allowed(samples.time_axis, mean, np.where(constant, np.nan, variance))
    wrong = np.abs(bias.value) > missed
    return Calibration(
        time_axis=samples.time_axis,
        status=tuple(
            map(_status, seen, constant, _pays(mean), right, wrong, skill.low, skill.high)
        ),
        constant=seen & constant,
        num_samples=num_samples,
        num_episodes=num_episodes,
        enough=tuple(
            _enough(count, skill[i], bool(constant[i]), float(missed[i]), float(bias.value[i]))
            for i, count in enumerate(num_episodes.tolist())
        ),
        bias=bias,
        error=error,
        mean=mean,
        variance=variance,
        skill=skill,
        predicted_range=ranges[0],
        observed_range=ranges[1],
        reliability=reliability_of(samples),
    )


def _status(
    seen: bool, constant: bool, pays: bool, right: bool, wrong: bool, low: float, high: float
) -> Status:
    if not constant:
        return "good" if low > 0.0 else "bad" if high <= 0.0 else "open"
    if not seen or not (pays or wrong):
        return "not tested"
    return "good" if right else "bad" if wrong else "open"


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


def _enough(count: int, skill: Estimate, constant: bool, missed: float, bias: float) -> int | None:
    """Returns how many different episodes would tell; what could be missed shrinks as they grow."""
    if constant:
        return enough(count, np.sqrt(missed), np.sqrt(abs(bias)))
    if count < FEWEST_EPISODES:
        return FEWEST_EPISODES
    reach = skill.value - skill.low if skill.value > 0.0 else skill.high - skill.value
    return enough(count, reach, skill.value)


def _range(samples: Samples, components: FloatArray) -> FloatArray:
    """Returns `[2, N+2]`: the least and the most of every component, and of their sum."""
    rows = np.column_stack([components, components.sum(axis=1)])
    return np.stack([rows.min(axis=0), rows.max(axis=0)])


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


def _sums(samples: Samples) -> tuple[FloatArray, BoolArray]:
    """Returns `[E, 5, N+1]`, the sums of each episode, and `[N+1]`, what is constant.

    The sums are of 1, e = predicted − observed, e², o and o², with o counted from the mean of all
    o, so that squares do not swallow what is small.
    """
    known, observed = samples.known, samples.observed
    count = np.maximum(known.sum(axis=0), 1)
    centre = observed.sum(axis=0) / count  # [N+1]; what is not known is 0
    o = np.where(known, observed - centre, 0.0)
    e = np.where(known, samples.predicted - observed, 0.0)
    constant = np.abs(o).max(axis=0) <= _ROUNDING * np.abs(observed).max(axis=0)
    parts = (known.astype(np.float64), e, e * e, o, o * o)
    return np.stack([samples.per_episode(part) for part in parts], axis=1), np.asarray(constant)


def _statistics(sums: FloatArray) -> FloatArray:
    """Returns `[R, 3, N+1]`: bias, error and skill of pooled sums `[R, 5, N+1]`.

    Where a sample has no variance, its skill is −∞ if there was an error and does not exist if
    there was none.
    """
    n, e, ee, o, oo = np.moveaxis(sums, 1, 0)
    return np.stack([e / n, ee / n, 1.0 - (ee / n) / _variance(n, o, oo)], axis=1)


def _variance(count: FloatArray, total: FloatArray, squares: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.maximum(squares / count - (total / count) ** 2, 0.0))
