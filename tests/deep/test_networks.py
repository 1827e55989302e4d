"""Networks: the right one for each space, its shapes, its seed, and what it refuses."""

import gymnasium as gym
import numpy as np
import pytest
import torch

from trdlab.decomposition import TimeAxis
from trdlab.deep.networks import NatureNetwork, VectorNetwork, build_network, count_actions
from trdlab.deep.update import load_weights
from trdlab.errors import InputError

AXIS = TimeAxis(0.99, horizon=4)
ATARI = gym.spaces.Box(0, 255, (4, 84, 84), np.uint8)
VECTOR = gym.spaces.Box(-1, 1, (3, 2), np.float64)
RAM = gym.spaces.Box(0, 255, (128,), np.uint8)
STATES = gym.spaces.Discrete(7, start=2)


def batch_of(space: gym.Space, size: int = 3) -> torch.Tensor:
    space.seed(0)
    return torch.as_tensor(np.stack([space.sample() for _ in range(size)]))


@pytest.mark.parametrize(
    ("space", "kind"),
    [
        (ATARI, NatureNetwork),
        (gym.spaces.Box(0, 255, (3, 36, 50), np.uint8), NatureNetwork),
        (VECTOR, VectorNetwork),
        (RAM, VectorNetwork),
        (STATES, VectorNetwork),
    ],
)
def test_each_space_has_its_network(space, kind):
    network = build_network(space, 6, AXIS, hidden=(16,))
    assert type(network) is kind
    components = network(batch_of(space))
    assert components.shape == (3, 6, 5)
    assert components.dtype == torch.float32
    assert network(batch_of(space)[:0]).shape == (0, 6, 5)
    assert components.std() > 0


def test_the_nature_network_is_that_of_the_paper():
    shapes = [tuple(p.shape) for p in build_network(ATARI, 4, TimeAxis(0.99, 40)).parameters()]
    assert shapes[::2] == [(32, 4, 8, 8), (64, 32, 4, 4), (64, 64, 3, 3), (512, 3136), (164, 512)]
    assert shapes[1::2] == [(32,), (64,), (64,), (512,), (164,)]


def test_the_head_is_action_by_action():
    network = build_network(VECTOR, 2, TimeAxis(0.9, 2), hidden=())
    with torch.no_grad():
        network.head.weight.zero_()
        network.head.bias.copy_(torch.arange(6.0))
    assert network(torch.zeros(1, 3, 2)).tolist() == [[[0, 1, 2], [3, 4, 5]]]


def test_the_mean_of_images_is_taken_away():
    network, rng = build_network(ATARI, 2, AXIS), np.random.default_rng(0)
    seen = rng.integers(0, 256, (50, 4, 84, 84), dtype=np.uint8)
    network.standardise(seen)
    inputs = network.preprocess(torch.as_tensor(seen))
    torch.testing.assert_close(inputs.mean(dim=0), torch.zeros(4, 84, 84), atol=1e-5, rtol=0)
    torch.testing.assert_close(inputs[3] + network.middle, torch.as_tensor(seen[3]) / 255.0)


def test_weights_of_images_that_know_no_mean_are_read_as_they_were_learned():
    network, older = build_network(ATARI, 2, AXIS, seed=1), build_network(ATARI, 2, AXIS, seed=2)
    network.standardise(np.full((2, 4, 84, 84), 9, dtype=np.uint8))
    load_weights(network, {k: v for k, v in older.state_dict().items() if k != "middle"})
    white = torch.full((1, 4, 84, 84), 255, dtype=torch.uint8)
    assert torch.equal(network(white), older(white))


def test_images_and_bytes_reach_from_0_to_1():
    white = torch.full((1, 4, 84, 84), 255, dtype=torch.uint8)
    assert build_network(ATARI, 2, AXIS).preprocess(white).unique().tolist() == [1]
    assert build_network(RAM, 2, AXIS).preprocess(white[0, 0, :1].repeat(1, 2)[:, :128]).max() == 1


def test_states_are_one_hot_from_the_first_one():
    one_hot = build_network(STATES, 2, AXIS).preprocess(torch.tensor([2, 8]))
    assert one_hot.argmax(1).tolist() == [0, 6]
    assert one_hot.sum(1).tolist() == [1, 1]


