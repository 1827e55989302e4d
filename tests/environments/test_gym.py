"""Gymnasium environments as a trainer acts in them."""

import subprocess
import sys
from dataclasses import fields
from zlib import crc32

import gymnasium as gym
import numpy as np
import pytest

from trdlab.environments import Environments, GymEnvironments, NotReproducible, Step
from trdlab.environments.naming import is_numbered
from trdlab.environments.stack import FrameStack, observation_space
from trdlab.errors import InputError, TrdlabError
from trdlab.gridworld import Gridworld, load_map
from trdlab.gridworld.pixels import pictures


class Counter(gym.Env):
    """Counts its steps; action 7 terminates, and it forgets to be reproducible if it is told to."""

    def __init__(self, observation_space=None, action_space=None, drifts=False, names=()):
        self.observation_space = observation_space or gym.spaces.Box(0, 99, (2,), np.float32)
        self.action_space = action_space or gym.spaces.Discrete(3, start=5)
        self.drifts, self.action_names = drifts, names
        self.episodes = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count, self.episodes = 0, self.episodes + 1
        return self.seen(), {}

    def step(self, action):
        assert self.action_space.contains(action)
        self.count += 1
        return self.seen(), 0.5 * self.count, action == 7, False, {}

    def seen(self):
        if self.observation_space.shape != (2,):
            return self.observation_space.sample()
        return np.array([self.count, self.episodes * self.drifts], dtype=np.float64)


@pytest.fixture(autouse=True, scope="module")
def _counter():
    gym.register("Counter-v0", Counter, max_episode_steps=4)
    yield
    del gym.registry["Counter-v0"]


def same(a: Step, b: Step) -> bool:
    names = [field.name for field in fields(Step) if field.name != "info"]
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)


def acted(environments: Environments, steps: int, seed: int = 0) -> list[Step]:
    size = (steps, environments.num_envs)
    actions = np.random.default_rng(seed).integers(environments.num_actions, size=size)
    return [environments.step(row) for row in actions]


def test_ends_are_exact_and_the_next_episode_begins_in_the_same_call():
    environments = GymEnvironments("Counter-v0", 2, seed=0)
    assert environments.reset()[:, 0].tolist() == [0, 0]
    happened = [environments.step(np.array(row)) for row in ([0, 1], [2, 1], [0, 0], [0, 2])]
    told = [
        [step.frames[:, 0], step.rewards, step.terminated, step.truncated, step.following[:, 0]]
        for step in happened
    ]
    assert [[column.tolist() for column in step] for step in told] == [
        [[1, 1], [0.5, 0.5], [False, False], [False, False], [1, 1]],
        [[2, 2], [1.0, 1.0], [True, False], [False, False], [0, 2]],
        [[1, 3], [0.5, 1.5], [False, False], [False, False], [1, 3]],
        # the second one terminates at its time limit, which is one end and not two
        [[2, 4], [1.0, 2.0], [False, True], [False, False], [2, 0]],
    ]
    assert [step.ended.tolist() for step in happened[1::2]] == [[True, False], [False, True]]
    assert not any(step.life_lost.any() for step in happened)
    cut = [environments.step(np.array([0, 0])) for _ in range(4)]
    truncated = [step.truncated.tolist() for step in cut]
    assert truncated == [[False, False], [True, False], [False, False], [False, True]]
    assert cut[1].frames[0, 0] == 4
    assert cut[1].following[0, 0] == 0


def test_steps_are_never_overwritten():
    environments = GymEnvironments("CartPole-v1", 2, seed=0)
    first = environments.reset()
    kept = first.copy()
    steps = acted(environments, 30)
    copies = [step.frames.copy() for step in steps]
    acted(environments, 30)
    np.testing.assert_array_equal(first, kept)
    for step, copy in zip(steps, copies, strict=True):
        np.testing.assert_array_equal(step.frames, copy)


