"""Environments that are drawn: they do the same, and an episode's last picture is its own."""

import gymnasium as gym
import numpy as np
import pytest

from trdlab.environments import GymEnvironments
from trdlab.environments.screens import screened


class Counting(gym.Env):
    """Shows how many steps have been taken, as a number and as a grey picture."""

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012
    observation_space, action_space = gym.spaces.Box(0, 99, (1,)), gym.spaces.Discrete(2)

    def __init__(self, render_mode: str | None = "rgb_array", breaks: bool = False) -> None:
        self.render_mode, self.breaks = render_mode, breaks

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return np.float32([0]), {}

    def step(self, action):
        self.count += 1
        return np.float32([self.count]), 1.0, self.count == 3, False, {}

    def render(self):
        if self.breaks:
            raise OSError("there is no display")
        return np.full((8, 8, 3), self.count, dtype=np.uint8)


@pytest.mark.parametrize("make", [Counting, Counting()])
def test_the_last_picture_of_an_episode_is_not_the_first_of_the_next(make):
    drawn = screened(GymEnvironments(make, 2, seed=0))
    drawn.reset()
    seen = [drawn.step(np.array([0, 1])) for _ in range(4)]
    assert [step.screens[:, 0, 0, 0].tolist() for step in seen] == [[1, 1], [2, 2], [3, 3], [1, 1]]
    assert seen[2].following[0, 0] == 0
    assert drawn.screens.shape == (2, 8, 8, 3)


@pytest.mark.parametrize("make", [lambda: Counting(None), lambda: Counting(breaks=True)])
def test_what_cannot_be_drawn_is_played_all_the_same(make):
    drawn = screened(GymEnvironments(make, 1, seed=0))
    assert (drawn.reset().tolist(), drawn.screens) == ([[0.0]], None)
    assert drawn.step(np.array([0])).screens is None


def test_drawing_changes_nothing():
    pytest.importorskip("pygame", reason="Gymnasium draws CartPole with pygame, which is no need")
    plain, drawn = (GymEnvironments("CartPole-v1", 1, seed=5) for _ in range(2))
    drawn = screened(drawn)
    np.testing.assert_array_equal(plain.reset(), drawn.reset())
    for action in [0, 1] * 20:
        one, other = (each.step(np.array([action])) for each in (plain, drawn))
        np.testing.assert_array_equal(one.following, other.following)
        assert one.rewards == other.rewards
    assert drawn.screens.shape == (1, 400, 600, 3)
