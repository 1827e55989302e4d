"""The forecast beside the frames of any environment, one or many, and videos of them."""

import importlib.util
import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import trdlab.envs  # noqa: F401  registers the maps
from trdlab.atari.game import AtariGame
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, TrdlabError
from trdlab.estimator import Future
from trdlab.gridworld.env import GridworldEnv
from trdlab.rendering import ForecastRendering, VectorForecastRendering, record_video
from trdlab.tabular import exact

DOWN, RIGHT = 1, 3
AXIS = TimeAxis(0.95, horizon=4)


class Constant:
    """An estimator that expects the same of every observation."""

    future = Future("nobody's policy")

    def __init__(self, rows: Any, axis: TimeAxis = AXIS) -> None:
        self.rows, self.time_axis = np.asarray(rows, dtype=np.float32), axis

    def decompose(self, observations: Any) -> RewardDecomposition:
        batch = len(observations)
        return RewardDecomposition(np.repeat(self.rows[None], batch, axis=0), self.time_axis)


def drone(**how: Any) -> ForecastRendering:
    env = gym.make("trdlab/DroneGridworld-v0", render_mode="rgb_array")
    return ForecastRendering(env, exact(env.unwrapped.mdp, AXIS), **how)


def test_the_frame_itself_is_unchanged_and_all_have_one_even_size():
    env = drone()
    env.reset(seed=0)
    sizes = set()
    for action in (DOWN, RIGHT, RIGHT, RIGHT, RIGHT):
        frame, own = env.render(), env.env.render()
        zoom = 2  # 192 pixels are low
        seen = frame[: zoom * own.shape[0], : zoom * own.shape[1]]
        np.testing.assert_array_equal(seen[::zoom, ::zoom], own)
        np.testing.assert_array_equal(seen[1::zoom, 1::zoom], own)
        sizes.add(frame.shape)
        env.step(action)
    assert len(sizes) == 1
    assert all(side % 2 == 0 for side in next(iter(sizes))[:2])


def test_frames_can_be_shown_as_they_are():
    env = drone(zoom=1)
    env.reset(seed=0)
    own = env.env.render()
    np.testing.assert_array_equal(env.render()[: own.shape[0], : own.shape[1]], own)


def test_what_is_taken_and_paid_is_told_and_at_the_end_nothing_is_expected():
    env = drone()
    env.reset(seed=0)
    assert env._told.taken is None
    for action in (DOWN, RIGHT):
        env.step(action)
    assert (env._told.step, env._told.taken, env._told.reward) == (2, RIGHT, 1.0)
    before = env.render()
    for _ in range(3):
        *_, terminated, _, _ = env.step(RIGHT)
    assert terminated
    assert env._told.over
    assert env.render().shape == before.shape


def test_the_scale_begins_anew_with_each_episode():
    env = drone()
    env.reset(seed=0)
    first = env.render()
    env.step(DOWN)
    assert (env.render() != first).any()
    env.reset(seed=0)
    np.testing.assert_array_equal(env.render(), first)


def test_info_is_that_of_the_wrapper_without_pictures():
    env = drone()
    _, info = env.reset(seed=0)
    assert info["reward_decomposition"][DOWN].round(2).tolist() == [0, 0.95, 0.9, 0.86, 0.81]
    *_, info = env.step(DOWN)
    assert info["chosen_decomposition"].round(2).tolist() == [0, 0.95, 0.9, 0.86, 0.81]


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
def test_it_passes_the_checker():
    check_env(drone())


def test_the_spec_makes_the_same_environment_again():
    env = drone(rows=3)
    again = gym.make(env.spec)
    assert isinstance(again, ForecastRendering)
    env.reset(seed=0), again.reset(seed=0)
    np.testing.assert_array_equal(env.render(), again.render())


@pytest.mark.parametrize("mode", [None, "ansi"])
def test_an_environment_that_draws_nothing_is_refused(mode: str | None):
    env = GridworldEnv("drone", render_mode=mode)
    with pytest.raises(InputError, match=r'Make it with render_mode="rgb_array"\.'):
        ForecastRendering(env, exact(env.mdp, AXIS))


@pytest.mark.parametrize("how", [{"rows": 0}, {"zoom": 0}])
def test_there_is_at_least_one_of_each(how: dict[str, int]):
    with pytest.raises(InputError, match=r"It is at least 1\."):
        drone(**how)


def test_before_the_first_reset_there_is_nothing_to_draw():
    env = GridworldEnv("drone", render_mode="rgb_array")
    with pytest.raises(TrdlabError, match=r"Call reset\(\)"):
        ForecastRendering(env, exact(env.mdp, AXIS)).render()


class Growing(gym.Env):
    """Draws a larger picture each time."""

    observation_space, action_space = gym.spaces.Discrete(1), gym.spaces.Discrete(2)
    metadata = {"render_modes": ["rgb_array"], "render_fps": 5}  # noqa: RUF012
    render_mode, side = "rgb_array", 8

    def reset(self, *, seed=None, options=None):
        return 0, {}

    def step(self, action):
        return 0, 0.0, False, False, {}

    def render(self):
        self.side += 1
        return np.zeros((self.side, self.side, 3), np.uint8)


