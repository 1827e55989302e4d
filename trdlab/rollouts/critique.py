"""A policy's own critic: what it says that states are worth, against what came and what is told."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from trdlab.arrays import FloatArray, one_sign
from trdlab.decomposition import TimeAxis
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import common_axis, returns
from trdlab.statistics import Estimates, Statistic, by_episode

Cause = Literal["sum", "factor", "discount"]
CAUSES: tuple[Cause, ...] = ("sum", "factor", "discount")
"""What may be all that is wrong with a critic: an amount, its unit, its discount factor."""
SLACK = 0.1
"""How far off a critic may be, as a share of what comes, before it is called wrong."""
EXPLAINED = 0.95
"""The share of what is wrong that a cause must be able to explain."""
LEFT = 0.05
"""The share of what counts that a limit may cut off; what the critic says there stands for it."""
DISCOUNTS = 1.0 - np.logspace(0.0, -3.0, 121)
"""The discount factors that are tried where nothing says it: 1/(1 − γ) is 1 to 1,000 steps."""
FURTHEST = 3

_FURTHEST = ("episode", "step", "critic", "forecast", "came")
_ROUNDING = 1e-9  # of the largest: what varies by less is always the same
_TINY = float(np.finfo(np.float64).tiny)
_ALIKE = 0.01  # of what near and far vary: if no more is not shared, they cannot be told apart

# What is multiplied and summed over the steps of an episode, z by u; in z the means are taken off.
_ONE, _CRITIC, _TOLD, _NEAR, _FAR = range(5)
_LEAST = 5  # of z: whether the step is in the third where the critic says least; then, most
_ERRORS, _GAP, _CAME = slice(5, 7), slice(7, 9), slice(9, 11)  # of u


@dataclass(frozen=True, eq=False)
class Critique:
    """What a critic says of states, and what is forecast there (Σ v^TRD), against what came.

    All are in discounted reward. Arrays of 2 are of the critic, and of the forecasts.

    Args:
        time_axis: what the components mean.
        gamma: the critic's, if that is known; else that of the forecasts.
        factor: what the critic's values were divided by first, since they surely are in another
            unit; else 1.
        said: `[2]`, the mean.
        spread: `[2]`, the standard deviation of what is said.
        came: `[2]`, the mean, each by its own discount factor; NaN where it is not known.
        size: `[2]`, the mean of what came without its sign.
        bias: `[2]`, said − came.
        slope: `[2]`, how much more came where 1 more was said; NaN where that was always the same.
        error: `[3]`, the mean square of said − came; last, that of the critic less the other.
        gap: `[2]`, the mean and the mean square of critic − forecasts.
        correlation: of the critic with the forecasts.
        left: `[3]`, the share of the mean square of critic − forecasts that is left when each of
            `CAUSES` is mended; infinite for a discount factor that is known, or cannot be told.
        repair: `[3]`, what is to be added; the unit it counts in; the discount factor it has.
        thirds: `[2, 3]`, of the steps where the critic says least, and most: what it says there,
            what came, and the difference.
        split: the component before which half of what is forecast comes.
        reached: the component up to which as much is forecast on average as the critic says in all;
            None if that is not before the residual, or some components pay and others cost.
        counts: `[3]`, how much the critic counts of what comes before that, and from there on;
            last, the difference. NaN where the two do not explain nearly all that it says.
        furthest: the steps at which the two are furthest apart.
    """

    time_axis: TimeAxis
    gamma: float
    factor: float
    said: FloatArray
    spread: FloatArray
    came: FloatArray
    size: FloatArray
    bias: Estimates
    slope: Estimates
    error: Estimates
    gap: Estimates
    correlation: float
    left: FloatArray
    repair: FloatArray
    thirds: Estimates
    split: int
    reached: int | None
    counts: Estimates
    furthest: tuple[dict[str, float], ...]

    @property
    def is_same(self) -> bool:
        """Whether critic and forecasts have the same γ, so that both tell of the same."""
        return self.gamma == self.time_axis.gamma

    def is_off(self, which: int) -> bool:
        """Returns whether `which`, the critic (0) or forecasts (1), surely is off by a tenth."""
        slack = SLACK * self.size[which]
        return bool(self.bias.low[which] > slack or self.bias.high[which] < -slack)

    def is_uneven(self, which: int) -> bool:
        """Returns whether the slope of `which` is so far from 1 that it surely matters."""
        low, high = self.slope.low[which] - 1.0, self.slope.high[which] - 1.0
        return bool(max(low, -high) * self.spread[which] > SLACK * self.size[which])

    def is_wrong(self, which: int) -> bool:
        """Returns whether the critic or the forecasts, `which`, surely are wrong."""
        return self.is_off(which) or self.is_uneven(which)

    @property
    def cause(self) -> Cause | None:
        """What is nearly all that is wrong with the critic, where no other of `CAUSES` can be it.

        It is held against the forecasts, which must not be wrong themselves.
        """
        best, other = np.argsort(self.left)[:2]
        is_it = self.left[best] <= (1.0 - EXPLAINED) * min(self.left[other], 1.0)
        is_known = self.is_same and self.is_wrong(0) and not self.is_wrong(1)
        return CAUSES[best] if is_known and is_it and self.left[other] > _ROUNDING else None


def critique_of(
    episodes: Sequence[Episode], gamma: float | None = None, *, seed: int = 0
) -> Critique | None:
    """Compares what a critic says with what came, and with what is forecast.

    It is known what came where an episode ended, and where a limit cuts off no more than a
    twentieth of what counts. Where the critic surely counts in another unit, its values are
    compared by the best scale.

    Args:
        episodes: what was said, and what happened; None is returned where there is no critic.
        gamma: the discount factor that the critic was trained with, if that is known.
        seed: of the bootstrap.
    """
    if any(of.critic is None for of in episodes):
        return None
    axis = common_axis(episodes)
    gammas = np.array([axis.gamma if gamma is None else gamma, axis.gamma])
    until = _until(episodes, gammas[0])
    steps = [_steps(episode, gammas, until) for episode in episodes]
    found = _compared(steps, axis, gamma, seed)
    if found.cause != "factor":
        return found
    factor = float(found.repair[1])
    scaled = [(said / np.array([factor, 1.0]), told, came) for said, told, came in steps]
    return replace(_compared(scaled, axis, gamma, seed), factor=factor)


_Steps = tuple[FloatArray, FloatArray, FloatArray]
"""What critic and forecasts said `[T, 2]`, of each component `[T, N+1]`, and what came `[T, …]`."""


def _steps(episode: Episode, gammas: FloatArray, until: int) -> _Steps:
    """Returns the steps of an episode of which it is known what came; if there are none, all."""
    told, critic = episode.expected[:-1], np.asarray(episode.critic, dtype=np.float64)
    came = (
        returns(episode, gammas, critic[-1])
        if until
        else np.full((len(critic), len(gammas)), np.nan)
    )
    said = np.column_stack([critic, told.sum(axis=1)])
    return said[: until or None], told[: until or None], came[: until or None]


def _until(episodes: Sequence[Episode], gamma: float) -> int:
    """Returns up to which step it is known what came; one for all, or ends would count more."""
    if any(of.epsilon > 0.0 for of in episodes):
        return 0
    cut = [len(of) for of in episodes if not of.ends[-1]]
    if not cut:
        return max(map(len, episodes))
    limits = [*cut, *(of.time_limit for of in episodes if of.time_limit is not None)]
    left = np.ceil(np.log(LEFT) / np.log(max(gamma, 1e-9)))
    return max(min(limits) - int(left), 0)


def _compared(steps: Sequence[_Steps], axis: TimeAxis, gamma: float | None, seed: int) -> Critique:
    """Returns how the critic does, by the sums of z·u over the steps of each episode."""
    said, told, came = (np.concatenate(of) for of in zip(*steps, strict=True))
    half = np.abs(told).mean(axis=0).cumsum()  # [N+1]
    split = min(int(np.searchsorted(half, 0.5 * half[-1])) + 1, axis.horizon)
    near = told[:, :split].sum(axis=1)
    known = np.column_stack([said, near, said[:, 1] - near])  # [S, 4]
    spread = np.maximum(known.std(axis=0), _ROUNDING * np.abs(known).max())
    ends = np.quantile(said[:, 0], [1.0 / 3.0, 2.0 / 3.0])
    third = np.column_stack([said[:, 0] <= ends[0], said[:, 0] >= ends[1]])
    one, gap = np.ones((len(said), 1)), said[:, :1] - said[:, 1:]  # [S, 1]
    z = np.column_stack([one, (known - known.mean(axis=0)) / spread, third])
    u = np.column_stack([one, known, (said - came[:, :2]) ** 2, gap, gap**2, came])
    starts = np.cumsum([0, *(len(of[0]) for of in steps)])
    pairs = zip(np.split(z, starts[1:-1]), np.split(u, starts[1:-1]), strict=True)
    sums = np.stack([left.T @ right for left, right in pairs])  # [E, z, u]

    def of(statistic: Statistic) -> Estimates:
        return by_episode(sums, statistic, seed=seed)

    is_late = np.abs(told[:, -1]).mean() > SLACK * half[-1]  # so that its discount is not told
    is_known = gamma is not None or axis.gamma == 0.0
    tried = DISCOUNTS[:0] if is_late or is_known else DISCOUNTS
    left, repair = _causes(said[:, 0], told, axis, tried)
    order = np.argsort(-np.abs(gap[:, 0]), kind="stable")[:FURTHEST]
    at = np.searchsorted(starts, order, side="right") - 1
    furthest = np.column_stack([at, order - starts[at], said[order], came[order, 0]])
    return Critique(
        time_axis=axis,
        gamma=axis.gamma if gamma is None else gamma,
        factor=1.0,
        said=said.mean(axis=0),
        spread=said.std(axis=0),
        came=came[:, :2].mean(axis=0),
        size=np.abs(came[:, :2]).mean(axis=0),
        bias=of(lambda sums: _means(sums)[:, 0, [_CRITIC, _TOLD]] - _means(sums)[:, 0, _CAME]),
        slope=of(_slopes),
        error=of(_errors),
        gap=of(lambda sums: _means(sums)[:, 0, _GAP]),
        correlation=float(np.mean(z[:, _CRITIC] * z[:, _TOLD])),
        left=left,
        repair=repair,
        thirds=of(_thirds),
        split=split,
        reached=_reached(told.mean(axis=0), float(said[:, 0].mean())),
        counts=of(_counts),
        furthest=tuple(dict(zip(_FURTHEST, row, strict=True)) for row in furthest.tolist()),
    )


def _reached(told: FloatArray, value: float) -> int | None:
    """Returns the explicit component at which a sum of one sign `[N+1]` reaches a value."""
    there = np.flatnonzero(told[:-1].cumsum() * np.sign(value) >= abs(value))
    return int(there[0]) if there.size and one_sign(told) and value else None


def _means(sums: FloatArray) -> FloatArray:
    """Returns `[R, z, u]`, the means of what is summed."""
    return np.asarray(sums / sums[:, :1, :1])


def _covariances(sums: FloatArray) -> FloatArray:
    """Returns `[R, z, u]`, the means less the product of both means."""
    means = _means(sums)
    return np.asarray(means - means[:, :, :1] * means[:, :1])


def _slopes(sums: FloatArray) -> FloatArray:
    """Returns `[R, 2]`, by how much what came rises with what was said.

    Source: Mincer and Zarnowitz (1969), "The evaluation of economic forecasts".
    """
    both, which = _covariances(sums), [_CRITIC, _TOLD]
    return np.asarray(both[:, which, _CAME][:, [0, 1], [0, 1]] / both[:, which, which])


def _errors(sums: FloatArray) -> FloatArray:
    """Returns `[R, 3]`, the mean squares, and the difference."""
    squares = _means(sums)[:, 0, _ERRORS]
    return np.column_stack([squares, squares[:, 0] - squares[:, 1]])


def _thirds(sums: FloatArray) -> FloatArray:
    """Returns `[R, 2, 3]`, of the two outer thirds: said, came, and the difference."""
    count, said, came = (sums[:, _LEAST:, i] for i in (_ONE, _CRITIC, _CAME.start))
    return np.stack([said / count, came / count, (said - came) / count], axis=-1)


def _causes(
    critic: FloatArray, told: FloatArray, axis: TimeAxis, discounts: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Returns `[3]` twice: what is left of the gaps after each repair, and the repairs.

    Of the residual it is not told when it comes, so what a discount factor makes of it is free.

    Args:
        critic: what the critic says, `[S]`.
        told: what is forecast, `[S, N+1]`.
        axis: of that.
        discounts: the discount factors to try, `[K]`.
    """
    value, one = told.sum(axis=1), np.ones(len(told))
    (add, left_sum), (unit, left_unit) = _without(critic - value, one), _without(critic, value)
    repair, left = np.array([-add, unit, np.nan]), np.array([left_sum, left_unit, np.inf])
    for discount in discounts:
        later = (discount / axis.gamma) ** (axis.width * np.arange(axis.horizon))  # [N]
        _, square = _without(critic - told[:, :-1] @ later, told[:, -1])
        if square < left[2]:
            repair[2], left[2] = discount, square
    return left / max(float(np.mean((critic - value) ** 2)), _TINY), repair


def _without(what: FloatArray, of: FloatArray) -> tuple[float, float]:
    """Returns how much of one column is best taken off another, and the mean square then left."""
    share = float(what @ of) / max(float(of @ of), _TINY)
    return share, float(np.mean((what - share * of) ** 2))


def _counts(sums: FloatArray) -> FloatArray:
    """Returns `[R, 3]`: least squares of what the critic says by near and far, and near − far."""
    parts, both = [_NEAR, _FAR], _covariances(sums)
    (a, b), (c, d) = both[:, _NEAR, parts].T, both[:, _FAR, parts].T
    e, f = both[:, parts, _CRITIC].T
    apart = a * d - b * c
    near, far = (e * d - b * f) / apart, (a * f - e * c) / apart
    whole = near * both[:, _CRITIC, _NEAR] + far * both[:, _CRITIC, _FAR]
    is_all = (whole >= EXPLAINED * both[:, _CRITIC, _CRITIC]) & (apart > _ALIKE * a * d)
    return np.where(is_all[:, None], np.column_stack([near, far, near - far]), np.nan)