@pytest.mark.parametrize("num_envs", [1, 4])
@pytest.mark.parametrize(
    ("env_id", "arguments"),
    [
        ("CartPole-v1", {}),
        ("trdlab/DroneGridworld-v0", {"slip": 0.25}),
        ("trdlab/DroneGridworld-v0", {"slip": 0.25, "observation": "pixels"}),
    ],
)
def test_restored_to_the_bit_in_the_middle_of_an_episode(env_id, arguments, num_envs):
    def made() -> GymEnvironments:
        return GymEnvironments(env_id, num_envs, seed=3, env_arguments=arguments)

    environments = made()
    environments.reset()
    *_, last = acted(environments, 57)
    state = environments.state_dict()
    assert state["actions"].dtype == np.uint8
    after = acted(environments, 60, seed=1)
    again = made()
    np.testing.assert_array_equal(again.load_state_dict(state), last.following)
    assert all(map(same, after, acted(again, 60, seed=1)))
    again.load_state_dict(state)  # and by the same environments, later on
    assert all(map(same, after, acted(again, 60, seed=1)))


def test_what_is_saved_tells_all_that_was_seen_since_the_episode_began():
    """Saved runs of earlier versions are restored, too: their checksums are made in this way."""
    environments = GymEnvironments("Counter-v0", 3, seed=0)
    seen = [crc32(frame) for frame in environments.reset()]
    for row, active in [
        ([0, 1, 2], None),  # the third one ends
        ([1, 1, 1], None),
        ([0, 0, 0], np.array([True, False, True])),
    ]:
        step = environments.step(np.array(row), active)
        for env in range(3) if active is None else (0, 2):
            seen[env] = crc32(step.rewards[env], crc32(step.frames[env], seen[env]))
            seen[env] = crc32(step.following[env]) if step.ended[env] else seen[env]
    state = environments.state_dict()
    assert state["checksums"].tolist() == seen
    assert state["lengths"].tolist() == [3, 2, 2]
    assert state["actions"].tolist() == [0, 1, 0, 1, 1, 1, 0]
    acted(environments, 1)
    assert environments.state_dict()["lengths"].tolist() == [0, 3, 3], "the first one has ended"


def test_same_seed_same_run_and_every_episode_another():
    def firsts(seed: int) -> list[bytes]:
        environments = GymEnvironments("CartPole-v1", 3, seed=seed)
        frames = [environments.reset(), environments.reset()]
        frames += [step.following[step.ended] for step in acted(environments, 60)]
        return [row.tobytes() for some in frames for row in some]

    assert firsts(0) == firsts(0)
    assert len({*firsts(0), *firsts(1)}) == len(firsts(0)) + len(firsts(1))


def test_an_environment_that_is_no_function_of_its_seed_is_found_out():
    made = {"env_arguments": {"drifts": True}, "seed": 0}
    environments = GymEnvironments("Counter-v0", 2, **made)
    environments.reset()
    acted(environments, 6)
    state = environments.state_dict()
    with pytest.raises(NotReproducible, match=r"Counter-v0 did something else when \d+ actions"):
        environments.load_state_dict(state)
    environments.reset()  # new episodes, whose seeds were never drawn before
    assert (environments.state_dict()["seedings"] > state["seedings"]).all()


def test_a_saved_state_is_for_the_same_environments():
    environments = GymEnvironments("CartPole-v1", 2, seed=0)
    with pytest.raises(TrdlabError, match=r"have not begun\. Call reset\(\) first"):
        environments.state_dict()
    environments.reset()
    acted(environments, 5)
    state = environments.state_dict()
    with pytest.raises(InputError, match=r"have seed = 0, these have 1\. Resume with the options"):
        GymEnvironments("CartPole-v1", 2, seed=1).load_state_dict(state)
    with pytest.raises(InputError, match="have num_envs = 2, these have 1"):
        GymEnvironments("CartPole-v1", 1, seed=0).load_state_dict(state)
    with pytest.raises(InputError, match=r"have 9 actions in place of 10\. The file is torn"):
        environments.load_state_dict({**state, "actions": state["actions"][:-1]})


