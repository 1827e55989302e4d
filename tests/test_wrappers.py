"""The wrappers add one lookup to `info`, for one environment as for many."""

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import trdlab.envs  # noqa: F401  registers the maps
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, TrdlabError
from trdlab.estimator import Estimator, Future
from trdlab.gridworld.env import GridworldEnv
from trdlab.tabular import ExactTable, exact
from trdlab.wrappers import TemporalRewardDecomposition, VectorTemporalRewardDecomposition

UP, DOWN, LEFT, RIGHT = range(4)
AXIS = TimeAxis(0.95, horizon=2, width=2)
ALL, CHOSEN = "reward_decomposition", "chosen_decomposition"


def drone_table() -> ExactTable:
    return exact(GridworldEnv("drone").mdp, AXIS)


class Counting:
    """An estimator that counts how often it is asked, and remembers with what."""

    time_axis = TimeAxis(0.9, horizon=1)
    future = Future("nobody's policy")

    def __init__(self, num_actions: int) -> None:
        self.num_actions = num_actions
        self.asked: list[Any] = []

    def decompose(self, observations: Any) -> RewardDecomposition:
        self.asked.append(observations)
        first = (
            next(iter(observations.values())) if isinstance(observations, dict) else observations
        )
        numbers = np.arange(len(first) * self.num_actions * 2, dtype=np.float32)
        shape = (len(first), self.num_actions, 2)
        return RewardDecomposition(numbers.reshape(shape) + 100 * len(self.asked), self.time_axis)


def test_the_drone_sees_the_papers_numbers():
    env = TemporalRewardDecomposition(gym.make("trdlab/DroneGridworld-v0"), drone_table())
    _, info = env.reset(seed=0)
    assert info[ALL].round(2)[[UP, DOWN]].tolist() == [[0, 0, 3.26], [0.95, 1.76, 0.81]]
    assert CHOSEN not in info
    assert info["column"] == 0  # what was there stays
    state, *_, info = env.step(DOWN)
    assert info[CHOSEN].round(2).tolist() == [0.95, 1.76, 0.81]
    np.testing.assert_array_equal(info[ALL], drone_table().decomposition[state].components)


def test_nothing_else_changes():
    plain = gym.make("trdlab/BridgeGridworld-v0")
    wrapped = TemporalRewardDecomposition(
        gym.make("trdlab/BridgeGridworld-v0"), exact(plain.unwrapped.mdp, AXIS)
    )
    assert wrapped.observation_space == plain.observation_space
    assert wrapped.action_space == plain.action_space
    assert plain.reset(seed=4)[0] == wrapped.reset(seed=4)[0]
    for action in (RIGHT, RIGHT, UP):
        expected, got = plain.step(action), wrapped.step(action)
        assert got[:4] == expected[:4]
        assert {k: v for k, v in got[4].items() if k not in (ALL, CHOSEN)} == expected[4]


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
def test_a_wrapped_environment_passes_the_checker():
    check_env(TemporalRewardDecomposition(gym.make("trdlab/DroneGridworld-v0"), drone_table()))


def test_the_spec_makes_the_same_environment_again_with_the_same_estimator():
    table = drone_table()
    env = TemporalRewardDecomposition(gym.make("trdlab/DroneGridworld-v0"), table)
    again = gym.make(env.spec)
    assert isinstance(again, TemporalRewardDecomposition)
    assert again.estimator is table
    np.testing.assert_array_equal(again.reset(seed=0)[1][ALL], env.reset(seed=0)[1][ALL])


def test_a_wrapped_environment_can_be_pickled_in_mid_episode():
    env = TemporalRewardDecomposition(GridworldEnv("drone"), drone_table())
    env.reset(seed=0)
    twin = pickle.loads(pickle.dumps(env))
    np.testing.assert_array_equal(twin.step(DOWN)[-1][CHOSEN], env.step(DOWN)[-1][CHOSEN])


def test_what_is_given_away_is_the_callers_own():
    env = TemporalRewardDecomposition(GridworldEnv("drone"), drone_table())
    _, first = env.reset(seed=0)
    first[ALL][:] = 99.0
    *_, second = env.step(DOWN)
    assert second[CHOSEN].round(2).tolist() == [0.95, 1.76, 0.81]
    kept = second[ALL].copy()
    env.step(RIGHT)
    np.testing.assert_array_equal(second[ALL], kept)


