"""The trust report: all that is known of how far a forecast can be trusted."""

from collections.abc import Sequence
from dataclasses import dataclass

from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations.calibration.calibration import Calibration, Endings, calibrate, endings
from trdlab.explanations.calibration.ceiling import Ceiling, ceiling
from trdlab.explanations.calibration.consistency import Audit, audit
from trdlab.explanations.calibration.errors import MIN_DISCOUNT, Blame, blame
from trdlab.explanations.calibration.faults import Fault, diagnose
from trdlab.explanations.calibration.residual import Hidden, hidden
from trdlab.explanations.calibration.trust import Trust, trust
from trdlab.rollouts.branches import Branches
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import pool


@dataclass(frozen=True, eq=False)
class TrustReport:
    """What an estimator predicted in some episodes, judged by what came.

    Args:
        future: whose future the estimator speaks of.
        num_episodes: E.
        num_steps: of all episodes together.
        epsilon: the chance of a random action in them.
        endings: how they ended.
        calibration: how well each component was predicted.
        trust: how far the forecast can be trusted.
        hidden: what lies in the residual.
        blame: what is wrong with the errors; None where there are no two explicit components.
        audit: how steps fit each other; None for N = 0.
        ceiling: the skill of a perfect prediction; None where states were not copied.
        foils: how well the components of actions were predicted that the policy would not have
            taken; None where states were not copied, or where there is no other action.
        faults: what is surely implemented wrongly.
        seconds_per_step: how long a step takes as people play, if that is known.
        lost: why there is no ceiling and there are no foils though they were asked for, else empty.
    """

    future: Future
    num_episodes: int
    num_steps: int
    epsilon: float
    endings: Endings
    calibration: Calibration
    trust: Trust
    hidden: Hidden
    blame: Blame | None
    audit: Audit | None
    ceiling: Ceiling | None
    foils: Calibration | None
    faults: tuple[Fault, ...]
    seconds_per_step: float | None = None
    lost: str = ""

    @property
    def foil_trust(self) -> Trust | None:
        """How far the forecasts of actions can be trusted that the policy would not have taken."""
        return None if self.foils is None else trust(self.foils)

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.calibration.time_axis


def judge(
    future: Future,
    episodes: Sequence[Episode],
    branches: Branches | None = None,
    foils: Branches | None = None,
    *,
    seconds_per_step: float | None = None,
    seed: int = 0,
) -> TrustReport:
    """Judges an estimator by its episodes.

    Args:
        future: whose future it speaks of.
        episodes: what it predicted and what happened.
        branches: what else could have followed, for the ceiling.
        foils: what followed other first actions than the policy's.
        seconds_per_step: how long a step takes as people play, if that is known.
        seed: of every bootstrap.

    Raises:
        InputError: there are no episodes, or they and the branches are of different time axes.
    """
    samples = pool(episodes)
    axis = samples.time_axis
    for copied in (branches, foils):
        if copied is not None and copied.time_axis != axis:
            raise InputError(
                f"The episodes are of {axis}, the copies of {copied.time_axis}.",
                "Play both with the same estimator.",
            )
    has_neighbours = axis.horizon > 1 and axis.discounts[-2] >= MIN_DISCOUNT
    calibration = calibrate(samples, seed=seed)
    blamed = blame(samples, seed=seed) if has_neighbours else None
    audited = audit(episodes, seed=seed) if axis.horizon else None
    return TrustReport(
        future=future,
        num_episodes=len(episodes),
        num_steps=len(samples),
        epsilon=max(episode.epsilon for episode in episodes),
        endings=endings(episodes),
        calibration=calibration,
        trust=trust(calibration),
        hidden=hidden(episodes, seed=seed),
        blame=blamed,
        audit=audited,
        ceiling=None if branches is None else ceiling(branches, seed=seed),
        foils=None if foils is None else calibrate(foils.samples, seed=seed),
        faults=diagnose(blamed, audited),
        seconds_per_step=seconds_per_step,
    )
