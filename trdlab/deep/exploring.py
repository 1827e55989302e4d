"""When an agent acts at random while it learns, and what it does then."""

from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, IntArray


class Exploring:
    """Random actions of B environments, each of them held for a while.

    Where something is reached only by doing the same for long, steps that are each at random never
    reach it: they undo each other. ε stays the part of all steps that are at random, however
    long one is held.

    Args:
        num_envs: B.
        num_actions: A.
        longest: for how many steps an action is held at most; the number is drawn evenly from 1 on.

    Source: Dabney et al. (2021), "Temporally-extended ε-greedy exploration", with an even
    distribution of durations.
    """

    def __init__(self, num_envs: int, num_actions: int, longest: int = 1) -> None:
        self.num_actions, self.longest = num_actions, longest
        self.actions, self.left = np.zeros((2, num_envs), dtype=np.int64)

    def draw(self, epsilon: float, rng: np.random.Generator) -> tuple[BoolArray, IntArray]:
        """Returns `[B]`, where to act at random in this step, and what to do there."""
        num_envs = len(self.left)
        begins = rng.random(num_envs) < begin_chance(epsilon, self.longest)  # [B]
        actions = rng.integers(self.num_actions, size=num_envs)  # [B]
        if self.longest == 1:
            return begins, actions
        begins &= self.left == 0
        self.left = np.where(begins, rng.integers(1, self.longest + 1, size=num_envs), self.left)
        self.actions = np.where(begins, actions, self.actions)
        explore = self.left > 0
        self.left = self.left - explore
        return explore, self.actions

    def drop(self, ended: BoolArray) -> None:
        """Holds nothing beyond the end of an episode."""
        self.left[ended] = 0

    def state_dict(self) -> dict[str, Any]:
        """Returns everything, as plain numbers."""
        return {"actions": self.actions.tolist(), "left": self.left.tolist()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Takes over what `state_dict` returned."""
        self.actions[:], self.left[:] = state["actions"], state["left"]


def begin_chance(epsilon: float, longest: int) -> float:
    """Returns the chance to begin, in a step in which nothing is held, for ε of all to be random.

    >>> begin_chance(0.1, 1), begin_chance(1.0, 30)
    (0.1, 1.0)
    """
    mean = (longest + 1) / 2
    return epsilon / (mean - epsilon * (mean - 1))
