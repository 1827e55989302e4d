"""Counterfactuals: what really follows an action and its foil, from copies of one state."""

from dataclasses import dataclass

import numpy as np

from trdlab.arrays import FloatArray, difference
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.rollouts.branches import Branches, Branching
from trdlab.rollouts.playing import Playing
from trdlab.statistics import Estimates, mean_difference


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
            Intervals mind what is too rare to be seen; they have no width where there is no chance.
        same_every_time: whether all copies of each action brought the same, as far as is known.
    """

    time_axis: TimeAxis
    action: int
    foil: int
    copies: int
    whole: bool
    predicted: FloatArray
    observed: Estimates
    same_every_time: bool


def try_actions(
    branching: Branching, playing: Playing, action: int, foil: int, *, seed: int = 0
) -> tuple[Branches, Branches]:
    """Returns what follows two actions, each tried from copies of where the first episode stands.

    Raises:
        InputError: there is no such action, or both are the same.
        NotCopyable: the environments cannot be copied.
    """
    if action == foil:
        raise InputError(f"Action and foil are both {action}.", "Give two different actions.")
    one, other = np.random.SeedSequence(seed).generate_state(2).tolist()
    return branching.at(playing, action, seed=one), branching.at(playing, foil, seed=other)


def compared(
    tried: tuple[Branches, Branches],
    seen: FloatArray | None = None,
    chance: bool | None = None,
    *,
    seed: int = 0,
) -> Counterfactual:
    """Returns how two actions differ that were tried.

    Nothing can come that is less, or more, than what was ever seen, at any step, or is predicted.
    Where all copies of each brought the same, and not always nothing, there is no chance, unless
    copies went differently elsewhere.

    Args:
        tried: what followed the one and the other.
        seen: `[2, N+2]`, the least and the most that ever came elsewhere of each component, and of
            all together.
        chance: whether a state ever led to different things; None where that was not looked at.
        seed: of the intervals.
    """
    whole = all(bool(branches.known[0, -1]) for branches in tried)
    one, other = (_futures(branches, whole) for branches in tried)  # [n, N+2]
    said = np.stack([_with_sum(branches.predicted[0], whole) for branches in tried])  # [2, N+2]
    same = not any(np.nan_to_num(np.ptp(of, axis=0)).any() for of in (one, other))
    chance = any(branches.shared_chance for branches in tried) or chance
    if same and (chance is False or (chance is None and np.nan_to_num(one + other).any())):
        value = one.mean(axis=0) - other.mean(axis=0)
        observed = Estimates(value, value, value)
    else:
        came = np.concatenate([one, other, *([] if seen is None else [seen])])
        ends = _extremes(tried[0].time_axis, came, said)
        observed = mean_difference(one, other, *ends, rng=np.random.default_rng(seed))
    return Counterfactual(
        time_axis=tried[0].time_axis,
        action=int(tried[0].actions[0]),
        foil=int(tried[1].actions[0]),
        copies=tried[0].copies,
        whole=whole,
        predicted=difference(*said),
        observed=observed,
        same_every_time=same,
    )


def _extremes(axis: TimeAxis, came: FloatArray, said: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns `[N+2]` twice: the least and the most that can come of each component, and in all.

    What was paid at one explicit component could be paid at any, by its own discount.
    """
    rows = np.concatenate([came, said])
    least, most = rows.min(axis=0), rows.max(axis=0)
    discounts = np.maximum(axis.discounts, np.finfo(np.float64).tiny)  # [N+1]
    paid = came[:, : axis.horizon] / discounts[:-1]
    if np.isfinite(paid).any():
        least[:-1] = np.minimum(least[:-1], np.nanmin(paid) * discounts)
        most[:-1] = np.maximum(most[:-1], np.nanmax(paid) * discounts)
    return least, most


def _futures(branches: Branches, whole: bool) -> FloatArray:
    """Returns `[n, N+2]`: every component of what followed, and their sum; NaN if not known."""
    observed = np.where(branches.known, branches.observed, np.nan)  # [n, N+1]
    if not whole and branches.time_axis.horizon == 0:
        return np.column_stack([observed, observed])  # the sum of nothing that was seen is no 0
    return _with_sum(observed, whole)


def _with_sum(components: FloatArray, whole: bool) -> FloatArray:
    """Returns `[..., N+2]`: components with their sum, or that of the explicit ones."""
    counted = components if whole else components[..., :-1]
    return np.concatenate([components, counted.sum(axis=-1, keepdims=True)], axis=-1)
