"""Networks from their weights by name: layers in the order of the numbers in the names."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from trdlab.arrays import BoolArray, FloatArray
from trdlab.errors import InputError, closest

Weights = Mapping[str, npt.NDArray[Any]]

_NOWHERE = "meta"  # where layers are made: their weights come later, and cost no chance
_AGAIN = "Save the agent again."

ACTIVATIONS: Mapping[str, type[nn.Module]] = {
    kind.__name__.lower(): kind
    for kind in (nn.ReLU, nn.Tanh, nn.ELU, nn.GELU, nn.SiLU, nn.LeakyReLU)
}
"""Those that can stand between layers, by the names that people write."""


def activation(name: str) -> type[nn.Module]:
    """Returns the kind of layer that an activation is.

    Raises:
        InputError: there is none of that name.

    >>> activation("tanh").__name__
    'Tanh'
    """
    if name.lower() not in ACTIVATIONS:
        raise InputError(f"There is no activation '{name}'.", closest(name, ACTIVATIONS))
    return ACTIVATIONS[name.lower()]


def numbered(weights: Weights, prefix: str) -> list[str]:
    """Returns the names of layers, without `.weight`, in the order of their numbers.

    >>> numbered({"net.10.weight": 0, "net.2.weight": 0, "net.2.bias": 0}, "net.")
    ['net.2', 'net.10']
    """
    found = [re.fullmatch(rf"({re.escape(prefix)}(\d+))\.weight", name) for name in weights]
    return [match[1] for match in sorted(filter(None, found), key=lambda match: int(match[2]))]


def dense(
    weights: Weights, names: Sequence[str], between: type[nn.Module], *, ends: bool = False
) -> nn.Sequential:
    """Returns linear layers with an activation between them.

    Args:
        weights: by name.
        names: of the layers.
        between: the activation.
        ends: whether one follows the last layer too.

    Raises:
        InputError: they do not fit to each other, or are no linear layers.
    """
    matrices = [_weight(weights, name) for name in names]
    for name, matrix in zip(names, matrices, strict=True):
        if matrix.ndim != 2 or not matrix.size:
            raise InputError(
                f"The layer '{name}' has weights of shape {matrix.shape}.",
                "Only linear layers can be read, [outputs, inputs].",
            )
    for (name, one), (other, next_one) in pairwise(zip(names, matrices, strict=True)):
        if len(one) != next_one.shape[1]:
            raise InputError(
                f"The layer '{other}' takes {next_one.shape[1]} numbers, and '{name}' before it "
                f"gives {len(one)}.",
                "Give the weights of layers that follow each other.",
            )
    layers: list[nn.Module] = []
    for name, matrix in zip(names, matrices, strict=True):
        linear = nn.Linear(
            matrix.shape[1], len(matrix), bias=f"{name}.bias" in weights, device=_NOWHERE
        )
        layers += [_filled(linear, weights, f"{name}."), between()]
    return nn.Sequential(*(layers if ends else layers[:-1]))


def flow(layers: nn.Sequential) -> tuple[int, int]:
    """Returns how many numbers linear layers take, and how many they give."""
    linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
    return linear[0].in_features, linear[-1].out_features


def convolutions(
    weights: Weights,
    names: Sequence[str],
    strides: Sequence[int],
    between: type[nn.Module] = nn.ReLU,
    padding: int = 0,
) -> nn.Sequential:
    """Returns convolutions, each followed by an activation, and then all in a row.

    Args:
        weights: by name.
        names: of the layers.
        strides: of each.
        between: the activation.
        padding: how many zeros stand around what each of them sees.

    Raises:
        InputError: there are more or fewer, or they are none.
    """
    kernels = [_weight(weights, name) for name in names]
    if len(names) != len(strides) or any(of.ndim != 4 or not of.size for of in kernels):
        raise InputError(
            f"There are {len(names)} layers for images, of shapes "
            f"{', '.join(str(kernel.shape) for kernel in kernels)}.",
            f"Only networks with {len(strides)} convolutions as in the DQN of 2015 can be read.",
        )
    layers: list[nn.Module] = []
    for name, kernel, stride in zip(names, kernels, strides, strict=True):
        out, into, height, width = kernel.shape
        biased = f"{name}.bias" in weights
        size = (height, width)
        convolution = nn.Conv2d(into, out, size, stride, padding, bias=biased, device=_NOWHERE)
        layers += [_filled(convolution, weights, f"{name}."), between()]
    return nn.Sequential(*layers, nn.Flatten())


def lstm(weights: Weights, prefix: str) -> nn.LSTM:
    """Returns the LSTM whose weights have names that begin so.

    Raises:
        InputError: a tensor of it is missing, or has another shape.
    """
    count = len([name for name in weights if name.startswith(f"{prefix}weight_hh_l")])
    gates = weights.get(f"{prefix}weight_ih_l0")  # [4·hidden, inputs]
    if gates is None or gates.ndim != 2 or len(gates) < 4:
        raise InputError(f"The weights '{prefix}weight_ih_l0' are no LSTM's.", _AGAIN)
    filled: nn.LSTM = _filled(
        nn.LSTM(gates.shape[1], len(gates) // 4, count, device=_NOWHERE), weights, prefix
    )
    return filled


def gru(weights: Weights, prefix: str) -> nn.GRU:
    """Returns the GRU of one layer whose weights have names that begin so.

    Raises:
        InputError: a tensor of it is missing, or has another shape.
    """
    gates = weights.get(f"{prefix}weight_ih_l0")  # [3·hidden, inputs]
    if gates is None or gates.ndim != 2 or len(gates) < 3:
        raise InputError(f"The weights '{prefix}weight_ih_l0' are no GRU's.", _AGAIN)
    empty = nn.GRU(gates.shape[1], len(gates) // 3, device=_NOWHERE)
    filled: nn.GRU = _filled(empty, weights, prefix)
    return filled


@dataclass(frozen=True, eq=False)
class Network:
    """A network that is asked in numpy.

    Args:
        layers: from what is seen `[B, ...]` to what is said `[B, n]`.
        seen: the shape of an observation; of states by number, how many there are.
        divisor: what observations are divided by.
    """

    layers: nn.Module
    seen: tuple[int, ...]
    divisor: float = 1.0

    @torch.no_grad()
    def __call__(self, observations: Any) -> FloatArray:
        """Returns what it says `[B, n]` of observations `[B, ...]`."""
        told: Tensor = self.layers(self.tensor(observations))
        return np.asarray(told.numpy())

    def tensor(self, observations: Any) -> Tensor:
        """Returns observations as the network takes them: `[B, *seen]`, states by number as n.

        Raises:
            InputError: they have another shape.
        """
        seen = np.asarray(observations)
        if seen.ndim == 1 and seen.dtype.kind in "iu":
            seen = seen[:, None] == np.arange(self.seen[0])  # [B, n]
        if seen.size != len(seen) * prod(self.seen):
            raise InputError(
                f"The network is shown observations of shape {seen.shape[1:]}.",
                f"It takes {self.seen}.",
            )
        shaped = np.ascontiguousarray(seen, dtype=np.float32).reshape(len(seen), *self.seen)
        return torch.from_numpy(shaped) / self.divisor


@dataclass(frozen=True, eq=False)
class Recurrent:
    """A network with an LSTM or a GRU in its middle, asked in numpy.

    What it remembers is zero where episodes begin: `[B, layers, hidden]`, of an LSTM two of those.

    Args:
        before: makes of observations what the memory takes.
        memory: the LSTM or GRU.
        after: makes of what it gives the logits.
    """

    before: Network
    memory: nn.LSTM | nn.GRU
    after: nn.Module

    @torch.no_grad()
    def __call__(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns logits `[B, A]`, and what to remember."""
        features = self.before.layers(self.before.tensor(observations))  # [B, inputs]
        shape = (len(begins), self.memory.num_layers, self.memory.hidden_size)
        blank = np.zeros(shape, dtype=np.float32)
        is_pair = isinstance(self.memory, nn.LSTM)
        held = (blank,) * (1 + is_pair) if state is None else state
        now = tuple(
            torch.from_numpy(np.where(begins[:, None, None], 0, part)).transpose(0, 1).contiguous()
            for part in held
        )
        told, then = self.memory(features[None], now if is_pair else now[0])
        logits = np.asarray(self.after(told[0]).numpy())
        parts = then if is_pair else (then,)
        return logits, tuple(part.transpose(0, 1).contiguous().numpy() for part in parts)


