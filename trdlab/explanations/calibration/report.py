"""The calibration report: all that is known of how far a forecast can be trusted."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations.calibration.calibration import Calibration, calibrate
from trdlab.explanations.calibration.ceiling import Ceiling, ceiling_of
from trdlab.explanations.calibration.consistency import Consistency, consistency_of
from trdlab.explanations.calibration.errors import MIN_DISCOUNT, Errors, errors_of
from trdlab.explanations.calibration.residual import Residual, residual_of
from trdlab.explanations.calibration.score import Score, score_of
from trdlab.explanations.calibration.trust import Trust, trust
from trdlab.printable import Printable
from trdlab.rollouts.branches import Branches
from trdlab.rollouts.counterfactual import Seen
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import pool


@dataclass(frozen=True, eq=False, repr=False)
class CalibrationReport(Printable):
    """What an estimator predicted in some episodes, judged by what came.

    Args:
        future: whose future the estimator speaks of.
        score: how the agent does, left to itself.
        judged: how it did in the episodes that its forecasts were judged by.
        calibration: how well each component was predicted.
        residual: what lies in the residual.
        errors: what would mend the forecast; None where there are no two explicit components.
        consistency: how steps fit each other; None for N = 0.
        ceiling: the skill of a perfect prediction; None where states were not copied.
        foils: how well the components of actions were predicted that the policy would not have
            taken; None where states were not copied, or where there is no other action.
        scale: the largest component, of any action, by its absolute value.
        chance: whether steps of which the same was expected went differently, or it was seen that
            copies share their chance.
        seconds_per_step: how long a step takes as people play, if that is known.
        lost: why there is no ceiling and there are no foils though they were asked for, else empty.
    """

    future: Future
    score: Score
    judged: Score
    calibration: Calibration
    residual: Residual
    errors: Errors | None
    consistency: Consistency | None
    ceiling: Ceiling | None
    foils: Calibration | None
    scale: float
    chance: bool
    seconds_per_step: float | None = None
    lost: str = ""

    @property
    def trust(self) -> Trust:
        """How far the forecast can be trusted."""
        return trust(self.calibration)

    @property
    def foil_trust(self) -> Trust | None:
        """How far the forecasts of actions can be trusted that the policy would not have taken."""
        return None if self.foils is None else trust(self.foils)

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.calibration.time_axis

    @property
    def seen(self) -> Seen:
        """What two actions that are tried have to be held against."""
        ranges = [of.observed_range for of in (self.calibration, self.foils) if of is not None]
        least, most = np.stack(ranges).min(axis=0)[0], np.stack(ranges).max(axis=0)[1]
        unless = None if self.ceiling is None else not self.ceiling.deterministic
        return Seen(np.stack([least, most]), self.chance or unless)


def judge(
    future: Future,
    episodes: Sequence[Episode],
    branches: Branches | None = None,
    foils: Branches | None = None,
    *,
    score: Score | None = None,
    seconds_per_step: float | None = None,
    seed: int = 0,
) -> CalibrationReport:
    """Judges an estimator by its episodes.

    Args:
        future: whose future it speaks of.
        episodes: what it predicted and what happened.
        branches: what else could have followed, for the ceiling.
        foils: what followed other first actions than the policy's.
        score: how the agent does, left to itself; by default as in these episodes.
        seconds_per_step: how long a step takes as people play, if that is known.
        seed: of every bootstrap.

    Raises:
        InputError: there are no episodes, or they and the branches are of different time axes.
    """
    samples = pool(episodes)
    axis = samples.time_axis
    copies = [of for of in (branches, foils) if of is not None]
    for copied in copies:
        if copied.time_axis != axis:
            raise InputError(
                f"The episodes are of {axis}, the copies of {copied.time_axis}.",
                "Play both with the same estimator.",
            )
    has_neighbours = axis.horizon > 1 and axis.discounts[-2] >= MIN_DISCOUNT
    judged = score_of(episodes, seed=seed)
    return CalibrationReport(
        future=future,
        score=score or judged,
        judged=judged,
        calibration=calibrate(samples, seed=seed),
        residual=residual_of(episodes, seed=seed),
        errors=errors_of(samples, seed=seed) if has_neighbours else None,
        consistency=consistency_of(episodes, seed=seed) if axis.horizon else None,
        ceiling=None if branches is None else ceiling_of(branches, seed=seed),
        foils=None if foils is None else calibrate(foils.samples, seed=seed),
        scale=max(float(np.abs(of.decomposition.components).max()) for of in episodes),
        chance=_has_chance(episodes) or any(of.shared_chance for of in copies),
        seconds_per_step=seconds_per_step,
    )


def _has_chance(episodes: Sequence[Episode]) -> bool:
    """Returns whether the same action brought another reward where the same was expected.

    Component 0 has to be the reward of the action, or states of which the same is expected could
    pay it earlier or later.
    """
    axis, paid = episodes[0].time_axis, dict[tuple[bytes, int], float]()
    if axis.horizon == 0 or axis.width > 1:
        return False
    return any(
        paid.setdefault((row.tobytes(), int(action)), reward) != reward
        for episode in episodes
        for row, action, reward in zip(
            episode.decomposition.components, episode.actions, episode.rewards, strict=True
        )
    )
