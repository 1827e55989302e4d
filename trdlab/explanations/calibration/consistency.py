"""Consistency: do the components of one step fit those of the next?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trdlab.arrays import RELATIVE_ZERO, BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import common_axis, windows
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
        discount: what the next explicit components are really multiplied by; γ^w if all is well.
        discount_explains: the share of the gaps between explicit components that this mends; 1 if
            nothing else is wrong with them.
        past_end: how much of what is expected after the end of an episode counts although it ended,
            as a share of γ^w; 0 if all is well, 1 where ends are ignored.
        past_reset: the part of that which is expected in the first observation of an episode: what
            comes next where an environment resets itself. The other part is expected in the true
            last one.
        end_explains: the share of all gaps that this mends.
    """

    time_axis: TimeAxis
    num_transitions: int
    num_ends: int
    gap: Estimates
    discount: Estimate
    discount_explains: Estimate
    past_end: Estimate
    past_reset: Estimate
    end_explains: Estimate


def consistency_of(episodes: Sequence[Episode], *, seed: int = 0) -> Consistency:
    """Compares the components of steps t and t+w with each other; no reward is looked at.

    With n the components of the action taken at t, n′ those expected at t+w, g = 1 where the
    episode went on and 0 where it ended, and y and z what is expected in the last observation of
    the episode and in a first one, the mean gaps n_i − γ^w·g·n′_(i−1), i ≥ 1, are fitted by least
    squares: by a·g·n′_(i−1), where the discount is γ^w + a, and, apart from that, by
    b·(1−g)·y_(i−1) + c·(1−g)·z_(i−1). By the law a = b = c = 0. Means are compared, because where
    there is chance a step fits the next on average only; over steps of about the same age, because
    the age is known before anything happens.

    The residual tells no discount. It is learned from itself, so it lags behind for 1/(1 − γ^w)
    copies to the target network, and that looks like another discount.

    Raises:
        InputError: there are no episodes, or of different time axes; there are no components to
            compare (N = 0), or no two steps w apart.
    """
    axis, pairs = common_axis(episodes), [windows(episode, fair=True) for episode in episodes]
    ages, _, ended = (np.concatenate(of) for of in zip(*pairs, strict=True))
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
    gaps, enough = sums[:, 1] - discount * sums[:, 2], has_enough(sums)  # [E, ages, N]
    count, gap = (pooled(drawn, of.sum(axis=1)) for of in (sums[:, 0], gaps))  # [1 + R, N]
    more, explains = _fitted(drawn, gaps[..., :-1], sums[:, 2:3, :, :-1])
    last, reset, end_explains = _fitted(drawn, gaps, sums[:, 3:])
    past = (last + reset) / discount, reset / discount
    estimates = percentiles(np.stack([discount + more, explains, *past, end_explains], 1), enough)
    return Consistency(
        time_axis=axis,
        num_transitions=len(ages),
        num_ends=int(ended.sum()),
        gap=percentiles(gap / np.maximum(count, 1.0), enough),
        discount=estimates[0],
        discount_explains=estimates[1],
        past_end=estimates[2],
        past_reset=estimates[3],
        end_explains=estimates[4],
    )


def _sums(
    episode: Episode,
    t: IntArray,
    last: IntArray,
    ended: BoolArray,
    edges: FloatArray,
    first: FloatArray,
) -> FloatArray:
    """Returns `[5, ages, N]`: of 1, before, and after where it goes on, ends, and is reset."""
    before, after = (
        episode.predicted[t, 1:].astype(np.float64),
        _shifted(episode.expected[last + 1]),
    )
    on, over = ~ended[:, None], ended[:, None]
    parts = (np.ones_like(before), before, after * on, after * over, first * over)
    age = np.searchsorted(edges, t, side="right")
    of_age = (age == np.arange(len(edges) + 1)[:, None]).astype(np.float64)  # [ages, K]
    return np.asarray(of_age @ np.stack(parts))


def _shifted(components: FloatArray) -> FloatArray:
    """Returns `[..., N]`: the components one place later, the last two together."""
    folded = components[..., -2:].sum(axis=-1, keepdims=True)
    return np.concatenate([components[..., :-2], folded], axis=-1)


def _fitted(drawn: FloatArray, gaps: FloatArray, causes: FloatArray) -> FloatArray:
    """Returns `[n + 1, 1 + R]`: how much of each cause makes the gaps, and the share it explains.

    Gaps are `[E, ages, i]`, causes `[E, n, ages, i]`; NaN where no cause is seen. Products are
    taken between different episodes only, where chance is independent: that of what follows would
    otherwise make the discount too small.
    """
    sums = np.concatenate([gaps[:, None], causes], axis=1)
    if not sums.size:
        return np.full((sums.shape[1], len(drawn)), np.nan)
    sums = sums.reshape(*sums.shape[:2], -1)  # [E, 1 + n, cells]
    total = pooled(drawn, sums)  # [1 + R, 1 + n, cells]
    same = pooled(drawn**2, sums @ sums.transpose(0, 2, 1))  # [1 + R, 1 + n, 1 + n]
    products = total @ total.transpose(0, 2, 1) - same
    solved = np.linalg.pinv(products[:, 1:, 1:], rcond=1e-10, hermitian=True)
    factors = (solved @ products[:, 1:, :1])[..., 0].T  # [n, 1 + R]
    explained = (factors * products[:, 1:, 0].T).sum(axis=0)
    size = np.where(products[:, 0, 0] > 0.0, products[:, 0, 0], np.nan)
    seen = total[:, 1:].any(axis=(1, 2))  # [1 + R]
    return np.where(seen, np.stack([*factors, explained / size]), np.nan)
