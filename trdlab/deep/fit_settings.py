"""How a decomposition is fitted, and how far that is."""

from dataclasses import dataclass
from typing import Literal, get_args

from trdlab.errors import InputError, closest

Method = Literal["mixed", "regression", "td"]
Layers = Literal["new", "copied", "frozen"]
"""What a network begins with, all but its last layer: new weights; those of the network by which
the agent acts, to learn on from; or those, frozen, with layers after them that are new."""


@dataclass(frozen=True)
class FitSettings:
    """How a decomposition is fitted.

    Args:
        method: `regression` on what really came, where that is known, with the residual by
            bootstrapping; `td`, the law from one component to the next; or `mixed`: what came as
            far as it is known, and from there on what is expected.
        hidden: the sizes of the hidden layers, for vectors; by default none for numbered states,
            of which each has a row of its own then, and two of 256 for others.
        learning_rate: of Adam, at first; it falls where held-out error stops falling. By default
            0.01 for numbered states, and 0.001 for others.
        batch_size: the steps in each update.
        check_every: the updates between two looks at the held-out error; a multiple of
            `sync_every`.
        patience: the looks without a gain after which the learning rate falls.
        most_updates: after which it stops anyway.
        sync_every: the updates between two copies to the target network.
        held_out: the share of the episodes that is not learned from.
        seed: of the weights and of the batches.

    Raises:
        InputError: there is no such method, or a number is out of its range.
    """

    method: Method = "mixed"
    hidden: tuple[int, ...] | None = None
    learning_rate: float | None = None
    batch_size: int = 256
    check_every: int = 200
    patience: int = 5
    most_updates: int = 20_000
    sync_every: int = 50
    held_out: float = 0.1
    seed: int = 0

    def __post_init__(self) -> None:
        if self.method not in get_args(Method):
            raise InputError(
                f"There is no method '{self.method}'.", closest(self.method, get_args(Method))
            )
        if not 0.0 < self.held_out < 1.0:
            raise InputError(
                f"A share of {self.held_out} is held out.", "Choose one between 0 and 1."
            )
        for name in ("batch_size", "check_every", "most_updates", "sync_every"):
            if getattr(self, name) < 1:
                raise InputError(f"`{name}` is {getattr(self, name)}.", "It is at least 1.")
        if self.check_every % self.sync_every:
            raise InputError(
                f"`check_every` is {self.check_every}, and `sync_every` is {self.sync_every}.",
                "Choose a multiple.",
            )


@dataclass(frozen=True)
class FitProgress:
    """How far a fit is.

    Args:
        updates: made so far.
        error: on held-out episodes: the mean squared error of all that is known of them, as a share
            of that of the best constant; 1 if nothing was learned.
        best: the least so far.
        share: how much of the way is done at least: learning gets slower several times, and stops.
    """

    updates: int
    error: float
    best: float
    share: float
