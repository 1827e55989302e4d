"""What an agent sees of its environments: the newest frames, stacked."""

from typing import Any

import gymnasium as gym
import numpy as np

from trdlab.arrays import BoolArray
from trdlab.environments.protocol import Environments, Frames, Padding


def observation_space(environments: Environments) -> gym.spaces.Space[Any]:
    """Returns the space of what the agent sees: a frame, or a stack `[k, ...]` of them."""
    frame = environments.observation_space
    if environments.stack is None or not isinstance(frame, gym.spaces.Box):
        return frame
    return stacked(frame, environments.stack)


def stacked(frame: gym.spaces.Box, size: int) -> gym.spaces.Box:
    """Returns the space of stacks `[k, ...]` of frames.

    >>> stacked(gym.spaces.Box(0, 255, (84, 84), np.uint8), 4).shape
    (4, 84, 84)
    """
    low, high = (np.stack([bound] * size) for bound in (frame.low, frame.high))
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
        if not where.any():
            return
        first = frames[where]
        self.frames[where] = first[:, None] if self.padding == "reset" else 0
        self.frames[where, -1] = first

    def push(self, frames: Frames, begins: BoolArray | None = None) -> None:
        """Sees the next frames `[B, ...]`; where an episode `begins [B]`, its first one.

        Args:
            frames: `[B, ...]`.
            begins: `[B]`; by default no episode does.
        """
        if self.frames.shape[1] > 1:
            self.frames[:, :-1] = self.frames[:, 1:]
        self.frames[:, -1] = frames
        if begins is not None:
            self.begin(frames, begins)
