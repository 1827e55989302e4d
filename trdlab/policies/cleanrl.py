"""Agents of CleanRL's single-file scripts in PyTorch: state dicts with names of their own."""

import re
from collections.abc import Iterable

from torch import nn

from trdlab.policies.adapted import About, Drawing, Valuing, critic_of
from trdlab.policies.files import AgentFile, Options
from trdlab.policies.networks import (
    Network,
    Weights,
    activation,
    convolutions,
    dense,
    flow,
    numbered,
    plain,
    sizes,
)

CONVOLUTIONS = ("network.0", "network.2", "network.4")
_STRIDES = (4, 2, 1)
_SCREEN = (84, 84)
_BYTES = 255.0
GAMMA = 0.99  # of these scripts; the files do not say it


def adapt(file: AgentFile, options: Options) -> Drawing | Valuing | None:
    """Returns the agent in a `.cleanrl_model`; None where the file is none.

    Those of `dqn_atari`, `ppo_atari` and `ppo` are known by the names of their weights; those of
    `dqn` are plain linear layers.
    """
    weights = file.weights
    layers = {name.rpartition(".")[0] for name in weights}
    if layers == {*CONVOLUTIONS, "network.7", "network.9"}:
        head = dense(weights, ["network.7", "network.9"], nn.ReLU)
        network = of_games(weights, head)
        about = _about("DQN", network, len(weights["network.9.weight"]), "ReLU", draws=False)
        return Valuing(about, network)
    if layers == {*CONVOLUTIONS, "network.7", "actor", "critic"}:
        network, critic = (
            of_games(weights, dense(weights, ["network.7", head], nn.ReLU))
            for head in ("actor", "critic")
        )
        about = _about("PPO", network, len(weights["actor.weight"]), "ReLU")
        return Drawing(about, plain(network), critic_of(plain(critic)))
    if _are(layers, r"(actor|critic)\.\d+") and "actor.0" in layers:
        names, between = numbered(weights, "actor."), activation(options.activation or "Tanh")
        actor = dense(weights, names, between)
        size, count = flow(actor)
        network = Network(actor, (size,))
        about = _about("PPO", network, count, between.__name__)
        critic = Network(dense(weights, numbered(weights, "critic."), between), (size,))
        has_critic = "critic.0" in layers
        return Drawing(about, plain(network), critic_of(plain(critic)) if has_critic else None)
    return None


def of_games(weights: Weights, head: nn.Sequential) -> Network:
    """Returns the network of a script for Atari games, which sees stacks of frames."""
    before = convolutions(weights, CONVOLUTIONS, _STRIDES)
    stack = weights["network.0.weight"].shape[1]
    return Network(nn.Sequential(before, head), (stack, *_SCREEN), _BYTES)


def _about(algorithm: str, network: Network, count: int, between: str, draws: bool = True) -> About:
    return About(
        algorithm,
        "CleanRL",
        seen=network.seen,
        num_actions=count,
        layers=sizes(network.layers),
        activation=between,
        gamma=GAMMA,
        draws=draws,
    )


def _are(names: Iterable[str], pattern: str) -> bool:
    return all(re.fullmatch(pattern, name) for name in names)
