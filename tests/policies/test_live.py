"""Loaded models, as stand-ins that have what those of Stable-Baselines3 have (see test_interop)."""

from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
import torch
from torch import nn

import trdlab
from trdlab.errors import InputError
from trdlab.policies import ask
from trdlab.policies.registry import policy_of

SEEN = np.random.default_rng(1).normal(size=(6, 4)).astype(np.float32)


class Standing:
    """A policy of theirs, whose network is given."""

    device = "cpu"

    def __init__(self, **parts):
        self.__dict__.update(parts)

    def set_training_mode(self, mode):
        assert mode is False

    def obs_to_tensor(self, observations):
        return torch.as_tensor(observations, dtype=torch.float32), True


class Actor(Standing):
    def get_distribution(self, seen):
        return SimpleNamespace(distribution=SimpleNamespace(logits=self.action_net(seen)))


class Model:
    gamma = 0.97

    def __init__(self, policy, actions=None, normalise=None):
        self.policy, self.observation_space = policy, gym.spaces.Box(-1, 1, (4,))
        self.action_space = actions or gym.spaces.Discrete(2)
        self.get_vec_normalize_env = lambda: normalise

    def predict(self, observation):
        raise AssertionError("it tells an action, and not how likely each is")


def test_values_are_asked_for_and_the_best_is_taken():
    net = nn.Linear(4, 2)
    agent = trdlab.agent(Model(Standing(q_net=net)), env="CartPole-v1")
    values = SEEN @ net.weight.detach().numpy().T + net.bias.detach().numpy()
    np.testing.assert_allclose(agent.policy.q_values(SEEN), values, rtol=1e-5, atol=1e-6)
    assert ask(agent.policy, SEEN)[0].argmax(axis=1).tolist() == values.argmax(axis=1).tolist()
    about = agent.policy.about
    assert (about.algorithm, about.layers, about.gamma, about.draws) == (
        "Model",
        "4 → 2",
        0.97,
        False,
    )
    assert agent.evaluate(3).returns.min() > 5


def test_probabilities_are_drawn_from_and_observations_normalised():
    net = nn.Linear(4, 2)
    halved = SimpleNamespace(normalize_obs=lambda seen: seen / 2.0)
    policy = policy_of(Model(Actor(action_net=net), normalise=halved))
    logits = net(torch.from_numpy(SEEN / 2.0)).detach()
    np.testing.assert_allclose(ask(policy, SEEN)[0], logits.softmax(dim=1), rtol=1e-5)
    assert policy.about.draws


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (
            Model(Standing(q_net=nn.Linear(4, 2)), gym.spaces.Box(-1, 1, (2,))),
            "action space of this Model is Box.*Let the environment take a few by their numbers",
        ),
        (Model(Standing()), "has no values of actions, and no distribution over them"),
        (Model(Standing(q_net=nn.Linear(4, 3))), "gives 3 probabilities, and 'CartPole-v1' has 2"),
    ],
)
def test_models_that_cannot_act_are_refused(model, message):
    with pytest.raises(InputError, match=message):
        trdlab.agent(model, env="CartPole-v1")


def test_what_only_looks_alike_is_none_of_theirs():
    assert policy_of(SimpleNamespace(predict=len, policy="greedy")) is None
    assert policy_of(len) is None
