"""The environment samples its exact model, and keeps Gymnasium's contract."""

import copy
import importlib
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import trdlab.envs
from trdlab.errors import InputError, MapError, TrdlabError
from trdlab.gridworld import load_map, map_names, parse_map
from trdlab.gridworld.env import GridworldEnv

UP, DOWN, LEFT, RIGHT = range(4)


def run(env: gym.Env, seed: int, steps: int = 60) -> list[tuple]:
    """Returns what happens when random actions are taken, episode after episode."""
    actions = np.random.default_rng(seed).integers(env.action_space.n, size=steps)
    happened = [env.reset(seed=seed)]
    for action in actions:
        happened.append(env.step(action))
        if happened[-1][2] or happened[-1][3]:
            happened.append(env.reset())
    return happened


@pytest.mark.parametrize("name", map_names())
def test_every_map_is_registered_and_passes_the_checker(name):
    env = gym.make(trdlab.envs.env_id(name))
    assert env.unwrapped.world.grid.name == name
    check_env(env.unwrapped)
    run(env, seed=0)  # Gymnasium's passive checker watches each step


def test_ids_are_found_without_an_import_by_their_module():
    assert gym.make("trdlab.envs:trdlab/DroneGridworld-v0").observation_space.n == 14
    assert gym.make("trdlab/CorridorGridworld-v0").spec.max_episode_steps > 1000


def test_registering_twice_changes_nothing_and_does_not_warn():
    before = dict(gym.registry)
    importlib.reload(trdlab.envs)
    assert dict(gym.registry) == before