def test_what_is_known_of_an_environment():
    cartpole = GymEnvironments("CartPole-v1", 2, seed=0)
    assert (cartpole.num_actions, cartpole.first_action) == (2, 0)
    assert cartpole.action_names == ("push left", "push right")
    assert (cartpole.time_limit, cartpole.frames_per_second, cartpole.frame_skip) == (500, 50, 1)
    short = GymEnvironments("CartPole-v1", seed=0, env_arguments={"max_episode_steps": 7})
    assert short.time_limit == 7
    short.reset()
    assert acted(short, 7)[-1].truncated.all()
    drone = GymEnvironments("trdlab/DroneGridworld-v0", seed=0)
    assert drone.action_names == ("up", "down", "left", "right")


@pytest.mark.parametrize("names", [("a", "b"), ("a", "b", "a"), ()])  # of three actions
def test_actions_without_names_are_called_by_the_numbers_of_the_environment(names):
    counter = GymEnvironments("Counter-v0", seed=0, env_arguments={"names": names})
    assert (counter.num_actions, counter.first_action) == (3, 5)
    assert counter.action_names == ("action 5", "action 6", "action 7")
    assert is_numbered(counter.action_names)
    counter.reset()
    assert not counter.step(np.array([1])).terminated  # action 6
    assert counter.step(np.array([2])).terminated  # action 7


def test_grey_pictures_are_single_frames_and_coloured_ones_channels_first():
    drone = GymEnvironments(
        "trdlab/DroneGridworld-v0", 2, seed=0, env_arguments={"observation": "pixels"}
    )
    assert (drone.observation_space.shape, drone.stack) == ((84, 84), 1)
    stack = FrameStack(drone.reset(), drone.stack, drone.padding)
    assert stack.observations.shape == (2, 1, 84, 84)
    assert observation_space(drone).shape == (1, 84, 84)
    np.testing.assert_array_equal(stack.newest[0], pictures(Gridworld(load_map("drone")))[0])
    for shape, seen in (((40, 50, 3), (3, 40, 50)), ((40, 50, 1), (1, 40, 50))):
        coloured = gym.spaces.Box(0, 255, shape, np.uint8, seed=0)
        environments = GymEnvironments(
            "Counter-v0", seed=0, env_arguments={"observation_space": coloured}
        )
        assert (environments.observation_space.shape, environments.stack) == (seen, None)
        first = environments.reset()[0]
        coloured.seed(0)
        np.testing.assert_array_equal(first, np.moveaxis(coloured.sample(), -1, 0))


@pytest.mark.parametrize(
    ("space", "stack"),
    [
        (gym.spaces.Box(0, 255, (4, 84, 84), np.uint8), None),  # channels first as it is
        (gym.spaces.Box(0, 255, (128,), np.uint8), None),  # a memory, not a picture
        (gym.spaces.Box(0, 2, (8, 8), np.uint8), None),  # a board, not a picture
        (gym.spaces.Discrete(5, start=2), None),
    ],
)
def test_other_observations_stay_as_they_are(space, stack):
    environments = GymEnvironments("Counter-v0", seed=0, env_arguments={"observation_space": space})
    assert environments.observation_space == space
    assert environments.stack == stack
    assert environments.reset().shape == (1, *space.shape)


