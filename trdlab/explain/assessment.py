"""Assessing an agent: its episodes are played, and what it expected is judged by what came."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np

from trdlab.environments import CopyableEnvironments, Environments, NotCopyable
from trdlab.errors import InputError
from trdlab.explain.agents import Agent
from trdlab.explain.branches import Branches, Branching
from trdlab.explain.counterfactual import counterfactual, play_to
from trdlab.explain.episodes import Episode, collect
from trdlab.explain.tried import Trial
from trdlab.explain.trust.intervals import FEWEST_EPISODES
from trdlab.explain.trust.report import TrustReport, judge

FOLLOWED = 100
"""Steps for which two actions that are tried are followed at least."""


@dataclass(frozen=True)
class Copying:
    """How the states of an agent's episodes are copied, for the ceiling.

    Args:
        episodes: how many are played for it.
        moments: how many states of each are copied, about.
        copies: how often each is.
    """

    episodes: int = 20
    moments: int = 5
    copies: int = 8


def assess(
    agent: Agent,
    *,
    episodes: int = 50,
    epsilon: float | None = None,
    copying: Copying | None = None,
    seed: int = 1000,
    on_episode: Callable[[int], None] = lambda finished: None,
) -> TrustReport:
    """Plays episodes of an agent, and judges what it expected by what came.

    Where neither the agent nor its environments know chance, all episodes are the same one, of
    which nothing can be told for sure. Then, unless ε is given, they are played again with an ε of
    1/(N·w + 2), so that about one action in a horizon is a random one.

    Args:
        agent: whom to judge.
        episodes: how many to play.
        epsilon: the chance of a random action.
        copying: how states are copied for the ceiling and for foils; without it there are none, nor
            where states cannot be copied.
        seed: of everything.
        on_episode: called with the number of finished episodes whenever some finish.

    Raises:
        InputError: there is less than one episode, or ε is outside [0, 1).
    """
    if episodes < 1:
        raise InputError(f"There are {episodes} episodes.", "Ask for at least 1.")
    chance = epsilon or 0.0
    played = _played(agent, episodes, chance, seed, on_episode)
    if epsilon is None and _different(played) < min(FEWEST_EPISODES, episodes):
        chance = 1.0 / (agent.estimator.time_axis.num_steps + 2)
        played = _played(agent, episodes, chance, seed, on_episode)
    length = float(np.mean([len(episode) for episode in played]))
    copied = None if copying is None else _copied(agent, copying, length, chance, seed + 1)
    return judge(
        agent.estimator.future,
        played,
        *(copied or ()),
        seconds_per_step=agent.seconds_per_step,
        seed=seed,
    )


def try_out(
    agent: Agent, action: str, foil: str, *, seed: int = 0, step: int = 0, copies: int = 50
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
        copies: how often each is tried.

    Returns:
        What was forecast and what came; None where states cannot be copied.

    Raises:
        InputError: there is no such step or action, or both are the same.
    """
    environments = agent.make(1, seed)
    steps = max(FOLLOWED, agent.estimator.time_axis.num_steps)
    branching = Branching(agent.estimator, agent.policy, agent.counting, copies, steps)
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
            seed=seed,
        )
    except NotCopyable:
        return None
    finally:
        environments.close()
    return Trial(found, agent.action_names, agent.seconds_per_step)


def _played(
    agent: Agent, count: int, epsilon: float, seed: int, on_episode: Callable[[int], None]
) -> tuple[Episode, ...]:
    environments = agent.make(count, seed)
    try:
        return collect(
            agent.estimator,
            environments,
            policy=agent.policy,
            counting=agent.counting,
            epsilon=epsilon,
            seed=seed,
            on_episode=on_episode,
        )
    finally:
        environments.close()


def _different(episodes: Sequence[Episode]) -> int:
    """Returns how many episodes are not the same as another one."""
    return len(
        {
            (e.actions.tobytes(), e.rewards.tobytes(), np.asarray(e.expected).tobytes())
            for e in episodes
        }
    )


def _copied(
    agent: Agent, copying: Copying, length: float, epsilon: float, seed: int
) -> tuple[Branches, Branches | None] | None:
    """Returns what else could have followed, and what follows foils, if there is another action.

    None where states cannot be copied.
    """
    branching = Branching(agent.estimator, agent.policy, agent.counting, copies=copying.copies)
    every = max(1, round(length / copying.moments))

    def along(seed: int, *, foils: bool) -> Branches | None:
        environments = agent.make(copying.episodes, seed)
        try:
            if not _can_be_copied(environments):
                return None
            return branching.along(
                environments, every=every, epsilon=epsilon, seed=seed, foils=foils
            )
        except NotCopyable:
            return None
        finally:
            environments.close()

    branches = along(seed, foils=False)
    if branches is None:
        return None
    return branches, along(seed + 1, foils=True) if len(agent.action_names) > 1 else None


def _can_be_copied(environments: Environments) -> TypeGuard[CopyableEnvironments]:
    return hasattr(environments, "branch")
