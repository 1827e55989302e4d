"""Calibration: what was predicted for each step against the reward that then came."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.explanations.calibration.reliability import Reliability, reliability
from trdlab.intervals import (
    FEWEST_EPISODES,
    LEVEL,
    RESAMPLES,
    Estimates,
    by_episode,
    different_episodes,
)
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import Samples, pool

State = Literal["judged", "nothing to predict", "too few episodes", "unknown"]

_ROUNDING = 1e-12  # relative; rewards that differ by less are the same reward


@dataclass(frozen=True, eq=False)
class Calibration:
    """How well each component was predicted, over the steps of whole episodes.

    All are in units of discounted reward. Intervals are bootstrapped by episode; they are NaN
    where there are `too few episodes`.

    Args:
        time_axis: what the components mean.
        states: N+1 of them. `judged`: there is a skill, with an interval. `nothing to predict`:
            the observed reward was always the same, so there is no skill. `too few episodes`:
            fewer different ones than `FEWEST_EPISODES` tell of it. `unknown`: none does.
        num_samples: `[N+1]`, the steps of which it is known what followed.
        num_episodes: `[N+1]`, the different episodes that these are from.
        bias: `[N+1]`, the mean of predicted − observed.
        error: `[N+1]`, the mean of (predicted − observed)².
        mean: `[N+1]`, of what was observed.
        variance: `[N+1]`, of what was observed: the error of the best constant prediction.
        skill: `[N+1]`, 1 − error / error of the best constant prediction; 1 is perfect, 0 no better
            than a constant.
        correlation: `[N+1]`, of predicted and observed; NaN where one of them is constant.
        reliability: what came where a reward was predicted with some probability; None where
            rewards are not either 0 or one amount, and for w > 1.
    """

    time_axis: TimeAxis
    states: tuple[State, ...]
    num_samples: IntArray
    num_episodes: IntArray
    bias: Estimates
    error: Estimates
    mean: FloatArray
    variance: FloatArray
    skill: Estimates
    correlation: Estimates
    reliability: Reliability | None

    def is_(self, state: State) -> BoolArray:
        """Returns `[N+1]`: the components in a state."""
        return np.array([own == state for own in self.states])


@dataclass(frozen=True)
class Endings:
    """How episodes ended.

    Args:
        terminated: how many ended for good.
        truncated: how many were cut off.
        life_losses: how often a life was lost and the episode went on.
        life_loss_ends: whether that counts as an end.
        time_limit: the steps after which they were cut off, if that is known.
    """

    terminated: int
    truncated: int
    life_losses: int
    life_loss_ends: bool
    time_limit: int | None = None


def endings(episodes: Sequence[Episode]) -> Endings:
    """Returns how episodes ended."""
    limits = {episode.time_limit for episode in episodes}
    return Endings(
        terminated=sum(episode.terminated for episode in episodes),
        truncated=sum(not episode.terminated for episode in episodes),
        life_losses=sum(int(episode.life_lost.sum()) for episode in episodes),
        life_loss_ends=any(bool((e.life_lost & e.ends).any()) for e in episodes),
        time_limit=limits.pop() if len(limits) == 1 else None,
    )


def calibrate(
    episodes: Sequence[Episode] | Samples,
    *,
    seed: int = 0,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
) -> Calibration:
    """Returns how well each component was predicted.

    Args:
        episodes: what was predicted and what happened, or the samples of that.
        seed: of the bootstrap.
        level: the probability that the intervals are made for.
        resamples: how many samples of episodes are drawn.

    Raises:
        InputError: there are no episodes, or they are of different time axes.
    """
    samples = episodes if isinstance(episodes, Samples) else pool(episodes)
    sums, constant = _sums(samples)
    rng = np.random.default_rng(seed)
    estimates = by_episode(sums, _statistics, rng=rng, level=level, resamples=resamples)
    num_episodes = different_episodes(sums, sums[:, 0] > 0)
    num_samples = samples.known.sum(axis=0)
    states = [_state(*of) for of in zip(num_samples, num_episodes, constant, strict=True)]
    seen, many = num_samples > 0, num_episodes >= FEWEST_EPISODES
    bias, error, skill, correlation = (
        Estimates(estimates.value[i], estimates.low[i], estimates.high[i]).where(
            shown, shown & many
        )
        for i, shown in enumerate((seen, seen, seen & ~constant, seen & ~constant))
    )
    return Calibration(
        time_axis=samples.time_axis,
        states=tuple(states),
        num_samples=num_samples,
        num_episodes=num_episodes,
        bias=bias,
        error=error,
        mean=np.where(seen, samples.observed.sum(axis=0) / np.maximum(num_samples, 1), np.nan),
        variance=_variance(*sums[:, [0, 3, 4]].sum(axis=0)),
        skill=skill,
        correlation=correlation,
        reliability=reliability(samples),
    )


def _state(num_samples: int, num_episodes: int, constant: bool) -> State:
    if num_samples == 0:
        return "unknown"
    if constant:
        return "nothing to predict"
    return "judged" if num_episodes >= FEWEST_EPISODES else "too few episodes"


def _sums(samples: Samples) -> tuple[FloatArray, BoolArray]:
    """Returns `[E, 8, N+1]`, the sums of each episode, and `[N+1]`, what is constant.

    The sums are of 1, e = predicted − observed, e², o, o², p and p·o, with p and o counted from the
    mean of all o, so that squares do not swallow what is small.
    """
    known, observed = samples.known, samples.observed
    count = np.maximum(known.sum(axis=0), 1)
    centre = observed.sum(axis=0) / count  # [N+1]; what is not known is 0
    o = np.where(known, observed - centre, 0.0)
    p = np.where(known, samples.predicted - centre, 0.0)
    scale = np.abs(observed).max(axis=0)
    constant = np.abs(o).max(axis=0) <= _ROUNDING * scale
    e = p - o
    parts = (known.astype(np.float64), e, e * e, o, o * o, p, p * p, p * o)
    return np.stack([samples.per_episode(part) for part in parts], axis=1), np.asarray(constant)


def _statistics(sums: FloatArray) -> FloatArray:
    """Returns `[R, 4, N+1]`: bias, error, skill and correlation of pooled sums `[R, 8, N+1]`.

    Where a sample has no variance, its skill is −∞ if there was an error and does not exist if
    there was none.
    """
    n, e, ee, o, oo, p, pp, po = np.moveaxis(sums, 1, 0)
    variance_o, variance_p = _variance(n, o, oo), _variance(n, p, pp)
    skill = 1.0 - (ee / n) / variance_o
    correlation = (po / n - o * p / n**2) / np.sqrt(variance_o * variance_p)
    return np.stack([e / n, ee / n, skill, correlation], axis=1)


def _variance(count: FloatArray, total: FloatArray, squares: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.maximum(squares / count - (total / count) ** 2, 0.0))
