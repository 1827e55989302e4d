"""One game as a Gymnasium environment."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from trdlab.atari import AtariEnvironments, AtariGame
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.environments.stack import FrameStack
from trdlab.errors import InputError, TrdlabError
from trdlab.estimator import Future
from trdlab.wrappers import TemporalRewardDecomposition


def test_it_keeps_gymnasiums_contract():
    env = AtariGame("Breakout", sticky=0.25)
    check_env(env, skip_render_check=True)  # made without a render mode
    assert env.observation_space == gym.spaces.Box(0, 255, (4, 84, 84), np.uint8)
    assert env.metadata["render_fps"] == 15


def test_a_seed_fixes_all_that_follows_also_the_games_after():
    actions = np.random.default_rng(0).integers(4, size=400)

    def played(env: AtariGame) -> list[bytes]:
        observations = [env.reset(seed=7)[0]]
        for action in actions:
            observation, _, terminated, truncated, info = env.step(action)
            observations.append(observation)
            assert (info["lives"] == 0) == terminated
            if terminated or truncated:
                observations.append(env.reset()[0])
        return [observation.tobytes() for observation in observations]

    env = AtariGame("Breakout", sticky=0.25)
    first = played(env)
    assert len(first) > 402  # two games ended
    assert first == played(env) == played(AtariGame("Breakout", sticky=0.25))


def test_it_shows_what_the_environments_of_the_trainer_show():
    games = AtariEnvironments("Pong", 1, seed=0)
    first = games.reset()
    stack = FrameStack(first, games.stack, games.padding)
    env = AtariGame("pong")
    seed = int(np.random.SeedSequence([0, 0, 0]).generate_state(1)[0] >> 1)
    observation, _ = env._envs.reset(seed=np.array([seed]))
    env._running = True
    np.testing.assert_array_equal(observation, stack.observations)
    for action in np.random.default_rng(0).integers(6, size=50):
        step = games.step(np.array([action]))
        stack.push(step.following, step.ended)
        observation, reward, *_ = env.step(action)
        np.testing.assert_array_equal(observation, stack.observations[0])
        assert reward == step.rewards[0]


def test_the_wrapper_takes_it():
    class Zeros:
        time_axis, future = TimeAxis(0.99, 2), Future("nobody")

        def decompose(self, observations):
            assert observations.shape == (1, 4, 84, 84)
            return RewardDecomposition(np.zeros((1, 4, 3)), self.time_axis)

    env = TemporalRewardDecomposition(AtariGame("Breakout"), Zeros())
    env.reset(seed=0)
    assert env.step(1)[4]["chosen_decomposition"].tolist() == [0, 0, 0]


def test_misuse_is_refused():
    env = AtariGame("Breakout", max_frames=8)
    with pytest.raises(TrdlabError, match=r"No game is running\. Call reset\(\) first"):
        env.step(0)
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"There is no action 4\. They run from 0 to 3"):
        env.step(4)
    assert [env.step(0)[3] for _ in range(2)] == [False, True]
    with pytest.raises(TrdlabError, match="No game is running"):
        env.step(0)


def test_a_drawn_game_is_the_same_game_and_shows_the_whole_screen():
    plain, drawn = AtariGame("Pong"), AtariGame("Pong", render_mode="rgb_array")
    with pytest.raises(TrdlabError, match=r"Call reset\(\) first"):
        drawn.render()
    np.testing.assert_array_equal(plain.reset(seed=3)[0], drawn.reset(seed=3)[0])
    before = drawn.render()
    assert (before.shape, before.dtype) == ((210, 160, 3), np.uint8)
    for action in (2, 2, 3, 3, 0) * 4:
        one, other = plain.step(action), drawn.step(action)
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1:] == other[1:]
    assert (drawn.render() != before).any()


def test_a_game_draws_nothing_else():
    with pytest.raises(InputError, match=r"The render mode is 'human'"):
        AtariGame("Pong", render_mode="human")
