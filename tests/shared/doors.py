"""An environment that shows two things at once, and in which not every action can be taken."""

from typing import Any

import gymnasium as gym
import numpy as np

LENGTH = 6


class Doors(gym.Env):
    """Three doors, two or three of them open: door i pays i. Nobody may go through a closed one.

    Args:
        masks: where it tells which are open: by its `method`, as sb3-contrib asks; in `info`, as
            Gymnasium's Taxi; or nowhere, and then a closed door pays nothing.
        terminates: whether episodes end for good, rather than by a time limit.
    """

    def __init__(self, masks: str = "method", terminates: bool = True) -> None:
        self.observation_space = gym.spaces.Dict(
            {"time": gym.spaces.Box(0, 1, (1,)), "open": gym.spaces.MultiBinary(3)}
        )
        self.action_space = gym.spaces.Discrete(3)
        self.masks, self.terminates = masks, terminates
        if masks == "method":
            self.action_masks = lambda: self.open.astype(bool)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return self.seen(), self.told()

    def step(self, action):
        assert self.masks == "nowhere" or self.open[action], "a closed door"
        self.steps += 1
        reward, over = float(action * self.open[action]), self.steps == LENGTH
        return self.seen(), reward, over and self.terminates, over, self.told()

    def seen(self) -> dict[str, Any]:
        self.open = np.ones(3, dtype=np.int8)
        self.open[self.np_random.integers(4) :][:1] = 0  # one is closed, or none
        return {"time": np.float32([self.steps / LENGTH]), "open": self.open.copy()}

    def told(self) -> dict[str, Any]:
        return {"action_mask": self.open.copy()} if self.masks == "info" else {}
