"""Networks with a head of A × (N+1): the Nature CNN for images, an MLP for everything else."""

import math
from collections.abc import Sequence
from copy import deepcopy
from itertools import pairwise
from typing import Any, Self

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from trdlab.arrays import FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.deep.layers import (
    LEAST_SIDE,
    NATURE_CONVOLUTIONS,
    convolution,
    linear,
    side_after_convolutions,
)
from trdlab.errors import InputError

_STILL = 0.05  # of how much all inputs move
_UNBOUNDED = 1e6  # wider bounds are those of a number format, not of a quantity


class DecompositionNetwork(nn.Module):
    """Observations in, components `[B, A, N+1]` out.

    `forward` is `components(preprocess(observations))`. The two are apart because a gradient with
    respect to the observations exists from the floating-point inputs on.

    Beside `head` there can be a `policy_head`, which reads the same features and says how to act:
    logits `[B, A]`. The components then tell the future of that policy.

    Args:
        body: preprocessed inputs to features `[B, F]`.
        head: features to `[B, A·(N+1)]`, action by action.
        observation_shape: the shape of one observation.
        num_actions: A.
        num_components: N+1.
    """

    def __init__(
        self,
        body: nn.Module,
        head: nn.Linear,
        observation_shape: tuple[int, ...],
        num_actions: int,
        num_components: int,
    ) -> None:
        super().__init__()
        self.body, self.head = body, head
        self.policy_head: nn.Linear | None = None
        self.observation_shape = observation_shape
        self.num_actions, self.num_components = num_actions, num_components

    def forward(self, observations: Tensor) -> Tensor:
        """Returns the components `[B, A, N+1]` of observations `[B, ...]`.

        Raises:
            InputError: the observations have another shape or type than those of the space that
                the network was built for.
        """
        return self.components(self.preprocess(observations))

    def preprocess(self, observations: Tensor) -> Tensor:
        """Returns observations `[B, ...]` as the floating-point inputs of the first layer."""
        raise NotImplementedError

    def standardise(self, seen: NDArray[Any], *, alike: bool = False) -> None:
        """Makes inputs like these `[M, ...]` easy to learn from, as far as that makes sense.

        Args:
            seen: the observations.
            alike: whether all numbers of vectors are of one unit: then one that hardly ever moves
                is not blown up.
        """

    def components(self, inputs: Tensor) -> Tensor:
        """Returns the components `[B, A, N+1]` of preprocessed inputs."""
        return self.by_action(self.body(inputs))  # [B, ...] -> [B, F] -> [B, A, N+1]

    def told(self, observations: Tensor) -> tuple[Tensor, Tensor | None]:
        """Returns the components `[B, A, N+1]`, and the logits `[B, A]` of the policy head."""
        features = self.body(self.preprocess(observations))  # [B, F]
        logits = None if self.policy_head is None else self.policy_head(features)  # [B, A]
        return self.by_action(features), logits

    def logits(self, observations: Tensor) -> Tensor:
        """Returns `[B, A]`, by which it acts: of the policy head, or else the sums of components.

        Of observations `[B, ...]`.
        """
        components, logits = self.told(observations)
        return components.sum(dim=-1) if logits is None else logits

    def with_outputs(self, num_actions: int, num_components: int, *, seed: int) -> Self:
        """Returns a copy whose last layer, `[F]` to `[A·(N+1)]`, is new; it has no policy head."""
        copy, rng = deepcopy(self), torch.Generator().manual_seed(seed)
        copy.head = linear(self.head.in_features, num_actions * num_components, rng)
        copy.num_actions, copy.num_components, copy.policy_head = num_actions, num_components, None
        return copy.requires_grad_(True)

    def by_action(self, features: Tensor) -> Tensor:
        """Returns the components `[B, A, N+1]` that the head tells of features `[B, F]`."""
        flat: Tensor = self.head(features)  # [B, F] -> [B, A·(N+1)]
        return flat.reshape(len(flat), self.num_actions, self.num_components)  # [B, A, N+1]

    def _check_shape(self, observations: Tensor) -> None:
        if tuple(observations.shape[1:]) != self.observation_shape or observations.ndim == 0:
            expected = ", ".join(map(str, ("B", *self.observation_shape)))
            raise InputError(
                f"The observations have shape {tuple(observations.shape)}.",
                f"This network takes a batch of them: [{expected}].",
            )


