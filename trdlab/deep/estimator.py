"""A network as an Estimator: numpy observations in, decompositions out."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from trdlab.arrays import BoolArray, FloatArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.deep.channels import Channels, outlook_of, reward_of, within
from trdlab.deep.loss import acted
from trdlab.deep.networks import DecompositionNetwork
from trdlab.deep.saliency import gradcam, integrated_gradients, redrawn
from trdlab.errors import InputError
from trdlab.estimator import Future, Outlook


@dataclass(frozen=True, eq=False)
class NetworkEstimator:
    """Decomposes observations with a network; an Estimator.

    The network is shared, not copied: while it learns, the estimator follows.

    Args:
        network: moved to `device`.
        time_axis: what its components mean.
        future: whose future it was trained to tell.
        device: where it computes.
        batch_size: the most observations in one forward pass.
        channels: where the network tells several numbers of each action, what they are, C of them.
        possible: `[2, C, N+1]`, the least and the most that they can be, if that is known; what the
            network tells beyond is cut to it.
        reach: how many components of each channel, from the first on, are surely told better than
            by a constant guess; empty if that has not been judged.

    Raises:
        InputError: the network has another number of components, or `batch_size` is below 1.
    """

    network: DecompositionNetwork
    time_axis: TimeAxis
    future: Future
    device: torch.device | str = "cpu"
    batch_size: int = 256
    channels: Channels = ()
    possible: FloatArray | None = None
    reach: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        ours, theirs = self.time_axis.num_components, self.network.num_components
        if ours != theirs:
            raise InputError(
                f"The network has {theirs} components, N = {self.time_axis.horizon} needs {ours}.",
                f"Give the time axis it was trained with, of N = {theirs - 1}.",
            )
        if self.batch_size < 1:
            raise InputError(f"The batch size is {self.batch_size}.", "Choose 1 or more.")
        self.network.to(self.device)

    def decompose(self, observations: Any) -> RewardDecomposition:
        """Returns `[B, A, N+1]`, float32, for a batch `[B, ...]` of observations.

        Raises:
            InputError: the observations have another shape or type than the network takes, or hold
                what is no number.
        """
        told = self._told(observations)
        reward = reward_of(self.channels, told) if self.channels else told
        return RewardDecomposition(reward, self.time_axis)

    def outlook(self, observations: Any) -> Outlook | None:
        """Returns what is expected beside the mean of the reward, if the network was taught that.

        Raises:
            InputError: as for `decompose`.
        """
        if not self.channels or not self.time_axis.horizon:
            return None
        return outlook_of(self.channels, self._told(observations), self.time_axis, self.reach)

    def features(self, observations: Any) -> FloatArray:
        """Returns what the last layer reads of observations `[B, ...]`: `[B, F]`, float32.

        Raises:
            InputError: as for `decompose`.
        """
        network = self.network
        return self._asked(lambda seen: network.body(network.preprocess(seen)), observations)

    @torch.inference_mode(mode=False)
    def saliency(self, observations: Any, actions: Any, *, layer: int = 0) -> FloatArray:
        """Returns where in images each component is decided: GradCAM maps `[B, N+1, h, w]`, signed.

        The map of a component is the sum of the layer's activation maps, each times the mean of the
        component's gradient over it (see `trdlab.deep.saliency.gradcam`). It is of the expected
        reward, before that is cut to what is `possible`.

        Args:
            observations: `[B, ...]`.
            actions: `[B]`, the number of the action that each is asked about.
            layer: which convolution, from 0.

        Raises:
            InputError: the network has no such convolution, there are not B actions, one does not
                exist, or as for `decompose`.
        """
        seen, chosen = self._given(observations), self._chosen(actions, len(observations))
        each = max(1, self.batch_size // self.time_axis.num_components)
        inputs = (self.network.preprocess(of.to(self.device)) for of in torch.split(seen, each))
        parts = [
            gradcam(self.network, of, partial(self._row, rows), layer).cpu()
            for of, rows in zip(inputs, torch.split(chosen, each), strict=True)
        ]
        maps: FloatArray = torch.cat(parts).numpy()
        return maps

    @torch.inference_mode(mode=False)
    def attributions(self, observations: Any, actions: Any, *, baseline: Any) -> FloatArray:
        """Returns what each entry of vectors adds to each component: `[B, N+1, F]`.

        They are integrated gradients: over the entries, they add up to what is expected beyond
        what is expected of the baseline (see `trdlab.deep.saliency.integrated_gradients`), both
        before they are cut to what is `possible`.

        Args:
            observations: `[B, ...]`, vectors with F entries.
            actions: `[B]`, the number of the action that each is asked about.
            baseline: `[...]`, what they are held against, for example the mean of many.

        Raises:
            InputError: the network reads images, or the numbers of states; there are not B actions,
                one does not exist; or as for `decompose`.
        """
        seen, chosen = self._given(observations), self._chosen(actions, len(observations))
        preprocess = self.network.preprocess
        inputs = preprocess(seen.to(self.device))  # [B, F]
        if inputs.ndim != 2 or seen.ndim == 1:
            whole, cure = ("images", "`saliency`") if seen.ndim > 2 else ("states", "`decompose`")
            raise InputError(
                f"The network reads {whole}, which have no entries of their own.", f"Use {cure}."
            )
        held = preprocess(self._given(np.asarray(baseline)[None]).to(self.device))[0]  # [F]
        found = np.zeros((len(inputs), self.time_axis.num_components, held.numel()), np.float32)
        for i, of in enumerate(inputs):
            tell = partial(self._row, chosen[i : i + 1])
            found[i] = integrated_gradients(self.network, of, held, tell).cpu().numpy()
        return found

    def redrawn(self, seed: int, *, layer: int | None = None) -> Self:
        """Returns the same estimator with new weights, as before anything was learned.

        Args:
            seed: of the draw.
            layer: of the convolution above which weights are new; by default all are.

        Raises:
            InputError: the network has no such convolution.
        """
        return replace(self, network=redrawn(self.network, seed, layer))

    def _told(self, observations: Any) -> FloatArray:
        """Returns all that the network tells: `[B, A, N+1]`, or of channels `[B, A, C, N+1]`."""
        components = self._asked(self.network, observations)  # [B, A, N+1], or [B, A·C, N+1]
        if not self.channels:
            return components
        shape = (len(components), -1, len(self.channels), self.time_axis.num_components)
        components = components.reshape(shape)  # [B, A, C, N+1]
        return (
            components
            if self.possible is None
            else within(self.channels, components, self.possible)
        )

    def _row(self, actions: Tensor, told: Tensor) -> Tensor:
        """Returns the expected reward `[B, N+1]` of one action each `[B]`, of all that is told."""
        rows = torch.arange(len(told), device=told.device), actions
        if not self.channels:
            return told[rows]
        weights = torch.tensor([of.weight for of in self.channels], device=told.device)  # [C]
        by_action = told.reshape(len(told), -1, len(weights), told.shape[-1])  # [B, A, C, N+1]
        return torch.einsum("c,bck->bk", weights, by_action[rows])

    def _chosen(self, actions: Any, count: int) -> Tensor:
        """Returns the numbers of actions `[B]`, where there are as many as observations."""
        known = self.network.num_actions // max(1, len(self.channels))
        chosen = np.asarray(actions)
        if chosen.shape != (count,) or (count and chosen.dtype.kind not in "iu"):
            raise InputError(
                f"The actions are {actions!r}, for {count} observations.",
                "Give the number of one action for each.",
            )
        if count and not 0 <= chosen.min() <= chosen.max() < known:
            wrong = chosen[(chosen < 0) | (chosen >= known)][0]
            raise InputError(f"There is no action {wrong}.", f"They run from 0 to {known - 1}.")
        return torch.from_numpy(chosen.astype(np.int64)).to(self.device)

    def _asked(self, tell: Callable[[Tensor], Tensor], observations: Any) -> FloatArray:
        """Returns what the network tells of observations `[B, ...]`, batch by batch."""
        given, was_training = self._given(observations), self.network.training
        self.network.eval()
        try:
            with torch.inference_mode():
                parts = [
                    tell(of.to(self.device)).cpu() for of in torch.split(given, self.batch_size)
                ]
        finally:
            self.network.train(was_training)
        told: FloatArray = torch.cat(parts).numpy()
        return told

    def _given(self, observations: Any) -> Tensor:
        """Returns observations `[B, ...]` for the network, once they are checked."""
        array = np.array(observations)  # [B, ...], a copy that PyTorch may own
        if array.dtype.kind not in "fiub":
            raise InputError(
                f"The observations have type {array.dtype}.",
                "A network takes arrays of numbers, for example through "
                "gymnasium.wrappers.FlattenObservation.",
            )
        if array.ndim == 0:
            raise InputError("The observations have shape ().", "Give a batch [B, ...] of them.")
        finite = np.isfinite(array)
        if not finite.all():
            raise InputError(
                f"The observations hold {array[~finite][0]}.",
                "Give finite numbers; an environment that shows others must be corrected.",
            )
        return torch.from_numpy(array)


@dataclass(frozen=True, eq=False)
class ActingEstimator(NetworkEstimator):
    """Decomposes, and acts by the network's policy head, whose future it tells: a Policy, too.

    Args:
        draw: whether it draws its actions, rather than taking the likeliest.
    """

    draw: bool = False

    def act(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns how likely it takes each action `[B, A]`; there is nothing to remember.

        Raises:
            InputError: as for `decompose`.
        """
        logits = torch.from_numpy(self._asked(self.network.logits, observations))  # [B, A]
        return acted(logits, draw=self.draw).numpy(), None
