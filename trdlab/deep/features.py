"""A frozen network's features, for another network to learn from.

What a network has learned to see in order to act is most of what there is to see in order to
predict. To read it once for each step, and to learn from 512 numbers in place of four frames, takes
a hundredth of the time.
"""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from torch import Tensor, nn

from trdlab.deep.estimator import NetworkEstimator
from trdlab.deep.networks import DecompositionNetwork
from trdlab.errors import InputError


def trunk_of(who: Any) -> NetworkEstimator:
    """Returns the network, as an Estimator, by which somebody acts.

    Args:
        who: an estimator, or a policy that acts by one, perhaps with random actions in between.

    Raises:
        InputError: it acts by no network of trdlab's.
    """
    while (inside := getattr(who, "policy", None) or getattr(who, "estimator", None)) is not None:
        who = inside
    if isinstance(who, NetworkEstimator) and not who.channels:
        return who
    raise InputError(
        f"The features of a {type(who).__name__} cannot be read: it is no network of trdlab's.",
        "Fit it with new layers.",
    )


def features_space(size: int) -> gym.spaces.Box:
    """Returns the space of F features."""
    return gym.spaces.Box(-np.inf, np.inf, (size,), np.float32)


class UponFeatures(DecompositionNetwork):
    """Observations in, components out: what a network tells of the features of another.

    Args:
        trunk: whose features are read.
        top: what reads them, `[B, F]` to `[B, A, N+1]`.
    """

    def __init__(self, trunk: DecompositionNetwork, top: DecompositionNetwork) -> None:
        body = nn.Sequential(trunk.body, _Preprocessed(top), top.body)  # [B, ...] -> [B, F']
        outputs = top.num_actions, top.num_components
        super().__init__(body, top.head, trunk.observation_shape, *outputs)
        self.trunk = trunk

    def preprocess(self, observations: Tensor) -> Tensor:
        """Returns observations `[B, ...]` as the floating-point inputs of the first layer."""
        return self.trunk.preprocess(observations)


class _Preprocessed(nn.Module):
    """What a network makes of what it is given before its first layer."""

    def __init__(self, network: DecompositionNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, features: Tensor) -> Tensor:
        """Returns `[B, F]` of features `[B, F]`."""
        return self.network.preprocess(features)


def upon(trunk: NetworkEstimator, top: NetworkEstimator) -> NetworkEstimator:
    """Returns an estimator of features as one of observations.

    Raises:
        InputError: it reads more or fewer features than there are.
    """
    size, (reads,) = trunk.network.head.in_features, top.network.observation_shape
    if reads != size:
        raise InputError(
            f"The fit reads {reads} features, and the agent's network has {size}.",
            "It belongs to another agent.",
        )
    return replace(top, network=UponFeatures(trunk.network, top.network))
