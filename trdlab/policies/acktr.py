"""Agents that ACKTR trained in the scripts of ikostrikov: biases are layers of their own there."""

import numpy as np
from torch import nn

from trdlab.policies.adapted import About, Drawing, critic_of
from trdlab.policies.files import AgentFile, Options
from trdlab.policies.networks import Network, Weights, convolutions, dense, plain, sizes

_BIASES = {
    "conv1": "ab1",
    "conv2": "ab2",
    "conv3": "ab3",
    "linear1": "ab_fc1",
    "critic_linear": "ab_fc2",
    "actor_linear": "ab_fc3",
}
_STRIDES = (4, 2, 1)
_SCREEN = (84, 84)
_BYTES = 255.0


def adapt(file: AgentFile, options: Options) -> Drawing | None:
    """Returns the agent in a state dict of theirs; None where the file is none.

    It was trained as if each life were a game of its own, and is played so (`separate_lives`).
    """
    layers = {f"{layer}.weight" for layer in _BIASES} | {f"{by}.bias" for by in _BIASES.values()}
    if set(file.weights) != layers:
        return None
    weights: dict[str, np.ndarray] = {}
    for layer, bias in _BIASES.items():
        weights[f"{layer}.weight"] = file.weights[f"{layer}.weight"]
        weights[f"{layer}.bias"] = file.weights[f"{bias}.bias"].reshape(-1)
    actor, critic = (_network(weights, head) for head in ("actor_linear", "critic_linear"))
    about = About(
        "ACKTR",
        "pytorch-a2c-ppo-acktr",
        seen=actor.seen,
        num_actions=len(weights["actor_linear.weight"]),
        layers=sizes(actor.layers),
        activation="ReLU",
        gamma=0.99,
        games={"separate_lives": True},
    )
    return Drawing(about, plain(actor), critic_of(plain(critic)))


def _network(weights: Weights, head: str) -> Network:
    before = convolutions(weights, ("conv1", "conv2", "conv3"), _STRIDES)
    layers = nn.Sequential(before, dense(weights, ["linear1", head], nn.ReLU))
    return Network(layers, (weights["conv1.weight"].shape[1], *_SCREEN), _BYTES)