def in_new_python(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_importing_trdlab_registers_only_where_gymnasium_is_in_use():
    heavy = "[m for m in ('gymnasium', 'matplotlib', 'torch', 'numpy') if m in sys.modules]"
    assert in_new_python(f"import sys, trdlab; print({heavy})") == "[]"
    make = "gymnasium.make('trdlab/DroneGridworld-v0').reset(seed=0)[0]"
    assert in_new_python(f"import gymnasium, trdlab; print({make})") == "0"


def test_only_pictures_need_matplotlib():
    code = (
        "import sys; from trdlab.gridworld.env import GridworldEnv\n"
        "env = GridworldEnv(render_mode='{}'); env.reset(seed=0); env.render()\n"
        "print('matplotlib' in sys.modules)"
    )
    assert in_new_python(code.format("ansi")) == "False"
    assert in_new_python(code.format("rgb_array")) == "True"


def test_the_coins_are_paid_once_each_and_the_last_one_ends_the_episode():
    env = GridworldEnv("drone")
    state, info = env.reset(seed=0)
    assert state == 0
    assert info == {"row": 1, "column": 0, "collected": 0}
    steps = [env.step(action) for action in (DOWN, RIGHT, RIGHT, LEFT, RIGHT, RIGHT, RIGHT)]
    assert [reward for _, reward, *_ in steps] == [0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0]
    assert [terminated for _, _, terminated, *_ in steps] == [False] * 6 + [True]
    assert not any(truncated for *_, truncated, _ in steps)
    parts = {"coin": 1.0, "treasure": 0.0}
    assert steps[-1][-1] == {"row": 2, "column": 4, "collected": 4, "parts": parts}


def test_transitions_come_as_often_as_the_model_says():
    env = GridworldEnv("bridge", slip=0.4)
    env.reset(seed=7)
    state, draws = env.world.find_state("1,1"), 4000
    arrived = np.zeros(env.mdp.num_states)
    for _ in range(draws):
        env.reset(options={"state": state})
        arrived[env.step(RIGHT)[0]] += 1
    row = slice(*env.mdp.offsets[state * 4 + RIGHT : state * 4 + RIGHT + 2])
    expected = np.zeros(env.mdp.num_states)
    np.add.at(expected, env.mdp.next_states[row], env.mdp.probabilities[row])
    assert sorted(expected[expected > 0].round(9)) == [0.2, 0.2, 0.6]
    error = np.sqrt(expected * (1 - expected) / draws)
    assert np.all(np.abs(arrived / draws - expected) <= 4 * error)


def test_the_mean_return_of_a_policy_is_the_value_of_the_model():
    env = GridworldEnv("bridge")
    env.reset(seed=3)
    returns = []
    for _ in range(600):  # always right: over the bridge, if it does not slip
        env.reset()
        total, terminated = 0.0, False
        while not terminated:
            _, reward, terminated, *_ = env.step(RIGHT)
            total += reward
        returns.append(total)
    # entered from the start, five cells are crossed; each step off them slips up with 0.05
    # and down, into a wall, with 0.05, which leaves the drone where it is
    falls = 0.05 / 0.95
    survives = (1 - falls) ** 5
    spread = 8 * np.sqrt(survives * (1 - survives) / len(returns))
    assert np.mean(returns) == pytest.approx(4 * survives - 4 * (1 - survives), abs=4 * spread)


def test_the_same_seed_gives_the_same_run():
    first, again, other = (run(GridworldEnv("bridge"), seed) for seed in (5, 5, 6))
    assert first == again
    assert first != other


def test_a_copy_goes_on_alike_and_apart():
    env = GridworldEnv("bridge", slip=0.5)
    env.reset(seed=1)
    env.step(RIGHT)
    for twin in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        actions = [RIGHT, DOWN, LEFT]
        assert [copy.deepcopy(env).step(a) for a in actions] == [
            copy.deepcopy(twin).step(a) for a in actions
        ]
        twin.reset(options={"state": 0})
        assert twin is not env


def test_the_map_can_be_changed_on_the_way_in(tmp_path):
    rich = GridworldEnv("drone", treasure=10)
    rich.reset(seed=0)
    assert sum(rich.step(action)[1] for action in (UP, RIGHT, RIGHT, RIGHT, RIGHT)) == 10.0
    assert GridworldEnv("drone", slip=0.25).world.grid.slip == 0.25
    file = tmp_path / "mine.txt"
    file.write_text("S.T\n")
    assert GridworldEnv(file).world.grid.name == "mine"
    assert GridworldEnv(str(file)).mdp.num_states == 3
    assert GridworldEnv(parse_map("S.T")).mdp.num_states == 3
    assert gym.make("trdlab/DroneGridworld-v0", treasure=10).unwrapped.mdp.rewards.max() == 10.0
    with pytest.raises(MapError, match=r"There is no map 'dron'. Did you mean 'drone'\?"):
        GridworldEnv("dron")
    with pytest.raises(MapError, match="slip"):
        GridworldEnv("drone", slip=2)
    with pytest.raises(MapError, match="no treasure"):
        GridworldEnv("loop", treasure=2)


def test_an_episode_can_begin_anywhere_but_where_it_is_over():
    env = GridworldEnv("drone")
    state, info = env.reset(options={"state": "2,3"})
    assert (info["row"], info["column"], info["collected"]) == (2, 3, 3)
    assert env.reset(options={"state": int(state)})[0] == state
    assert env.reset(options={"state": state})[0] == state  # as the environment returned it
    assert env.step(RIGHT)[1:3] == (1.0, True)
    assert env.reset(options={})[0] == 0
    for wrong in (14, -1, 1.5, True, None, "up"):
        with pytest.raises(InputError, match=r"state"):
            env.reset(options={"state": wrong})
    with pytest.raises(InputError, match=r"over in state 10 \(row 0, column 4.*not terminal"):
        env.reset(options={"state": 10})


def test_misuse_is_named_with_its_cure():
    env = GridworldEnv("tie")
    with pytest.raises(TrdlabError, match=r"no episode yet. Call reset\(\)"):
        env.step(UP)
    env.reset(seed=0)
    for wrong in (4, -1, 1.0, "up", None):
        with pytest.raises(InputError, match="Actions are whole numbers: 0 up, 1 down"):
            env.step(wrong)
    env.step(LEFT)
    assert env.step(LEFT)[2]
    with pytest.raises(TrdlabError, match=r"episode is over. Call reset\(\)"):
        env.step(LEFT)
    with pytest.raises(InputError, match="Did you mean 'rgb_array'"):
        GridworldEnv(render_mode="rgb_aray")


def test_text_shows_the_drone_and_what_is_left():
    env = gym.make("trdlab/DroneGridworld-v0", render_mode="ansi")
    env.reset(seed=0)
    assert env.render() == ">...T\n@####\n>cccC"
    for action in (DOWN, RIGHT, RIGHT):
        env.step(action)
    assert env.render().splitlines()[2] == ">.@cC"


def test_pictures_follow_the_episode():
    env = gym.make("trdlab/DroneGridworld-v0", render_mode="rgb_array", cell_pixels=16)
    env.reset(seed=0)
    frames = [env.render()]
    for action in (DOWN, RIGHT, RIGHT, RIGHT, RIGHT):
        env.step(action)
        frames.append(env.render())
    assert {frame.shape for frame in frames} == {(48, 80, 3)}
    assert len({frame.tobytes() for frame in frames}) == len(frames)


def test_a_list_of_pictures_can_be_collected():
    env = gym.make("trdlab/TieGridworld-v0", render_mode="rgb_array_list", cell_pixels=8)
    env.reset(seed=0)
    env.step(LEFT)
    assert [frame.shape for frame in env.render()] == [(8, 48, 3)] * 2


def test_rendering_without_a_mode_says_how_to():
    env = GridworldEnv("tie")
    env.reset(seed=0)
    with pytest.warns(UserWarning, match='render_mode="rgb_array"'):
        assert env.render() is None


def test_the_model_travels_with_the_environment():
    env = gym.make("trdlab/WindyGridworld-v0")
    assert env.get_wrapper_attr("action_names") == ("up", "down", "left", "right")
    assert env.get_wrapper_attr("mdp") is env.unwrapped.world.mdp
    assert env.unwrapped.world.grid == load_map("windy")


def test_exploring_starts_begin_anywhere_where_something_can_happen():
    env = GridworldEnv("drone", exploring_starts=True)
    env.reset(seed=0)
    counts = np.bincount([env.reset()[0] for _ in range(6000)], minlength=env.mdp.num_states)
    begun = counts > 0
    assert begun.sum() == 12
    assert not (begun & env.mdp.terminal_states).any()
    assert counts[begun] == pytest.approx(500, abs=5 * 500**0.5)
    assert [GridworldEnv("drone").reset(seed=i)[0] for i in range(3)] == [env.mdp.start] * 3
