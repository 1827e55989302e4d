"""The network as an Estimator: its contract, in the wrappers and in explanations."""

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.vector import SyncVectorEnv

from moments import told
from trdlab.decomposition import TimeAxis
from trdlab.deep.estimator import NetworkEstimator
from trdlab.deep.networks import build_network
from trdlab.errors import InputError
from trdlab.estimator import Estimator, Future
from trdlab.explanations import check, moment_of
from trdlab.explanations.moment.moment import CHOICES
from trdlab.gridworld.env import GridworldEnv
from trdlab.wrappers import TemporalRewardDecomposition, VectorTemporalRewardDecomposition

AXIS = TimeAxis(0.95, horizon=4)
FUTURE = Future("the greedy policy of the network")
CART = gym.spaces.Box(-1, 1, (4,), np.float32)
ATARI = gym.spaces.Box(0, 255, (4, 84, 84), np.uint8)


def estimator_for(space: gym.Space, num_actions: int = 4, **options: int) -> NetworkEstimator:
    return NetworkEstimator(build_network(space, num_actions, AXIS), AXIS, FUTURE, **options)


@pytest.mark.parametrize("space", [CART, ATARI, gym.spaces.Discrete(9)])
def test_it_is_an_estimator(space):
    estimator = estimator_for(space)
    assert isinstance(estimator, Estimator)
    assert estimator.future == FUTURE
    space.seed(0)
    observations = np.stack([space.sample() for _ in range(3)])
    decomposition = estimator.decompose(observations)
    assert decomposition.time_axis == AXIS
    assert decomposition.components.shape == (3, 4, 5)
    assert decomposition.components.dtype == np.float32
    with pytest.raises(ValueError, match=r"read-only"):
        decomposition.components[0] = 0
    with torch.no_grad():
        expected = estimator.network(torch.as_tensor(observations)).numpy()
    np.testing.assert_array_equal(decomposition.components, expected)


@pytest.mark.parametrize("size", [0, 1, 2, 7])
def test_large_inputs_are_cut_into_batches(size):
    observations = np.random.default_rng(0).random((size, 4), dtype=np.float32)
    whole = estimator_for(CART).decompose(observations).components
    assert whole.shape == (size, 4, 5)
    parts = estimator_for(CART, batch_size=2).decompose(observations).components
    np.testing.assert_allclose(parts, whole, atol=1e-6)


def test_no_gradients_eval_mode_and_the_mode_comes_back():
    estimator, modes = estimator_for(CART), []
    estimator.network.register_forward_hook(
        lambda module, *_: modes.append((module.training, torch.is_grad_enabled()))
    )
    estimator.network.train()
    estimator.decompose(np.zeros((1, 4), np.float32))
    assert modes == [(False, False)]
    assert estimator.network.training
    with pytest.raises(InputError, match=r"shape"):
        estimator.decompose(np.zeros((1, 5), np.float32))
    assert estimator.network.training


def test_it_follows_a_network_that_learns_but_what_it_said_stands():
    estimator = estimator_for(CART)
    said = estimator.decompose(np.zeros((1, 4), np.float32))
    before = said.components.copy()
    with torch.no_grad():
        estimator.network.head.bias += 1
    np.testing.assert_array_equal(said.components, before)
    after = estimator.decompose(np.zeros((1, 4), np.float32)).components
    np.testing.assert_allclose(after, before + 1, atol=1e-6)


def test_read_only_observations_are_taken_and_left_alone():
    observations = np.zeros((2, 4), np.float32)
    observations.setflags(write=False)
    assert estimator_for(CART).decompose(observations).shape == (2, 4)


def test_in_the_wrappers():
    env = GridworldEnv("drone")
    estimator = estimator_for(env.observation_space)
    _, info = TemporalRewardDecomposition(env, estimator).reset(seed=0)
    assert info["reward_decomposition"].shape == (4, 5)
    envs = SyncVectorEnv([lambda: GridworldEnv("drone")] * 3)
    wrapped = VectorTemporalRewardDecomposition(envs, estimator)
    wrapped.reset(seed=0)
    *_, infos = wrapped.step(np.array([0, 1, 2]))
    assert infos["chosen_decomposition"].shape == (3, 5)
    np.testing.assert_allclose(
        infos["chosen_decomposition"], info["reward_decomposition"][:3], atol=1e-6
    )
    pole = TemporalRewardDecomposition(gym.make("CartPole-v1"), estimator_for(CART, 2))
    _, info = pole.reset(seed=0)
    assert info["reward_decomposition"].shape == (2, 5)


def test_in_explanations():
    env = GridworldEnv("drone")
    moment = moment_of(estimator_for(env.observation_space), env.mdp.start, env.action_names)
    choice = moment.choice()
    said = [claim.sentence for claim in told(choice)]
    assert len(check(" ".join(said), [(CHOICES, choice)])) == len(said) > 0
    assert moment.future == FUTURE


def test_what_does_not_fit_is_refused():
    network = build_network(CART, 2, AXIS)
    with pytest.raises(InputError, match=r"network has 5 components, N = 5 needs 6.*N = 4"):
        NetworkEstimator(network, TimeAxis(0.95, 5), FUTURE)
    with pytest.raises(InputError, match=r"batch size is 0"):
        NetworkEstimator(network, AXIS, FUTURE, batch_size=0)
    estimator = NetworkEstimator(network, AXIS, FUTURE)
    with pytest.raises(InputError, match=r"shape \(\).*batch"):
        estimator.decompose(1.0)
    with pytest.raises(InputError, match=r"arrays of numbers.*FlattenObservation"):
        estimator.decompose({"position": np.zeros((1, 4))})