class Combined(nn.Module):
    """Parts of a vector, each through layers of its own or as it is, one behind the other again.

    Args:
        shapes: of the parts, in the order of the vector.
        layers: of some parts, by their numbers.
        divisor: what those parts are divided by.
    """

    def __init__(
        self, shapes: Sequence[tuple[int, ...]], layers: Mapping[int, nn.Module], divisor: float
    ) -> None:
        super().__init__()
        self.shapes, self.divisor = list(shapes), divisor
        self.layers = nn.ModuleDict({str(part): of for part, of in layers.items()})

    def forward(self, vectors: Tensor) -> Tensor:
        """Returns features `[B, n]` of vectors `[B, F]`."""
        parts = torch.split_with_sizes(vectors, [prod(shape) for shape in self.shapes], dim=1)
        features: list[Tensor] = []
        for number, (part, shape) in enumerate(zip(parts, self.shapes, strict=True)):
            if str(number) in self.layers:
                image = part.reshape(len(part), *shape) / self.divisor  # [B, C, H, W]
                features.append(self.layers[str(number)](image))
            else:
                features.append(part)
        return torch.cat(features, dim=1)


def sizes(*parts: nn.Module) -> str:
    """Returns what flows through networks, one behind the other, in words.

    >>> sizes(nn.Sequential(nn.Linear(4, 64), nn.ReLU(), nn.Linear(64, 2)))
    '4 → 64 → 2'
    """
    words: list[str] = []
    for layer in (layer for part in parts for layer in part.modules()):
        if isinstance(layer, nn.Conv2d):
            height, width = layer.kernel_size
            words += [f"{layer.out_channels} of {height}×{width}"]
        elif isinstance(layer, nn.LSTM | nn.GRU):
            deep = f" ×{layer.num_layers}" * (layer.num_layers > 1)
            words += [f"{layer.mode} {layer.hidden_size}{deep}"]
        elif isinstance(layer, nn.Linear):
            words += [str(layer.in_features)] * (not words) + [str(layer.out_features)]
    return " → ".join(words)


def plain(network: Network) -> Callable[[Any, Any, BoolArray], tuple[FloatArray, Any]]:
    """Returns a network without memory as one that is given some, and keeps none."""
    return lambda observations, state, begins: (network(observations), None)


def _weight(weights: Weights, name: str) -> npt.NDArray[Any]:
    if (weight := weights.get(f"{name}.weight")) is None:
        raise InputError(f"The weights '{name}.weight' are missing.", _AGAIN)
    return weight


def _filled(layer: Any, weights: Weights, prefix: str) -> Any:
    """Returns a layer with its weights in it, to be asked and not to be trained."""
    layer = layer.to_empty(device="cpu")
    for name, parameter in layer.named_parameters():
        weight = weights.get(f"{prefix}{name}")
        if weight is None or weight.shape != tuple(parameter.shape):
            found = "are missing" if weight is None else f"have shape {weight.shape}"
            raise InputError(
                f"The weights '{prefix}{name}' {found}.",
                f"They should have {tuple(parameter.shape)}. {_AGAIN}",
            )
        parameter.data = torch.from_numpy(np.array(weight, dtype=np.float32))
        parameter.requires_grad = False
    return layer.eval()
