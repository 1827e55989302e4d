"""Blame: what is wrong with the errors of a forecast: the timing, the amount, the sharpness."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.intervals import LEVEL, RESAMPLES, by_episode, draws, has_enough, pooled
from trdlab.rollouts.realised import Samples
from trdlab.statistics import Estimate

LARGEST_SHIFT = 10
AGREEMENT = 0.99
"""The share of bootstrap samples in which a shift must be the best one, to be blamed."""
MIN_DISCOUNT = float(np.finfo(np.float64).tiny) ** 0.25
"""Below this the discount of a component cannot be taken out of it again."""
SLACK = 0.1
"""How far from 1 an amount may be, before it is blamed."""


@dataclass(frozen=True, eq=False)
class Blame:
    """The error of each component, split into what would mend it.

    Rewards are compared undiscounted, each group as seen from its own start, so that a component
    can stand in for its neighbour. One repair follows another: components are moved by `shift`
    places, divided by `amount` if that `is_off`, and sharpened by `smear` if that is surely above
    0. What each of them takes off the error is what it is to blame for; the rest is chance and
    everything else.

    Args:
        time_axis: what the components mean.
        shift: by how many components rewards are predicted too late; negative if too early. It is
            0 unless another one is the best in nearly all bootstrap samples.
        agreement: the share of bootstrap samples in which `best_shift` is the best.
        best_shift: the shift at which predictions correlate best with what followed.
        amount: how many times as much is predicted as comes. NaN where no amount was told from 0.
        smear: x, where p + x·(2p − p₋ − p₊) is the best prediction that can be had from p and its
            neighbours p₋ and p₊. Above 0, rewards are smeared over neighbouring components; below,
            there is noise that differs between neighbours. A prediction that is rightly unsure of
            the timing has 0.
        error: `[N]`, the mean square error in units of discounted reward; NaN where the shift
            moves a component out of what is predicted.
        timing: `[N]`, the part of it that the shift takes off.
        scale: `[N]`, the part that the amount takes off then.
        sharpness: `[N]`, the part that sharpening takes off then.
        rest: `[N]`, what is left.
    """

    time_axis: TimeAxis
    shift: int
    agreement: float
    best_shift: int
    amount: Estimate
    smear: Estimate
    error: FloatArray
    timing: FloatArray
    scale: FloatArray
    sharpness: FloatArray
    rest: FloatArray


def blame(
    samples: Samples, *, seed: int = 0, level: float = LEVEL, resamples: int = RESAMPLES
) -> Blame:
    """Splits the error of each explicit component into timing, amount, smear and the rest.

    Args:
        samples: predictions and what followed them.
        seed: of the bootstrap, which is by episode.
        level: the probability that the intervals are made for.
        resamples: how many samples of episodes are drawn.

    Raises:
        InputError: there are fewer than 2 explicit components, or their discounts vanish.
    """
    axis = samples.time_axis
    if axis.horizon < 2 or axis.discounts[-2] < MIN_DISCOUNT:
        raise InputError(
            f"Components of {axis} cannot stand in for each other.",
            "Decompose with N of at least 2, and γ above 0.",
        )
    bootstrap = _Bootstrap(samples, np.random.default_rng(seed), level, resamples)
    known = samples.known[:, :-1]  # [M, N]
    p = samples.predicted[:, :-1] / axis.discounts[:-1]
    o = np.where(known, samples.observed[:, :-1] / axis.discounts[:-1], 0.0)
    best, agreement = _best_shift(bootstrap, p, o, known)
    shift = best if agreement >= AGREEMENT else 0

    here = np.arange(max(0, -shift), min(axis.horizon, axis.horizon - shift))  # [K], in range
    moved, o, known = p[:, here + shift], o[:, here], known[:, here]
    amount = _amount(bootstrap, moved, o, known)
    scaled = moved / amount.value if is_off(amount) else moved
    bend = _bend(scaled)
    smear = _smear(bootstrap, bend, np.where(known, o - scaled, 0.0), known)
    sharp = scaled + smear.value * bend if smear.low > 0.0 else scaled

    def error(prediction: FloatArray) -> FloatArray:
        result = np.full(axis.horizon, np.nan)
        squares = np.where(known, (prediction - o) ** 2, 0.0).sum(axis=0)
        with np.errstate(invalid="ignore"):  # 0/0 where nothing is known
            result[here] = squares / known.sum(axis=0) * axis.discounts[here] ** 2
        return result

    errors = [error(of) for of in (p[:, here], moved, scaled, sharp)]
    timing, scale, sharpness = (before - after for before, after in pairwise(errors))
    return Blame(
        time_axis=axis,
        shift=shift,
        best_shift=best,
        agreement=agreement,
        amount=amount,
        smear=smear,
        error=errors[0],
        timing=timing,
        scale=scale,
        sharpness=sharpness,
        rest=errors[-1],
    )


def is_off(amount: Estimate) -> bool:
    """Returns whether an amount is surely wrong by more than a tenth, and not in its sign."""
    return 0.0 < amount.high < 1.0 - SLACK or amount.low > 1.0 + SLACK


@dataclass(frozen=True)
class _Bootstrap:
    """How intervals are drawn: from which episodes, by what chance."""

    samples: Samples
    rng: np.random.Generator
    level: float
    resamples: int

    def sums(self, *parts: FloatArray) -> FloatArray:
        """Returns `[E, parts, ...]`: the sums of each `[M, ...]` over each episode."""
        return np.stack([self.samples.per_episode(part) for part in parts], axis=1)

    def estimate(self, sums: FloatArray, statistic: Callable[[FloatArray], FloatArray]) -> Estimate:
        """Returns a number with its interval, which is NaN where there are too few episodes."""
        return by_episode(
            sums, statistic, rng=self.rng, level=self.level, resamples=self.resamples
        )[()]


def _best_shift(
    bootstrap: _Bootstrap, p: FloatArray, o: FloatArray, known: BoolArray
) -> tuple[int, float]:
    """Returns the shift at which p and o correlate best, and how surely it is the best.

    Both are `[M, N]`, and counted from the mean of each component: that much is predicted at some
    steps, and much comes at some, is not yet timing. A shift is compared with none over the same
    components of o, since near ones are easier to predict.
    """
    horizon = p.shape[1]
    p = p - p.mean(axis=0)
    o = np.where(known, o - o.sum(axis=0) / np.maximum(known.sum(axis=0), 1), 0.0)
    reach = min(LARGEST_SHIFT, horizon // 2)
    shifts, parts = np.arange(-reach, reach + 1), []
    for shift in shifts:
        to = slice(max(0, -shift), min(horizon, horizon - shift))
        moved = np.where(known[:, to], p[:, to.start + shift : to.stop + shift], 0.0)
        still = np.where(known[:, to], p[:, to], 0.0)
        pairs = [(moved, o[:, to]), (moved, moved), (still, o[:, to]), (still, still)]
        pairs.append((o[:, to], o[:, to]))
        parts.append([np.einsum("mk,mk->m", *pair) for pair in pairs])
    products = np.moveaxis(np.array(parts), -1, 0)  # [M, shifts, 5]
    sums = bootstrap.samples.per_episode(products)  # [E, shifts, 5]

    def gain(total: FloatArray) -> FloatArray:  # [R, shifts, 5] to [R, shifts]
        moved, of_moved, still, of_still, of_o = np.moveaxis(total, -1, 0)
        better = _cosine(moved, of_moved, of_o) - _cosine(still, of_still, of_o)
        mends = of_moved - 2.0 * moved < of_still - 2.0 * still  # the error, too, is smaller
        return np.where(mends | (better <= 0.0), better, 0.0)

    drawn = draws(len(sums), bootstrap.resamples, bootstrap.rng)
    gains = gain(pooled(drawn, sums))
    gains[:, reach] = 1e-9  # no shift at all is the best where others gain nothing
    best, *others = gains.argmax(axis=1)
    agreement = float(np.mean(others == best)) if has_enough(sums) else float("nan")
    return int(shifts[best]), agreement


def _cosine(product: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Returns Σab / √(Σa²·Σb²), 0 where one of them is 0."""
    square = a * b
    return np.where(square > 0.0, product / np.sqrt(np.where(square > 0.0, square, 1.0)), 0.0)


