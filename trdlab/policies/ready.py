"""Policies made of what there is: of an estimator, of a function, of another policy."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.errors import InputError
from trdlab.estimator import Estimator
from trdlab.policies.protocol import Policy, ask

Who = Policy | Estimator | Callable[[Any], FloatArray]
"""Who can act: by itself, greedily, or by a function to action probabilities."""


def greedy(value: FloatArray, allowed: BoolArray | None = None) -> FloatArray:
    """Returns probabilities `[B, A]`: 1 for the action of largest value, of equals for the first.

    Args:
        value: `[B, A]`.
        allowed: `[B, A]`, which actions can be taken; None where all can.

    >>> greedy(np.array([[1.0, 3.0, 3.0]])).tolist()
    [[0.0, 1.0, 0.0]]
    """
    possible = value if allowed is None else np.where(allowed, value, -np.inf)
    best = possible.argmax(axis=1)[:, None] == np.arange(value.shape[1])
    return np.asarray(best.astype(value.dtype))


@dataclass(frozen=True)
class Greedy:
    """Takes the action of largest Σ components, of equals the first.

    Args:
        estimator: whose components.
    """

    estimator: Estimator

    def act(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns the probabilities `[B, A]`; there is nothing to remember."""
        return self.act_within(observations, state, begins, None)

    def act_within(
        self, observations: Any, state: Any, begins: BoolArray, allowed: BoolArray | None
    ) -> tuple[FloatArray, Any]:
        """Returns the same, of the actions that are `allowed [B, A]`."""
        return greedy(self.estimator.decompose(observations).value, allowed), None


@dataclass(frozen=True)
class Memoryless:
    """Acts by what is seen now.

    Args:
        function: from observations `[B, ...]` to action probabilities `[B, A]`.
    """

    function: Callable[[Any], FloatArray]

    def act(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns the probabilities `[B, A]`; there is nothing to remember."""
        return self.function(observations), None


@dataclass(frozen=True)
class EpsilonGreedy:
    """Acts as another policy does, but with a chance of any action at random.

    Args:
        policy: the other one.
        epsilon: that chance, in [0, 1].

    Raises:
        InputError: ε is outside [0, 1].
    """

    policy: Policy
    epsilon: float

    @property
    def about(self) -> Any:
        """What is known about the other one (`About`), if anything is."""
        about = getattr(self.policy, "about", None)
        return about and replace(about, draws=True)

    def __post_init__(self) -> None:
        if not 0.0 <= self.epsilon <= 1.0:
            raise InputError(f"ε is {self.epsilon}.", "It must be in [0, 1].")

    def act(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns `(1 − ε)·p + ε/A` `[B, A]`, and what the other policy remembers."""
        probabilities, state = self.policy.act(observations, state, begins)
        evenly = self.epsilon / probabilities.shape[1]
        return (1.0 - self.epsilon) * probabilities + evenly, state

    def act_within(
        self, observations: Any, state: Any, begins: BoolArray, allowed: BoolArray
    ) -> tuple[FloatArray, Any]:
        """Returns the same, of the actions that are `allowed [B, A]`."""
        probabilities, state = ask(self.policy, observations, state, begins, allowed)
        evenly = self.epsilon * allowed / allowed.sum(axis=1, keepdims=True)
        return (1.0 - self.epsilon) * probabilities + evenly, state


@dataclass(frozen=True)
class Likeliest:
    """Takes the action that another policy is likeliest to take, of equals the first.

    Args:
        policy: the other one.
    """

    policy: Policy

    @property
    def about(self) -> Any:
        """What is known about the other one (`About`), if anything is."""
        about = getattr(self.policy, "about", None)
        return about and replace(about, draws=False)

    @property
    def gamma(self) -> float | None:
        """γ that the other one was trained with, if that is said."""
        return getattr(self.policy, "gamma", None)

    @property
    def state_values(self) -> Any:
        """What the other one's critic says (`StateValues`), if it has one: of the other one."""
        return getattr(self.policy, "state_values", None)

    def act(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns 1 for that action `[B, A]`, and what the other policy remembers."""
        return self.act_within(observations, state, begins, None)

    def act_within(
        self, observations: Any, state: Any, begins: BoolArray, allowed: BoolArray | None
    ) -> tuple[FloatArray, Any]:
        """Returns the same, of the actions that are `allowed [B, A]`."""
        probabilities, state = ask(self.policy, observations, state, begins, allowed)
        return greedy(probabilities), state


def acting(who: Who) -> Policy:
    """Returns who acts: a policy as it is, an estimator by its greedy policy, or by a function.

    Raises:
        InputError: it is none of these; the message says which methods are missing.
    """
    if isinstance(who, Policy):
        return who
    if isinstance(who, Estimator):
        return Greedy(who)
    if callable(who):
        return Memoryless(who)
    raise InputError(
        f"This {type(who).__name__} neither acts nor decomposes: it has no act and no decompose.",
        "Give a policy, an estimator, or a function from observations to action probabilities.",
    )