def test_each_observation_is_looked_up_once_whatever_its_space():
    class Nested(gym.Env):
        observation_space = gym.spaces.Dict(
            {"a": gym.spaces.Box(-1, 1, (3,)), "b": gym.spaces.Discrete(4)}
        )
        action_space = gym.spaces.Discrete(2, start=5)

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            return {"a": np.zeros(3, np.float32), "b": 1}, {}

        def step(self, action):
            return {"a": np.ones(3, np.float32), "b": 2}, 0.0, False, False, {}

    estimator = Counting(num_actions=2)
    env = TemporalRewardDecomposition(Nested(), estimator)
    env.reset()
    *_, info = env.step(6)
    assert [asked["a"].shape for asked in estimator.asked] == [(1, 3), (1, 3)]
    assert [asked["b"].tolist() for asked in estimator.asked] == [[1], [2]]
    assert info[CHOSEN].tolist() == [102.0, 103.0]  # of the second action, at the first lookup
    assert info[CHOSEN].dtype == np.float32


def test_what_does_not_fit_is_refused():
    table = drone_table()
    assert isinstance(table, Estimator)
    with pytest.raises(InputError, match="wrap an environment with a Discrete one"):
        TemporalRewardDecomposition(gym.make("Pendulum-v1"), table)
    with pytest.raises(InputError, match="A dict is no Estimator"):
        TemporalRewardDecomposition(GridworldEnv("drone"), {})
    with pytest.raises(InputError, match=r"the environment has 4 actions.*made for this"):
        TemporalRewardDecomposition(GridworldEnv("drone"), Counting(num_actions=3)).reset()
    with pytest.raises(TrdlabError, match="Call reset"):
        TemporalRewardDecomposition(GridworldEnv("drone"), table).step(DOWN)
    with pytest.raises(InputError, match="wrap an environment with a Discrete one"):
        VectorTemporalRewardDecomposition(gym.make_vec("Pendulum-v1", num_envs=2), table)
    vector = gym.make_vec("trdlab/DroneGridworld-v0", num_envs=2)
    with pytest.raises(InputError, match="A list is no Estimator"):
        VectorTemporalRewardDecomposition(vector, [])
    with pytest.raises(TrdlabError, match="Call reset"):
        VectorTemporalRewardDecomposition(vector, table).step([DOWN, UP])
    with pytest.raises(InputError, match="the environment has 4 actions"):
        VectorTemporalRewardDecomposition(vector, Counting(num_actions=3)).reset()


def make_vector(mode: AutoresetMode, *, inside: bool, num_envs: int = 3) -> gym.vector.VectorEnv:
    """Returns drones, wrapped one by one on the inside or all at once from the outside."""
    table = drone_table()
    env = gym.make_vec(
        "trdlab/DroneGridworld-v0",
        num_envs=num_envs,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": mode},
        wrappers=[lambda env: TemporalRewardDecomposition(env, table)] if inside else [],
        slip=0.3,
        max_episode_steps=9,
    )
    return env if inside else VectorTemporalRewardDecomposition(env, table)


def entries(info: dict[str, Any], key: str, num_envs: int = 3) -> list[list | None]:
    """Returns what `info` says to each environment, None where it says nothing."""
    if key not in info:
        return [None] * num_envs
    given = zip(info[f"_{key}"], info[key].tolist(), strict=True)
    return [value if present else None for present, value in given]


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_many_environments_say_what_each_would_say_alone(mode):
    alone, together = make_vector(mode, inside=True), make_vector(mode, inside=False)
    (_, expected), (_, got) = alone.reset(seed=1), together.reset(seed=1)
    assert entries(got, ALL) == entries(expected, ALL)
    assert CHOSEN not in got
    ends, silent = 0, 0
    for actions in np.random.default_rng(2).choice([DOWN, RIGHT, UP], size=(60, 3)):
        *_, terminated, truncated, expected = alone.step(actions)
        *_, got = together.step(actions)
        assert entries(got, ALL) == entries(expected, ALL)
        said = entries(expected, CHOSEN)
        if mode is AutoresetMode.SAME_STEP and "final_info" in expected:
            last = entries(expected["final_info"], CHOSEN)
            said = [b if a is None else a for a, b in zip(last, said, strict=True)]
        assert entries(got, CHOSEN) == said
        assert not got[CHOSEN][~got[f"_{CHOSEN}"]].any()
        ends += int((terminated | truncated).sum())
        silent += said.count(None)
    assert ends > 10
    assert (silent > 10) is (mode is AutoresetMode.NEXT_STEP)


