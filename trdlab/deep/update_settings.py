"""How to learn, of whoever updates a network. No torch here."""

from dataclasses import dataclass
from typing import Literal, get_args

from trdlab.errors import InputError

Reduction = Literal["sum", "mean"]
Loss = Literal["squared", "huber"]
Precision = Literal["float32", "bfloat16"]


@dataclass(frozen=True)
class UpdateSettings:
    """How to learn; the defaults are the paper's (Appendix B).

    Args:
        learning_rate: of Adam.
        target_sync_updates: the updates, not agent steps, between two copies of the network to
            the target network (errata C6).
        reduction: over components, see `td_loss`.
        loss: of their errors, see there.
        max_grad_norm: the length to which longer gradients are cut; None leaves them.
        double: whether the online network chooses the next action (double DQN); not where a policy
            head does.
        precision: what the networks compute in; bfloat16 keeps two or three digits. Weights,
            targets and the loss are float32 in either case.
        temperature: by which logits are divided before they are compared with a teacher's.
        draw: of a policy head: whether it draws its actions, or takes the likeliest.
        averaging: what the mean of all networks so far weighs at each update, against the newest;
            0 leaves the newest alone.

    Raises:
        InputError: a value is out of its range.
    """

    learning_rate: float = 1e-4
    target_sync_updates: int = 1000
    reduction: Reduction = "sum"
    loss: Loss = "squared"
    max_grad_norm: float | None = None
    double: bool = False
    precision: Precision = "float32"
    temperature: float = 1.0
    draw: bool = False
    averaging: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.learning_rate < float("inf"):
            raise InputError(f"The learning rate is {self.learning_rate}.", "Choose one above 0.")
        if self.target_sync_updates < 1:
            raise InputError(
                f"`target_sync_updates` is {self.target_sync_updates}.",
                "Copy the network every 1 or more updates.",
            )
        if not 0.0 < self.temperature < float("inf"):
            raise InputError(f"The temperature is {self.temperature}.", "Choose one above 0.")
        if not 0.0 <= self.averaging < 1.0:
            raise InputError(
                f"`averaging` is {self.averaging}.", "Choose 0, or a weight below 1, such as 0.999."
            )
        longest = self.max_grad_norm
        if longest is not None and not 0.0 < longest < float("inf"):
            raise InputError(f"`max_grad_norm` is {longest}.", "Choose a length above 0.")
        for name, known in (
            ("loss", get_args(Loss)),
            ("reduction", get_args(Reduction)),
            ("precision", get_args(Precision)),
        ):
            if getattr(self, name) not in known:
                raise InputError(
                    f"The {name} is {getattr(self, name)!r}.",
                    f"Use {' or '.join(map(repr, known))}.",
                )