@pytest.mark.parametrize(
    ("env_id", "arguments", "message"),
    [
        ("Cartpole-v1", {}, "no environment 'Cartpole-v1'. Did you mean 'CartPole-v1'?"),
        ("CartPole-v9", {}, "no environment 'CartPole-v9'. Did you mean 'CartPole-v1'?"),
        ("LunarLander-v2", {}, "no environment 'LunarLander-v2'. Did you mean 'LunarLander-v3'?"),
        ("CartPole", {}, "no environment 'CartPole'. Did you mean 'CartPole-v1'?"),
        ("qwertz", {}, "no environment 'qwertz'. python -c"),
        ("trdlab/DronGridworld-v0", {}, "Did you mean 'trdlab/DroneGridworld-v0'?"),
        ("nowhere:Foo-v0", {}, "nowhere:Foo-v0 cannot be imported: No module named 'nowhere'"),
        ("CartPole-v1", {"gravity": 9}, "CartPole-v1 takes no argument 'gravity'. Known:"),
        ("CartPole-v1", {"suton_barto_reward": 1}, "Did you mean 'sutton_barto_reward'?"),
        ("CartPole-v1", {"sutton_barto_reward": 1}, "is '1'. It must be true or false."),
        ("CartPole-v1", {"max_episode_steps": 0}, "cannot be made with max_episode_steps=0"),
        (
            "trdlab/DroneGridworld-v0",
            {"slip": 2},
            "The slip probability is 2. It must lie between 0 and 1.",
        ),
        (
            "Pendulum-v1",
            {},
            "The action space of Pendulum-v1 is Box(-2.0, 2.0, (1,), float32). A decomposition has "
            "one row per action. Name a few actions to choose from: gymnasium.wrappers.",
        ),
        (
            "Counter-v0",
            {"action_space": gym.spaces.MultiBinary(3)},
            "The action space of Counter-v0 is MultiBinary(3). A decomposition has one row per "
            "action: use an environment with a Discrete or MultiDiscrete one.",
        ),
        (
            "Counter-v0",
            {"action_space": gym.spaces.MultiDiscrete([10, 10, 10])},
            "These are 1,000 combinations. A decomposition has one row for each: name 256 of them",
        ),
        (
            "Counter-v0",
            {"observation_space": gym.spaces.Dict(say=gym.spaces.Text(9))},
            "Use one of numbers: Box, Discrete, MultiDiscrete, MultiBinary, or a Dict or Tuple of",
        ),
        ("ALE/Breakout-v5", {}, "is an Atari game. Use: trdlab train atari ALE/Breakout-v5"),
    ],
)
def test_refused_in_one_line_with_the_cure(env_id, arguments, message):
    with pytest.raises(InputError) as refusal:
        GymEnvironments(env_id, seed=0, env_arguments=arguments)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_parts_of_an_observation_stand_one_behind_the_other():
    picture = gym.spaces.Box(0, 255, (2, 5, 3), np.uint8)
    space = gym.spaces.Dict(
        [  # not in the order of the alphabet
            ("z", picture),
            ("a", gym.spaces.Tuple([gym.spaces.Discrete(3, start=-1), gym.spaces.Box(-1, 1)])),
            ("m", gym.spaces.MultiDiscrete([2, 3])),
            ("b", gym.spaces.MultiBinary((2, 2))),
        ]
    )
    environments = GymEnvironments("Counter-v0", seed=0, env_arguments={"observation_space": space})
    seen = {
        "z": np.arange(30, dtype=np.uint8).reshape(2, 5, 3),
        "a": (np.int64(1), np.float32([0.5])),
        "m": np.array([1, 0]),
        "b": np.array([[0, 1], [1, 1]], dtype=np.int8),
    }
    flat = environments.observation_space
    ours = environments._frame(seen)
    assert ours.dtype == np.float32
    assert ours[:10].tolist() == list(range(0, 30, 3))  # a channel after the other
    assert ours[30:].tolist() == [0, 0, 1, 0.5, 0, 1, 1, 0, 0, 0, 1, 1, 1]
    assert flat.parts == {"z": (3, 2, 5), "a": (4,), "m": (5,), "b": (2, 2)}
    back = flat.unflat(ours[None])
    assert np.array_equal(back["z"][0], np.moveaxis(seen["z"], -1, 0))
    assert [part.tolist() for part in (*back["a"], back["m"], back["b"])] == [
        [1],
        [[0.5]],
        [[1, 0]],
        [[[0, 1], [1, 1]]],
    ]
    assert (flat.low[0], flat.high[0], flat.shape) == (0.0, 255.0, (43,))
    assert environments.reset().shape == (1, 43)
    assert environments.step(np.array([0])).frames.shape == (1, 43)


