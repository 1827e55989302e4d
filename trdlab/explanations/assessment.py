"""Assessing an agent: its episodes are played, and what it expected is judged by what came."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.arrays import FloatArray
from trdlab.decomposition import RewardDecomposition
from trdlab.environments import NotCopyable, NotParallel
from trdlab.errors import InputError
from trdlab.explanations.calibration.calibration import Calibration
from trdlab.explanations.calibration.report import CalibrationReport, judge, score_of
from trdlab.explanations.moment.exact import exact_moment
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.outcome import Trial
from trdlab.rollouts.branches import Branches, Branching, Copying, TooFewMoments
from trdlab.rollouts.counterfactual import compared, try_actions
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.playing import Playing, Progress, Watch, can_be_copied, unwatched
from trdlab.statistics import FEWEST_EPISODES
from trdlab.tabular import ExactTable

FOLLOWED = 100
"""Steps for which two actions that are tried are followed at least."""

_FIRST = 0.2  # of the episodes, by which it is seen whether all are alike


@dataclass(frozen=True)
class _Judging:
    """How episodes are played to judge an agent by.

    Args:
        agent: whom to judge.
        max_steps: after which an episode is cut off, if not before.
        seed: of everything.
        watch: told how far the episodes are, after every step.
    """

    agent: Agent
    max_steps: int | None
    seed: int
    watch: Watch

    def alike(self, count: int) -> tuple[tuple[Episode, ...], bool]:
        """Returns episodes by the policy alone, and whether they are too much alike to judge by.

        Where all of the first ones are the same, no more are played, and each is given once.
        """
        first = min(count, max(FEWEST_EPISODES, round(_FIRST * count)))
        played = self.played(0.0, first, of=count)
        if count > first and len(_different(played)) > 1:
            played += self.played(0.0, count - first, of=count, before=first)
        different = _different(played)
        alike = len(different) < min(FEWEST_EPISODES, count)
        return (different if alike else played), alike

    def played(
        self, epsilon: float, count: int, *, of: int, before: int = 0
    ) -> tuple[Episode, ...]:
        """Returns `count` episodes out of some, `before` which others have been played."""

        def tell(progress: Progress) -> None:
            self.watch(replace(progress, finished=progress.finished + before, episodes=of))

        return self.agent.play(
            count,
            seed=self.seed + 3 * (before > 0),  # the two seeds between are of the copies
            epsilon=epsilon,
            max_steps=self.max_steps,
            watch=tell,
            what="episodes with some random actions" if epsilon else "episodes to judge by",
        )

    def copied(self, copying: Copying, epsilon: float, every: int) -> "_Copied":
        """Returns what else could have followed, and what follows foils, if there are any.

        Where a few long episodes hide that most are short, moments are copied more often than
        `every`.
        """
        agent = self.agent
        branching = Branching(agent.estimator, agent.policy, copies=copying.copies)

        def along(every: int, *, foils: bool) -> Branches:
            environments = agent.make(copying.episodes, self.seed + 1 + foils)
            try:
                if not can_be_copied(environments):
                    raise NotCopyable("Its environments cannot be copied.")
                return branching.along(
                    environments,
                    every=every,
                    epsilon=epsilon,
                    max_steps=self.max_steps,
                    seed=self.seed + 1 + foils,
                    foils=foils,
                    watch=self.watch,
                )
            except TooFewMoments:
                if every == 1:
                    raise
                return along(every // 2, foils=foils)
            finally:
                environments.close()

        try:
            branches = along(every, foils=False)
            foils = along(every, foils=True) if len(agent.action_names) > 1 else None
        except (NotCopyable, NotParallel) as error:
            return _Copied(lost=f"{error.cause} {LOST}")
        return _Copied(branches, foils)


LOST = (
    "So nothing tells how well anybody could forecast here, nor how well the agent forecasts "
    "actions that it would not take."
)
"""What is lost where the states of an environment cannot be copied."""


@dataclass(frozen=True, eq=False)
class _Copied:
    """What followed copies, or what is lost where there are none."""

    branches: Branches | None = None
    foils: Branches | None = None
    lost: str = ""


def assess(
    agent: Agent,
    *,
    episodes: int = 50,
    epsilon: float | None = None,
    max_steps: int | None = None,
    copying: Copying | None = None,
    seed: int = 1000,
    watch: Watch = unwatched,
) -> CalibrationReport:
    """Plays episodes of an agent, and judges what it expected by what came.

    Where neither the agent nor its environments know chance, all episodes are the same one, of
    which nothing can be told for sure; it is not played again and again. Unless ε is given, others
    are then played with an ε of 1/(N·w + 2), so that about one action in a horizon is a random one.

    Args:
        agent: whom to judge.
        episodes: how many to play.
        epsilon: the chance of a random action.
        max_steps: after which an episode is cut off, if not before.
        copying: how states are copied for the ceiling and for foils; without it there are none. Nor
            are there where states cannot be copied: `lost` of the report then says why.
        seed: of everything.
        watch: told how far the episodes are, after every step.

    Raises:
        InputError: there is less than one episode, or ε is outside [0, 1).
    """
    if episodes < 1:
        raise InputError(f"There are {episodes} episodes.", "Ask for at least 1.")
    judging, chance = _Judging(agent, max_steps, seed, watch), epsilon or 0.0
    if chance:
        played = judging.played(chance, episodes, of=episodes)
        score = score_of(played, seed=seed)
    else:
        played, alike = judging.alike(episodes)
        score = score_of(played, seed=seed)
        if alike and epsilon is None:
            chance = 1.0 / (agent.estimator.time_axis.num_steps + 2)
            played = judging.played(chance, episodes, of=episodes)
    copied = _Copied()
    if copying is not None:
        length = float(np.mean([len(episode) for episode in played]))
        copied = judging.copied(copying, chance, max(1, round(length / copying.moments)))
    report = judge(
        agent.estimator.future,
        played,
        copied.branches,
        copied.foils,
        score=score,
        seconds_per_step=agent.seconds_per_step,
        seed=seed,
    )
    return replace(report, lost=copied.lost)


def usual_episodes(agent: Agent) -> int:
    """Returns by how many episodes an agent is judged, where nothing else is said.

    Of what has to be played that is few; of an exact table it is cheap.
    """
    return 50 if agent.world is None else 300


def moment_at(agent: Agent, *, seed: int = 0, step: int = 0) -> Moment:
    """Returns what the agent expects at a step of an episode that its policy plays.

    Args:
        agent: whom to ask.
        seed: of the episode.
        step: how many steps have been taken.

    Raises:
        InputError: the episode is over by then, or the step is negative.
    """
    with agent.begin(seed=seed) as recording:
        recording.play_to(step)
        return moment_of_play(agent, recording.playing)


def moment_of_play(agent: Agent, playing: Playing) -> Moment:
    """Returns what the agent expects where the first of its episodes stands."""
    if agent.world is not None and isinstance(agent.estimator, ExactTable):
        return exact_moment(agent.world, agent.estimator, int(playing.stack.observations[0]))
    decision = playing.decide()
    # findings compare sums, and float32 sums differ in order
    components = decision.decomposition.components[0].astype(np.float64)  # [A, N+1]
    return Moment(
        RewardDecomposition(components, agent.estimator.time_axis),
        agent.action_names,
        agent.estimator.future,
        policy=decision.probabilities[0].astype(np.float64),
        seconds_per_step=agent.seconds_per_step,
    )


def judged(moment: Moment, report: CalibrationReport) -> Moment:
    """Returns a moment with what a report knows of such forecasts.

    That is how far they can be trusted, what they are off by, and whether rewards are of one kind.

    Args:
        moment: what is expected.
        report: on the estimator that expects it.
    """
    reliability = report.calibration.reliability
    return replace(
        moment,
        trust=report.trust,
        foil_trust=report.foil_trust,
        error=_root_mean_square(report.calibration),
        foil_error=None if report.foils is None else _root_mean_square(report.foils),
        only_reward=None if reliability is None else reliability.amount,
    )


def _root_mean_square(calibration: Calibration) -> FloatArray:
    error = calibration.error
    return np.where(np.isfinite(error.low), np.sqrt(error.value), np.nan)


def try_out(
    agent: Agent,
    action: str,
    foil: str,
    *,
    seed: int = 0,
    step: int = 0,
    copies: int | None = None,
    report: CalibrationReport | None = None,
) -> Trial:
    """Tries two actions at a step of an agent's episode, each from copies of the state.

    Args:
        agent: whose policy is followed after the first action.
        action: the name of one action.
        foil: the name of the other.
        seed: of the episode.
        step: of that episode.
        copies: how often each is tried, by default as the agent's `copying` says.
        report: on the agent, which knows what rewards can come.

    Raises:
        InputError: there is no such step or action, or both are the same.
        NotCopyable: the states of its environment cannot be copied.
    """
    with agent.begin(seed=seed) as recording:
        recording.play_to(step)
        playing = recording.playing
        tried = try_in_play(agent, playing, action, foil, seed=seed, copies=copies)
    return trial_of(agent, tried, report, seed=seed)


def try_in_play(
    agent: Agent, playing: Playing, action: str, foil: str, *, seed: int, copies: int | None = None
) -> tuple[Branches, Branches]:
    """Returns what follows two actions where the first of an agent's episodes stands.

    The copies are followed until all have ended, but no further than `FOLLOWED` steps or the
    explicit components, whichever is more.
    """
    steps = max(FOLLOWED, agent.estimator.time_axis.num_steps)
    tries = agent.copying.tries if copies is None else copies
    branching = Branching(agent.estimator, agent.policy, tries, steps)
    numbers = (agent.action_names.index(name) for name in (action, foil))
    return try_actions(branching, playing, *numbers, seed=seed)


def trial_of(
    agent: Agent,
    tried: tuple[Branches, Branches],
    report: CalibrationReport | None,
    *,
    seed: int,
) -> Trial:
    """Returns how two actions differ that an agent tried, held against what it knows otherwise."""
    found = compared(tried, None if report is None else report.seen, seed=seed)
    return Trial(found, agent.action_names, agent.seconds_per_step)


def _different(episodes: Sequence[Episode]) -> tuple[Episode, ...]:
    """Returns the episodes that are not the same as one before."""
    found: dict[tuple[bytes, ...], Episode] = {}
    for e in episodes:
        found.setdefault((e.actions.tobytes(), e.rewards.tobytes(), e.expected.tobytes()), e)
    return tuple(found.values())