@pytest.mark.parametrize("space", [ATARI, VECTOR, STATES])
def test_the_seed_decides_the_weights_and_nothing_else_moves(space):
    torch.manual_seed(1)
    before = torch.get_rng_state()
    one, same, other = (build_network(space, 3, AXIS, seed=seed) for seed in (5, 5, 6))
    assert torch.equal(torch.get_rng_state(), before)
    for mine, twin, stranger in zip(
        one.parameters(), same.parameters(), other.parameters(), strict=True
    ):
        assert torch.equal(mine, twin)
        assert not torch.equal(mine, stranger)


def test_a_generator_goes_on():
    rng = torch.Generator().manual_seed(5)
    first, second = (build_network(VECTOR, 3, AXIS, seed=rng) for _ in range(2))
    assert torch.equal(first.head.bias, build_network(VECTOR, 3, AXIS, seed=5).head.bias)
    assert not torch.equal(first.head.bias, second.head.bias)


def test_weights_are_spread_as_pytorch_draws_them():
    network = build_network(ATARI, 4, AXIS)
    for layer in (*network.body, network.head):
        if (weight := getattr(layer, "weight", None)) is not None:
            bound = weight[0].numel() ** -0.5
            for parameter in (weight, layer.bias):
                assert parameter.abs().max() <= bound
            assert weight.std().item() == pytest.approx(bound / 3**0.5, rel=0.05)


def test_channels_last_changes_the_layout_and_not_the_answer():
    fast, plain = (build_network(ATARI, 4, AXIS, channels_last=last) for last in (True, False))
    images = batch_of(ATARI)
    assert fast.body[2].weight.is_contiguous(memory_format=torch.channels_last)
    assert plain.body[2].weight.is_contiguous()
    torch.testing.assert_close(fast(images), plain(images), atol=1e-5, rtol=1e-4)


def test_a_gradient_reaches_the_pixels():
    network = build_network(ATARI, 4, AXIS)
    inputs = network.preprocess(batch_of(ATARI)).requires_grad_()
    network.components(inputs)[0, 1, 2].backward()
    assert inputs.grad[0].abs().sum() > 0
    assert inputs.grad[1:].abs().sum() == 0


def test_observations_that_do_not_fit_are_refused():
    network = build_network(ATARI, 4, AXIS)
    with pytest.raises(InputError, match=r"shape \(4, 84, 84\).*\[B, 4, 84, 84\]"):
        network(torch.zeros(4, 84, 84, dtype=torch.uint8))
    with pytest.raises(InputError, match=r"type float32.*divides by 255 itself"):
        network(torch.zeros(1, 4, 84, 84))
    states = build_network(STATES, 4, AXIS)
    with pytest.raises(InputError, match=r"shape \(\).*\[B\]"):
        states(torch.tensor(3))
    with pytest.raises(InputError, match=r"from 1 to 3.*from 2 to 8"):
        states(torch.tensor([1, 3]))
    with pytest.raises(InputError, match=r"type float32.*whole numbers"):
        states(torch.tensor([2.0]))


def test_spaces_without_a_network_are_refused():
    with pytest.raises(InputError, match=r"MultiBinary.*FlattenObservation"):
        build_network(gym.spaces.MultiBinary(3), 2, AXIS)
    channels_last = gym.spaces.Box(0, 255, (84, 84, 3), np.uint8)
    with pytest.raises(InputError, match=r"\(84, 84, 3\).*channels, height, width.*at least 36"):
        build_network(channels_last, 2, AXIS)


def test_only_discrete_actions_are_counted():
    assert count_actions(gym.spaces.Discrete(4, start=1)) == 4
    with pytest.raises(InputError, match=r"action space is Box.*Discrete"):
        count_actions(gym.spaces.Box(-1, 1, (2,)))


def test_inputs_with_bounds_run_from_minus_one_to_one():
    """The middle of the bounds is 0; an input without finite bounds is taken as it is."""
    low = np.array([-1.2, -0.07, -np.inf, 0.0, -3e38], dtype=np.float32)
    high = np.array([0.6, 0.07, np.inf, 0.0, 3e38], dtype=np.float32)
    network = build_network(gym.spaces.Box(low, high), 2, AXIS)
    seen = torch.tensor([[-1.2, 0.07, 5.0, 0.0, 7.0], [-0.3, 0.0, -9.0, 0.0, 0.0]])
    expected = [[-1.0, 1.0, 5.0, 0.0, 7.0], [0.0, 0.0, -9.0, 0.0, 0.0]]
    torch.testing.assert_close(network.preprocess(seen), torch.tensor(expected))
    assert {"middle", "scale"} <= network.state_dict().keys()  # kept with the weights
