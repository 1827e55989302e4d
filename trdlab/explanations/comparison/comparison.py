"""The comparison of two agents: how far they are apart over many states, with intervals."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.estimator import Future
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.comparison.states import Visits
from trdlab.explanations.rules import Language
from trdlab.explanations.words import forms_of
from trdlab.printable import Printable
from trdlab.statistics import FEWEST_EPISODES, Estimate, Estimates, draws, percentiles, pooled

SIDES = ("A", "B")
"""What the two are called."""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Printable):
    """How far two agents are apart, on average over the states that both came to.

    Intervals are bootstrapped by the seeds of the episodes: the two episodes of a seed, that of the
    one agent and that of the other, can be much alike. They are NaN where too few episodes differ.

    Args:
        names: of the two.
        words: what names each on the command line, where both act.
        place: the options that name where that is.
        action_names: A names.
        futures: whose future each speaks of.
        episodes: how many each of them played.
        visits: what both expect at every state.
        means: `[2, N+1]`, what each expects of what it would do.
        difference: `[N+1]`, the second's mean minus the first's.
        apart: `[N+1]`, the mean absolute difference at a state.
        of_any_action: `[N+1]`, the same of one and the same action, over all actions.
        gap: the difference over all components.
        shift: by how many steps later the second expects its rewards (see `centre`).
        agreement: the share of the states at which both would take the same action.
        reports: how far the forecasts of each can be trusted; None where that was not judged.
        max_steps: after which an episode was cut off, if not before; None for never.
        seconds_per_step: how long a step takes as people play, if that is known.
    """

    names: tuple[str, str]
    words: tuple[tuple[str, ...], tuple[str, ...]]
    place: tuple[str, ...]
    action_names: tuple[str, ...]
    futures: tuple[Future, Future]
    episodes: int
    visits: Visits
    means: Estimates
    difference: Estimates
    apart: Estimates
    of_any_action: Estimates
    gap: Estimate
    shift: Estimate
    agreement: Estimate
    reports: tuple[CalibrationReport | None, CalibrationReport | None] = (None, None)
    max_steps: int | None = None
    seconds_per_step: float | None = None

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.visits.time_axis

    @property
    def titles(self) -> tuple[str, ...]:
        """Who A and who B is; in full where their names do not tell."""
        names = self.names
        if names[0] == names[1] and all(self.words):
            names = self.words[0][0], self.words[1][0]
        return tuple(f"{side}: {name}" for side, name in zip(SIDES, names, strict=True))


COMPARISONS = Language[Comparison](
    "this comparison", lambda of: forms_of(of.time_axis, of.seconds_per_step)
)


def compared(visits: Visits, *, seed: int = 0, **told: Any) -> Comparison:
    """Returns how far apart two estimators are at some states; `told` are its other fields."""
    size, actions = visits.time_axis.num_components, visits.actions
    rows = np.concatenate(
        [
            *visits.expected,
            visits.difference,
            np.abs(visits.difference),
            np.abs(visits.of_any_action).mean(axis=1),
            (actions[0] == actions[1])[:, None],
        ],
        axis=1,
    )  # [M, 5·(N+1) + 1]
    counted = np.concatenate([np.ones((len(visits), 1)), rows], axis=1)
    seeds, of = np.unique(visits.seed, return_inverse=True)  # [E], [M]
    sums = np.zeros((len(seeds), counted.shape[1]))  # [E, 5·(N+1) + 2]
    np.add.at(sums, of.ravel(), counted)

    def statistics(sums: FloatArray) -> FloatArray:
        means = sums[:, 1:] / sums[:, :1]
        gap = means[:, 2 * size : 3 * size].sum(axis=1)
        gap[np.abs(gap) <= size * visits.least] = 0.0
        one, other = (centre(means[:, i * size : (i + 1) * size], visits.time_axis) for i in (0, 1))
        return np.column_stack([means, gap, other - one])

    drawn = draws(len(sums), seed)
    values = statistics(pooled(drawn, sums))
    found = percentiles(values, visits.different >= FEWEST_EPISODES)
    exists = ~np.isnan(found.value)
    found = found.where(exists, exists)
    ends = [of[: 5 * size].reshape(5, size) for of in (found.value, found.low, found.high)]
    means, difference, apart, of_any_action = (
        Estimates(*(end[part] for end in ends)) for part in (slice(2), 2, 3, 4)
    )
    return Comparison(
        visits=visits,
        means=means,
        difference=difference,
        apart=apart,
        of_any_action=of_any_action,
        agreement=found[5 * size],
        gap=found[5 * size + 1],
        shift=found[5 * size + 2],
        **told,
    )


def centre(means: FloatArray, axis: TimeAxis) -> FloatArray:
    """Returns `[...]`: the mean step at which rewards come, weighted by what they are worth now.

    Of means `[..., N+1]` each component counts at its first step, so the residual at N·w. NaN where
    components have two signs or are all zero.

    >>> centre(np.array([[1.0, 0.0, 3.0], [1.0, -1.0, 0.0]]), TimeAxis(0.9, 2, 5))
    array([7.5, nan])
    """
    total = means.sum(axis=-1)
    one_sign = (means >= 0.0).all(axis=-1) | (means <= 0.0).all(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = means @ (np.arange(axis.num_components) * axis.width) / total
    return np.where(one_sign & (total != 0.0), found, np.nan)
