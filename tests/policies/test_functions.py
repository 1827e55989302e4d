"""Functions of one's own as policies, and files of Python that make an agent."""

import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import TransformAction

import trdlab
from doors import Doors
from trdlab.errors import InputError
from trdlab.policies import Likeliest, Memoryless, ask
from trdlab.policies.functions import OneByOne, from_function

PUSH = (
    "def push(seen):\n    return int(seen[2] + 0.5 * seen[3] > 0)\n\ndef make():\n    return push\n"
)


def even(seen):
    return np.full((len(seen), 2), 0.5)


def test_a_function_is_told_by_what_it_answers():
    batch = np.zeros((2, 4))
    assert isinstance(from_function(even, batch, 2), Memoryless)
    one = from_function(lambda seen: np.int64(seen.sum() > 1), batch, 2)
    assert isinstance(one, OneByOne)
    assert ask(one, np.array([[1.0, 1.0], [0.0, 0.0]]))[0].tolist() == [[0, 1], [1, 0]]
    states = from_function(lambda state: int(state) % 3, np.array([0, 0]), 3)
    assert ask(states, np.array([4, 2]))[0].argmax(axis=1).tolist() == [1, 2]


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda seen: 1 / 0, r"fails at the first observation \(ZeroDivisionError: division"),
        (lambda seen: "left", r"with shape \(\), for 2 actions. It must take an observation"),
        (lambda seen: np.ones((len(seen), 3)), r"shape \(2, 3\), for 2 actions"),
        (lambda seen: None, r"for 2 actions"),
        (lambda: 1, r"takes 0 positional arguments"),
    ],
)
def test_a_function_that_is_no_policy_is_refused(function, message):
    with pytest.raises(InputError, match=message):
        trdlab.agent(function, env="CartPole-v1")


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda seen: 2, "answered observation 0 of 1 with 2. It must .* from 0 to 1"),
        (lambda seen: -1, "answered observation 0 of 1 with -1"),
        (
            lambda seen: np.full((len(seen), 2), np.nan),
            r"answer to observation 0 of 1 is no distribution over actions: \[nan, nan\]",
        ),
        (lambda seen: np.ones((len(seen), 2)), "no distribution over actions"),
    ],
)
def test_answers_that_are_no_action_are_named_with_their_observation(function, message):
    with pytest.raises(InputError, match=message):
        trdlab.agent(function, env="CartPole-v1")


def test_what_fails_later_is_named_with_its_observation():
    def sometimes(seen):
        return "?" if seen[0] > 0 else 0

    policy = OneByOne(sometimes, 2)
    with pytest.raises(InputError, match=r"observation 1 of 2 with '\?'"):
        policy.act(np.array([[-1.0], [1.0]]), None, np.ones(2, bool))
    with pytest.raises(InputError, match=r"fails at observation 0 of 1 \(IndexError"):
        policy.act(np.zeros((1, 0)), None, np.ones(1, bool))


def test_an_agent_without_expectations_plays_and_says_what_is_missing():
    agent = trdlab.agent(even, env="CartPole-v1", action_names=["left", "right"])
    assert not agent.is_fitted
    assert repr(agent) == "<Agent: even · not fitted · left, right>"
    assert agent.evaluate(4, seed=1).returns.tolist() == agent.evaluate(4, seed=1).returns.tolist()
    greedy = agent.evaluate(2, greedy=True)
    assert greedy.lengths.max() < 12  # always to the left
    assert trdlab.agent(agent, env="CartPole-v1").policy is agent.policy
    for ask_it in (
        lambda: trdlab.explain(agent),
        lambda: trdlab.calibrate(agent),
        lambda: trdlab.compare(agent, agent, episodes=2),
        lambda: agent.estimator.decompose(np.zeros((1, 4))),
        lambda: agent.play(1, seed=0),
    ):
        with pytest.raises(InputError, match=r"Nobody knows yet .* Fit it first: trdlab.fit"):
            ask_it()
    with pytest.raises(InputError, match="There are 0 episodes"):
        agent.evaluate(0)


