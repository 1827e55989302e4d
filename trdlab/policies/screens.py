"""What agents have in common that look at the whole screen of an Atari game: four convolutions."""

from torch import nn

from trdlab.policies.networks import Weights, convolutions

SCREEN = (210, 160, 3)
"""The shape of the screens that they look at."""

FOUR = ("conv1", "conv2", "conv3", "conv4")
"""Their layers."""


def four_convolutions(weights: Weights) -> nn.Sequential:
    """Returns those layers, each of which halves the image, and then all in a row.

    Raises:
        InputError: they are none.
    """
    return convolutions(weights, FOUR, (2,) * len(FOUR), nn.ELU, padding=1)
