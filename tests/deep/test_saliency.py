"""Saliency of networks: by hand, against one component at a time, and against captum."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
import torch
from torch import nn

from trdlab.decomposition import TimeAxis
from trdlab.deep.channels import Channel
from trdlab.deep.estimator import NetworkEstimator
from trdlab.deep.features import features_space, upon
from trdlab.deep.networks import DecompositionNetwork, build_network
from trdlab.deep.saliency import gradcam
from trdlab.errors import InputError
from trdlab.estimator import Future

AXIS = TimeAxis(0.95, horizon=4)
FUTURE = Future("the greedy policy of the network")
ATARI = gym.spaces.Box(0, 255, (4, 84, 84), np.uint8)
CART = gym.spaces.Box(-1, 1, (4,), np.float32)


class Small(DecompositionNetwork):
    """A convolution, whatever follows, and a linear head; inputs are taken as they are."""

    def __init__(self, *body: nn.Module, features: int, components: int, shape: tuple[int, ...]):
        head = nn.Linear(features, components)
        super().__init__(nn.Sequential(*body, nn.Flatten()), head, shape, 1, components)

    def preprocess(self, observations):
        return observations.float()


def estimator_for(space: gym.Space, actions: int = 3, seed: int = 0, **how) -> NetworkEstimator:
    return NetworkEstimator(build_network(space, actions, AXIS, seed=seed), AXIS, FUTURE, **how)


def images(count: int) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (count, 4, 84, 84), dtype=np.uint8)


def of_channels() -> NetworkEstimator:
    """A fit that tells chances of rewards and survival, upon the features of another network."""
    channels = (Channel("value", reward=1.0), Channel("running"), Channel("value", reward=4.0))
    trunk = estimator_for(ATARI)
    top = build_network(features_space(512), 3 * len(channels), AXIS, seed=1, hidden=(16,))
    return upon(trunk, NetworkEstimator(top, AXIS, FUTURE, channels=channels))


def test_by_hand():
    """One convolution of kernel 1 makes two maps, x and 3 − x; the head sees all of their places.

    On [[1, 2], [0, 4]] the ReLU leaves A₀ = [[1, 2], [0, 4]] and A₁ = [[2, 1], [3, 0]]. The head of
    component 0 weighs the places of A₀ by 1, 2, 3, 4 and those of A₁ by −1: α = 10/4 and −1.
    Component 1 reads the last place of A₁ alone, where the ReLU is shut: GradCAM of the maps
    after it gives α = 0 and 2/4.
    """
    network = Small(nn.Conv2d(1, 2, 1), nn.ReLU(), features=8, components=2, shape=(1, 2, 2))
    with torch.no_grad():
        network.body[0].weight.copy_(torch.tensor([1.0, -1.0]).reshape(2, 1, 1, 1))
        network.body[0].bias.copy_(torch.tensor([0.0, 3.0]))
        network.head.weight.copy_(
            torch.tensor([[1.0, 2, 3, 4, -1, -1, -1, -1], [0, 0, 0, 0, 0, 0, 0, 2]])
        )
    estimator = NetworkEstimator(network, TimeAxis(0.9, 1), FUTURE)
    (maps,) = estimator.saliency(np.array([[[[1, 2], [0, 4]]]]), [0])
    np.testing.assert_allclose(maps[0], [[2.5 - 2, 5 - 1], [-3, 10]])
    np.testing.assert_allclose(maps[1], [[1, 0.5], [1.5, 0]])


@pytest.mark.parametrize(
    "following",
    [
        nn.Conv2d(3, 2, 3, stride=2, bias=False),
        nn.Conv2d(3, 2, 3, padding=1),
        nn.Conv2d(3, 2, 3, padding="same"),
        nn.Conv2d(3, 3, 2, groups=3),
        nn.Conv2d(3, 2, 2, dilation=3),
        nn.MaxPool2d(2),
    ],
)
def test_whatever_follows_the_layer_the_weights_are_mean_gradients(following):
    torch.manual_seed(0)
    body = [nn.Conv2d(2, 3, 2), nn.ReLU(), following, nn.ReLU()]
    size = nn.Sequential(*body, nn.Flatten())(torch.zeros(1, 2, 8, 9)).shape[1]
    network = Small(*body, features=size, components=5, shape=(2, 8, 9))
    inputs = torch.rand(2, 2, 8, 9)
    maps = network.body[:2](inputs).detach().requires_grad_()
    told = network.by_action(network.body[2:](maps))[:, 0]
    for k in range(5):
        (slopes,) = torch.autograd.grad(told[:, k].sum(), maps, retain_graph=True)
        expected = (slopes.mean(dim=(2, 3), keepdim=True) * maps).sum(dim=1).detach()
        found = gradcam(network, inputs, lambda outputs: outputs[:, 0])[:, k]
        torch.testing.assert_close(found, expected)


@pytest.mark.parametrize("make", [lambda: estimator_for(ATARI), of_channels])
@pytest.mark.parametrize("layer", [0, 1, 2])
def test_all_components_at_once_equal_captum_one_by_one(make, layer):
    attr = pytest.importorskip("captum.attr", reason="captum is not installed")
    estimator, seen, actions = make(), images(2), [2, 0]
    network, channels = estimator.network, estimator.channels
    weights = torch.tensor([channel.weight for channel in channels] or [1.0])

    def told(inputs):
        by_action = network.components(inputs).reshape(len(inputs), 3, -1, AXIS.num_components)
        return torch.einsum("bck,c->bk", by_action[torch.arange(2), actions], weights)

    relus = [of for of in network.modules() if isinstance(of, nn.ReLU)]
    theirs = attr.LayerGradCam(told, relus[layer])
    inputs = network.preprocess(torch.from_numpy(seen))
    maps = estimator.saliency(seen, actions, layer=layer)
    assert maps.shape[:2] == (2, 5)
    for k in range(5):
        expected = theirs.attribute(inputs, target=k)[:, 0].detach().numpy()
        np.testing.assert_allclose(maps[:, k], expected, atol=1e-6 * np.abs(maps).max())


def test_a_batch_is_the_same_as_one_by_one_and_may_be_empty():
    estimator, seen = estimator_for(ATARI, batch_size=11), images(5)  # two at a time
    actions = [0, 1, 2, 1, 0]
    maps = estimator.saliency(seen, actions)
    assert maps.shape == (5, 5, 20, 20)
    for one, action, expected in zip(seen, actions, maps, strict=True):
        (found,) = estimator.saliency(one[None], [action])
        np.testing.assert_allclose(found, expected, atol=1e-6)
    assert estimator.saliency(seen[:0], []).shape == (0, 5, 20, 20)


def test_nothing_of_the_network_changes():
    estimator, seen = estimator_for(ATARI), images(1)
    network = estimator.network
    network.train()
    network.body[2].eval()  # someone has frozen a layer
    network.body[0].requires_grad_(False)
    before = {name: value.clone() for name, value in network.state_dict().items()}
    with torch.inference_mode():
        estimator.saliency(seen, [0])
    assert network.training
    assert not network.body[2].training
    assert network.body[3].training
    assert all(parameter.grad is None for parameter in network.parameters())
    assert not network.body[0].weight.requires_grad
    after = network.state_dict()
    assert all(torch.equal(after[name], value) for name, value in before.items())


def test_layers_and_actions_that_do_not_exist():
    estimator, seen = estimator_for(ATARI), images(2)
    with pytest.raises(InputError, match=r"no convolution 3.*from 0 to 2"):
        estimator.saliency(seen, [0, 0], layer=3)
    with pytest.raises(InputError, match=r"no action 3.*from 0 to 2"):
        estimator.saliency(seen, [0, 3])
    with pytest.raises(InputError, match=r"for 2 observations"):
        estimator.saliency(seen, [0])
    with pytest.raises(InputError, match=r"no convolutions.*`attributions`"):
        estimator_for(CART).saliency(np.zeros((1, 4), np.float32), [0])


# ---- vectors -----------------------------------------------------------------------------------


def test_integrated_gradients_by_hand():
    """One hidden unit max(0, x₀ + 2·x₁ − 1), from (0, 0) to (1, 1): it opens after a third.

    So its slopes (1, 2) count for two thirds of it: 2/3 and 4/3, together the 2 that it rises by.
    """
    space = gym.spaces.Box(-np.inf, np.inf, (2,), np.float32)
    network = build_network(space, 1, TimeAxis(0.9, 0), hidden=(1,))
    with torch.no_grad():
        network.body[0].weight.copy_(torch.tensor([[1.0, 2.0]]))
        network.body[0].bias.fill_(-1.0)
        network.head.weight.fill_(1.0)
    estimator = NetworkEstimator(network, TimeAxis(0.9, 0), FUTURE)
    found = estimator.attributions(np.ones((1, 2), np.float32), [0], baseline=np.zeros(2))
    np.testing.assert_allclose(found, [[[2 / 3, 4 / 3]]], rtol=2e-3)


@pytest.mark.parametrize("seed", range(4))
def test_attributions_add_up_to_what_is_expected_beyond_the_baseline(seed):
    estimator = estimator_for(CART, seed=seed)
    rng = np.random.default_rng(seed)
    seen, held = rng.normal(size=(3, 4)).astype(np.float32), rng.normal(size=4)
    actions = np.array([0, 1, 2])
    found = estimator.attributions(seen, actions, baseline=held)
    assert found.shape == (3, 5, 4)
    told = estimator.decompose(seen).components[np.arange(3), actions]
    at_baseline = estimator.decompose(held[None].astype(np.float32)).components[0, actions]
    rise = told - at_baseline
    np.testing.assert_allclose(found.sum(axis=-1), rise, atol=2e-3 * np.abs(rise).max())


def test_an_entry_that_is_as_in_the_baseline_adds_nothing():
    seen = np.array([[0.3, -0.2, 0.5, 0.1]], np.float32)
    found = estimator_for(CART).attributions(seen, [1], baseline=[0.3, 0.0, 0.0, 0.1])
    assert not found[..., [0, 3]].any()
    assert found[..., [1, 2]].all()
    assert estimator_for(CART).attributions(seen[:0], [], baseline=seen[0]).shape == (0, 5, 4)


def test_images_and_states_have_no_attributions():
    with pytest.raises(InputError, match=r"reads images.*`saliency`"):
        estimator_for(ATARI).attributions(images(1), [0], baseline=images(1)[0])
    with pytest.raises(InputError, match=r"reads states.*`decompose`"):
        estimator_for(gym.spaces.Discrete(5)).attributions(np.array([1]), [0], baseline=0)


# ---- weights drawn anew ------------------------------------------------------------------------


def test_weights_above_a_layer_are_drawn_anew_and_others_are_kept():
    estimator = of_channels()
    fresh = estimator.redrawn(0, layer=1)
    kept, changed = set(), set()
    for name, value in fresh.network.state_dict().items():
        same = torch.equal(value, estimator.network.state_dict()[name])
        (kept if same else changed).add(name.rpartition(".")[0])
    assert {"body.0.0", "body.0.2"} <= kept
    assert {"body.0.4", "body.0.7", "body.2.0", "head"} <= changed
    again = estimator.redrawn(0, layer=1).saliency(images(1), [0])
    np.testing.assert_array_equal(fresh.saliency(images(1), [0]), again)
    other = estimator.redrawn(1, layer=1).saliency(images(1), [0])
    assert not np.allclose(again, other)
    assert not torch.equal(
        estimator.redrawn(0).network.body[0][0].weight, estimator.network.body[0][0].weight
    )


def test_what_is_told_of_the_reward_is_not_cut():
    """A map is of what the network tells, also where that is more than can be."""
    estimator = of_channels()
    cut = replace(estimator, possible=np.zeros((2, 3, 5)))
    assert not cut.decompose(images(1)).components.any()
    np.testing.assert_array_equal(cut.saliency(images(1), [1]), estimator.saliency(images(1), [1]))