def test_frames_of_another_size_are_refused():
    env = ForecastRendering(Growing(), Constant(np.ones((2, 5))))
    env.reset()
    env.render()
    with pytest.raises(InputError, match=r"were \(9, 9, 3\) and are now \(10, 10, 3\)"):
        env.render()


def many(count: int, mode: AutoresetMode) -> VectorForecastRendering:
    envs = SyncVectorEnv(
        [lambda: gym.make("trdlab/DroneGridworld-v0", render_mode="rgb_array")] * count,
        autoreset_mode=mode,
    )
    return VectorForecastRendering(envs, exact(GridworldEnv("drone").mdp, AXIS))


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_many_are_drawn_as_one_is(mode: AutoresetMode):
    envs, one = many(2, mode), drone()
    envs.reset(seed=0), one.reset(seed=0)
    for action in (DOWN, RIGHT, RIGHT, RIGHT, RIGHT, DOWN, RIGHT):
        frames, alone = envs.render(), one.render()
        assert isinstance(frames, tuple)
        for frame in frames:
            np.testing.assert_array_equal(frame, alone)
        begins = one._told.over  # the step that follows only begins the next episode
        envs.step(np.array([action, action]))
        if begins:
            one.reset()
        else:
            *_, terminated, _, _ = one.step(action)
            if terminated and mode is AutoresetMode.SAME_STEP:
                one.reset()


def test_a_masked_reset_begins_only_those_episodes():
    envs = many(2, AutoresetMode.DISABLED)
    envs.reset(seed=0)
    first = envs.render()
    envs.step(np.array([DOWN, DOWN]))
    stays = envs.render()[1]
    envs.reset(options={"reset_mask": np.array([True, False])})
    frames = envs.render()
    np.testing.assert_array_equal(frames[0], first[0])
    np.testing.assert_array_equal(frames[1], stays)


def test_it_does_not_pickle_less_than_the_wrapper_without_pictures():
    env = drone()
    env.reset(seed=0)
    env.render()
    again = pickle.loads(pickle.dumps(env))
    np.testing.assert_array_equal(again.render(), env.render())


def test_without_the_extra_the_message_names_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr("trdlab.rendering.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"Run: pip install 'trdlab\[video\]'"):
        record_video(drone(), tmp_path)


def test_what_draws_nothing_is_not_recorded(tmp_path: Path):
    with pytest.raises(InputError, match="rgb_array"):
        record_video(gym.make("trdlab/DroneGridworld-v0"), tmp_path)


def read_back(path: Path) -> tuple[int, tuple[int, int]]:
    """Returns how many frames a video has, and how wide and high they are."""
    imageio = pytest.importorskip("imageio.v2")
    with imageio.get_reader(path) as video:
        return video.count_frames(), tuple(video.get_meta_data()["size"])


needs_moviepy = pytest.mark.skipif(
    importlib.util.find_spec("moviepy") is None, reason="moviepy, of the extra video, is missing"
)


@needs_moviepy
def test_gymnasium_records_a_gridworld(tmp_path: Path):
    env = drone()
    recorded = record_video(env, tmp_path / "made", episode_trigger=lambda episode: True)
    recorded.reset(seed=0)
    for action in (DOWN, RIGHT, RIGHT, RIGHT, RIGHT):
        recorded.step(action)
    height, width, _ = env.render().shape
    recorded.close()
    assert read_back(tmp_path / "made" / "rl-video-episode-0.mp4") == (6, (width, height))


@needs_moviepy
def test_gymnasium_records_an_atari_game(tmp_path: Path):
    game = AtariGame("Breakout", render_mode="rgb_array")
    env = ForecastRendering(game, Constant(np.eye(4, 5)))
    recorded = record_video(env, tmp_path / "made", episode_trigger=lambda episode: True)
    recorded.reset(seed=0)
    for action in range(20):
        recorded.step(action % 4)
    height, width, _ = env.render().shape
    recorded.close()
    assert read_back(tmp_path / "made" / "rl-video-episode-0.mp4") == (21, (width, height))


@needs_moviepy
def test_gymnasium_records_many(tmp_path: Path):
    envs = many(2, AutoresetMode.NEXT_STEP)
    if not hasattr(gym.wrappers.vector, "RecordVideo"):
        pytest.skip("this Gymnasium records no videos of many environments")
    recorded = record_video(
        envs, tmp_path / "made", episode_trigger=lambda e: True, record_first_only=True
    )
    recorded.reset(seed=0)
    for action in (DOWN, RIGHT, RIGHT, RIGHT, RIGHT):
        recorded.step(np.array([action, action]))
    height, width, _ = envs.render()[0].shape
    recorded.close()
    assert read_back(tmp_path / "made" / "rl-video-episode-0.mp4") == (6, (width, height))
