"""The calibration report: all that is known of how far a forecast can be trusted."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.arrays import FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations.calibration.calibration import Calibration, Trust, calibrate
from trdlab.explanations.calibration.ceiling import Ceiling, ceiling_of
from trdlab.explanations.calibration.consistency import Consistency, consistency_of
from trdlab.explanations.calibration.errors import Errors, errors_of
from trdlab.explanations.calibration.residual import Residual, residual_of
from trdlab.printable import Printable
from trdlab.rollouts.branches import Branches
from trdlab.rollouts.critique import Critique, critique_of
from trdlab.rollouts.episodes import Episode, distinct
from trdlab.rollouts.realised import pool
from trdlab.statistics import FEWEST_EPISODES, Estimate, bootstrap


@dataclass(frozen=True)
class Score:
    """How an agent did in some episodes, and how they ended.

    Args:
        episodes: E.
        different: how many of them are not the same as another one.
        steps: of all together.
        epsilon: the chance of a random action.
        returns: the mean of the undiscounted rewards of an episode, as they are counted; its ends
            are NaN where fewer than `FEWEST_EPISODES` differ, unless all pay the same.
        least: the least reward of any step.
        most: the largest.
        terminated: how many ended for good.
        truncated: how many were cut off.
        life_losses: how often a life was lost and the episode went on.
        life_loss_ends: whether that counts as an end.
        time_limit: the steps after which they were cut off, if that is known.
    """

    episodes: int
    different: int
    steps: int
    epsilon: float
    returns: Estimate
    least: float
    most: float
    terminated: int
    truncated: int
    life_losses: int
    life_loss_ends: bool
    time_limit: int | None = None


def score_of(episodes: Sequence[Episode], *, seed: int = 0) -> Score:
    """Returns how an agent did in some episodes, one or more; the seed is of the bootstrap."""
    returns = np.array([episode.rewards.sum() for episode in episodes])
    mean = bootstrap(returns, rng=np.random.default_rng(seed))
    different = len(distinct(episodes))
    if different < FEWEST_EPISODES and np.ptp(returns) > 0.0:
        mean = Estimate(mean.value, np.nan, np.nan)
    terminated, limits = sum(e.terminated for e in episodes), {e.time_limit for e in episodes}
    return Score(
        episodes=len(episodes),
        different=different,
        steps=sum(map(len, episodes)),
        epsilon=max(e.epsilon for e in episodes),
        returns=mean,
        least=float(min(e.rewards.min() for e in episodes)),
        most=float(max(e.rewards.max() for e in episodes)),
        terminated=terminated,
        truncated=len(episodes) - terminated,
        life_losses=sum(int(e.life_lost.sum()) for e in episodes),
        life_loss_ends=any(bool((e.life_lost & e.ends).any()) for e in episodes),
        time_limit=limits.pop() if len(limits) == 1 else None,
    )


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
        critique: how the policy's own critic compares; None where it has none.
        agent: whom it judges; None where that is not known.
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
    critique: Critique | None = None
    agent: Agent | None = None

    @property
    def trust(self) -> Trust:
        """How far the forecast can be trusted."""
        return self.calibration.trust

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.calibration.time_axis

    @property
    def seen(self) -> tuple[FloatArray, bool | None]:
        """What two actions that are tried have to be held against (see `compared`)."""
        ranges = [of.observed_range for of in (self.calibration, self.foils) if of is not None]
        least, most = np.stack(ranges).min(axis=0)[0], np.stack(ranges).max(axis=0)[1]
        unless = None if self.ceiling is None else not self.ceiling.deterministic
        return np.stack([least, most]), self.chance or unless


def judge(
    future: Future,
    episodes: Sequence[Episode],
    branches: Branches | None = None,
    foils: Branches | None = None,
    *,
    score: Score | None = None,
    gamma: float | None = None,
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
        gamma: the discount factor that the policy's own critic was trained with, if that is known.
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
    judged = score_of(episodes, seed=seed)
    return CalibrationReport(
        future=future,
        score=score or judged,
        judged=judged,
        calibration=calibrate(samples, seed=seed),
        residual=residual_of(episodes, seed=seed),
        errors=errors_of(samples, seed=seed),
        consistency=consistency_of(episodes, seed=seed) if axis.horizon else None,
        ceiling=None if branches is None else ceiling_of(branches, seed=seed),
        foils=None if foils is None else calibrate(foils, seed=seed),
        scale=max(float(np.abs(of.decomposition.components).max()) for of in episodes),
        chance=_has_chance(episodes) or any(of.shared_chance for of in copies),
        seconds_per_step=seconds_per_step,
        critique=critique_of(episodes, gamma, seed=seed),
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
