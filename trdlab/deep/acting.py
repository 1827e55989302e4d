"""What an agent sees, and what became of it: stacks of frames, and the episodes so far."""

from collections import deque
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from trdlab.arrays import BoolArray
from trdlab.environments import Environments, Padding, Step

RECENT = 100
"""Episodes whose mean return is the score."""

Frames = npt.NDArray[Any]


def observation_space(environments: Environments) -> gym.spaces.Space[Any]:
    """Returns the space of what the agent sees: a frame, or a stack `[k, ...]` of them."""
    frame = environments.observation_space
    if environments.stack is None or not isinstance(frame, gym.spaces.Box):
        return frame
    low, high = (np.stack([bound] * environments.stack) for bound in (frame.low, frame.high))
    return gym.spaces.Box(low, high, dtype=frame.dtype.type)


class FrameStack:
    """The newest k frames of each environment, as the agent sees them.

    Args:
        frames: `[B, ...]`, the first ones of every environment.
        size: k; None where an observation is a frame, without an axis for the stack.
        padding: what stands before the first frame of an episode (see `ReplayBuffer`).

    >>> stack = FrameStack(np.array([[7]]), size=2, padding="zero")
    >>> stack.push(np.array([[8]]), np.array([False]))
    >>> stack.observations.tolist()
    [[[7], [8]]]
    """

    def __init__(self, frames: Frames, size: int | None, padding: Padding) -> None:
        self.size, self.padding = size, padding
        self.frames = np.zeros((len(frames), size or 1, *frames.shape[1:]), dtype=frames.dtype)
        """`[B, k, ...]`, the newest last."""
        self.begin(frames, np.ones(len(frames), dtype=np.bool_))

    @property
    def observations(self) -> Frames:
        """`[B, k, ...]`, or `[B, ...]` without a stack."""
        return self.frames if self.size else self.frames[:, 0]

    @property
    def newest(self) -> Frames:
        """`[B, ...]`: the newest frame of each."""
        return self.frames[:, -1]

    def begin(self, frames: Frames, where: BoolArray) -> None:
        """Begins episodes `where [B]` with these frames `[B, ...]`."""
        first = frames[where]
        self.frames[where] = first[:, None] if self.padding == "reset" else 0
        self.frames[where, -1] = first

    def push(self, frames: Frames, begins: BoolArray) -> None:
        """Sees the next frames `[B, ...]`; where an episode `begins [B]`, its first one."""
        self.frames[:, :-1] = self.frames[:, 1:]
        self.frames[:, -1] = frames
        self.begin(frames, begins)


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
        """Their mean length, in agent steps."""
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
