"""Assessing an agent: its episodes are played, and what it expected is judged by what came."""

from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.decomposition import RewardDecomposition
from trdlab.environments import NotCopyable, NotParallel
from trdlab.errors import InputError
from trdlab.explanations.calibration.report import CalibrationReport, judge, score_of
from trdlab.explanations.moment.exact import exact_moment
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.outcome import Trial
from trdlab.rollouts.branches import Branches, Branching, Effort, TooFewMoments
from trdlab.rollouts.counterfactual import compared, try_actions
from trdlab.rollouts.episodes import Episode, distinct
from trdlab.rollouts.playing import Playing, Watch, part_of, unwatched
from trdlab.statistics import FEWEST_EPISODES
from trdlab.tabular import ExactTable

FOLLOWED = 100  # steps for which two actions that are tried are followed at least
LOST = (  # where the states of an environment cannot be copied
    "So nothing tells how well anybody could forecast here, nor how well the agent forecasts "
    "actions that it would not take."
)

_FIRST = 0.2  # of the episodes, by which it is seen whether all are alike


def assess(
    agent: Agent,
    *,
    episodes: int = 50,
    epsilon: float | None = None,
    max_steps: int | None = None,
    effort: Effort | None = None,
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
        effort: how states are copied for the ceiling and for foils; without it there are none. Nor
            are there where states cannot be copied: `lost` of the report then says why.
        seed: of everything.
        watch: told how far the episodes are, after every step.

    Raises:
        InputError: there is less than one episode, or ε is outside [0, 1).
    """
    if episodes < 1:
        raise InputError(f"There are {episodes} episodes.", "Ask for at least 1.")
    judging, chance = _Judging(agent, episodes, max_steps, seed, watch), epsilon or 0.0
    played, alike = (judging.played(chance), False) if chance else judging.alike()
    score = score_of(played, seed=seed) if alike else None
    played = distinct(played) if alike else played
    if alike and epsilon is None:
        chance = 1.0 / (agent.estimator.time_axis.num_steps + 2)
        played = judging.played(chance)
    branches, foils, lost = None, None, ""
    if effort is not None:
        length = float(np.mean([len(episode) for episode in played]))
        every = max(1, round(length / effort.moments))
        try:
            branches = judging.copied(effort, chance, every, foils=False)
            if len(agent.action_names) > 1:
                foils = judging.copied(effort, chance, every, foils=True)
        except (NotCopyable, NotParallel) as error:
            branches, lost = None, f"{error.cause} {LOST}"
    report = judge(
        agent.estimator.future,
        played,
        branches,
        foils,
        score=score,
        gamma=getattr(agent.policy, "gamma", None),
        seconds_per_step=agent.seconds_per_step,
        seed=seed,
    )
    return replace(report, lost=lost, agent=agent)


@dataclass(frozen=True)
class _Judging:
    """How episodes are played to judge an agent by; see `assess`."""

    agent: Agent
    episodes: int
    max_steps: int | None
    seed: int
    watch: Watch

    def alike(self) -> tuple[tuple[Episode, ...], bool]:
        """Returns episodes by the policy alone, and whether they are too much alike to judge by.

        Where all of the first ones are the same, no more are played.
        """
        first = min(self.episodes, max(FEWEST_EPISODES, round(_FIRST * self.episodes)))
        played = self.played(0.0, first)
        if self.episodes > first and len(distinct(played)) > 1:
            played += self.played(0.0, before=first)
        return played, len(distinct(played)) < min(FEWEST_EPISODES, self.episodes)

    def played(
        self, epsilon: float, end: int | None = None, before: int = 0
    ) -> tuple[Episode, ...]:
        """Returns the episodes up to the `end` of them, but for those that were played `before`."""
        return self.agent.play(
            (end or self.episodes) - before,
            seed=self.seed + 3 * (before > 0),  # the two seeds between are of the copies
            epsilon=epsilon,
            max_steps=self.max_steps,
            watch=part_of(self.watch, before, self.episodes),
            what="episodes with some random actions" if epsilon else "episodes to judge by",
        )

    def copied(self, effort: Effort, epsilon: float, every: int, *, foils: bool) -> Branches:
        """Returns what else could have followed, of the policy's actions or of foils.

        Where a few long episodes hide that most are short, moments are copied more often than
        `every`.
        """
        agent, seed = self.agent, self.seed + 1 + foils
        branching = Branching(agent.estimator, agent.policy, effort.copies)
        try:
            with closing(agent.make(effort.episodes, seed)) as environments:
                return branching.along(
                    environments,
                    every=every,
                    epsilon=epsilon,
                    max_steps=self.max_steps,
                    seed=seed,
                    foils=foils,
                    watch=self.watch,
                )
        except TooFewMoments:
            if every == 1:
                raise
            return self.copied(effort, epsilon, every // 2, foils=foils)


def usual_episodes(agent: Agent) -> int:
    """Returns by how many episodes an agent is judged, where nothing else is said."""
    return agent.effort.judged


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
    """Returns what the agent expects where the first of its episodes stands.

    Of actions that the environment forbids there nothing is told.
    """
    if agent.world is not None and isinstance(agent.estimator, ExactTable) and not agent.is_away:
        found = exact_moment(agent.world, agent.estimator, int(playing.stack.observations[0]))
        called = dict(zip(found.action_names, agent.action_names, strict=True))
        tied = tuple(called[name] for name in found.tied)
        return replace(found, action_names=agent.action_names, tied=tied)
    decision, names = playing.decide(), np.array(agent.action_names)
    allowed = slice(None) if playing.allowed is None else playing.allowed[0]  # [A]
    # findings compare sums, and float32 sums differ in order
    components = decision.decomposition.components[0, allowed].astype(np.float64)  # [A, N+1]
    own = tuple(names[allowed].tolist())
    seen = playing.stack.observations[playing.running][:1]  # [1, ...]
    outlook = agent.estimator.outlook(seen) if hasattr(agent.estimator, "outlook") else None
    return Moment(
        RewardDecomposition(components, agent.estimator.time_axis),
        own,
        agent.estimator.future,
        policy=decision.probabilities[0, allowed].astype(np.float64),
        forbidden=tuple(name for name in agent.action_names if name not in own),
        outlook=None if outlook is None else outlook[0, allowed],
        seconds_per_step=agent.seconds_per_step,
    )


def try_in_play(
    agent: Agent, playing: Playing, action: str, foil: str, *, seed: int
) -> tuple[Branches, Branches]:
    """Returns what follows two actions where the first of an agent's episodes stands.

    The copies are followed until all have ended, but no further than `FOLLOWED` steps or the
    explicit components, whichever is more.
    """
    steps = max(FOLLOWED, agent.estimator.time_axis.num_steps)
    branching = Branching(agent.estimator, agent.policy, agent.effort.tries, steps)
    one, other = map(agent.action_names.index, (action, foil))
    return try_actions(branching, playing, one, other, seed=seed)


def trial_of(
    agent: Agent, tried: tuple[Branches, Branches], report: CalibrationReport | None, *, seed: int
) -> Trial:
    """Returns how two actions differ that an agent tried, held against what it knows otherwise."""
    found = compared(tried, *(() if report is None else report.seen), seed=seed)
    return Trial(found, agent.action_names, agent.seconds_per_step)
