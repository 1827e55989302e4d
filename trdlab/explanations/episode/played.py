"""An episode that was played, and the family of claims about one."""

from dataclasses import dataclass, field

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.explanations.claims import Claim
from trdlab.explanations.episode.revision import Revision, revise
from trdlab.rollouts.episodes import Episode


@dataclass(frozen=True, eq=False)
class Played:
    """An episode with all that a story of it is held against.

    Args:
        episode: what was predicted and what happened.
        action_names: A names.
        seconds_per_step: how long a step takes as people play, if that is known.
        revision: what each step changed; it follows from the episode.
    """

    episode: Episode
    action_names: tuple[str, ...]
    seconds_per_step: float | None = None
    revision: Revision = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "revision", revise(self.episode))

    @property
    def scale(self) -> float:
        """The largest reward that came, or value that was expected, whatever its sign."""
        episode = self.episode
        values = (episode.predicted.sum(axis=1), episode.expected.sum(axis=1), episode.rewards)
        return float(max(np.abs(of).max() for of in values))

    def action(self, step: int) -> str:
        """Returns the name of the action taken at a step."""
        return self.action_names[int(self.episode.actions[step])]

    def row(self, step: int) -> int | None:
        """Returns the place of a step in the revision, None if it has none."""
        steps = self.revision.steps
        place = int(np.searchsorted(steps, step))
        return place if place < len(steps) and steps[place] == step else None


class StoryClaim(Claim):
    """A claim about an episode that was played."""

    @property
    def place(self) -> int | None:
        """The step of the episode that it is about; None if it is about the whole."""
        return None

    def holds(self, played: Played) -> bool:
        """Returns whether the claim is true of an episode, tested by its definition."""
        raise NotImplementedError


def play(agent: Agent, seed: int = 0, *, max_steps: int | None = None) -> Played:
    """Returns an episode that an agent's policy plays, without any random actions of ours.

    Args:
        agent: who plays.
        seed: of the episode.
        max_steps: after which it is cut off, if not before.
    """
    (episode,) = agent.play(1, seed=seed, max_steps=max_steps)
    return Played(episode, agent.action_names, agent.seconds_per_step)
