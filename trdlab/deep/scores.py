"""What became of an agent's acting: the episodes so far."""

from collections import deque
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray
from trdlab.environments import Step

RECENT = 100
"""Episodes whose mean return is the score."""


class Scores:
    """Returns and lengths of the episodes: those that run, and the last hundred.

    A return is the plain sum of the rewards that the environment paid, neither clipped nor
    discounted; a length is in agent steps. An episode ends with the game, not with a life.

    Args:
        num_envs: B.
    """

    def __init__(self, num_envs: int) -> None:
        self.returns, self.lengths = np.zeros(num_envs), np.zeros(num_envs, dtype=np.int64)
        self.recent: deque[tuple[float, int]] = deque(maxlen=RECENT)
        self.num_episodes = 0

    def add(self, step: Step) -> None:
        """Counts a step of every environment."""
        self.returns += step.rewards
        self.lengths += 1
        for env in np.flatnonzero(step.ended):
            self.recent.append((float(self.returns[env]), int(self.lengths[env])))
            self.num_episodes += 1
        self.drop(step.ended)

    def drop(self, where: BoolArray | slice = slice(None)) -> None:
        """Forgets the episodes that run in these environments."""
        self.returns[where], self.lengths[where] = 0.0, 0

    @property
    def mean_return(self) -> float | None:
        """The score: the mean return of the last hundred episodes; None before the first."""
        return float(np.mean([total for total, _ in self.recent])) if self.recent else None

    @property
    def mean_length(self) -> float | None:
        """The mean length of the episodes, in agent steps."""
        return float(np.mean([length for _, length in self.recent])) if self.recent else None

    def state_dict(self) -> dict[str, Any]:
        """Returns everything, as plain numbers and arrays."""
        return {
            "returns": self.returns.copy(),
            "lengths": self.lengths.copy(),
            "recent": [list(episode) for episode in self.recent],
            "num_episodes": self.num_episodes,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Takes over what `state_dict` returned."""
        self.returns[:], self.lengths[:] = state["returns"], state["lengths"]
        self.recent = deque(((total, length) for total, length in state["recent"]), maxlen=RECENT)
        self.num_episodes = state["num_episodes"]
