"""Assessing an agent: its episodes are played, and what it expected is judged by what came."""

from dataclasses import replace
from typing import Any, TypeGuard

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.environments import CopyableEnvironments, Environments, NotCopyable
from trdlab.errors import InputError
from trdlab.explanations.calibration.report import CalibrationReport, judge
from trdlab.explanations.calibration.score import score_of
from trdlab.explanations.moment.exact import exact_moment
from trdlab.explanations.moment.moment import Moment, moment_of
from trdlab.explanations.moment.outcome import Trial
from trdlab.rollouts.branches import Branches, Branching, Copying, TooFewMoments
from trdlab.rollouts.counterfactual import counterfactual
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.playing import Watch, decide, play_to, unwatched
from trdlab.statistics import FEWEST_EPISODES
from trdlab.tabular import ExactTable

FOLLOWED = 100
"""Steps for which two actions that are tried are followed at least."""


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
    which nothing can be told for sure. Then, unless ε is given, they are played again with an ε of
    1/(N·w + 2), so that about one action in a horizon is a random one.

    Args:
        agent: whom to judge.
        episodes: how many to play.
        epsilon: the chance of a random action.
        max_steps: after which an episode is cut off, if not before.
        copying: how states are copied for the ceiling and for foils; without it there are none, nor
            where states cannot be copied.
        seed: of everything.
        watch: told how far the episodes are, after every step.

    Raises:
        InputError: there is less than one episode, or ε is outside [0, 1).
    """
    if episodes < 1:
        raise InputError(f"There are {episodes} episodes.", "Ask for at least 1.")

    def played_with(chance: float, what: str) -> tuple[Episode, ...]:
        how: dict[str, Any] = {"epsilon": chance, "max_steps": max_steps, "seed": seed}
        return agent.play(episodes, **how, watch=watch, what=what)

    chance = epsilon or 0.0
    played = played_with(chance, "episodes to judge by")
    score = score_of(played, seed=seed)
    if epsilon is None and score.different < min(FEWEST_EPISODES, episodes):
        chance = 1.0 / (agent.estimator.time_axis.num_steps + 2)
        played = played_with(chance, "episodes with some random actions")
    length = float(np.mean([len(episode) for episode in played]))
    copied = None
    if copying is not None:
        every = max(1, round(length / copying.moments))
        how: dict[str, Any] = {"epsilon": chance, "max_steps": max_steps, "watch": watch}
        copied = _copied(agent, copying, every, seed + 1, **how)
    return judge(
        agent.estimator.future,
        played,
        *(copied or ()),
        score=score,
        seconds_per_step=agent.seconds_per_step,
        seed=seed,
    )


def try_out(
    agent: Agent,
    action: str,
    foil: str,
    *,
    seed: int = 0,
    step: int = 0,
    copies: int | None = None,
    report: CalibrationReport | None = None,
) -> Trial | None:
    """Tries two actions at a step of an agent's episode, each from copies of the state.

    The copies are followed until all have ended, but no further than `FOLLOWED` steps or the
    explicit components, whichever is more.

    Args:
        agent: whose policy is followed after the first action.
        action: the name of one action.
        foil: the name of the other.
        seed: of the episode.
        step: of that episode.
        copies: how often each is tried, by default as the agent's `copying` says.
        report: on the agent, which knows what rewards can come.

    Returns:
        What was forecast and what came; None where states cannot be copied.

    Raises:
        InputError: there is no such step or action, or both are the same.
    """
    environments = agent.make(1, seed)
    steps = max(FOLLOWED, agent.estimator.time_axis.num_steps)
    tries = agent.copying.tries if copies is None else copies
    branching = Branching(agent.estimator, agent.policy, agent.counting, tries, steps)
    try:
        if not _can_be_copied(environments):
            return None
        stack = play_to(agent.estimator, environments, step, policy=agent.policy, seed=seed)
        found = counterfactual(
            branching,
            environments,
            stack,
            agent.action_names.index(action),
            agent.action_names.index(foil),
            age=step,
            seen=None if report is None else report.seen,
            seed=seed,
        )
    except NotCopyable:
        return None
    finally:
        environments.close()
    return Trial(found, agent.action_names, agent.seconds_per_step)


def moment_at(agent: Agent, *, seed: int = 0, step: int = 0) -> Moment:
    """Returns what the agent expects at a step of an episode that its policy plays.

    Args:
        agent: whom to ask.
        seed: of the episode.
        step: how many steps have been taken.

    Raises:
        InputError: the episode is over by then, or the step is negative.
    """
    if step < 0:
        raise InputError(f"The step is {step}.", "Steps are counted from 0.")
    environments = agent.make(1, seed)
    try:
        stack = play_to(agent.estimator, environments, step, policy=agent.policy, seed=seed)
    finally:
        environments.close()
    if agent.world is not None and isinstance(agent.estimator, ExactTable):
        return exact_moment(agent.world, agent.estimator, int(stack.observations[0]))
    chosen = decide(agent.estimator, stack.observations, agent.policy).probabilities[0]
    moment = moment_of(agent.estimator, stack.observations[0], agent.action_names)
    policy = np.asarray(chosen, dtype=np.float64)
    return replace(moment, policy=policy, seconds_per_step=agent.seconds_per_step)


def _copied(
    agent: Agent, copying: Copying, every: int, seed: int, **how: Any
) -> tuple[Branches, Branches | None] | None:
    """Returns what else could have followed, and what follows foils, if there is another action.

    Where a few long episodes hide that most are short, moments are copied more often than `every`.
    None where states cannot be copied.
    """
    branching = Branching(agent.estimator, agent.policy, agent.counting, copies=copying.copies)

    def along(every: int, seed: int, *, foils: bool) -> Branches | None:
        environments = agent.make(copying.episodes, seed)
        try:
            if not _can_be_copied(environments):
                return None
            return branching.along(environments, every=every, seed=seed, foils=foils, **how)
        except NotCopyable:
            return None
        except TooFewMoments:
            if every == 1:
                raise
            return along(every // 2, seed, foils=foils)
        finally:
            environments.close()

    branches = along(every, seed, foils=False)
    if branches is None:
        return None
    return branches, along(every, seed + 1, foils=True) if len(agent.action_names) > 1 else None


def _can_be_copied(environments: Environments) -> TypeGuard[CopyableEnvironments]:
    return hasattr(environments, "branch")
