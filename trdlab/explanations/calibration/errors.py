"""Errors of a forecast: what is wrong with its timing, its amount, its sharpness."""

from dataclasses import dataclass

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.explanations.moment.steps import LEAST_DISCOUNT
from trdlab.rollouts.realised import Samples
from trdlab.statistics import Estimate, by_episode, draws, has_enough, pooled

LARGEST_SHIFT = 10
AGREEMENT = 0.99
"""The share of bootstrap samples in which a shift must be the best one, to be blamed."""
LEAST_SMEAR = 0.05
"""Less than this is not blamed."""
SLACK = 0.1
"""How far from 1 an amount may be, before it is blamed."""


@dataclass(frozen=True, eq=False)
class Errors:
    """What would mend a forecast.

    Rewards are compared undiscounted, each group as seen from its own start, so that a component
    can stand in for its neighbour. One repair follows another: components are moved by `shift`
    places, divided by `amount` if that `is_off`, and then `smear` is looked for.

    Args:
        shift: by how many components rewards are predicted too late; negative if too early. It is
            0 unless another one is the best in nearly all bootstrap samples.
        amount: how many times as much is predicted as comes, of all explicit components together.
            NaN where nothing came.
        smear: x, where p + x·(2p − p₋ − p₊) is the best prediction that can be had from p and its
            neighbours p₋ and p₊. Above 0, rewards are smeared over neighbouring components; below,
            there is noise that differs between neighbours. A prediction that is rightly unsure of
            the timing has 0.
    """

    shift: int
    amount: Estimate
    smear: Estimate


def is_off(amount: Estimate) -> bool:
    """Returns whether an amount is surely wrong by more than a tenth, and not in its sign."""
    return 0.0 <= amount.high < 1.0 - SLACK or amount.low > 1.0 + SLACK


def errors_of(samples: Samples, *, seed: int = 0) -> Errors | None:
    """Returns what is wrong with the timing, the amount and the sharpness of a forecast.

    It is None where no component can stand in for another: there are fewer than 2 explicit ones, or
    their discounts vanish.
    """
    axis, known = samples.time_axis, samples.known[:, :-1]  # [M, N]
    if axis.horizon < 2 or axis.discounts[-2] < LEAST_DISCOUNT:
        return None
    p, o = (of[:, :-1] / axis.discounts[:-1] for of in (samples.predicted, samples.observed))
    best, agreement = _best_shift(samples, p, o, seed)
    is_sure = agreement >= AGREEMENT and not _spoils(samples, p, o, best, seed)
    shift = best if is_sure else 0
    there, here = _places(shift, axis.horizon)[0]
    known = known[:, here]
    p, o = (np.where(known, of, 0.0) for of in (p[:, there], o[:, here]))
    weights = axis.discounts[here] * np.sign(o.sum(axis=0))  # so that gains and costs add up
    amount = _ratio(samples, p @ weights, o @ weights, seed)
    scaled = p / amount.value if is_off(amount) and amount.value else p
    bend = np.zeros_like(p)  # 2p − p₋ − p₊, and 0 where a neighbour is missing
    bend[:, 1:-1] = 2.0 * scaled[:, 1:-1] - scaled[:, :-2] - scaled[:, 2:]
    bend = np.where(known, bend, 0.0)
    over, under = (np.einsum("mk,mk->m", bend, of) for of in (o - scaled, bend))
    return Errors(shift, amount, smear=_ratio(samples, over, under, seed))


def _best_shift(samples: Samples, p: FloatArray, o: FloatArray, seed: int) -> tuple[int, float]:
    """Returns the shift at which p and o correlate best, and how surely it is the best.

    Both are `[M, N]`, and counted from the mean of each component: that much is predicted at some
    steps, and much comes at some, is not yet timing. A shift s takes p_(k+s) for what o_k is said
    to be, and has to do better than no shift as seen from both.
    """
    horizon, known = p.shape[1], samples.known[:, :-1]
    reach = min(LARGEST_SHIFT, horizon // 2)
    p = p - p.mean(axis=0)
    o = known * (o - _mean(o, known))
    shifts, parts = np.arange(-reach, reach + 1), []
    for shift in shifts:
        for of_p, of_o in _places(shift, horizon):
            a, b = p[:, of_p] * known[:, of_o], o[:, of_o]
            parts += [np.einsum("mk,mk->m", *pair) for pair in ((a, b), (a, a), (b, b))]
    rows = np.stack(parts, axis=1).reshape(len(p), len(shifts), 3, 3)
    sums = samples.per_episode(rows)  # [E, shifts, 3, 3]
    ab, aa, bb = np.moveaxis(pooled(draws(len(sums), seed), sums), -1, 0)  # [1 + R, shifts, 3]
    size = aa * bb
    cosine = np.where(size > 0.0, ab / np.sqrt(np.where(size > 0.0, size, 1.0)), 0.0)
    gains = cosine[..., 0] - cosine[..., 1:].max(axis=-1)  # [1 + R, shifts]
    gains[:, reach] = 1e-9  # no shift at all is the best where others gain nothing
    best, *others = gains.argmax(axis=1)
    return int(shifts[best]), float(np.mean(others == best)) if has_enough(sums) else float("nan")


def _spoils(samples: Samples, p: FloatArray, o: FloatArray, shift: int, seed: int) -> bool:
    """Returns whether a shift surely spoils some component.

    Near components that are right, and far ones that were never learned, can look as if all rewards
    were expected too early; but then the near ones fit best where they are. A component is spoiled
    if its error becomes larger by a tenth of the error of constant guesses, on average over all.
    """
    known, places = samples.known[:, :-1], _places(shift, p.shape[1])
    moved, *still = (known[:, of_o] * (p[:, of_p] - o[:, of_o]) ** 2 for of_p, of_o in places)
    more = samples.per_episode(np.concatenate([moved - error for error in still], axis=1))
    guess = (known * (o - _mean(o, known)) ** 2).sum() / p.shape[1]
    return bool((by_episode(more, lambda of: of, seed=seed).low > SLACK * guess).any())


def _mean(o: FloatArray, known: BoolArray) -> FloatArray:
    """Returns `[N]`: the mean of `o [M, N]`, which is 0 where it is not known."""
    return np.asarray(o.sum(axis=0) / np.maximum(known.sum(axis=0), 1))


def _places(shift: int, horizon: int) -> list[tuple[IntArray, IntArray]]:
    """Returns the components of p, and those of o, that are compared: moved by a shift, and not.

    Those that are not moved are the same of o, and the same of p.
    """
    k = np.arange(max(0, -shift), min(horizon, horizon - shift))
    return [(k + shift, k), (k, k), (k + shift, k + shift)]


def _ratio(samples: Samples, over: FloatArray, under: FloatArray, seed: int) -> Estimate:
    """Returns Σover / Σunder of `[M]` each; NaN where there is nothing to divide by."""
    sums = samples.per_episode(np.column_stack([over, under]))  # [E, 2]
    return by_episode(
        sums, lambda of: np.where(of[:, 1] > 0.0, of[:, 0] / of[:, 1], np.nan), seed=seed
    )[()]
