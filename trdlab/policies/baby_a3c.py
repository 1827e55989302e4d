"""Agents of baby-a3c: a GRU that looks at one small grey image of the screen at a time."""

from torch import Tensor, nn
from torch.nn.functional import interpolate

from trdlab.policies.adapted import About, Drawing, critic_of
from trdlab.policies.files import AgentFile, Options
from trdlab.policies.networks import Network, Recurrent, dense, gru, sizes
from trdlab.policies.screens import FOUR, SCREEN, four_convolutions

_ROWS = slice(35, 195)  # without the score
_SIDE = 80
_BYTES = 255.0
_HEADS = ("actor_linear", "critic_linear")
_CELL = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")


def adapt(file: AgentFile, options: Options) -> Drawing | None:
    """Returns the agent in a state dict of theirs; None where the file is none."""
    layers = {f"{layer}.{part}" for layer in (*FOUR, *_HEADS) for part in ("weight", "bias")}
    if set(file.weights) != layers | {f"gru.{part}" for part in _CELL}:
        return None
    cell = {f"gru.{part}_l0": file.weights[f"gru.{part}"] for part in _CELL}
    weights = {**file.weights, **cell}
    before = four_convolutions(weights)
    network, memory = Network(nn.Sequential(_Seen(), before), SCREEN), gru(weights, "gru.")
    actor, critic = (dense(weights, [head], nn.ELU) for head in _HEADS)
    about = About(
        "A3C",
        "baby-a3c",
        seen=SCREEN,
        num_actions=len(weights["actor_linear.weight"]),
        layers=sizes(before, memory, actor),
        activation="ELU",
        memory=memory.hidden_size,
        gamma=0.99,
        games={"screens": True},
    )
    scores, values = (Recurrent(network, memory, head) for head in (actor, critic))
    return Drawing(about, scores, critic_of(values))


class _Seen(nn.Module):
    """What is seen of whole screens."""

    def forward(self, screens: Tensor) -> Tensor:
        """Returns `[B, 1, 80, 80]`, from 0 to 1, of screens `[B, 210, 160, 3]`."""
        grey = screens[:, _ROWS].mean(dim=3)  # [B, 160, 160]
        low, high = grey.amin(dim=(1, 2), keepdim=True), grey.amax(dim=(1, 2), keepdim=True)
        stretched = ((grey - low) / (high - low).clamp(min=1.0) * _BYTES).round()
        size = (_SIDE, _SIDE)
        return interpolate(stretched[:, None], size, mode="bilinear", antialias=True) / _BYTES
