"""The A3C agent of River Raid: an LSTM that looks at one small image, normalised as it goes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from torch import Tensor, nn
from torch.nn.functional import interpolate

from trdlab.arrays import BoolArray, FloatArray
from trdlab.policies.adapted import About, Drawing, critic_of
from trdlab.policies.files import AgentFile, Options
from trdlab.policies.networks import Network, Recurrent, dense, lstm, sizes
from trdlab.policies.screens import FOUR, SCREEN, four_convolutions

_ROWS = slice(34, 194)  # without the score
_FIRST, _SIDE = 80, 42
_BYTES = 255.0
_DECAY = 0.9999
_TINY = 1e-8
STATISTICS = (0.376, 0.13)
"""The mean and the deviation that an episode begins with: those of its own play, in 8,000 steps."""

_ORDER = (
    *(f"{layer}.{part}" for layer in FOUR for part in ("weight", "bias")),
    *(f"lstm.{part}_l0" for part in ("weight_ih", "weight_hh", "bias_ih", "bias_hh")),
    *(f"{head}_linear.{part}" for head in ("critic", "actor") for part in ("weight", "bias")),
)


def adapt(file: AgentFile, options: Options) -> Drawing | None:
    """Returns the agent in a list of 16 tensors; None where the file is none.

    It takes the likeliest action, unless `options.greedy` is False.
    """
    numbers = [str(number) for number in range(len(_ORDER))]
    if list(file.weights) != numbers or file.weights["0"].ndim != 4:
        return None
    weights = dict(zip(_ORDER, file.weights.values(), strict=True))
    before = four_convolutions(weights)
    image, small = Network(before, (1, _SIDE, _SIDE)), Network(_Small(), SCREEN, _BYTES)
    memory = lstm(weights, "lstm.")
    actor, critic = (dense(weights, [f"{head}_linear"], nn.ELU) for head in ("actor", "critic"))
    about = About(
        "A3C",
        "RL-A3C-Riverraid",
        seen=SCREEN,
        num_actions=len(weights["actor_linear.weight"]),
        layers=sizes(before, memory, actor),
        activation="ELU",
        memory=2 * memory.hidden_size + 2,
        gamma=0.99,
        draws=options.greedy is False,
        games={"screens": True},
    )
    scores, values = (
        _Normalised(Recurrent(image, memory, head), small) for head in (actor, critic)
    )
    return Drawing(about, scores, critic_of(values))


@dataclass(frozen=True, eq=False)
class _Normalised:
    """A network with memory that sees images less their running mean, by their deviation.

    In training the statistics went on from one episode to the next, and hardly moved any more. Here
    each episode begins with what they had come to (`STATISTICS`), so that it is the same whatever
    was played before it. Without any at the beginning, it scores half as much.

    Args:
        network: what sees them.
        small: makes images `[B, 1, 42, 42]` of screens.
    """

    network: Recurrent
    small: Network

    def __call__(self, screens: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns logits `[B, A]`; statistics `[B, 2]` and what the network remembers."""
        images = self.small(screens)  # [B, 1, 42, 42]
        first = np.array(STATISTICS)
        running, own = (first, None) if state is None else state
        now = np.stack([images.mean((1, 2, 3)), images.std((1, 2, 3))], axis=1)
        running = (
            _DECAY * np.where(begins[:, None], first, running) + (1.0 - _DECAY) * now
        )  # [B, 2]
        mean, deviation = running.T[..., None, None, None]
        normalised = (images - mean) / (deviation + _TINY)
        told, own = self.network(normalised, own, begins)
        return told, (running, own)


class _Small(nn.Module):
    """What is seen of whole screens."""

    def forward(self, screens: Tensor) -> Tensor:
        """Returns `[B, 1, 42, 42]` in grey of screens `[B, 210, 160, 3]`, all from 0 to 1."""
        colours = screens[:, _ROWS].permute(0, 3, 1, 2)  # [B, 3, 160, 160]
        for side in (_FIRST, _SIDE):
            colours = interpolate(colours, (side, side), mode="bilinear")
        return colours.mean(dim=1, keepdim=True)
