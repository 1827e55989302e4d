"""Counterfactuals: what really follows an action and its foil, from copies of one state."""

from dataclasses import dataclass

import numpy as np

from trdlab.arrays import RELATIVE_ZERO, FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.intervals import LEVEL, RESAMPLES, Estimates, draws, percentiles
from trdlab.rollouts.branches import Branches, Branching
from trdlab.rollouts.playing import Playing


@dataclass(frozen=True, eq=False)
class Counterfactual:
    """How the futures of two actions differ, as predicted and as they followed.

    Args:
        time_axis: what the components mean.
        action: the number of one action.
        foil: the number of the other.
        copies: how often each was tried.
        whole: whether all copies came to an end, so that the sum holds the residual too; otherwise
            it is that of the explicit components.
        predicted: `[N+2]`, action − foil of every component, and of their sum.
        observed: `[N+2]`, the same of the means of what followed; NaN where that is not known.
            There is no interval where nothing varied, unless nothing did at any step: what happened
            in none of some copies can still happen.
    """

    time_axis: TimeAxis
    action: int
    foil: int
    copies: int
    whole: bool
    predicted: FloatArray
    observed: Estimates

    @property
    def same_every_time(self) -> bool:
        """Whether all copies of each action went the same way, at every step that is known."""
        known = ~np.isnan(self.observed.value)
        return bool((self.observed.low == self.observed.high)[known].all())


def counterfactual(
    branching: Branching,
    playing: Playing,
    action: int,
    foil: int,
    *,
    age: int | None = None,
    seed: int = 0,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
) -> Counterfactual:
    """Tries two actions, each from copies of the same state, and follows the policy after them.

    Args:
        branching: the estimator, and how many copies to make.
        playing: where the state is: that of the first episode.
        action: the number of one action.
        foil: the number of the other.
        age: the steps since the episode began; by default those that were played.
        seed: of the copies and of the bootstrap.
        level: the probability that the intervals are made for.
        resamples: how many samples of copies are drawn.

    Raises:
        InputError: there is no such action, or both are the same.
        NotCopyable: the environments cannot be copied.
    """
    if action == foil:
        raise InputError(f"Action and foil are both {action}.", "Give two different actions.")
    seeds = np.random.SeedSequence(seed).generate_state(2).tolist()
    tried = [
        branching.at(playing, first, age=age, seed=own)
        for first, own in zip((action, foil), seeds, strict=True)
    ]
    rng = np.random.default_rng(seed)
    whole = all(bool(branches.known[0, -1]) for branches in tried)
    futures = [_futures(branches, whole) for branches in tried]  # 2 of [n, N+2]
    one, other = (draws(len(of), resamples, rng) @ of / len(of) for of in futures)
    varies = np.max([np.ptp(of, axis=0) > 0.0 for of in futures], axis=0)  # [N+2]
    found = percentiles(one - other, level, branching.copies > 1)
    ends = (np.where(varies, end, found.value) for end in (found.low, found.high))
    said = [branches.predicted[0] for branches in tried]  # 2 of [N+1]
    whole_of = [row.sum() if whole else row[:-1].sum() for row in said]
    return Counterfactual(
        time_axis=branching.estimator.time_axis,
        action=action,
        foil=foil,
        copies=branching.copies,
        whole=whole,
        predicted=_apart(*(np.append(*of) for of in zip(said, whole_of, strict=True))),
        observed=Estimates(found.value, *ends).where(np.True_, varies | ~varies.any()),
    )


def _apart(one: FloatArray, other: FloatArray) -> FloatArray:
    """Returns one − other, 0 where they differ only by rounding."""
    difference, least = one - other, RELATIVE_ZERO * np.maximum(np.abs(one), np.abs(other))
    return np.where(np.abs(difference) <= least, 0.0, difference)


def _futures(branches: Branches, whole: bool) -> FloatArray:
    """Returns `[n, N+2]`: every component of what followed, and their sum; NaN if not known."""
    observed = np.where(branches.known[0], branches.observed[0], np.nan)  # [n, N+1]
    if not whole and branches.time_axis.horizon == 0:
        return np.column_stack([observed, observed])  # the sum of nothing that was seen is no 0
    return np.column_stack([observed, (observed if whole else observed[:, :-1]).sum(axis=1)])
