"""Consistency: do the components of one step fit those of the next?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trdlab.arrays import RELATIVE_ZERO, BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import common_axis, next_flag
from trdlab.statistics import Estimate, Estimates, draws, has_enough, percentiles, pooled

NUM_AGES = 6


@dataclass(frozen=True, eq=False)
class Consistency:
    """How the components of one step follow from those of w steps later.

    By the law component i ≥ 1 is γ^w times component i−1 of the next state, on average, and
    nothing where the episode ended; the residual is γ^w times the last two together.

    Args:
        time_axis: what the components mean.
        num_transitions: how many pairs of steps were compared.
        num_ends: how many of them ended in between.
        gap: `[N]`, the mean of component i ≥ 1 less γ^w times what follows it; 0 if all is well.
        discount: what the next components are really multiplied by; γ^w if all is well.
        discount_near: the same of the nearer components alone, those that hold half of what is
            expected from component 1 on.
        discount_far: the same of the others; NaN where there are none.
        explained: the share of the components' size that fits what follows them, whatever the
            discount; near 1 unless they contradict each other in other ways.
        past_end: how much of what is expected after the end of an episode counts although it ended,
            as a share of γ^w; 0 if all is well, 1 where ends are ignored.
        past_reset: the part of that which is expected in the first observation of an episode: what
            comes next where an environment resets itself. The other part is expected in the true
            last one.
    """

    time_axis: TimeAxis
    num_transitions: int
    num_ends: int
    gap: Estimates
    discount: Estimate
    discount_near: float
    discount_far: float
    explained: float
    past_end: Estimate
    past_reset: Estimate


def consistency_of(episodes: Sequence[Episode], *, seed: int = 0) -> Consistency:
    """Compares the components of steps t and t+w with each other; no reward is looked at.

    With n the components of the action taken at t, n′ those expected at t+w, g = 1 where the
    episode went on and 0 where it ended, and y and z what is expected in the last observation of
    the episode and in a first one, the means of n_i are fitted, over all i ≥ 1, by
    d·g·n′_(i−1) + b·(1−g)·y_(i−1) + c·(1−g)·z_(i−1), by least squares. By the law d = γ^w and
    b = c = 0. Means are compared, because where there is chance a step fits the next on average
    only; over steps of about the same age, because the age is known before anything happens.

    Raises:
        InputError: there are no episodes, or of different time axes; there are no components to
            compare (N = 0), or no two steps w apart.
    """
    axis, pairs = common_axis(episodes), [_pairs(episode) for episode in episodes]
    ages, _, goes_on = (np.concatenate(of) for of in zip(*pairs, strict=True))
    if axis.horizon == 0 or not ages.size:
        raise InputError(
            f"There are {ages.size} pairs of steps to compare, N is {axis.horizon}.",
            "Decompose with N of at least 1, and play longer episodes.",
        )
    edges = np.unique(np.quantile(ages, np.arange(1, NUM_AGES) / NUM_AGES, method="higher"))
    first = _shifted(np.mean([episode.expected[0] for episode in episodes], axis=0))  # [N]
    each = zip(episodes, pairs, strict=True)
    sums = np.stack([_sums(episode, *of, edges, first) for episode, of in each])  # [E, 5, ages, N]
    scale = max(float(np.abs(of.decomposition.components).max()) for of in episodes)
    sums[:, 1:] *= np.abs(sums[:, 1:]) > RELATIVE_ZERO * scale  # the rest is rounding
    drawn, discount = draws(len(sums), seed), axis.gamma**axis.width  # [1 + R, E]
    count, before, after = pooled(drawn, sums[:, :3].sum(axis=2)).transpose(1, 0, 2)
    gap = (before - discount * after) / np.maximum(count, 1.0)  # [1 + R, N]
    mass = np.abs(before[0]).cumsum()  # [N]
    near = np.arange(axis.horizon) <= (mass >= mass[-1] / 2.0).argmax()
    fitted, enough = _fitted(drawn, sums[:, 1:], discount), has_enough(sums)
    estimates = percentiles(fitted, enough)
    return Consistency(
        time_axis=axis,
        num_transitions=len(ages),
        num_ends=int((~goes_on).sum()),
        gap=percentiles(gap, enough),
        discount=estimates[0],
        discount_near=_fitted(drawn[:1], sums[:, 1:, :, near], discount)[0, 0],
        discount_far=_fitted(drawn[:1], sums[:, 1:, :, ~near], discount)[0, 0],
        explained=fitted[0, 3],
        past_end=estimates[1],
        past_reset=estimates[2],
    )


def _pairs(episode: Episode) -> tuple[IntArray, IntArray, BoolArray]:
    """Returns `[K]` thrice: t, the observation at t+w, or the last one, and whether it goes on.

    Left out are pairs with a random action after the first, and those that reach beyond a
    truncation (see `what_followed`).
    """
    total, width, far = len(episode), episode.time_axis.width, np.iinfo(np.int64).max
    t = np.arange(total)
    end = next_flag(episode.ends, far)  # [T]
    random = next_flag(np.append(episode.random, False), far)[1 : total + 1]
    goes_on = end >= t + width
    usable = (~goes_on | (t + width <= total)) & (random >= t + width)
    if episode.time_limit is not None:
        usable &= t + width <= episode.time_limit
    to = np.where(goes_on, t + width, np.minimum(end, total - 1) + 1)
    return t[usable], to[usable], goes_on[usable]


def _sums(
    episode: Episode,
    t: IntArray,
    to: IntArray,
    goes_on: BoolArray,
    edges: FloatArray,
    first: FloatArray,
) -> FloatArray:
    """Returns `[5, ages, N]`: of 1, before, and after where it goes on, ends, and is reset."""
    before, after = episode.predicted[t, 1:].astype(np.float64), _shifted(episode.expected[to])
    on, over = goes_on[:, None], ~goes_on[:, None]
    parts = (np.ones_like(before), before, after * on, after * over, first * over)
    age = np.searchsorted(edges, t, side="right")
    of_age = (age == np.arange(len(edges) + 1)[:, None]).astype(np.float64)  # [ages, K]
    return np.asarray(of_age @ np.stack(parts))


def _shifted(components: FloatArray) -> FloatArray:
    """Returns `[..., N]`: the components one place later, the last two together."""
    folded = components[..., -2:].sum(axis=-1, keepdims=True)
    return np.concatenate([components[..., :-2], folded], axis=-1)


def _fitted(drawn: FloatArray, sums: FloatArray, discount: float) -> FloatArray:
    """Returns `[1 + R, 4]`: d, (b + c)/γ^w, c/γ^w and the share that they explain.

    They are fitted to sums `[E, 4, ages, n]` as `consistency_of` says. Products are taken between
    different episodes only, where chance is independent: that of what follows would otherwise make
    d too small.
    """
    sums = sums.reshape(len(sums), 4, -1)  # [E, 4, cells]
    if not sums.size:
        return np.full((len(drawn), 4), np.nan)
    total = pooled(drawn, sums)  # [1 + R, 4, cells]
    same = pooled(drawn**2, sums @ sums.transpose(0, 2, 1))  # [1 + R, 4, 4]
    products = total @ total.transpose(0, 2, 1) - same
    solved = np.linalg.pinv(products[:, 1:, 1:], rcond=1e-10, hermitian=True)
    d, b, c = factors = (solved @ products[:, 1:, :1])[..., 0].T  # 3 of [1 + R]
    explained = (factors * products[:, 1:, 0].T).sum(axis=0)
    size = np.where(products[:, 0, 0] > 0.0, products[:, 0, 0], np.nan)
    seen = np.abs(total[:, 1:]).max(axis=2) > 0.0  # [1 + R, 3]
    past = np.where(seen[:, 1:].any(axis=1), (b + c) / discount, np.nan)
    reset = np.where(seen[:, 2], c / discount, np.nan)
    return np.stack([np.where(seen[:, 0], d, np.nan), past, reset, explained / size], axis=1)
