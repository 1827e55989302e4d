"""The ceiling: the skill of a perfect prediction, so that it is seen what cannot be known."""

from dataclasses import dataclass

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.rollouts.branches import Branches
from trdlab.statistics import Estimates, by_episode


@dataclass(frozen=True, eq=False)
class Ceiling:
    """The skill of a perfect prediction, as far as it can be told from copies of states.

    Args:
        skill: `[N+1]`; NaN where it is not known, or where nothing varies.
        num_moments: how many moments were continued from copies.
        deterministic: whether different things followed different moments, and the same followed
            all copies of each: then the ceiling is 1, if chance is not shared by copies.
    """

    skill: Estimates
    num_moments: int
    deterministic: bool


def ceiling_of(branches: Branches, *, seed: int = 0) -> Ceiling:
    """Estimates the skill of a perfect prediction from what followed copies of the same states.

    A perfect prediction is the mean μ of what follows, so its skill is Var(μ) / (Var(μ) + σ²) with
    σ² the mean variance of what follows one and the same state. With n copies of each of M moments,
    σ² is estimated by the mean variance within moments, and Var(μ) by the variance of the moments'
    means less σ²/n; both are unbiased. Where there is nothing to know, the estimate of Var(μ), and
    with it the ceiling, can come out just below zero.

    Args:
        branches: moments of whole episodes, as `Branching.along` draws them.
        seed: of the bootstrap, which is by episode.

    Raises:
        InputError: there is only one copy of each moment, or only one moment.

    Source: the one-way random-effects analysis of variance, Fisher (1925).
    """
    n, moments = branches.copies, len(branches) // branches.copies
    if n < 2 or moments < 2:
        raise InputError(
            f"There are {moments} moments, continued {n} times each.",
            "A ceiling needs at least 2 of both.",
        )
    observed = branches.observed.reshape(moments, n, -1)  # [M, n, N+1], 0 if not known
    known = branches.known[::n]  # [M, N+1]
    mean = np.where(known, observed.mean(axis=1) - observed.mean(axis=(0, 1)), 0.0)  # [M, N+1]
    parts = (known.astype(np.float64), mean, mean**2, observed.var(axis=1, ddof=1))
    sums = np.stack([branches.per_episode(part, n) for part in parts], axis=1)  # [E, 4, N+1]
    scale = np.abs(observed).max(axis=(0, 1)) ** 2  # [N+1]

    def skill(pooled: FloatArray) -> FloatArray:  # [R, 4, N+1] to [R, N+1]
        count, total, squares, variance = np.moveaxis(pooled, 1, 0)
        between = (squares - total**2 / count) / (count - 1.0)
        noise = variance / count
        whole = between + noise * (1.0 - 1.0 / n)
        return np.where(whole > 1e-12 * scale, 1.0 - noise / whole, np.nan)

    return Ceiling(
        skill=by_episode(sums, skill, seed=seed),
        num_moments=moments,
        # a variance may have rounding errors
        deterministic=bool(np.ptp(observed, axis=0).any() and not np.ptp(observed, axis=1).any()),
    )