@pytest.mark.parametrize("seen", [{}, {"at": [0.0, 1.0]}, {"at": "here"}, [0.5]])
def test_what_is_none_of_its_parts_is_refused(seen):
    space = gym.spaces.Dict(at=gym.spaces.Box(-1, 1))
    environments = GymEnvironments("Counter-v0", seed=0, env_arguments={"observation_space": space})
    wrong = r"gives an observation that is none of its observation space Dict\('at'.*is wrong"
    with pytest.raises(InputError, match=wrong):
        environments._frame(seen)


def test_copies_are_made_of_environments_that_show_several_parts():
    environments = GymEnvironments("Blackjack-v1", 2, seed=0)
    assert environments.reset().shape == (2, 32 + 11 + 2)
    copies = environments.branch(np.array([0, 1, 1]), seed=1)
    assert copies.step(np.array([0, 0, 0])).terminated.all()


def test_actions_of_several_parts_are_numbered_and_named():
    turns = gym.spaces.MultiDiscrete([2, 3], start=[0, 5])
    names = (["stay", "jump"], ["left", "on", "right"])
    environments = [
        GymEnvironments("Counter-v0", seed=0, env_arguments={"action_space": turns, "names": given})
        for given in (names, "", [f"way {i}" for i in range(6)], (["stay"], ["left", "on"]))
    ]
    joined = ("stay+left", "stay+on", "stay+right", "jump+left", "jump+on", "jump+right")
    assert environments[0].action_names == joined
    assert environments[2].action_names[4:] == ("way 4", "way 5")
    numbers = ("action 0+0", "action 0+1", "action 0+2", "action 1+0", "action 1+1", "action 1+2")
    assert environments[1].action_names == environments[3].action_names == numbers
    taken = []
    environments[0]._envs[0].unwrapped.step = lambda action: (
        taken.append(action.tolist()) or (np.zeros(2), 0.0, False, False, {})
    )
    environments[0].reset()
    for action in range(6):
        environments[0].step(np.array([action]))
    assert taken == [[0, 5], [0, 6], [0, 7], [1, 5], [1, 6], [1, 7]]


def test_the_masks_of_parts_allow_what_all_of_them_allow():
    space = gym.spaces.MultiDiscrete([2, 2])  # of which there are as many actions as choices
    environments = GymEnvironments("Counter-v0", seed=0, env_arguments={"action_space": space})
    environments._envs[0].unwrapped.action_masks = lambda: [True, False, True, True]
    environments.reset()
    assert environments.allowed.tolist() == [[True, True, False, False]]
    assert environments.branch(np.array([0]), seed=0).allowed.tolist() == [
        [True, True, False, False]
    ]


def test_a_missing_extra_is_named(monkeypatch):
    for module in [name for name in sys.modules if name.startswith("gymnasium.envs.box2d")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "Box2D", None)
    with pytest.raises(InputError, match=r"pip install 'trdlab\[box2d\]'") as refusal:
        GymEnvironments("LunarLander-v3", seed=0)
    assert refusal.value.cause == "LunarLander-v3 needs a package that is not installed."


def test_wrong_numbers_are_refused():
    with pytest.raises(InputError, match=r"There are 0 environments\. Make at least 1"):
        GymEnvironments("CartPole-v1", 0, seed=0)
    with pytest.raises(InputError, match="The seed is -1"):
        GymEnvironments("CartPole-v1", seed=-1)
    environments = GymEnvironments("CartPole-v1", 2, seed=0)
    environments.reset()
    with pytest.raises(InputError, match=r"The actions are \[0, 2\]\. They run from 0 to 1"):
        environments.step(np.array([0, 2]))
    for actions in ([0], [0.0, 1.0]):
        with pytest.raises(InputError, match="Give 2 whole numbers"):
            environments.step(np.array(actions))


def test_observations_outside_their_space_are_found_out():
    wrong = gym.spaces.Box(0, 255, (2,), np.uint8)  # and it gives floats
    with pytest.raises(InputError, match="gives observations of type float64, and its observation"):
        GymEnvironments("Counter-v0", seed=0, env_arguments={"observation_space": wrong}).reset()


def test_the_protocol_can_be_imported_without_gymnasium():
    code = "import sys, trdlab.environments as e; e.Step; print('gymnasium' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
