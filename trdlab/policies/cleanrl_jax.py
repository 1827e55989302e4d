"""Agents of CleanRL's scripts in JAX, and the students of the paper's authors, in flax's format.

Both have the network of 2015 for stacks of frames. A student's last layer has A·(N+1) outputs, the
components of one action after those of another, and is an estimator as it is.
"""

import re
from typing import Any

import numpy as np
from torch import nn

from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.policies.adapted import About, Student, Valuing
from trdlab.policies.cleanrl import CONVOLUTIONS, GAMMA, of_games
from trdlab.policies.files import AgentFile, Options
from trdlab.policies.networks import Weights, dense, sizes
from trdlab.time_axis import TimeAxis

_LAYERS = ("Conv_0", "Conv_1", "Conv_2", "Dense_0", "Dense_1")
_MOST_ACTIONS = 18  # of an Atari game
_FUTURE = Future("the greedy policy of the network", clip_rewards=True, life_loss_ends=True)


def adapt(file: AgentFile, options: Options) -> Valuing | Student | None:
    """Returns the agent in a `.cleanrl_model` of JAX; None where the file is none.

    How many components a student has is what its name says (`n-41`, which counts them), or the
    option `N`, or what the actions of where it acts leave; how wide they are, its name (`w-1`) or
    the option `w`.

    Raises:
        InputError: a layer has another shape, or nobody says what the outputs are.
    """
    named = {f"params.{layer}.{part}" for layer in _LAYERS for part in ("kernel", "bias")}
    if set(file.weights) != named:
        return None
    weights = _renamed(file)
    network = of_games(weights, dense(weights, ["network.7", "network.9"], nn.ReLU))
    outputs = len(weights["network.9.weight"])
    components = _components(file, options, outputs)
    about = About(
        "DQN" if components is None else "TRD-DQN",
        "CleanRL (JAX)" if components is None else "the paper's authors",
        seen=network.seen,
        num_actions=outputs // (components or 1),
        layers=sizes(network.layers),
        activation="ReLU",
        gamma=GAMMA,
        draws=False,
    )
    if components is None:
        return Valuing(about, network)
    width = options.w if options.w is not None else _in_name(file, "w")
    if width is None:
        raise InputError(
            f"Nothing says how many steps a component of '{file.path}' has.",
            f"Say it: {file.path},w=1",
        )
    return Student(about, network, TimeAxis(GAMMA, components - 1, width), _FUTURE)


def _components(file: AgentFile, options: Options, outputs: int) -> int | None:
    """Returns N+1 of a student, None of a network that has one value for each action."""
    named = _in_name(file, "n")
    told = named if options.N is None else options.N + 1
    actions = None if told is not None else file.num_actions()
    if told is None and (actions == outputs or (actions is None and outputs <= _MOST_ACTIONS)):
        return None
    if told is None and actions is None:
        raise InputError(
            f"'{file.path}' has {outputs} outputs, more than games have actions.",
            f"Say how many components each action has, such as {file.path},N=40",
        )
    of = actions if told is None else told
    if not of or outputs % of:
        what = "actions" if told is None else "components"
        raise InputError(
            f"'{file.path}' has {outputs} outputs, which are not {of} {what} times a whole number.",
            "Name the game that it was trained in, or give its N.",
        )
    return outputs // of if told is None else told


def _in_name(file: AgentFile, letter: str) -> int | None:
    """Returns the number behind a letter in the name of a file, such as `…-n-41-w-1`."""
    found = re.search(rf"-{letter}-(\d{{1,5}})(?!\d)", file.path.name)
    return int(found[1]) if found else None


def _renamed(file: AgentFile) -> Weights:
    """Returns weights as PyTorch has them: outputs first, images channels first."""
    weights = {name.removeprefix("params."): of for name, of in file.weights.items()}
    kernels = [weights[f"{layer}.kernel"] for layer in _LAYERS]
    wanted = (4, 4, 4, 2, 2)
    for layer, kernel, ndim in zip(_LAYERS, kernels, wanted, strict=True):
        if kernel.ndim != ndim:
            raise InputError(
                f"'{layer}' in '{file.path}' has shape {kernel.shape}.",
                "Give the weights of dqn_atari_jax.",
            )
    first, channels = kernels[3], kernels[2].shape[3]
    side = round((len(first) / max(channels, 1)) ** 0.5)
    if side * side * channels != len(first):
        raise InputError(
            f"'Dense_0' in '{file.path}' takes {len(first)} numbers, which are no square image of "
            f"{channels} channels.",
            "Give the weights of dqn_atari_jax.",
        )
    image = first.reshape(side, side, channels, -1)  # flax flattens height, width, channel
    turned = [kernel.transpose(3, 2, 0, 1) for kernel in kernels[:3]]
    turned += [image.transpose(3, 2, 0, 1).reshape(first.shape[1], -1), kernels[4].T]
    names = (*CONVOLUTIONS, "network.7", "network.9")
    told: dict[str, Any] = {}
    for name, layer, kernel in zip(names, _LAYERS, turned, strict=True):
        told[f"{name}.weight"] = np.ascontiguousarray(kernel)
        told[f"{name}.bias"] = weights[f"{layer}.bias"]
    return told
