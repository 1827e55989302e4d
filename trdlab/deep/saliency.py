"""Saliency: which places of an image, or which entries of a vector, a component depends on.

Pure functions of a network. They leave its gradients, its mode and its weights as they are.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from typing import NamedTuple

import torch
from torch import Tensor, nn

from trdlab.deep.networks import DecompositionNetwork
from trdlab.errors import InputError

Tell = Callable[[Tensor], Tensor]
"""What is asked of a network, of its outputs `[B, A, N+1]`: one row of components, `[B, N+1]`."""

_APART = 1_000_003  # so that no draw is the one that learning began with
_LEAST_POINTS, _MOST_POINTS = 64, 4096  # on the way from a baseline
_INCOMPLETE = 1e-3  # so much of what is to be explained may be left over, before more are taken


class Parts(NamedTuple):
    """A network cut in two, above the activation maps of a convolution.

    Args:
        below: inputs `[B, ...]` to activation maps `[B, C, h, w]`.
        above: these to features `[B, F]`.
    """

    below: nn.Sequential
    above: nn.Sequential


def split(network: DecompositionNetwork, layer: int) -> Parts:
    """Returns the two parts of a network, cut above a convolution and the ReLU that follows it.

    Args:
        network: with convolutions.
        layer: which of them, from 0.

    Raises:
        InputError: it has no convolutions, or not so many.
    """
    layers = list(_layers(network.body))
    ends = [i + 1 for i, of in enumerate(layers) if isinstance(of, nn.Conv2d)]
    if not ends:
        raise InputError(
            "The network has no convolutions, so it has no maps of where it looks.",
            "It reads a vector: ask which entries matter, with `attributions`.",
        )
    if not 0 <= layer < len(ends):
        raise InputError(
            f"There is no convolution {layer}.",
            f"The network's convolutions are numbered from 0 to {len(ends) - 1}.",
        )
    end = ends[layer]
    end += end < len(layers) and isinstance(layers[end], nn.ReLU)
    return Parts(nn.Sequential(*layers[:end]), nn.Sequential(*layers[end:]))


def gradcam(network: DecompositionNetwork, inputs: Tensor, tell: Tell, layer: int = 0) -> Tensor:
    """Returns the GradCAM map of each component: `[B, N+1, h, w]`, signed.

    With A_c the activation maps of the layer, after its ReLU, the map of component k is
    `Σ_c α_kc·A_c`, and `α_kc` is the mean over all places (i, j) of `∂y_k / ∂A_c[i, j]`. Where
    it is positive, what the layer sees there raises y_k. The map that Selvaraju et al. (2017) show
    is its positive part.

    All components are differentiated in one batched pass. As only the means are needed, it
    is by one number for each channel, which lifts all of its map: that is exact, and a
    following convolution without padding need not be gone through place by place.

    Args:
        network: with convolutions.
        inputs: `[B, ...]`, preprocessed.
        tell: what y is.
        layer: which convolution, from 0.

    Raises:
        InputError: the network has no such convolution.
    """
    below, above = split(network, layer)
    with _asked(network):
        with torch.no_grad():
            maps = below(inputs)  # [B, C, h, w]
        lift = maps.new_zeros(maps.shape[:2], requires_grad=True)  # [B, C]
        told = tell(network.by_action(_lifted(maps, lift, above)))  # [B, N+1]
        slopes = _slopes(told, lift)  # [N+1, B, C]
        weights = slopes / math.prod(maps.shape[2:])  # [N+1, B, C], the means
        return torch.einsum("kbc,bchw->bkhw", weights, maps)


def integrated_gradients(
    network: DecompositionNetwork, inputs: Tensor, baseline: Tensor, tell: Tell
) -> Tensor:
    """Returns what each input of one observation adds to each component: `[N+1, F]`.

    The attribution of input i is `(x_i − b_i)` times the mean of `∂y_k / ∂x_i` on the straight way
    from a baseline b to x. Summed over the inputs, they are `y_k(x) − y_k(b)` (completeness). The
    mean is over the middles of equal pieces of the way, which are halved until all sums are right
    to a thousandth of the largest.

    Args:
        network: of vectors.
        inputs: `[F]`, preprocessed.
        baseline: `[F]`, likewise.
        tell: what y is.

    Source: Sundararajan et al. (2017).
    """
    with _asked(network):
        apart = inputs - baseline  # [F]
        with torch.no_grad():
            ends = tell(network.components(torch.stack([baseline, inputs])))  # [2, N+1]
        wanted, points = ends[1] - ends[0], _LEAST_POINTS
        while True:
            share = (torch.arange(points, dtype=apart.dtype, device=apart.device) + 0.5) / points
            way = (baseline + share[:, None] * apart).requires_grad_()  # [points, F]
            slopes = _slopes(tell(network.components(way)), way)  # [N+1, points, F]
            found = slopes.mean(dim=1) * apart  # [N+1, F]
            left = (found.sum(dim=1) - wanted).abs().max()
            if points >= _MOST_POINTS or left <= _INCOMPLETE * wanted.abs().max():
                return found
            points *= 2


def redrawn(
    network: DecompositionNetwork, seed: int, layer: int | None = None
) -> DecompositionNetwork:
    """Returns a copy of a network with new weights, as before anything was learned.

    They are uniform in ±1/√fan-in.

    Args:
        network: whose.
        seed: of the draw.
        layer: of the convolution above which weights are new; by default all are.

    Raises:
        InputError: the network has no such convolution.
    """
    copy, rng = deepcopy(network), torch.Generator().manual_seed(_APART + seed)
    new = _layers(copy.body) if layer is None else split(copy, layer).above
    for of in (*new, copy.head):
        if isinstance(of, nn.Linear | nn.Conv2d):
            bound = 1.0 / math.sqrt(of.weight[0].numel())
            for weights in of.parameters():
                drawn = torch.rand(weights.shape, generator=rng)
                weights.data.copy_(bound * (2.0 * drawn - 1.0))
    return copy


def _layers(body: nn.Module) -> Iterator[nn.Module]:
    """Returns the layers of a body in the order in which they are gone through."""
    if not isinstance(body, nn.Sequential):
        yield body
        return
    for part in body:
        yield from _layers(part)


def _lifted(maps: Tensor, lift: Tensor, above: nn.Sequential) -> Tensor:
    """Returns the features `[B, F]` of maps `[B, C, h, w]`, each lifted `[B, C]`, which is 0.

    Without padding, a convolution adds the sum of its kernel to all that it makes of a map that is
    lifted by 1.
    """
    following = above[0]
    if isinstance(following, nn.Conv2d) and following.groups == 1 and not _is_padded(following):
        kernel = following.weight.sum(dim=(2, 3))  # [C', C]
        made = following(maps) + (lift @ kernel.T)[:, :, None, None]  # [B, C', h', w']
        return _through(above[1:], made)
    return _through(above, maps + lift[:, :, None, None])


def _is_padded(of: nn.Conv2d) -> bool:
    return isinstance(of.padding, str) or any(of.padding)


def _through(layers: nn.Module, inputs: Tensor) -> Tensor:
    outputs: Tensor = layers(inputs)
    return outputs


def _slopes(told: Tensor, by: Tensor) -> Tensor:
    """Returns `[N+1, B, ...]`: of each component `[B, N+1]`, its derivative by `[B, ...]`."""
    each = torch.eye(told.shape[1], dtype=told.dtype, device=told.device)
    (found,) = torch.autograd.grad(told.sum(dim=0), by, each, is_grads_batched=True)
    return found


@contextmanager
def _asked(network: nn.Module) -> Iterator[None]:
    """Lets a network be differentiated as it is used, and leaves it in the mode it was in."""
    modes = [(of, of.training) for of in network.modules()]
    network.eval()
    try:
        with torch.enable_grad():
            yield
    finally:
        for of, training in modes:
            of.training = training