def test_a_function_is_shown_the_parts_of_an_observation():
    def one(seen):
        assert sorted(seen) == ["open", "time"]
        return int(np.flatnonzero(seen["open"])[-1])

    def all_together(seen):
        return np.eye(3)[2 - seen["open"][:, ::-1].argmax(axis=1)]

    agents = [trdlab.agent(who, env=Doors) for who in (one, all_together)]
    assert isinstance(agents[0].policy, OneByOne)
    returns = [agent.evaluate(5, seed=2).returns.tolist() for agent in agents]
    assert returns[0] == returns[1]
    assert min(returns[0]) > 6
    cards = trdlab.agent(lambda hand: int(hand[0] < 18), env="Blackjack-v1")  # a Tuple
    assert cards.evaluate(20).mean.value > -0.8


def test_an_agent_with_continuous_actions_is_explained_by_the_nearest_of_a_few():
    torques = np.float32([[-2], [0], [2]])

    def pendulum():
        env = gym.make("Pendulum-v1")
        return TransformAction(env, lambda i: torques[i], gym.spaces.Discrete(len(torques)))

    def nearest(seen):
        wanted = np.float32([-seen[2]])  # what an agent of another library would do
        return int(np.abs(torques - wanted).sum(axis=1).argmin())

    agent = trdlab.agent(nearest, env=pendulum, action_names=["left", "none", "right"])
    assert agent.evaluate(2, max_steps=20).lengths.tolist() == [20, 20]


def test_what_is_expected_of_observations_with_parts_is_fitted():
    agent = trdlab.agent(lambda seen: int(np.flatnonzero(seen["open"])[-1]), env=Doors)
    fitted = trdlab.fit(agent, horizon=2, steps=300, share=0.0, most_updates=200)
    seen = np.float32([[1, 1, 1, 0.5], [1, 1, 0, 0.5]])  # the doors, and the time
    told = fitted.estimator.decompose(seen).components[[0, 1], [2, 1], 0]
    np.testing.assert_allclose(told, [2.0, 1.0], atol=0.3)


def test_a_policy_with_memory_is_taken_as_it_is():
    class Alternating:
        def act(self, observations, state, begins):
            turn = np.where(begins, 0, 0 if state is None else 1 - state)
            return np.eye(2)[turn], turn

    agent = trdlab.agent(Alternating(), env="CartPole-v1")
    assert agent.name == "Alternating"
    assert agent.evaluate(3).returns.min() > 10
    assert isinstance(agent.policy, Alternating)
    assert Likeliest(agent.policy).about is None


def test_a_file_of_python_makes_an_agent(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(PUSH)
    before = list(sys.path)
    agent = trdlab.agent(f"python:{path}:make", env="CartPole-v1")
    assert sys.path == before
    assert agent.evaluate(3).returns.min() > 100
    assert agent.origin.words == (f"python:{path}:make", "--env", "CartPole-v1")
    with pytest.raises(InputError, match="Nothing says where this function acts"):
        trdlab.agent(f"python:{path}:make")
    with pytest.raises(InputError, match=r"no function 'mak' in .* Did you mean 'make'"):
        trdlab.agent(f"python:{path}:mak", env="CartPole-v1")
    with pytest.raises(InputError, match=r"'push' in .* makes no agent \(TypeError"):
        trdlab.agent(f"python:{path}:push", env="CartPole-v1")
    path.write_text("import nothing_of_that_name")
    with pytest.raises(InputError, match=r"mine.py' cannot be imported \(ModuleNotFoundError"):
        trdlab.agent(f"python:{path}:make", env="CartPole-v1")
    for name, message in [("make", "names no function"), (f"{path}x:make", "There is no file")]:
        with pytest.raises(InputError, match=message):
            trdlab.agent(f"python:{name}", env="CartPole-v1")