class NatureNetwork(DecompositionNetwork):
    """The convolutional network of Mnih et al. (2015), for stacks of frames as uint8.

    Args:
        observation_shape: `(C, H, W)`, for Atari (4, 84, 84).
        num_actions: A.
        num_components: N+1.
        rng: what the weights are drawn from.
        channels_last: whether the weights lie in memory as CPUs and tensor cores read them best.

    Source: Mnih et al. (2015), extended data table 1; head as in the paper, section 4.
    """

    middle: Tensor  # [C, H, W], what is taken away from images; saved with the weights

    def __init__(
        self,
        observation_shape: tuple[int, int, int],
        num_actions: int,
        num_components: int,
        *,
        rng: torch.Generator | None,
        channels_last: bool = True,
    ) -> None:
        channels, height, width = observation_shape
        rows, columns = side_after_convolutions(height), side_after_convolutions(width)
        body = nn.Sequential()  # [B, C, H, W]
        for filters, kernel, stride in NATURE_CONVOLUTIONS:
            body.append(convolution(channels, filters, kernel, stride, rng)).append(nn.ReLU())
            channels = filters
        body.append(nn.Flatten())  # [B, 64·rows·columns], for Atari 3136
        body.append(linear(channels * rows * columns, 512, rng)).append(nn.ReLU())  # [B, 512]
        head = linear(512, num_actions * num_components, rng)
        super().__init__(body, head, observation_shape, num_actions, num_components)
        self.memory_format = torch.channels_last if channels_last else torch.contiguous_format
        self.to(memory_format=self.memory_format)  # type: ignore[call-overload]
        middle = torch.zeros((height, width, observation_shape[0]), device=self.head.weight.device)
        self.register_buffer("middle", middle.permute(2, 0, 1))  # in the same layout

    def standardise(self, seen: NDArray[Any], *, alike: bool = False) -> None:
        """Has the mean of images like these `[M, C, H, W]` taken away from each.

        What never changes on a screen is most of it, and teaches nothing. Where it is bright,
        little else is learned for long: of Pong, nothing at all in thousands of updates.
        """
        self.middle.copy_(torch.as_tensor(seen).float().mean(dim=0) / 255.0)

    def preprocess(self, observations: Tensor) -> Tensor:
        """Returns `[B, C, H, W]`, from 0 to 1, less the mean image if that is known.

        Raises:
            InputError: the images have another shape or type.
        """
        self._check_shape(observations)
        if observations.dtype != torch.uint8:
            raise InputError(
                f"The images have type {str(observations.dtype).removeprefix('torch.')}.",
                "Give uint8 from 0 to 255: the network divides by 255 itself.",
            )
        pixels = observations.contiguous(memory_format=self.memory_format)  # [B, C, H, W]
        return pixels.float().div_(255.0).sub_(self.middle)  # [B, C, H, W]


class VectorNetwork(DecompositionNetwork):
    """A multilayer perceptron, for vectors and for the indices of states.

    Args:
        observation_shape: of one observation, which is flattened; `()` for an index.
        num_actions: A.
        num_components: N+1.
        hidden: the sizes of the hidden layers.
        rng: what the weights are drawn from.
        num_states: where observations are indices, how many there are: they become one-hot.
        first_state: the least index.
        bounds: `[F]` twice, the least and the largest value of each input: they become −1 and 1.
            An input without finite ones is taken as it is.
    """

    middle: Tensor  # [F], what inputs are moved by
    scale: Tensor  # [F], and then multiplied with; both are saved with the weights

    def __init__(
        self,
        observation_shape: tuple[int, ...],
        num_actions: int,
        num_components: int,
        *,
        hidden: Sequence[int],
        rng: torch.Generator | None,
        num_states: int | None = None,
        first_state: int = 0,
        bounds: tuple[FloatArray, FloatArray] | None = None,
    ) -> None:
        num_inputs = math.prod(observation_shape) if num_states is None else num_states
        sizes = [num_inputs, *hidden]
        body = nn.Sequential()
        for size, following in pairwise(sizes):
            body.append(linear(size, following, rng)).append(nn.ReLU())
        head = linear(sizes[-1], num_actions * num_components, rng)
        super().__init__(body, head, observation_shape, num_actions, num_components)
        self.num_states, self.first_state = num_states, first_state
        middle, scale = np.zeros(num_inputs), np.ones(num_inputs)
        if bounds is not None:
            known = (bounds[1] - bounds[0] < _UNBOUNDED) & (bounds[1] > bounds[0])
            low, high = bounds[0][known], bounds[1][known]
            middle[known], scale[known] = (low + high) / 2.0, 2.0 / (high - low)
        self.register_buffer("middle", torch.as_tensor(middle, dtype=torch.float32))
        self.register_buffer("scale", torch.as_tensor(scale, dtype=torch.float32))

    def standardise(self, seen: NDArray[Any], *, alike: bool = False) -> None:
        """Makes inputs like these `[M, ...]` have mean 0 and deviation 1; not those of states."""
        if self.num_states is not None:
            return
        inputs = seen.reshape(len(seen), -1).astype(np.float64)  # [M, F]
        spread = inputs.std(axis=0)
        if alike:
            spread = np.maximum(spread, _STILL * spread.mean())
        self.middle.copy_(torch.as_tensor(inputs.mean(axis=0)))
        self.scale.copy_(torch.as_tensor(1.0 / np.where(spread > 1e-8, spread, 1.0)))

    def preprocess(self, observations: Tensor) -> Tensor:
        """Returns `[B, F]`: flattened, or one-hot.

        Raises:
            InputError: the observations have another shape, or a state does not exist.
        """
        self._check_shape(observations)
        if self.num_states is None:
            return (observations.flatten(1).float() - self.middle) * self.scale  # [B, F]
        if observations.is_floating_point():
            raise InputError(
                f"The states have type {str(observations.dtype).removeprefix('torch.')}.",
                "Give whole numbers.",
            )
        states = observations.long() - self.first_state  # [B]
        if states.numel() and not 0 <= int(states.min()) <= int(states.max()) < self.num_states:
            raise InputError(
                f"The states run from {int(observations.min())} to {int(observations.max())}.",
                f"They must lie from {self.first_state} to "
                f"{self.first_state + self.num_states - 1}.",
            )
        return nn.functional.one_hot(states, self.num_states).float()  # [B, S]


