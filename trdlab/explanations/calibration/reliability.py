"""Reliability: where a reward was predicted with some probability, how often it came."""

from dataclasses import dataclass

import numpy as np

from trdlab.arrays import FloatArray, IntArray
from trdlab.rollouts.realised import Samples

NUM_BINS = 10


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

    Args:
        samples: predictions and what followed them.
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
