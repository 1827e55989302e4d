"""Layers whose weights are drawn from a generator of one's own."""

import math
from typing import TypeVar

import torch
from torch import nn

Layer = TypeVar("Layer", bound=nn.Module)

NATURE_CONVOLUTIONS = ((32, 8, 4), (64, 4, 2), (64, 3, 1))
"""Filters, kernel and stride of the Nature CNN."""

LEAST_SIDE = 36
"""The side of the smallest image that they can read."""


def linear(inputs: int, outputs: int, rng: torch.Generator | None) -> nn.Linear:
    """Returns a fully connected layer."""
    return _drawn(nn.Linear(inputs, outputs, device="meta"), inputs, rng)


def convolution(
    channels: int, filters: int, kernel: int, stride: int, rng: torch.Generator | None
) -> nn.Conv2d:
    """Returns a square convolution without padding."""
    layer = nn.Conv2d(channels, filters, kernel, stride=stride, device="meta")
    return _drawn(layer, channels * kernel**2, rng)


def side_after_convolutions(side: int) -> int:
    """Returns a side of an image after the convolutions of the Nature CNN.

    >>> side_after_convolutions(84)
    7
    """
    for _, kernel, stride in NATURE_CONVOLUTIONS:
        side = (side - kernel) // stride + 1
    return side


def _drawn(layer: Layer, fan_in: int, rng: torch.Generator | None) -> Layer:
    """Returns a layer from the meta device, where nothing was drawn yet, with its weights.

    Without a generator it stays there: it has shapes, and takes no memory.
    """
    if rng is None:
        return layer
    layer.to_empty(device="cpu")
    bound = 1.0 / math.sqrt(fan_in)
    for parameter in layer.parameters():
        nn.init.uniform_(parameter, -bound, bound, generator=rng)
    return layer