def build_network(
    observation_space: gym.Space[Any],
    num_actions: int,
    time_axis: TimeAxis,
    *,
    seed: int | torch.Generator | None = 0,
    hidden: Sequence[int] = (128, 128),
    channels_last: bool = True,
    policy_head: bool = False,
) -> DecompositionNetwork:
    """Returns the network that fits an observation space, with weights drawn from a seed.

    Images (uint8, channels first) are read by the Nature CNN; any other Box is flattened and scaled
    by its bounds, and a Discrete space becomes one-hot, for an MLP. Weights and biases are uniform
    in ±1/√fan-in, as PyTorch draws them; its global generator is neither used nor moved.

    Args:
        observation_space: of one observation.
        num_actions: A (see `count_actions`).
        time_axis: its N sets the size of the head.
        seed: a number, or a generator to go on drawing from; with None there are no weights, only
            their shapes.
        hidden: the sizes of the MLP's hidden layers.
        channels_last: the CNN's memory layout; it changes speed, not the weights.
        policy_head: whether there is one; its weights are drawn after all others.

    Raises:
        InputError: the observation space is of another kind, or its images are too small.

    >>> space = gym.spaces.Box(0, 255, (4, 84, 84), np.uint8)
    >>> network = build_network(space, 4, TimeAxis(0.99, horizon=40))
    >>> network(torch.zeros(2, 4, 84, 84, dtype=torch.uint8)).shape
    torch.Size([2, 4, 41])
    """
    rng = torch.Generator().manual_seed(seed) if isinstance(seed, int) else seed
    outputs = (num_actions, time_axis.num_components)
    network = _plain(observation_space, outputs, rng, hidden, channels_last)
    if policy_head:
        network.policy_head = linear(network.head.in_features, num_actions, rng)
    return network


def _plain(
    observation_space: gym.Space[Any],
    outputs: tuple[int, int],
    rng: torch.Generator | None,
    hidden: Sequence[int],
    channels_last: bool,
) -> DecompositionNetwork:
    """Returns the network of a space, with the one head that all have."""
    if isinstance(observation_space, gym.spaces.Discrete):
        states, first = int(observation_space.n), int(observation_space.start)
        return VectorNetwork(
            (), *outputs, hidden=hidden, rng=rng, num_states=states, first_state=first
        )
    if not isinstance(observation_space, gym.spaces.Box):
        raise InputError(
            f"There is no network for the observation space {observation_space}.",
            "Use a Box or Discrete one, for example through gymnasium.wrappers.FlattenObservation.",
        )
    shape, in_bytes = observation_space.shape, observation_space.dtype == np.uint8
    if in_bytes and len(shape) == 3:
        if min(shape[1:]) < LEAST_SIDE:
            raise InputError(
                f"The images have shape {shape}.",
                f"Give (channels, height, width), both sides at least {LEAST_SIDE}.",
            )
        return NatureNetwork(shape, *outputs, rng=rng, channels_last=channels_last)
    low, high = observation_space.low, observation_space.high
    bounds = low.astype(np.float64).ravel(), high.astype(np.float64).ravel()
    return VectorNetwork(shape, *outputs, hidden=hidden, rng=rng, bounds=bounds)


def count_actions(action_space: gym.Space[Any]) -> int:
    """Returns A.

    Raises:
        InputError: the actions are not discrete.
    """
    if not isinstance(action_space, gym.spaces.Discrete):
        raise InputError(
            f"The action space is {action_space}.",
            "A network has one row of components per action: use a Discrete action space.",
        )
    return int(action_space.n)