def test_the_step_that_only_begins_an_episode_has_no_chosen_action():
    env = VectorTemporalRewardDecomposition(
        gym.make_vec("trdlab/TieGridworld-v0", num_envs=2), exact(GridworldEnv("tie").mdp, AXIS)
    )
    env.reset(seed=0)
    env.step([LEFT, UP])
    *_, terminated, _, _ = env.step([LEFT, UP])
    assert terminated.tolist() == [True, False]
    *_, info = env.step([LEFT, RIGHT])
    assert info[f"_{CHOSEN}"].tolist() == [False, True]
    assert info[CHOSEN][0].tolist() == [0, 0, 0]
    assert info[f"_{ALL}"].tolist() == [True, True]
    *_, info = env.step([LEFT, RIGHT])
    assert info[f"_{CHOSEN}"].tolist() == [True, True]


def test_over_an_autoreset_the_step_that_only_resets_has_no_chosen_action():
    table = exact(GridworldEnv("tie").mdp, AXIS)
    inner = gym.wrappers.TransformReward(gym.wrappers.Autoreset(GridworldEnv("tie")), float)
    env = TemporalRewardDecomposition(inner, table)
    env.reset(seed=0)
    told = [env.step(LEFT) for _ in range(5)]  # the second one ends it
    assert [terminated for _, _, terminated, *_ in told] == [False, True, False, False, True]
    assert [CHOSEN in info for *_, info in told] == [True, True, False, True, True]
    np.testing.assert_array_equal(told[0][4][CHOSEN], told[3][4][CHOSEN])
    first = table.decomposition[env.unwrapped.mdp.start].components
    np.testing.assert_array_equal(told[2][4][ALL], first)
    env.reset(seed=0)  # in the place of the step that would only have reset
    assert CHOSEN in env.step(LEFT)[4]


def test_a_reset_of_some_speaks_of_those_alone():
    alone = make_vector(AutoresetMode.DISABLED, inside=True)
    together = make_vector(AutoresetMode.DISABLED, inside=False)
    for env in (alone, together):
        env.reset(seed=1)
    for actions in np.random.default_rng(3).choice([DOWN, RIGHT], size=(40, 3)):
        *_, terminated, truncated, expected = alone.step(actions)
        *_, got = together.step(actions)
        for key in (ALL, CHOSEN):
            assert entries(got, key) == entries(expected, key)
        mask = terminated | truncated
        if mask.any():
            _, expected = alone.reset(options={"reset_mask": mask.copy()})
            _, got = together.reset(options={"reset_mask": mask.copy()})
            assert entries(got, ALL) == entries(expected, ALL)
            assert got[f"_{ALL}"].tolist() == mask.tolist()


def test_a_batch_is_looked_up_once_and_given_away():
    estimator = Counting(num_actions=4)
    env = VectorTemporalRewardDecomposition(
        gym.make_vec("trdlab/DroneGridworld-v0", num_envs=2), estimator
    )
    _, info = env.reset(seed=0)
    assert info[ALL].shape == (2, 4, 2)
    info[ALL][:] = -1.0
    info[f"_{ALL}"][:] = False
    *_, info = env.step([DOWN, UP])
    assert len(estimator.asked) == 2
    assert info[CHOSEN].tolist() == [[102.0, 103.0], [108.0, 109.0]]
    assert info[CHOSEN].dtype == info[ALL].dtype == np.float32
    info[f"_{CHOSEN}"][:] = False
    *_, info = env.step([DOWN, UP])
    assert info[f"_{CHOSEN}"].all()


def test_async_environments_agree_with_sync_ones():
    table, infos = drone_table(), []
    for mode in ("sync", "async"):
        env = VectorTemporalRewardDecomposition(
            gym.make_vec("trdlab.envs:trdlab/DroneGridworld-v0", 2, vectorization_mode=mode), table
        )
        env.reset(seed=0)
        infos.append(env.step(np.array([DOWN, UP]))[-1])
        env.close()
    for key in (ALL, CHOSEN):
        np.testing.assert_array_equal(infos[0][key], infos[1][key])