def _amount(bootstrap: _Bootstrap, p: FloatArray, o: FloatArray, known: BoolArray) -> Estimate:
    """Returns the median over components of p̄/ō, weighted by |ō|; both are `[M, K]`.

    The bars are means over samples, so that noise in single predictions, which would look like too
    large an amount, does not enter; and of a median a few components that are all wrong do not
    make much.
    """
    sums = bootstrap.sums(known.astype(np.float64), np.where(known, p, 0.0), o)  # [E, 3, K]

    def median(total: FloatArray) -> FloatArray:
        count, of_p, of_o = np.moveaxis(total, 1, 0)
        weight = np.abs(of_o) / np.maximum(count, 1.0)  # [R, K]
        ratio = np.where(weight > 0.0, of_p / np.where(weight > 0.0, of_o, 1.0), np.inf)
        order = np.argsort(ratio, axis=1)
        reached = np.take_along_axis(weight, order, axis=1).cumsum(axis=1)
        middle = (reached >= reached[:, -1:] / 2.0).argmax(axis=1)
        found = np.take_along_axis(ratio, np.take_along_axis(order, middle[:, None], 1), 1)[:, 0]
        return np.asarray(np.where(reached[:, -1] > 0.0, found, np.nan))

    return bootstrap.estimate(sums, median)


def _smear(
    bootstrap: _Bootstrap, bend: FloatArray, missed: FloatArray, known: BoolArray
) -> Estimate:
    """Returns x of the best `missed` = x·`bend`, over all components and samples `[M, K]`."""
    seen = np.where(known, bend, 0.0)
    pairs = ((seen, missed), (seen, seen))
    sums = bootstrap.sums(*(np.einsum("mk,mk->m", *pair) for pair in pairs))  # [E, 2]
    return bootstrap.estimate(sums, lambda total: total[:, 0] / total[:, 1])


def _bend(p: FloatArray) -> FloatArray:
    """Returns `[M, K]`: 2p − p₋ − p₊, and 0 where a neighbour is missing."""
    bend = np.zeros_like(p)
    bend[:, 1:-1] = 2.0 * p[:, 1:-1] - p[:, :-2] - p[:, 2:]
    return bend
