"""Pictures for agents: what people see, smaller; no two states alike; painted once."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import trdlab.envs
from trdlab.errors import InputError
from trdlab.gridworld import Gridworld, load_map, map_names, parse_map, pixels, render
from trdlab.gridworld.env import GridworldEnv
from trdlab.gridworld.pixels import SIDE, Pictures, pictures

SMALL = [name for name in map_names() if name != "corridor"]


@pytest.mark.parametrize("name", SMALL)
def test_no_two_states_look_alike(name):
    seen = pictures(Gridworld(load_map(name))).astype(np.int64)
    assert seen.shape == (len(Gridworld(load_map(name)).states), SIDE, SIDE)
    flat = seen.reshape(len(seen), -1)
    for state, picture in enumerate(flat):  # clearly so: somewhere by more than 80 of 255
        different = np.abs(flat - picture).max(axis=1) > 80
        assert different.sum() == len(seen) - 1, f"state {state}"


def test_even_the_largest_map_tells_neighbours_apart():
    seen = Pictures(Gridworld(load_map("corridor")))  # to paint all 261 would take long
    looks = [seen[state].astype(np.int64) for state in (0, 1, 2, 129, 130, 131, 258, 259, 260)]
    for i, picture in enumerate(looks):
        assert all(np.abs(picture - other).max() > 80 for other in looks[:i])


def test_a_picture_is_what_people_see_in_grey_and_smaller():
    world = Gridworld(load_map("drone"))  # 3 rows, 5 columns: 50 by 84 pixels
    seen = pictures(world)[3]
    assert (seen[:17] == 0).all()
    assert (seen[67:] == 0).all()
    grey = render.frame(world, 3, 84) @ (0.299, 0.587, 0.114)  # [252, 420]
    row, column = 7, 31  # of 50 by 84: it covers rows 35.28 to 40.32, columns 155 to 160
    weights = np.array([0.72, 1, 1, 1, 1, 0.32])
    exact = weights @ grey[35:41, 155:160].mean(axis=1) / weights.sum()
    assert abs(exact - seen[17 + row, column]) < 2.0  # painted at another size
    assert abs(seen[17:67].mean() - grey.mean()) < 0.5


def test_areas_are_averaged_exactly():
    painted = np.array([[0, 30], [60, 90], [120, 150]]) * 1000
    np.testing.assert_array_equal(pixels._shrunk(painted, 1, 1), [[75]])
    np.testing.assert_array_equal(pixels._shrunk(painted, 2, 2), [[20, 50], [100, 130]])
    np.testing.assert_array_equal(pixels._shrunk(painted, 3, 2), painted // 1000)


def test_each_state_is_painted_once_for_all_worlds_on_a_map(monkeypatch):
    painted = []
    paint = Pictures._paint
    monkeypatch.setattr(Pictures, "_paint", lambda self, s: (painted.append(s), paint(self, s))[1])
    envs = [GridworldEnv("tie", slip=0.125, observation="pixels") for _ in range(3)]
    for env in envs:
        for seed in range(20):
            observation, _ = env.reset(seed=seed)
            observation[...] = 0  # the caller's own
            env.step(seed % 4)
    assert sorted(painted) == sorted(set(painted))
    assert GridworldEnv("tie", slip=0.25, observation="pixels")._pictures is not envs[0]._pictures


def test_the_same_episode_as_pixels_and_as_indices():
    indices, seen = (GridworldEnv("windy", observation=o) for o in ("index", "pixels"))
    of_state = pictures(seen.world)
    actions = np.random.default_rng(0).integers(4, size=40)
    (state, info), (picture, same_info) = indices.reset(seed=1), seen.reset(seed=1)
    for action in actions:
        np.testing.assert_array_equal(picture, of_state[int(state)])
        assert info == same_info
        state, reward, terminated, _, info = indices.step(action)
        picture, same_reward, same_end, _, same_info = seen.step(action)
        assert (reward, terminated) == (same_reward, same_end)
        if terminated:
            break


def test_gymnasium_makes_and_checks_it_and_it_can_be_copied():
    env = gym.make(trdlab.envs.env_id("drone"), observation="pixels")
    assert env.observation_space == gym.spaces.Box(0, 255, (84, 84), np.uint8)
    check_env(env.unwrapped)
    env.reset(seed=0)
    for other in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        np.testing.assert_array_equal(other.step(1)[0], copy.deepcopy(env).step(1)[0])


def test_refusals():
    with pytest.raises(InputError, match=r"The observation is 'pixel'\. Did you mean 'pixels'\?"):
        GridworldEnv("drone", observation="pixel")
    wide = parse_map("---\nS" + "." * 27 + "C", name="wide")
    with pytest.raises(InputError, match=r"'wide' is 1 cells by 29.* Up to 28 by 28"):
        GridworldEnv(wide, observation="pixels")
    assert GridworldEnv(wide).observation_space.n == 29
