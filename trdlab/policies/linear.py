"""Agents in plain files of weights: linear layers, one behind the other."""

import re

from trdlab.errors import InputError
from trdlab.policies.adapted import About, Drawing, Valuing
from trdlab.policies.files import AgentFile, Options
from trdlab.policies.networks import Network, activation, dense, flow, plain, sizes


def adapt(file: AgentFile, options: Options) -> Drawing | Valuing | None:
    """Returns the agent of a network of linear layers, in the order that the file has them in.

    What its outputs are, a file does not say: they are taken as values, of which the largest is
    chosen, or as logits where `options.greedy` is False.

    Raises:
        InputError: it holds something else than such layers.
    """
    names = list(dict.fromkeys(name.rpartition(".")[0] for name in file.weights))
    strange = [
        name
        for name, weight in file.weights.items()
        if not re.fullmatch(r"(.+\.)?(weight|bias)", name)
        or weight.ndim != (2 if name.endswith("weight") else 1)
    ]
    if strange or any(f"{name}.weight" not in file.weights for name in names):
        odd = strange[0] if strange else f"{names[0]}.bias"
        raise InputError(
            f"'{file.path}' has '{odd}' of shape {file.weights[odd].shape}: nobody who is known "
            "here writes such weights.",
            "Known are archives of Stable-Baselines3, weights of CleanRL, baby-a3c, ACKTR and the "
            "paper's authors, and linear layers. Or give trdlab.agent a function from observations "
            "to probabilities.",
        )
    between = activation(options.activation or "ReLU")
    layers = dense(file.weights, names, between)
    size, count = flow(layers)
    kind = between.__name__ if len(layers) > 1 else ""
    draws, network = options.greedy is False, Network(layers, (size,))
    about = About(
        "MLP", seen=(size,), num_actions=count, layers=sizes(layers), activation=kind, draws=draws
    )
    return Drawing(about, plain(network)) if draws else Valuing(about, network)
