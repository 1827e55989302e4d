"""A network as an Estimator: numpy observations in, decompositions out."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from trdlab.arrays import BoolArray, FloatArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.deep.channels import Channels, outlook_of, reward_of, within
from trdlab.deep.loss import acted
from trdlab.deep.networks import DecompositionNetwork
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

    def _asked(self, tell: Callable[[Tensor], Tensor], observations: Any) -> FloatArray:
        """Returns what the network tells of observations `[B, ...]`, batch by batch."""
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
        was_training = self.network.training
        self.network.eval()
        try:
            with torch.inference_mode():
                parts = [
                    tell(batch.to(self.device)).cpu()  # [≤ batch_size, ...]
                    for batch in torch.split(torch.from_numpy(array), self.batch_size)
                ]
        finally:
            self.network.train(was_training)
        told: FloatArray = torch.cat(parts).numpy()
        return told


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
